"""Shared parts of the experiments beyond the paper: workloads of the robot, and comparisons of arms."""
