"""The conditions of a spec, the types in them, and their translation to Python text."""
