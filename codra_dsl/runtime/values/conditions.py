"""The functions with which generated code builds conditions.

Conditions are trees of frozen terms. Python's operators build these trees. So generated code reads like the spec,
and an explanation can use the parts of a condition.
"""

from __future__ import annotations

from codra_dsl.logic import Scope, Term, Value, age, choose, first_of, known, literal, maximum, minimum, value
from codra_dsl.runtime.values.derived import first_known
from codra_dsl.runtime.values.hysteresis import between, confirmed

__all__ = [
    "Scope",
    "Term",
    "Value",
    "age",
    "between",
    "choose",
    "confirmed",
    "first_known",
    "first_of",
    "known",
    "literal",
    "maximum",
    "minimum",
    "value",
]
