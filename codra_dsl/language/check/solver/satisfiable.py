"""Decides whether conditions can hold, always hold, or follow from others, by the types, ranges and units of names.

Every answer comes from one question: is there a case in which some conditions hold and another condition does not? The
answers are exact if names are compared with constants, also through sums, `abs`, `min` and `max`. Otherwise the answers
err towards "possible": the answer that conditions cannot hold, or that they follow, is always correct.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction

from codra_dsl.language.check.conditions.types import Types
from codra_dsl.language.check.solver.case_split import conjuncts, is_case, names_of
from codra_dsl.language.check.solver.intervals import Interval
from codra_dsl.language.check.solver.values import EITHER, UNKNOWN, Values, age_key, known_key, known_values
from codra_dsl.language.expression import Call, Name, Node, walk

_ANY_AGE: Values = frozenset({Interval(-math.inf, math.inf)})
_NO_VALUES: Values = frozenset()


def can_hold(conditions: Sequence[Node], unknown: Iterable[str], types: Types) -> bool:
    """Return whether conditions can be true together; also True if this cannot be decided.

    Args:
        conditions: the conditions that must be true.
        unknown: names that are certainly unknown; every other name can have any value of its type or be unknown.
        types: the type of each name.
    """
    unknown_names = frozenset(unknown)
    if all(type(condition) is Name for condition in conditions):  # as in most preconditions
        return not any(condition.name in unknown_names for condition in conditions if isinstance(condition, Name))
    names = names_of(conditions)
    values = {name: UNKNOWN if name in unknown_names else known_values(types.get(name)) | UNKNOWN for name in names}
    values |= _ages(names, types)
    return is_case(conditions, None, values, types)


def known(name: str) -> Node:
    """Return the condition that a name is known."""
    return Call(start=0, end=0, function="known", arguments=(Name(start=0, end=0, name=name),))


def implies(stronger: Sequence[Node], weaker: Sequence[Node], types: Types) -> bool:
    """Return whether the weaker conditions are true whenever the stronger are, for any known and unknown values.

    Args:
        stronger: the conditions that are all true.
        weaker: the conditions that must all follow.
        types: the type of each name in the conditions, from `declared_type`. Nothing follows from missing names.
    """
    claims = conjuncts(weaker)
    names = names_of((*stronger, *claims))
    values = {name: known_values(types.get(name)) | UNKNOWN for name in names} | _ages(names, types)
    return not any(is_case(stronger, part, values, types) for part in claims)


def always_holds(condition: Node, types: Types, *, optional_names: Iterable[str] = ()) -> bool:
    """Return whether a condition is true for every possible value of its names, once these are known.

    `known(x)` can be true or false, and an age can be any number.

    Args:
        condition: the condition.
        types: the type of each name in it.
        optional_names: names that may be unknown nevertheless.
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
    return not is_case((), condition, values, types)


def _ages(names: Iterable[str], types: Types) -> dict[str, Values]:
    """Return the possible ages of valid evidence for each name with a finite validity, by its `age_key`."""
    declared = ((name, types.get(name)) for name in names)
    return {
        age_key(name): frozenset({Interval(Fraction(0), Fraction(repr(type_.valid_for_s)))})
        for name, type_ in declared
        if type_ is not None and math.isfinite(type_.valid_for_s)
    }
