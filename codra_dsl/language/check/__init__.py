"""Checks: Spec -> (CheckedSpec | None, diagnostics). Only this package makes a `CheckedSpec`.

`implies` decides whether one list of conditions follows from another, for code that compares specs. `implies` needs the
types of the names in the conditions: `declared_type` returns the type of a name from its declaration.
"""

from codra_dsl.language.check.checked.spec import CheckedAlgorithm, CheckedCondition, CheckedSpec
from codra_dsl.language.check.conditions.types import Type, Types, declared_type
from codra_dsl.language.check.index.rules import RULES
from codra_dsl.language.check.phases import PHASES, check
from codra_dsl.language.check.solver.satisfiable import implies

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
