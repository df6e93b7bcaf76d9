"""The maximum age of evidence with which a condition can hold."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.check.solver.budget import current_budget
from codra_dsl.language.check.solver.intervals import Interval
from codra_dsl.language.check.solver.values import UNKNOWN, Context, own_comparisons, possible_values
from codra_dsl.language.expression import And, Call, Compare, Name, Node, Not, Or, names_in
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import Condition

_MIRRORED_OPERATORS = {"<": ">", "<=": ">=", ">": "<", ">=": "<="}
_NEGATED_OPERATORS = {"<": ">=", "<=": ">", ">": "<=", ">=": "<"}


@dataclass(frozen=True, slots=True)
class Bound:
    """A maximum age.

    Attributes:
        name: the variable whose age is bounded.
        node: the comparison that bounds the age, including a `not` before the comparison.
        limit_s: the maximum age; None if the maximum depends on context-variables, or was not decided.
    """

    name: str
    node: Node
    limit_s: float | None


def upper_bounds(condition: Condition) -> Iterator[Bound]:
    """Yield the maximum ages that a condition requires, such as `age(x) < 2 s`. An `or` requires no maximum age."""
    pending_nodes = [] if condition.tree is None else [(condition.tree, condition.tree, False)]
    while pending_nodes:
        node, outermost_node, is_negated = pending_nodes.pop()
        if isinstance(node, Not):
            pending_nodes.append((node.operand, outermost_node, not is_negated))
        elif (isinstance(node, And) and not is_negated) or (isinstance(node, Or) and is_negated):
            pending_nodes.extend(
                (operand, outermost_node if is_negated else operand, is_negated) for operand in reversed(node.operands)
            )
        elif isinstance(node, Compare) and (not is_negated or len(node.rest) == 1):
            for operator, left, right in own_comparisons(node):
                yield from _bound(
                    _NEGATED_OPERATORS.get(operator, "") if is_negated else operator, left, right, outermost_node
                )


def _bound(operator: str, left: Node, right: Node, outermost_node: Node) -> Iterator[Bound]:
    for age_side, limit, age_operator in (
        (left, right, operator),
        (right, left, _MIRRORED_OPERATORS.get(operator, "")),
    ):
        if isinstance(age_side, Call) and age_side.function == "age" and age_operator in ("<", "<="):
            (argument,) = age_side.arguments
            assert isinstance(argument, Name)
            yield Bound(argument.name, outermost_node, _limit_s(limit))


def _limit_s(limit: Node) -> float | None:
    if names_in(limit):
        return None
    values = current_budget().answer(lambda: possible_values(limit, Context({})), [limit], undecided=UNKNOWN)
    (value, *others) = values
    return float(value.low) if not others and isinstance(value, Interval) and value.is_point else None
