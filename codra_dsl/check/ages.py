"""How old evidence may be at most for a condition to hold."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from codra_dsl.check.intervals import Interval
from codra_dsl.check.outcomes import Context, links, outcomes
from codra_dsl.expression import And, Call, Compare, Name, Node, Not, Or, names_in
from codra_dsl.model import Condition

_TURNED = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}
_NEGATED = {"<": ">=", "<=": ">", ">": "<=", ">=": "<"}


@dataclass(frozen=True, slots=True)
class Bound:
    """An age that must not be exceeded.

    Attributes:
        name: whose age it is.
        node: the comparison that says so, with the `not` before it.
        limit_s: how old it may be; None where that depends on context-variables.
    """

    name: str
    node: Node
    limit_s: float | None


def upper_bounds(condition: Condition) -> Iterator[Bound]:
    """Yield what must be true of ages for a condition to be true: `age(x) < 2 s`, but not in an `or`."""
    waiting = [] if condition.tree is None else [(condition.tree, condition.tree, False)]
    while waiting:
        node, whole, is_denied = waiting.pop()
        if isinstance(node, Not):
            waiting.append((node.operand, whole, not is_denied))
        elif (isinstance(node, And) and not is_denied) or (isinstance(node, Or) and is_denied):
            waiting.extend((operand, whole if is_denied else operand, is_denied) for operand in reversed(node.operands))
        elif isinstance(node, Compare) and (not is_denied or len(node.rest) == 1):
            for operator, left, right in links(node):
                yield from _bound(_NEGATED.get(operator, "") if is_denied else operator, left, right, whole)


def _bound(operator: str, left: Node, right: Node, whole: Node) -> Iterator[Bound]:
    for aging, limit, read in ((left, right, operator), (right, left, _TURNED.get(operator, ""))):
        if isinstance(aging, Call) and aging.function == "age" and read in ("<", "<="):
            (argument,) = aging.arguments
            assert isinstance(argument, Name)
            yield Bound(argument.name, whole, _seconds(limit))


def _seconds(limit: Node) -> float | None:
    if names_in(limit):
        return None
    (found, *others) = outcomes(limit, Context({}))
    return float(found.low) if not others and isinstance(found, Interval) and found.is_point else None
