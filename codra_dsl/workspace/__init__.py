"""The settings and the memory of one project."""
