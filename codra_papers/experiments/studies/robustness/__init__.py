"""What the experiment `lab-robustness` makes of its runs: P1, section 4.1, part by part."""
