"""Decides whether a divisor can be 0: exactly if its names have few values, as ints in a small range have."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from itertools import product

from codra_dsl.language.check.conditions.types import Type, Types
from codra_dsl.language.check.solver.budget import current_budget
from codra_dsl.language.check.solver.intervals import Interval, in_base, point
from codra_dsl.language.check.solver.satisfiable import can_hold
from codra_dsl.language.check.solver.values import Context, Value, known_values, possible_values
from codra_dsl.language.expression import Compare, Comparison, Node, Number, names_in, variables_in
from codra_dsl.language.model import Kind

MAX_TRIED_CASES = 1000
"""The maximum number of cases in which a number is computed."""

_ZERO = Number(start=0, end=0, value=0.0, unit=None)


def can_be_zero(number: Node, types: Types) -> bool | None:
    """Return whether a number can be 0; None if this cannot be decided.

    Args:
        number: an expression.
        types: the type of each name.
    """
    is_zero = Compare(start=0, end=0, first=number, rest=((Comparison.EQUAL, _ZERO),))
    if not can_hold([is_zero], (), types):
        return False
    is_zero_in_a_case = _occurs(_is_zero, number, types)
    if is_zero_in_a_case is not None:
        return is_zero_in_a_case
    names = names_in(number)
    return True if len(names) == len(variables_in(number)) and not current_budget().has_undecided else None


def is_known_in_all_cases(value: Node, types: Types) -> bool:
    """Return whether a value is known for all values of its names; False if they have too many values to try."""
    return _occurs(lambda result: result is None, value, types) is False


def _is_zero(result: Value) -> bool:
    return isinstance(result, Interval) and result.is_point and result.low == 0


def _occurs(is_wanted: Callable[[Value], bool], node: Node, types: Types) -> bool | None:
    """Return whether an expression has a wanted result for some of the tried values; None if values are left."""
    return current_budget().answer(lambda: _occurs_in_a_case(is_wanted, node, types), [node], undecided=None)


def _occurs_in_a_case(is_wanted: Callable[[Value], bool], node: Node, types: Types) -> bool | None:
    """Return whether an expression has a wanted result for some of the tried values of its names.

    All values of bools, enums and ints with small ranges are tried; of other numbers, the ends of the range and 0.
    """
    names = variables_in(node)
    values_of_names = [_values_to_try(types.get(name)) for name in names]
    if math.prod(len(values) for values, _ in values_of_names) > MAX_TRIED_CASES:
        return None
    for values in product(*(values for values, _ in values_of_names)):
        context = Context({name: frozenset({value}) for name, value in zip(names, values, strict=True)})
        if any(map(is_wanted, possible_values(node, context))):
            return True
    return False if all(is_complete for _, is_complete in values_of_names) else None


def _values_to_try(declared: Type | None) -> tuple[Sequence[Value], bool]:
    """Return values of a type, and whether they are all of its values."""
    if declared is None or not declared.is_number:
        values = sorted(known_values(declared), key=repr)
        return values, declared is not None and declared.kind is not Kind.STR
    low, high = declared.range or (-math.inf, math.inf)
    is_complete = declared.kind is Kind.INT and high - low < MAX_TRIED_CASES
    ends = [end for end in (low, 0.0, high) if low <= end <= high and math.isfinite(end)]
    numbers = range(math.ceil(low), math.floor(high) + 1) if is_complete else ends
    return [point(in_base(number, declared.unit)) for number in numbers], is_complete
