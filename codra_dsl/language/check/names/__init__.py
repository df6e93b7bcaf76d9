"""Checks of names: undeclared, misspelt, declared twice."""
