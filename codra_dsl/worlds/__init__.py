"""Simulated worlds with ground truth: examples of a robot's own code around its observers."""
