"""The syntax tree of a condition. Trees are compared without their offsets."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import field
from enum import StrEnum

from codra_dsl.language.frozen import dataclass


class Comparison(StrEnum):
    """The comparison operators."""

    LESS = "<"
    LESS_OR_EQUAL = "<="
    GREATER = ">"
    GREATER_OR_EQUAL = ">="
    EQUAL = "=="
    NOT_EQUAL = "!="


@dataclass(frozen=True, slots=True, kw_only=True)
class Node:
    """A part of a condition. `start` and `end` are offsets in code points within the condition's text."""

    start: int = field(compare=False)
    end: int = field(compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Name(Node):
    """A context-variable or a returned value.

    Attributes:
        pose_comparison: the comparison with poses that has this name, such as `distance(a, b) < 0.9 m`; in a derived
            variable also a distance or a count of paths; otherwise None.
    """

    name: str
    pose_comparison: Node | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Number(Node):
    """A literal number, with the text of its unit if it has one."""

    value: int | float
    unit: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Text(Node):
    """A quoted string: a str value or an enum member."""

    value: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth(Node):
    """`true` or `false`."""

    value: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Not(Node):
    """`not operand`."""

    operand: Node


@dataclass(frozen=True, slots=True, kw_only=True)
class And(Node):
    """`a and b and c`."""

    operands: tuple[Node, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Or(Node):
    """`a or b or c`."""

    operands: tuple[Node, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Compare(Node):
    """A chain of comparisons, such as `a < b < c`; it is equivalent to the conjunction of its links.

    Attributes:
        rest: pairs of an operator and the operand after it.
    """

    first: Node
    rest: tuple[tuple[Comparison, Node], ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class In(Node):
    """`item in (a, b)` or `item not in (a, b)`."""

    item: Node
    options: tuple[Node, ...]
    negated: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Arithmetic(Node):
    """`left + right` and so on; operator is one of `+ - * /`."""

    operator: str
    left: Node
    right: Node


@dataclass(frozen=True, slots=True, kw_only=True)
class Negative(Node):
    """`-operand`."""

    operand: Node


@dataclass(frozen=True, slots=True, kw_only=True)
class Choice(Node):
    """`then if condition else otherwise`."""

    then: Node
    condition: Node
    otherwise: Node


@dataclass(frozen=True, slots=True, kw_only=True)
class Fallback(Node):
    """`value else otherwise`: the first operand while it is known, then the second one."""

    value: Node
    otherwise: Node


@dataclass(frozen=True, slots=True, kw_only=True)
class Call(Node):
    """`abs(x)`, `min(a, b, ...)`, `max(a, b, ...)`, `known(name)`, `age(name)`."""

    function: str
    arguments: tuple[Node, ...]


def parts(node: Node) -> tuple[Node, ...]:
    """Return the children of a node, in text order."""
    match node:
        case And(operands=operands) | Or(operands=operands):
            return operands
        case Not(operand=operand) | Negative(operand=operand):
            return (operand,)
        case Compare(first=first, rest=rest):
            return (first, *(operand for _, operand in rest))
        case In(item=item, options=options):
            return (item, *options)
        case Arithmetic(left=left, right=right):
            return (left, right)
        case Choice(then=then, condition=condition, otherwise=otherwise):
            return (then, condition, otherwise)
        case Fallback(value=value, otherwise=otherwise):
            return (value, otherwise)
        case Call(arguments=arguments):
            return arguments
    return ()


def walk(node: Node) -> Iterator[Node]:
    """Yield a node and all nodes below it, in text order."""
    pending = [node]
    while pending:
        current = pending.pop()
        yield current
        pending.extend(reversed(parts(current)))


def variables_in(node: Node | None) -> tuple[str, ...]:
    """Return the names in a condition without repetitions; nothing for a condition that could not be parsed."""
    return () if node is None else tuple(dict.fromkeys(name.name for name in names_in(node)))


def names_in(node: Node) -> tuple[Name, ...]:
    """Return every mention of a name, in text order."""
    return tuple(part for part in walk(node) if isinstance(part, Name))
