"""The findings that a project wants to have reported: its settings, comments that silence findings, and fixes.

Errors of phases 0 to 6 are binding: settings and comments cannot silence them, because they prevent compiling.
"""

from codra_dsl.workspace.suppression.fixing import FixResult, fix_all
from codra_dsl.workspace.suppression.rules import RULES, known_rules, nearest_code
from codra_dsl.workspace.suppression.settings import Settings, settings_of
from codra_dsl.workspace.suppression.suppressions import Sources, read_sources, triage
from codra_dsl.workspace.suppression.writing import read_rewritable_files, rewrite, unified_diff

__all__ = [
    "RULES",
    "FixResult",
    "Settings",
    "Sources",
    "fix_all",
    "known_rules",
    "nearest_code",
    "read_rewritable_files",
    "read_sources",
    "rewrite",
    "settings_of",
    "triage",
    "unified_diff",
]
