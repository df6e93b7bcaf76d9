"""The `x else y` that was probably meant in an expression: `else` takes more to both sides than people expect.

`gap else 8 m < 1 m` means `gap else (8 m < 1 m)`, because `else` binds looser than all other operators.
"""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.expression.tree import And, Choice, Compare, Fallback, In, Node, Not, Or, walk


def intended_fallbacks(tree: Node) -> Iterator[tuple[int, int]]:
    """Yield the start and the end of each `x else y` with only those operands that belong to it, in text order."""
    for part in walk(tree):
        match part:
            case Choice(condition=condition, otherwise=Fallback(value=value)):  # a if x else y < b else c
                yield _last_operand(condition).start, _first_operand(value).end
            case Fallback(value=value, otherwise=otherwise):
                yield _last_operand(value).start, _first_operand(otherwise).end


def _last_operand(node: Node) -> Node:
    match node:
        case And(operands=(*_, last)) | Or(operands=(*_, last)) | Not(operand=last) | Compare(rest=(*_, (_, last))):
            return _last_operand(last)
    return node


def _first_operand(node: Node) -> Node:
    match node:
        case And(operands=(first, *_)) | Or(operands=(first, *_)) | Compare(first=first) | In(item=first):
            return _first_operand(first)
    return node
