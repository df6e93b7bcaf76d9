"""The words in which generated code writes conditions."""

from __future__ import annotations

from codra_dsl.logic import Scope, Term, Value, age, choose, first_of, known, literal, maximum, minimum, value
from codra_dsl.runtime.values.hysteresis import between, confirmed

__all__ = [
    "Scope",
    "Term",
    "Value",
    "age",
    "between",
    "choose",
    "confirmed",
    "first_of",
    "known",
    "literal",
    "maximum",
    "minimum",
    "value",
]
