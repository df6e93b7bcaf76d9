"""The rules of findings about FLL."""

from __future__ import annotations

from codra_dsl.language.diagnostics import Severity, rules

_ERROR = Severity.ERROR

RULES = rules(
    ("CDR2201", "fll-unreadable", _ERROR),
    ("CDR2202", "fll-too-large", _ERROR),
    ("CDR2203", "fll-no-definition", _ERROR),
    ("CDR2204", "fll-unknown-key", _ERROR),
    ("CDR2205", "fll-repeated", _ERROR),
    ("CDR2206", "fll-wrong-value", _ERROR),
    ("CDR2207", "fll-unknown-word", _ERROR),
    ("CDR2208", "fll-wrong-term", _ERROR),
    ("CDR2209", "fll-wrong-formula", _ERROR),
    ("CDR2210", "fll-wrong-rule", _ERROR),
    ("CDR2211", "fll-unknown-name", _ERROR),
    ("CDR2212", "fll-missing", _ERROR),
    ("CDR2213", "fll-unfit-term", _ERROR),
    ("CDR2214", "fll-version-5", Severity.WARNING),
)
"""The rules of findings about FLL, by name."""
