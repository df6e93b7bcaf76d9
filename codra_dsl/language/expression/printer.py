"""Syntax tree -> text, in codra's canonical form. Parsing this text gives the same tree again."""

from __future__ import annotations

from codra_dsl.language.expression.parser import Power
from codra_dsl.language.expression.tree import (
    And,
    Arithmetic,
    Call,
    Choice,
    Compare,
    Fallback,
    In,
    Name,
    Negative,
    Node,
    Not,
    Number,
    Or,
    Text,
    Truth,
)

_TIGHTEST = Power.SIGN + 1


def to_text(node: Node) -> str:
    """Return a condition as text, with no more parentheses than it needs."""
    return _text(node)[0]


def _text(node: Node) -> tuple[str, int]:
    """Return the text and its binding power."""
    match node:
        case Name(name=text):
            return text, _TIGHTEST
        case Number(value=value, unit=unit):
            return (f"{value!r} {unit}" if unit else repr(value)), _TIGHTEST
        case Text(value=value):
            return _quoted_text(value), _TIGHTEST
        case Truth(value=value):
            return ("true" if value else "false"), _TIGHTEST
        case Call(function=function, arguments=arguments):
            return f"{function}({_values_text(arguments)})", _TIGHTEST
        case Negative(operand=operand):
            return f"-{_operand_text(operand, Power.SIGN)}", Power.SIGN
        case Not(operand=operand):
            return f"not {_operand_text(operand, Power.NOT)}", Power.NOT
    return _operation_text(node)


def _operation_text(node: Node) -> tuple[str, int]:
    match node:
        case And(operands=operands):
            return " and ".join(_operand_text(operand, Power.AND + 1) for operand in operands), Power.AND
        case Or(operands=operands):
            return " or ".join(_operand_text(operand, Power.OR + 1) for operand in operands), Power.OR
        case Compare(first=first, rest=rest):
            rest_text = "".join(f" {operator} {_operand_text(operand, Power.SUM)}" for operator, operand in rest)
            return _operand_text(first, Power.SUM) + rest_text, Power.COMPARE
        case In(item=item, options=options, negated=negated):
            return (
                f"{_operand_text(item, Power.SUM)} {'not in' if negated else 'in'} ({_values_text(options)})",
                Power.COMPARE,
            )
        case Arithmetic(operator=operator, left=left, right=right):
            power = Power.SUM if operator in "+-" else Power.PRODUCT
            return f"{_operand_text(left, power)} {operator} {_operand_text(right, power + 1)}", power
        case Choice(then=then, condition=condition, otherwise=otherwise):
            operand_texts = (
                _operand_text(then, Power.OR),
                _operand_text(condition, Power.OR),
                _operand_text(otherwise, Power.CHOICE),
            )
            return "{} if {} else {}".format(*operand_texts), Power.CHOICE
        case Fallback(value=value, otherwise=otherwise):
            return f"{_operand_text(value, Power.OR)} else {_operand_text(otherwise, Power.CHOICE)}", Power.CHOICE
    raise TypeError(f"{type(node).__name__} is not a node of a condition")


def _operand_text(node: Node, power: int) -> str:
    text, own_power = _text(node)
    return text if own_power >= power else f"({text})"


def _values_text(nodes: tuple[Node, ...]) -> str:
    return ", ".join(_text(node)[0] for node in nodes)


def _quoted_text(value: str) -> str:
    escaped_value = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("\t", "\\t")
    return f'"{escaped_value}"'
