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
        operator = " and " if isinstance(node, And) else " or "
        return operator.join(operand_texts(node, enums))
    return value_text(node, enums)


def operand_texts(node: And | Or, enums: Enums) -> list[str]:
    """Return the operands of `&&` or `||`, in parentheses where they are necessary."""
    precedence = _AND if isinstance(node, And) else _OR
    return [_truth_operand(operand, precedence + 1, enums) for operand in node.operands]


def value_text(node: Node, enums: Enums) -> str:
    """Return a script as Python, for a place that uses its value."""
    return _text_and_precedence(node, enums)[0]


def _truth_operand(node: Node, precedence: int, enums: Enums) -> str:
    if isinstance(node, And | Or):
        own_precedence = _AND if isinstance(node, And) else _OR
        text = truth_text(node, enums)
        return text if own_precedence >= precedence else f"({text})"
    return _value_operand(node, precedence, enums)


def _value_operand(node: Node, precedence: int, enums: Enums) -> str:
    text, own_precedence = _text_and_precedence(node, enums)
    return text if own_precedence >= precedence else f"({text})"


def _text_and_precedence(node: Node, enums: Enums) -> tuple[str, int]:
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
            rest_text = "".join(f" {operator} {_value_operand(operand, _SUM, enums)}" for operator, operand in rest)
            return _value_operand(first, _SUM, enums) + rest_text, _COMPARE
        case Arithmetic(operator=operator, left=left, right=right):
            precedence = _SUM if operator in "+-" else _PRODUCT
            return (
                f"{_value_operand(left, precedence, enums)} {operator} {_value_operand(right, precedence + 1, enums)}",
                precedence,
            )
        case Choice(then=then, condition=condition, otherwise=otherwise):
            then_text, otherwise_text = _value_operand(then, _OR, enums), _value_operand(otherwise, _CHOICE, enums)
            return f"{then_text} if {_truth_operand(condition, _OR, enums)} else {otherwise_text}", _CHOICE
    raise TypeError(f"{type(node).__name__} is not a node of a script")
