"""What conditions can be, under the types, ranges and units of the names in them.

One question lies behind every answer: is there a case in which some conditions hold and another does not? The answers
are exact where names are compared with constants, be it through sums, `abs`, `min` and `max`, and past that they err
towards the possible: what is said to be impossible, or to follow, is so.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from fractions import Fraction

from codra_dsl.check.cases import conjuncts, is_case, names_of
from codra_dsl.check.intervals import Interval
from codra_dsl.check.outcomes import EITHER, UNKNOWN, Values, age_key, known_key, known_values
from codra_dsl.check.types import Types
from codra_dsl.expression import Call, Name, Node, walk

_ANY_AGE: Values = frozenset({Interval(-math.inf, math.inf)})
_NOTHING: Values = frozenset()


def can_hold(conditions: Sequence[Node], unknown: Iterable[str], types: Types) -> bool:
    """Return whether conditions can be true together, or whether that cannot be decided.

    Args:
        conditions: what must be true.
        unknown: names that are unknown for certain; every other name can have any value of its type or be unknown.
        types: what each name is.
    """
    hidden = frozenset(unknown)
    if all(type(condition) is Name for condition in conditions):  # as in most preconditions
        return not any(condition.name in hidden for condition in conditions if isinstance(condition, Name))
    names = names_of(conditions)
    values = {name: UNKNOWN if name in hidden else known_values(types.get(name)) | UNKNOWN for name in names}
    values |= _ages(names, types)
    return is_case(conditions, None, values, types)


def known(name: str) -> Node:
    """Return the condition that a name is known."""
    return Call(start=0, end=0, function="known", arguments=(Name(start=0, end=0, name=name),))


def implies(stronger: Sequence[Node], weaker: Sequence[Node], types: Types) -> bool:
    """Return whether conditions are certain to be true whenever others are, whatever is known.

    Args:
        stronger: the conditions that are true, all of them.
        weaker: the conditions in question: all of them must follow.
        types: what each name in either is, as `declared_type` gives it; nothing follows from names that are missing.
    """
    asked = conjuncts(weaker)
    names = names_of((*stronger, *asked))
    values = {name: known_values(types.get(name)) | UNKNOWN for name in names} | _ages(names, types)
    return not any(is_case(stronger, part, values, types) for part in asked)


def always_holds(condition: Node, types: Types, *, absent: Iterable[str] = ()) -> bool:
    """Return whether a condition is true for every value that its names can have, once these are known.

    Whether `known(x)` holds and how old a value is counts as open.

    Args:
        condition: the condition.
        types: what each name in it is.
        absent: names that may be unknown all the same.
    """
    may_lack = frozenset(absent)
    values = {
        name: known_values(types.get(name)) | (UNKNOWN if name in may_lack else _NOTHING)
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
    """Return how old evidence can be while it is valid, by key, where that is not for ever."""
    declared = ((name, types.get(name)) for name in names)
    return {
        age_key(name): frozenset({Interval(Fraction(0), Fraction(repr(each.valid_for_s)))})
        for name, each in declared
        if each is not None and math.isfinite(each.valid_for_s)
    }
