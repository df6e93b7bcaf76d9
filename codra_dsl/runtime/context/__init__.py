"""The context manager M and its parts."""
