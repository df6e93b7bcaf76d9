"""Examples of user code."""
