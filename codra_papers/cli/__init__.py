"""The commands and worlds of the papers, which `codra` finds by their entry points."""
