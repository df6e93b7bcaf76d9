"""Scripts of behaviour trees as Python: entries are `it["name"]`, everything else is Python's own operator.

The values that a scope hands out implement the differences to Python, such as a text that compares as a number.
"""

from __future__ import annotations

from collections.abc import Mapping

from codra_dsl.generation.emit.literals import literal
from codra_dsl.language.expression import (
    And,
    Arithmetic,
    Choice,
    Compare,
    Name,
    Negative,
    Node,
    Not,
    Number,
    Or,
    Text,
    Truth,
)

Enums = Mapping[str, int]

_CHOICE, _OR, _AND, _NOT, _COMPARE, _SUM, _PRODUCT, _SIGN, _ALONE = range(1, 10)


def asked_text(node: Node, enums: Enums) -> str:
    """Return a script as Python, for a place that uses only its truth."""
    if isinstance(node, And | Or):
        sign = " and " if isinstance(node, And) else " or "
        return sign.join(operands(node, enums))
    return value_text(node, enums)


def operands(node: And | Or, enums: Enums) -> list[str]:
    """Return the operands of `&&` or `||`, each in parentheses where it needs them."""
    power = _AND if isinstance(node, And) else _OR
    return [_asked(operand, power + 1, enums) for operand in node.operands]


def value_text(node: Node, enums: Enums) -> str:
    """Return a script as Python, for a place that uses its value."""
    return _text(node, enums)[0]


def _asked(node: Node, power: int, enums: Enums) -> str:
    if isinstance(node, And | Or):
        own = _AND if isinstance(node, And) else _OR
        text = asked_text(node, enums)
        return text if own >= power else f"({text})"
    return _grouped(node, power, enums)


def _grouped(node: Node, power: int, enums: Enums) -> str:
    text, own = _text(node, enums)
    return text if own >= power else f"({text})"


def _text(node: Node, enums: Enums) -> tuple[str, int]:
    """Return the text and its precedence."""
    match node:
        case Name(name=name):
            return (literal(enums[name]), _SIGN) if name in enums else (f"it[{literal(name)}]", _ALONE)
        case Number(value=value) | Text(value=value) | Truth(value=value):
            return literal(value), _ALONE
        case Negative(operand=operand):
            return f"-{_grouped(operand, _SIGN, enums)}", _SIGN
        case Not(operand=operand):
            return f"not {_asked(operand, _NOT, enums)}", _NOT
        case And() | Or():
            return f"bool({asked_text(node, enums)})", _ALONE
        case Compare(first=first, rest=rest):
            links = "".join(f" {sign} {_grouped(operand, _SUM, enums)}" for sign, operand in rest)
            return _grouped(first, _SUM, enums) + links, _COMPARE
        case Arithmetic(operator=sign, left=left, right=right):
            power = _SUM if sign in "+-" else _PRODUCT
            return f"{_grouped(left, power, enums)} {sign} {_grouped(right, power + 1, enums)}", power
        case Choice(then=then, condition=condition, otherwise=otherwise):
            sides = _grouped(then, _OR, enums), _asked(condition, _OR, enums), _grouped(otherwise, _CHOICE, enums)
            return "{} if {} else {}".format(*sides), _CHOICE
    raise TypeError(f"{type(node).__name__} is not a node of a script")
