"""The rules of findings about files of knowledge graphs: JSON of RoboComp's DSR, and GraphML."""

from __future__ import annotations

from codra_dsl.language.diagnostics import Severity, rules

RULES = rules(
    ("CDR2401", "graph-unreadable", Severity.ERROR),
    ("CDR2402", "graph-wrong-value", Severity.ERROR),
    ("CDR2403", "edge-to-missing-node", Severity.WARNING),
    ("CDR2404", "undirected-graph", Severity.ERROR),
)
"""The rules, by name."""
