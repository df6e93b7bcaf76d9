"""Lookup tables over a specification that all checks share, and the rules they report."""
