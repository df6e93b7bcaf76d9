"""Finds out which values can satisfy a condition, with intervals, cases and linear sums."""
