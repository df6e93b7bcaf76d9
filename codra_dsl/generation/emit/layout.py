"""Lay out Python expressions in lines, exactly as `ruff format` writes them.

An expression stays on one line if it fits. Otherwise its outermost part is broken first: brackets contain one item per
line, with a comma after the last item, and a chain of operators is broken before each operator of the lowest
precedence.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import NamedTuple

from codra_dsl.language.frozen import dataclass

WIDTH = 120
_STEP = 4

UNLIMITED_WIDTH = 10_000
"""Wider than any line that must not be broken."""

SHORT_TEXT_LENGTH = 70
"""A text of at most this length fits on every line: no declaration or behaviour is indented too far for it."""


class Brackets(NamedTuple):
    """A call, tuple, list or dictionary, made by `make_brackets`.

    Attributes:
        opening: the text up to and including the bracket, e.g. `Accept(` or `type=real(`.
        flat: the expression on one line; None if part of it always takes several lines.
    """

    opening: str
    items: tuple[Expression, ...]
    closing: str
    flat: str | None


@dataclass(frozen=True, slots=True)
class Chain:
    """Operands joined by operators of equal precedence: `first`, then pairs of an operator and an operand."""

    first: Expression
    rest: tuple[tuple[str, Expression], ...]

    @property
    def flat(self) -> str | None:
        """Return the chain on one line, or None if part of it always takes several lines."""
        operand_texts = [_flat_text(self.first), *(_flat_text(operand) for _, operand in self.rest)]
        operators = ["", *(f" {operator} " for operator, _ in self.rest)]
        texts = [text for pair in zip(operators, operand_texts, strict=True) for text in pair if text is not None]
        return None if None in operand_texts else "".join(texts)


@dataclass(frozen=True, slots=True)
class Grouped:
    """An expression in parentheses, with a text in front, e.g. `~`."""

    prefix: str
    inner: Expression

    @property
    def flat(self) -> str | None:
        """Return the expression on one line, or None if part of it always takes several lines."""
        inner = _flat_text(self.inner)
        return None if inner is None else f"{self.prefix}({inner})"


Expression = str | Brackets | Chain | Grouped


def make_brackets(opening: str, items: tuple[Expression, ...], closing: str) -> Brackets:
    """Return items in brackets."""
    return Brackets(opening, items, closing, _flat_brackets_text(opening, items, closing))


def _flat_brackets_text(opening: str, items: tuple[Expression, ...], closing: str) -> str | None:
    try:
        return f"{opening}{', '.join(items)}{closing}"  # type: ignore[arg-type]  # most often all items are texts
    except TypeError:
        texts = [text for text in map(_flat_text, items) if text is not None]
        return f"{opening}{', '.join(texts)}{closing}" if len(texts) == len(items) else None


def call(function: str, *arguments: Expression, **keywords: Expression) -> Expression:
    """Return a call."""
    return _brackets_or_text(f"{function}(", (*arguments, *_named_items(keywords, "=")) if keywords else arguments, ")")


def spread_call(function: str, *arguments: Expression, **keywords: Expression) -> Brackets:
    """Return a call with one argument per line."""
    return Brackets(f"{function}(", (*arguments, *_named_items(keywords, "=")), ")", None)


def tuple_of(items: Iterable[Expression]) -> Expression:
    """Return a tuple; a single item is followed by a comma."""
    elements = tuple(items)
    return _brackets_or_text("(", elements, ",)" if len(elements) == 1 else ")")


def spread_tuple(items: Iterable[Expression]) -> Brackets:
    """Return a tuple with one item per line; a single item is on the same line as the brackets."""
    elements = tuple(items)
    if len(elements) > 1:
        return Brackets("(", elements, ")", None)
    return make_brackets("(", elements, ",)" if elements else ")")


def spread_list(items: Iterable[Expression]) -> Brackets:
    """Return a list with one item per line."""
    return Brackets("[", tuple(items), "]", None)


def spread_dictionary(items: Mapping[str, Expression]) -> Brackets:
    """Return a dictionary with one item per line; keys are literals."""
    return Brackets("{", tuple(_named_items(items, ": ")), "}", None if items else "{}")


def dictionary(items: Mapping[str, Expression]) -> Expression:
    """Return a dictionary; keys are literals."""
    return _brackets_or_text("{", tuple(_named_items(items, ": ")), "}")


def _named_items(items: Mapping[str, Expression], separator: str) -> list[Expression]:
    """Return items, each after its name and a separator."""
    return [
        f"{name}{separator}{item}" if isinstance(item, str) else _add_prefix(f"{name}{separator}", item)
        for name, item in items.items()
    ]


def _add_prefix(prefix_text: str, item: Expression) -> Expression:
    """Return an item with a text before it on its first line."""
    match item:
        case str():
            return prefix_text + item
        case Brackets(opening, items, closing, flat):
            return Brackets(prefix_text + opening, items, closing, None if flat is None else prefix_text + flat)
        case Grouped(prefix, inner):
            return Grouped(prefix_text + prefix, inner)
        case Chain(first, rest):
            return Chain(_add_prefix(prefix_text, first), rest)


def _brackets_or_text(opening: str, items: tuple[Expression, ...], closing: str) -> Expression:
    """Return items in brackets, as plain text if this text is so short that it fits on every line."""
    flat = _flat_brackets_text(opening, items, closing)
    return Brackets(opening, items, closing, flat) if flat is None or len(flat) > SHORT_TEXT_LENGTH else flat


def lay_out(expression: Expression, *, indent: int = 0, before: int = 0, after: int = 0) -> str:
    """Return an expression as text.

    Args:
        expression: the expression to lay out.
        indent: the columns before the statement to which the expression belongs.
        before: the columns before the expression on its first line, including `indent`.
        after: the columns that the following text needs on the last line of the expression.
    """
    flat = _flat_text(expression)
    if flat is not None and before + len(flat) + after <= WIDTH:
        return flat
    if isinstance(expression, Brackets) and expression.items:
        return _break_brackets(expression, indent)
    if isinstance(expression, Chain):
        return _break_chain(expression, indent, before, after)
    if isinstance(expression, Grouped):
        inner = lay_out(expression.inner, indent=indent + _STEP, before=indent + _STEP)
        return f"{expression.prefix}(\n{' ' * (indent + _STEP)}{inner}\n{' ' * indent})"
    return flat or ""


def _flat_text(expression: Expression) -> str | None:
    """Return an expression on one line, or None if part of it always takes several lines."""
    return expression if isinstance(expression, str) else expression.flat


def _break_brackets(expression: Brackets, indent: int) -> str:
    inner_indent = indent + _STEP
    available_width = WIDTH - inner_indent - len(",")
    lines: list[str] = []
    for item in expression.items:
        flat = item if isinstance(item, str) else item.flat
        is_within_width = flat is not None and len(flat) <= available_width
        lines.append(
            flat
            if flat is not None and is_within_width
            else lay_out(item, indent=inner_indent, before=inner_indent, after=len(","))
        )
    separator = ",\n" + " " * inner_indent
    closing = f",\n{' ' * indent}{expression.closing.lstrip(',')}"
    return f"{expression.opening}\n{' ' * inner_indent}{separator.join(lines)}{closing}"


def _break_chain(expression: Chain, indent: int, before: int, after: int) -> str:
    lines = [lay_out(expression.first, indent=indent, before=before)]
    for number, (operator, operand) in enumerate(expression.rest, start=1):
        following_width = after if number == len(expression.rest) else 0
        column = indent + len(operator) + 1
        lines.append(f"{operator} {lay_out(operand, indent=indent, before=column, after=following_width)}")
    return f"\n{' ' * indent}".join(lines)
