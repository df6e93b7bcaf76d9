"""The lookup tables of a specification, which all checks share, and the rules that the checks report."""
