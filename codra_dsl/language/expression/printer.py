"""Syntax tree -> text, in codra's canonical form. Parsing this text gives the same tree again."""

from __future__ import annotations

from codra_dsl.language.expression.parser import Power
from codra_dsl.language.expression.tree import (
    And,
    Arithmetic,
    Call,
    Choice,
    Compare,
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
            return _quote(value), _TIGHTEST
        case Truth(value=value):
            return ("true" if value else "false"), _TIGHTEST
        case Call(function=function, arguments=arguments):
            return f"{function}({_list(arguments)})", _TIGHTEST
        case Negative(operand=operand):
            return f"-{_group(operand, Power.SIGN)}", Power.SIGN
        case Not(operand=operand):
            return f"not {_group(operand, Power.NOT)}", Power.NOT
    return _join(node)


def _join(node: Node) -> tuple[str, int]:
    match node:
        case And(operands=operands):
            return " and ".join(_group(operand, Power.AND + 1) for operand in operands), Power.AND
        case Or(operands=operands):
            return " or ".join(_group(operand, Power.OR + 1) for operand in operands), Power.OR
        case Compare(first=first, rest=rest):
            links = "".join(f" {operator} {_group(operand, Power.SUM)}" for operator, operand in rest)
            return _group(first, Power.SUM) + links, Power.COMPARE
        case In(item=item, options=options, negated=negated):
            return f"{_group(item, Power.SUM)} {'not in' if negated else 'in'} ({_list(options)})", Power.COMPARE
        case Arithmetic(operator=operator, left=left, right=right):
            power = Power.SUM if operator in "+-" else Power.PRODUCT
            return f"{_group(left, power)} {operator} {_group(right, power + 1)}", power
        case Choice(then=then, condition=condition, otherwise=otherwise):
            sides = _group(then, Power.OR), _group(condition, Power.OR), _group(otherwise, Power.CHOICE)
            return "{} if {} else {}".format(*sides), Power.CHOICE
    raise TypeError(f"{type(node).__name__} is not a node of a condition")


def _group(node: Node, power: int) -> str:
    text, own = _text(node)
    return text if own >= power else f"({text})"


def _list(nodes: tuple[Node, ...]) -> str:
    return ", ".join(_text(node)[0] for node in nodes)


def _quote(value: str) -> str:
    escaped = value.replace("\\", "\\\\").replace('"', '\\"').replace("\n", "\\n").replace("\t", "\\t")
    return f'"{escaped}"'
