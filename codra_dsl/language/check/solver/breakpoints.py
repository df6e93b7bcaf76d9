"""The numbers at which comparisons of a name with constants change. They cut the range of the name into pieces.

Between two neighbouring cuts, every comparison of the name with constants has only one result. This holds if both sides
are linear in the name, except at kinks. Kinks come from `abs`, `min`, `max` and choices. Other comparisons give no
cuts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from itertools import combinations, pairwise

from codra_dsl.language.check.solver.intervals import Interval, point
from codra_dsl.language.check.solver.values import Context, age_key, links, outcomes
from codra_dsl.language.expression import Arithmetic, Call, Choice, Name, Node, parts, walk

Function = Callable[[Fraction], Fraction | None]
"""A function from numbers to numbers. Its result is None where it is not a number."""

MAX_KINKS = 64
"""The maximum number of kinks on one side of a comparison. With more kinks, the comparison gives no cuts."""

MAX_RIVALS = 8
"""The maximum number of arguments of `min` and `max`. With more arguments, a comparison gives no cuts."""


def subjects(node: Node) -> frozenset[str]:
    """Return the keys of a context that a value depends on: names and ages."""
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
    """Return the numbers at which comparisons of one name, or one age, with constants change.

    Args:
        key: the name's key in a context.
        sides: the two sides of each comparison. They depend on nothing else.
    """
    breakpoints: set[Fraction] = set()
    for left, right in sides:
        kinks = _kinks(left, key), _kinks(right, key)
        if kinks[0] is not None and kinks[1] is not None:
            bends = kinks[0] | kinks[1]
            breakpoints |= bends | _roots(_difference(left, right, key), bends)
    return frozenset(breakpoints)


def _kinks(node: Node, key: str) -> set[Fraction] | None:
    """Return the kinks of a piecewise linear function, or None if it is not linear between its kinks."""
    if _bends(node):
        return None
    kinks: set[Fraction] = set()
    for part in parts(node):
        inner = _kinks(part, key)
        if inner is None:
            return None
        kinks |= inner
    bends = frozenset(kinks)
    for left, right in _rivals(node):
        kinks |= _roots(_difference(left, right, key), bends)
    return kinks if len(kinks) <= MAX_KINKS else None


def is_curved(*values: Node) -> bool:
    """Return whether one of these numbers is not a linear function of a name, apart from kinks."""
    return any(_bends(part) for value in values for part in walk(value))


def _bends(part: Node) -> bool:
    if isinstance(part, Call):
        return len(part.arguments) > MAX_RIVALS
    if not isinstance(part, Arithmetic) or part.operator in "+-":
        return False
    return bool(subjects(part.right)) and (part.operator == "/" or bool(subjects(part.left)))


def _rivals(part: Node) -> Iterable[tuple[Node, Node | None]]:
    """Yield the pairs of numbers whose order selects the function that a part computes; None means zero."""
    if isinstance(part, Call) and part.function == "abs":
        yield part.arguments[0], None
    elif isinstance(part, Call) and part.function in ("min", "max"):
        yield from combinations(part.arguments, 2)
    elif isinstance(part, Choice):
        yield from ((left, right) for node in walk(part.condition) for _, left, right in links(node))


def _difference(left: Node, right: Node | None, key: str) -> Function:
    """Return the function that computes by how much one number is larger than another, or than zero."""

    def at(number: Fraction) -> Fraction | None:
        """Return the difference for one value of the key; None if the difference is not a single number."""
        one = _number_at(left, key, number)
        other = Fraction(0) if right is None else _number_at(right, key, number)
        return None if one is None or other is None else one - other

    return at


def _number_at(node: Node, key: str, number: Fraction) -> Fraction | None:
    name = key.removeprefix("age(").removesuffix(")")
    values = outcomes(node, Context({name: frozenset({point(number)}), key: frozenset({point(number)})}))
    for value in values:
        if isinstance(value, Interval) and value.is_point and isinstance(value.low, Fraction) and len(values) == 1:
            return value.low
    return None


def _roots(function: Function, kinks: Iterable[Fraction]) -> set[Fraction]:
    """Return the zeros of a function that is linear between its kinks."""
    bends = sorted(kinks)
    samples: list[Sequence[Fraction]] = [
        (low + (high - low) / 3, high - (high - low) / 3) for low, high in pairwise(bends)
    ]
    if bends:
        samples += [(bends[0] - 2, bends[0] - 1), (bends[-1] + 1, bends[-1] + 2)]
    else:
        samples.append((Fraction(0), Fraction(1)))
    roots: set[Fraction] = set()
    for one, other in samples:
        first, second = function(one), function(other)
        if first is not None and second is not None and first != second:
            roots.add(one - first * (other - one) / (second - first))
    return roots
