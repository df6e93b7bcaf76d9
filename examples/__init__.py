"""Examples of users' own code."""
