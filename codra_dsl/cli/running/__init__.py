"""Commands for robots that are running."""
