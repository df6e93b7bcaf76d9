"""The analysis of the experiment `lab-robustness`: P1, section 4.1, part by part."""
