"""Supply the conditions that `codra why` reports as missing in a second run: `python -m tests.campaigns.whys 200`."""
