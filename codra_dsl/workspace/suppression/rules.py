"""The rules of findings about settings and suppression comments, and all rules of the findings of a run."""

from __future__ import annotations

from collections.abc import Mapping
from functools import cache

from codra_dsl.generation import output
from codra_dsl.language import behavior_trees as trees
from codra_dsl.language import check, fuzzy, knowledge_files, load
from codra_dsl.language.diagnostics import Rule, Severity, rules, suggest

RULES = rules(
    ("CDR0020", "unreadable-settings", Severity.ERROR),
    ("CDR0021", "unknown-setting", Severity.ERROR),
    ("CDR0022", "unknown-code-in-settings", Severity.ERROR),
    ("CDR0023", "wrong-setting", Severity.ERROR),
    ("CDR0024", "repeated-code", Severity.WARNING),
    ("CDR0025", "binding-code-in-settings", Severity.ERROR),
    ("CDR7901", "unused-suppression", Severity.WARNING),
    ("CDR7902", "suppression-without-reason", Severity.ERROR),
    ("CDR7903", "unknown-code-suppressed", Severity.WARNING),
    ("CDR7904", "binding-code-suppressed", Severity.WARNING),
    ("CDR7905", "ill-formed-suppression", Severity.WARNING),
)

OWN_PREFIX = "CDR79"
"""The prefix of the codes of findings about comments. No comment can silence these findings."""


@cache
def known_rules() -> Mapping[str, Rule]:
    """Return all rules of findings about specs and other files; the key is the code of the rule."""
    tables = (load.RULES, fuzzy.RULES, trees.RULES, knowledge_files.RULES, check.RULES, output.RULES, RULES)
    return {rule.code: rule for table in tables for rule in table.values()}


def nearest_code(written_code: str) -> str | None:
    """Return the code that was probably intended, or None if nothing is similar.

    This is the code itself, the code of the rule with this name, or the code with the most similar code or name.
    """
    codes = {code.casefold(): code for code in known_rules()}
    codes |= {rule.name: code for code, rule in known_rules().items()}
    folded_text = written_code.casefold()
    nearest_text = folded_text if folded_text in codes else suggest(folded_text, codes)
    return None if nearest_text is None else codes[nearest_text]
