"""Trials over all cores, and the report on their outcomes."""
