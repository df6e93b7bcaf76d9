"""Send signals to programs that write journals: `python -m tests.campaigns.signals 500 1`, or `make signals`."""
