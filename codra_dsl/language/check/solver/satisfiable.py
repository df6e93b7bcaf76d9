"""Decides, from types, ranges and units, whether conditions can hold, always hold, or follow from other conditions.

Every answer comes from one question: is there a case in which some conditions hold and another condition does not? The
answers are exact if names are compared with constants, also inside sums, `abs`, `min` and `max`. Otherwise, the answer
may be that there is such a case although there is none. If the answer is that conditions cannot hold, or that
conditions follow from others, it is always correct.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import chain

from codra_dsl.language.check.conditions.types import Types
from codra_dsl.language.check.solver.breakpoints import is_curved
from codra_dsl.language.check.solver.case_split import conjuncts, may_have_case, names_of
from codra_dsl.language.check.solver.intervals import Interval
from codra_dsl.language.check.solver.values import (
    EITHER,
    UNKNOWN,
    Values,
    age_key,
    known_key,
    known_values,
    own_comparisons,
)
from codra_dsl.language.expression import (
    And,
    Arithmetic,
    Call,
    Choice,
    Compare,
    Comparison,
    Fallback,
    Name,
    Negative,
    Node,
    Not,
    Number,
    Or,
    Text,
    Truth,
    walk,
)

_ANY_AGE: Values = frozenset({Interval(-math.inf, math.inf)})
_NO_VALUES: Values = frozenset()


def can_hold(conditions: Sequence[Node], unknown_names: Iterable[str], types: Types) -> bool:
    """Return whether conditions can be true together. If this cannot be decided, return True.

    Args:
        conditions: the conditions that must be true.
        unknown_names: names that are certainly unknown. Every other name can be unknown, or have any value of its type.
        types: the type of each name.
    """
    unknown_name_set = frozenset(unknown_names)
    if all(type(condition) is Name for condition in conditions):  # most preconditions are a single name
        return not any(condition.name in unknown_name_set for condition in conditions if isinstance(condition, Name))
    names = names_of(conditions)
    values = {name: UNKNOWN if name in unknown_name_set else known_values(types.get(name)) | UNKNOWN for name in names}
    values |= _ages(names, types)
    return may_have_case(conditions, None, values, types)


def has_exact_answers(condition: Node) -> bool:
    """Return whether a condition, beside others like it, can certainly hold if `can_hold` returns True.

    Each of its comparisons depends on one name at most, and is linear between kinks.
    """
    sides = [(left, right) for part in walk(condition) for _, left, right in own_comparisons(part)]
    return not is_curved(*chain(*sides)) and all(len(names_of(pair)) <= 1 for pair in sides)


def can_be_known(value: Node, unknown_names: Iterable[str], types: Types) -> bool:
    """Return whether a value can be known while some names are certainly unknown. If undecided, return True."""
    return can_hold([_knownness(value)], unknown_names, types)


def is_always_known(value: Node, unknown_names: Iterable[str], types: Types) -> bool:
    """Return whether a value is known in every case.

    Args:
        value: an expression.
        unknown_names: the names that can be unknown. All other names are known.
        types: the type of each name.
    """
    unknown_name_set = frozenset(unknown_names)
    names = names_of([value])
    values = {
        name: (known_values(types.get(name)) - UNKNOWN) | (UNKNOWN if name in unknown_name_set else _NO_VALUES)
        for name in names
    }
    return not may_have_case((), _knownness(value), values | _ages(names, types), types)


def _knownness(value: Node) -> Node:
    """Return a condition that is true exactly if a value is known."""
    if isinstance(value, Choice):  # if both branches have the same value, the condition may be unknown
        branches = replace(value, then=_knownness(value.then), otherwise=_knownness(value.otherwise))
        decided = And(start=0, end=0, operands=(_knownness(value.condition), branches))
        return Or(start=0, end=0, operands=(decided, _equality(value.then, value.otherwise)))
    if isinstance(value, Fallback):
        return Or(start=0, end=0, operands=(_knownness(value.value), _knownness(value.otherwise)))
    if isinstance(value, Name):
        return known_call(value.name)
    if isinstance(value, (Number, Text, Truth)):
        return Truth(start=0, end=0, value=True)
    if isinstance(value, (Arithmetic, Negative)) or (isinstance(value, Call) and value.function != "known"):
        return _equality(value, value)
    return Or(start=0, end=0, operands=(value, Not(start=0, end=0, operand=value)))


def _equality(one: Node, other: Node) -> Node:
    return Compare(start=0, end=0, first=one, rest=((Comparison.EQUAL, other),))


def known_call(name: str) -> Node:
    """Return the condition that a name is known."""
    return Call(start=0, end=0, function="known", arguments=(Name(start=0, end=0, name=name),))


def implies(stronger_conditions: Sequence[Node], weaker_conditions: Sequence[Node], types: Types) -> bool:
    """Return whether the weaker conditions are true in all cases in which the stronger conditions are true.

    In a case, each name is unknown or has a value.

    Args:
        stronger_conditions: the conditions that are all true.
        weaker_conditions: the conditions that must all follow from the stronger conditions.
        types: the type of each name in the conditions, from `declared_type`. A name without a type can have any value.
    """
    claims = conjuncts(weaker_conditions)
    names = names_of((*stronger_conditions, *claims))
    values = {name: known_values(types.get(name)) | UNKNOWN for name in names} | _ages(names, types)
    return not any(may_have_case(stronger_conditions, part, values, types) for part in claims)


def always_holds(condition: Node, types: Types, *, optional_names: Iterable[str] = ()) -> bool:
    """Return whether a condition is true for every possible value of its names.

    The names are known, except optional names. `known(x)` can be true or false, and an age can be any number.

    Args:
        condition: the condition.
        types: the type of each name in the condition.
        optional_names: the names that may be unknown.
    """
    optional_name_set = frozenset(optional_names)
    values = {
        name: known_values(types.get(name)) | (UNKNOWN if name in optional_name_set else _NO_VALUES)
        for name in names_of([condition])
    }
    for part in walk(condition):
        if isinstance(part, Call) and part.function in ("known", "age"):
            (argument,) = part.arguments
            assert isinstance(argument, Name)
            if part.function == "known":
                values[known_key(argument.name)] = EITHER
            else:
                values[age_key(argument.name)] = _ANY_AGE
    return not may_have_case((), condition, values, types)


def _ages(names: Iterable[str], types: Types) -> dict[str, Values]:
    """Return a mapping from the `age_key` of each name with a finite validity to the possible ages of its evidence."""
    declared = ((name, types.get(name)) for name in names)
    return {
        age_key(name): frozenset({Interval(Fraction(0), Fraction(repr(type_.valid_for_s)))})
        for name, type_ in declared
        if type_ is not None and math.isfinite(type_.valid_for_s)
    }
