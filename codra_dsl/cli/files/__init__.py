"""Commands for files that are not specs."""
