"""The simulated laboratory: its state, its frames, and its ground truth."""
