"""Checks of names that are undeclared, misspelt, reserved or ambiguous."""
