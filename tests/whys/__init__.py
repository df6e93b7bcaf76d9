"""Experiments with `codra why`: what it names as missing is supplied in a second run: `python -m tests.whys 200`."""
