"""The conditions of a spec, the types in them, and their lowering to Python text."""
