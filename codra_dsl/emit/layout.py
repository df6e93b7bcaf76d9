"""Python expressions laid out in lines, exactly as `ruff format` leaves them.

An expression stays on its line while it fits; what does not fit is opened from the outside in: brackets hold one item
a line, with a comma after the last; a chain of operators breaks before each of its weakest operators.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, replace

WIDTH = 120
_STEP = 4


@dataclass(frozen=True, slots=True)
class Brackets:
    """A call, tuple, list or dictionary.

    Attributes:
        opening: all up to and including the bracket, e.g. `Accept(`.
        items: each with what precedes it, e.g. `name=`.
        spread: one item a line, even where all would fit.
    """

    opening: str
    items: tuple[tuple[str, Expression], ...]
    closing: str
    spread: bool = False


@dataclass(frozen=True, slots=True)
class Chain:
    """Operands joined by operators of one strength: `first`, then pairs of an operator and an operand."""

    first: Expression
    rest: tuple[tuple[str, Expression], ...]


@dataclass(frozen=True, slots=True)
class Grouped:
    """An expression in parentheses, with what precedes them, e.g. `~`."""

    prefix: str
    inner: Expression


Expression = str | Brackets | Chain | Grouped


def call(function: str, *arguments: Expression, **keywords: Expression) -> Brackets:
    """Return a call."""
    return Brackets(f"{function}(", _items(arguments, keywords), ")")


def spread_call(function: str, *arguments: Expression, **keywords: Expression) -> Brackets:
    """Return a call with one argument a line."""
    return Brackets(f"{function}(", _items(arguments, keywords), ")", spread=True)


def tuple_of(items: Iterable[Expression]) -> Brackets:
    """Return a tuple; with one item it keeps its comma."""
    pairs = tuple(("", item) for item in items)
    return Brackets("(", pairs, ",)" if len(pairs) == 1 else ")")


def spread_tuple(items: Iterable[Expression]) -> Brackets:
    """Return a tuple with one item a line; the comma of a single item is no reason to spread it."""
    brackets = tuple_of(items)
    return replace(brackets, spread=len(brackets.items) > 1)


def spread_list(items: Iterable[Expression]) -> Brackets:
    """Return a list with one item a line."""
    return Brackets("[", tuple(("", item) for item in items), "]", spread=True)


def dictionary(items: Iterable[tuple[str, Expression]]) -> Brackets:
    """Return a dictionary; keys are literals."""
    return Brackets("{", tuple((f"{key}: ", value) for key, value in items), "}")


def _items(arguments: Iterable[Expression], keywords: dict[str, Expression]) -> tuple[tuple[str, Expression], ...]:
    named = ((f"{name}=", value) for name, value in keywords.items())
    return (*(("", argument) for argument in arguments), *named)


def laid_out(expression: Expression, *, indent: int = 0, before: int = 0, after: int = 0) -> str:
    """Return an expression as text.

    Args:
        expression: what to lay out.
        indent: columns before the statement that it belongs to.
        before: columns taken on its first line, `indent` included.
        after: columns that whatever follows needs on its last line.
    """
    flat = _flat(expression)
    if flat is not None and before + len(flat) + after <= WIDTH:
        return flat
    if isinstance(expression, Brackets) and expression.items:
        return _opened(expression, indent)
    if isinstance(expression, Chain):
        return _broken(expression, indent, before, after)
    if isinstance(expression, Grouped):
        inner = laid_out(expression.inner, indent=indent + _STEP, before=indent + _STEP)
        return f"{expression.prefix}(\n{' ' * (indent + _STEP)}{inner}\n{' ' * indent})"
    return flat or ""


def _flat(expression: Expression) -> str | None:
    """Return an expression on one line, or None where part of it takes several lines in any case."""
    if isinstance(expression, str):
        return expression
    if isinstance(expression, Brackets):
        return _flat_brackets(expression)
    if isinstance(expression, Grouped):
        inner = _flat(expression.inner)
        return None if inner is None else f"{expression.prefix}({inner})"
    parts = [_flat(expression.first), *(_flat(operand) for _, operand in expression.rest)]
    operators = ["", *(f" {operator} " for operator, _ in expression.rest)]
    whole = [text for pair in zip(operators, parts, strict=True) for text in pair if text is not None]
    return None if None in parts else "".join(whole)


def _flat_brackets(expression: Brackets) -> str | None:
    if expression.spread:
        return None
    texts = [(before, _flat(item)) for before, item in expression.items]
    if any(text is None for _, text in texts):
        return None
    return expression.opening + ", ".join(f"{before}{text}" for before, text in texts) + expression.closing


def _opened(expression: Brackets, indent: int) -> str:
    inner = indent + _STEP
    lines = [
        f"{' ' * inner}{before}{laid_out(item, indent=inner, before=inner + len(before), after=1)},\n"
        for before, item in expression.items
    ]
    return f"{expression.opening}\n{''.join(lines)}{' ' * indent}{expression.closing.lstrip(',')}"


def _broken(expression: Chain, indent: int, before: int, after: int) -> str:
    lines = [laid_out(expression.first, indent=indent, before=before)]
    for number, (operator, operand) in enumerate(expression.rest, start=1):
        following = after if number == len(expression.rest) else 0
        column = indent + len(operator) + 1
        lines.append(f"{operator} {laid_out(operand, indent=indent, before=column, after=following)}")
    return f"\n{' ' * indent}".join(lines)
