"""Cuts: the numbers at which the results of comparisons between a name and constants change.

The cuts divide the range of the name into pieces. Between two neighbouring cuts, every comparison of the name with
constants has only one result. This is true for comparisons whose sides are linear functions of the name, except at
kinks. Kinks come from `abs`, `min`, `max` and choices. Other comparisons give no cuts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from itertools import combinations, pairwise

from codra_dsl.language.check.solver.intervals import Interval, point
from codra_dsl.language.check.solver.values import Context, age_key, own_comparisons, possible_values
from codra_dsl.language.expression import Arithmetic, Call, Choice, Name, Node, parts, walk

Function = Callable[[Fraction], Fraction | None]
"""A function of a number. It returns None for an argument if the result is not a single number."""

MAX_KINKS = 64
"""The maximum number of kinks on one side of a comparison. With more kinks, the comparison gives no cuts."""

MAX_ARGUMENTS = 8
"""The maximum number of arguments of `min` and `max`. With more arguments, a comparison gives no cuts."""


def context_keys_of(node: Node) -> frozenset[str]:
    """Return the names and ages that a value depends on, as the keys that a `Context` uses."""
    keys: set[str] = set()
    pending_nodes = [node]
    while pending_nodes:
        part = pending_nodes.pop()
        if isinstance(part, Name):
            keys.add(part.name)
        elif isinstance(part, Call) and part.function == "age" and isinstance(part.arguments[0], Name):
            keys.add(age_key(part.arguments[0].name))
        else:
            pending_nodes.extend(parts(part))
    return frozenset(keys)


def cuts(key: str, sides: Iterable[tuple[Node, Node]]) -> frozenset[Fraction]:
    """Return the cuts for one name or one age.

    Args:
        key: the key of the name or of the age in a context.
        sides: the two sides of each comparison. The sides depend on no other name or age.
    """
    breakpoints: set[Fraction] = set()
    for left, right in sides:
        kinks = _kinks(left, key), _kinks(right, key)
        if kinks[0] is not None and kinks[1] is not None:
            all_kinks = kinks[0] | kinks[1]
            breakpoints |= all_kinks | _roots(_difference(left, right, key), all_kinks)
    return frozenset(breakpoints)


def _kinks(node: Node, key: str) -> set[Fraction] | None:
    """Return the kinks of a function; None if the function is not linear between its kinks, or has too many kinks."""
    if _is_part_curved(node):
        return None
    kinks: set[Fraction] = set()
    for part in parts(node):
        kinks_of_part = _kinks(part, key)
        if kinks_of_part is None:
            return None
        kinks |= kinks_of_part
    kinks_of_parts = frozenset(kinks)
    for left, right in _selecting_pairs(node):
        kinks |= _roots(_difference(left, right, key), kinks_of_parts)
    return kinks if len(kinks) <= MAX_KINKS else None


def is_curved(*values: Node) -> bool:
    """Return whether one of these values is a function of names that is not linear between its kinks."""
    return any(_is_part_curved(part) for value in values for part in walk(value))


def _is_part_curved(part: Node) -> bool:
    if isinstance(part, Call):
        return len(part.arguments) > MAX_ARGUMENTS
    if not isinstance(part, Arithmetic) or part.operator in "+-":
        return False
    return bool(context_keys_of(part.right)) and (part.operator == "/" or bool(context_keys_of(part.left)))


def _selecting_pairs(part: Node) -> Iterable[tuple[Node, Node | None]]:
    """Yield pairs of numbers; the part can have a kink where the numbers of a pair are equal. None means zero."""
    if isinstance(part, Call) and part.function == "abs":
        yield part.arguments[0], None
    elif isinstance(part, Call) and part.function in ("min", "max"):
        yield from combinations(part.arguments, 2)
    elif isinstance(part, Choice):
        yield from ((left, right) for node in walk(part.condition) for _, left, right in own_comparisons(node))


def _difference(left: Node, right: Node | None, key: str) -> Function:
    """Return the function that computes `left - right`. If `right` is None, the function computes `left`."""

    def difference_at(number: Fraction) -> Fraction | None:
        """Return the difference for one value of the key; None if the difference is not a single number."""
        one = _number_at(left, key, number)
        other = Fraction(0) if right is None else _number_at(right, key, number)
        return None if one is None or other is None else one - other

    return difference_at


def _number_at(node: Node, key: str, number: Fraction) -> Fraction | None:
    name = key.removeprefix("age(").removesuffix(")")
    values = possible_values(node, Context({name: frozenset({point(number)}), key: frozenset({point(number)})}))
    for value in values:
        if isinstance(value, Interval) and value.is_point and isinstance(value.low, Fraction) and len(values) == 1:
            return value.low
    return None


def _roots(function: Function, kinks: Iterable[Fraction]) -> set[Fraction]:
    """Return the zeros of a function that is linear between its kinks."""
    sorted_kinks = sorted(kinks)
    samples: list[Sequence[Fraction]] = [
        (low + (high - low) / 3, high - (high - low) / 3) for low, high in pairwise(sorted_kinks)
    ]
    if sorted_kinks:
        samples += [
            (sorted_kinks[0] - 2, sorted_kinks[0] - 1),
            (sorted_kinks[-1] + 1, sorted_kinks[-1] + 2),
        ]
    else:
        samples.append((Fraction(0), Fraction(1)))
    roots: set[Fraction] = set()
    for one, other in samples:
        first, second = function(one), function(other)
        if first is not None and second is not None and first != second:
            roots.add(one - first * (other - one) / (second - first))
    return roots
