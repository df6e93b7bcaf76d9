"""Checks of the types in conditions, literals and enum members."""
