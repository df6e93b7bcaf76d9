"""At which numbers comparisons with constants change: they cut what a name can be into pieces.

Between two neighbouring cuts every comparison of the name with constants has one answer. This holds where both sides
are linear in the name between their kinks, which `abs`, `min`, `max` and choices make; other comparisons give no cuts.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from fractions import Fraction
from itertools import combinations, pairwise

from codra_dsl.check.intervals import Interval, point
from codra_dsl.check.outcomes import Context, age_key, links, outcomes
from codra_dsl.expression import Arithmetic, Call, Choice, Name, Node, parts, walk

Function = Callable[[Fraction], Fraction | None]
"""A number that depends on another; None where it is no number."""

MAX_KINKS = 64
"""A comparison with more kinks gives no cuts."""

MAX_RIVALS = 8
"""Neither does one with a `min` or `max` of more numbers."""


def subjects(node: Node) -> frozenset[str]:
    """Return the keys of a context on which a value depends: names and ages."""
    found: set[str] = set()
    waiting = [node]
    while waiting:
        part = waiting.pop()
        if isinstance(part, Name):
            found.add(part.name)
        elif isinstance(part, Call) and part.function == "age" and isinstance(part.arguments[0], Name):
            found.add(age_key(part.arguments[0].name))
        else:
            waiting.extend(parts(part))
    return frozenset(found)


def cuts(key: str, sides: Iterable[tuple[Node, Node]]) -> frozenset[Fraction]:
    """Return where comparisons of one name, or one age, with constants change.

    Args:
        key: the name's key in a context.
        sides: the two sides of each comparison; neither depends on anything else.
    """
    found: set[Fraction] = set()
    for left, right in sides:
        kinks = _kinks(left, key), _kinks(right, key)
        if kinks[0] is not None and kinks[1] is not None:
            bends = kinks[0] | kinks[1]
            found |= bends | _roots(_difference(left, right, key), bends)
    return frozenset(found)


def _kinks(node: Node, key: str) -> set[Fraction] | None:
    """Return where a number stops being the linear function that it was, or None if it is none between kinks."""
    if _bends(node):
        return None
    found: set[Fraction] = set()
    for part in parts(node):
        inner = _kinks(part, key)
        if inner is None:
            return None
        found |= inner
    bends = frozenset(found)
    for left, right in _rivals(node):
        found |= _roots(_difference(left, right, key), bends)
    return found if len(found) <= MAX_KINKS else None


def is_curved(*values: Node) -> bool:
    """Return whether a number is no linear function of a name, kinks left aside."""
    return any(_bends(part) for value in values for part in walk(value))


def _bends(part: Node) -> bool:
    if isinstance(part, Call):
        return len(part.arguments) > MAX_RIVALS
    if not isinstance(part, Arithmetic) or part.operator in "+-":
        return False
    return bool(subjects(part.right)) and (part.operator == "/" or bool(subjects(part.left)))


def _rivals(part: Node) -> Iterable[tuple[Node, Node | None]]:
    """Yield the numbers whose order decides which of several functions a part is; None stands for zero."""
    if isinstance(part, Call) and part.function == "abs":
        yield part.arguments[0], None
    elif isinstance(part, Call) and part.function in ("min", "max"):
        yield from combinations(part.arguments, 2)
    elif isinstance(part, Choice):
        yield from ((left, right) for each in walk(part.condition) for _, left, right in links(each))


def _difference(left: Node, right: Node | None, key: str) -> Function:
    """Return by how much one number is larger than another, or than zero."""

    def at(number: Fraction) -> Fraction | None:
        """Return the difference where the key is a number; None where it is not known to be one."""
        one = _number_at(left, key, number)
        other = Fraction(0) if right is None else _number_at(right, key, number)
        return None if one is None or other is None else one - other

    return at


def _number_at(node: Node, key: str, number: Fraction) -> Fraction | None:
    name = key.removeprefix("age(").removesuffix(")")
    found = outcomes(node, Context({name: frozenset({point(number)}), key: frozenset({point(number)})}))
    for value in found:
        if isinstance(value, Interval) and value.is_point and isinstance(value.low, Fraction) and len(found) == 1:
            return value.low
    return None


def _roots(function: Function, kinks: Iterable[Fraction]) -> set[Fraction]:
    """Return where a function that is linear between its kinks is zero."""
    bends = sorted(kinks)
    samples: list[Sequence[Fraction]] = [
        (low + (high - low) / 3, high - (high - low) / 3) for low, high in pairwise(bends)
    ]
    if bends:
        samples += [(bends[0] - 2, bends[0] - 1), (bends[-1] + 1, bends[-1] + 2)]
    else:
        samples.append((Fraction(0), Fraction(1)))
    found: set[Fraction] = set()
    for one, other in samples:
        first, second = function(one), function(other)
        if first is not None and second is not None and first != second:
            found.add(one - first * (other - one) / (second - first))
    return found
