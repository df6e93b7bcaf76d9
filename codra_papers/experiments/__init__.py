"""Runs in a world, scored against its ground truth, with tables and pictures."""
