"""Write scripts of behaviour trees as Python: an entry is `it["name"]`, and operators are Python's operators.

The values that a scope returns implement the differences from Python, such as a text that compares as a number.
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

_CHOICE, _OR, _AND, _NOT, _COMPARE, _SUM, _PRODUCT, _SIGN, _ATOM = range(1, 10)


def truth_text(node: Node, enums: Enums) -> str:
    """Return a script as Python, for a place that uses only whether its value is true."""
    if isinstance(node, And | Or):
        sign = " and " if isinstance(node, And) else " or "
        return sign.join(operands(node, enums))
    return value_text(node, enums)


def operands(node: And | Or, enums: Enums) -> list[str]:
    """Return the operands of `&&` or `||`, in parentheses where they are necessary."""
    power = _AND if isinstance(node, And) else _OR
    return [_truth_operand(operand, power + 1, enums) for operand in node.operands]


def value_text(node: Node, enums: Enums) -> str:
    """Return a script as Python, for a place that uses its value."""
    return _text_and_power(node, enums)[0]


def _truth_operand(node: Node, power: int, enums: Enums) -> str:
    if isinstance(node, And | Or):
        own_power = _AND if isinstance(node, And) else _OR
        text = truth_text(node, enums)
        return text if own_power >= power else f"({text})"
    return _value_operand(node, power, enums)


def _value_operand(node: Node, power: int, enums: Enums) -> str:
    text, own_power = _text_and_power(node, enums)
    return text if own_power >= power else f"({text})"


def _text_and_power(node: Node, enums: Enums) -> tuple[str, int]:
    """Return the text of a node and the precedence of the text."""
    match node:
        case Name(name=name):
            return (literal(enums[name]), _SIGN) if name in enums else (f"it[{literal(name)}]", _ATOM)
        case Number(value=value) | Text(value=value) | Truth(value=value):
            return literal(value), _ATOM
        case Negative(operand=operand):
            return f"-{_value_operand(operand, _SIGN, enums)}", _SIGN
        case Not(operand=operand):
            return f"not {_truth_operand(operand, _NOT, enums)}", _NOT
        case And() | Or():
            return f"bool({truth_text(node, enums)})", _ATOM
        case Compare(first=first, rest=rest):
            links = "".join(f" {sign} {_value_operand(operand, _SUM, enums)}" for sign, operand in rest)
            return _value_operand(first, _SUM, enums) + links, _COMPARE
        case Arithmetic(operator=sign, left=left, right=right):
            power = _SUM if sign in "+-" else _PRODUCT
            return f"{_value_operand(left, power, enums)} {sign} {_value_operand(right, power + 1, enums)}", power
        case Choice(then=then, condition=condition, otherwise=otherwise):
            value, other_value = _value_operand(then, _OR, enums), _value_operand(otherwise, _CHOICE, enums)
            return f"{value} if {_truth_operand(condition, _OR, enums)} else {other_value}", _CHOICE
    raise TypeError(f"{type(node).__name__} is not a node of a script")
