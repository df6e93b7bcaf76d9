"""Checks: Spec -> (CheckedSpec | None, diagnostics). Only this room makes a `CheckedSpec`.

`implies` tells whether one list of conditions follows from another, for who compares specs; `declared_type` gives the
types of the names in them.
"""

from codra_dsl.check.checked import CheckedAlgorithm, CheckedCondition, CheckedSpec
from codra_dsl.check.phases import PHASES, check
from codra_dsl.check.possible import implies
from codra_dsl.check.rules import RULES
from codra_dsl.check.types import Type, Types, declared_type

__all__ = [
    "PHASES",
    "RULES",
    "CheckedAlgorithm",
    "CheckedCondition",
    "CheckedSpec",
    "Type",
    "Types",
    "check",
    "declared_type",
    "implies",
]
