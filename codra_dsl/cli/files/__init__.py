"""Commands for single files that are not specs."""
