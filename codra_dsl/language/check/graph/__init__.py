"""Checks of the dependency graph: cycles, and where values come from."""
