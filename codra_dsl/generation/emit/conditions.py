"""Conditions in Python, as expressions for generated code.

They contain only literals, operators, and the words of `codra_dsl.runtime.values.conditions` and of
`codra_dsl.runtime.knowledge.declarations`.
"""

from __future__ import annotations

import ast
import re
from collections.abc import Mapping
from dataclasses import replace

from codra_dsl.generation.build_plan.names import CONDITION_WORDS, POSE_FUNCTIONS
from codra_dsl.generation.emit.layout import (
    UNLIMITED_WIDTH,
    Brackets,
    Chain,
    Expression,
    Grouped,
    lay_out,
    make_brackets,
)
from codra_dsl.generation.emit.literals import literal

_CALLABLE_NAMES = CONDITION_WORDS | POSE_FUNCTIONS | {"abs"}
_SINGLETON_SETS = {word: frozenset({word}) for word in CONDITION_WORDS}
_METHODS = frozenset({"is_in"})
# Most conditions have this form. Python's parser reads the others; it would give the same result for all.
_SIMPLE_CONDITION = re.compile(
    r"""(value|known)\((["'])([A-Za-z][A-Za-z0-9_]*)\2\)"""
    r"""( (?:[<>]=?|[=!]=) (?:0|[1-9][0-9]{0,8})(?:\.(?:0|[0-9]{0,3}[1-9]))?)?"""
)

_COMPARISONS: Mapping[type[ast.cmpop], str] = {
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}
# Operators with their precedence.
_OPERATORS: Mapping[type[ast.operator], tuple[str, int]] = {
    ast.BitOr: ("|", 1),
    ast.BitAnd: ("&", 1),
    ast.Add: ("+", 2),
    ast.Sub: ("-", 2),
    ast.Mult: ("*", 3),
    ast.Div: ("/", 3),
}
_LOGICAL_PRECEDENCE = 1


class ConditionError(Exception):
    """A condition in Python uses something other than the words of the runtime: a bug in the code that wrote it."""


def condition_with_words(python: str) -> tuple[Expression, frozenset[str]]:
    """Return a condition in Python as an expression, and the words that the condition uses.

    Raises:
        ConditionError: if the condition contains anything except words of conditions, operators and literals.
    """
    simple_match = _SIMPLE_CONDITION.fullmatch(python)
    if simple_match is not None:
        word, _, name, comparison = simple_match.groups()
        return f'{word}("{name}"){comparison or ""}', _SINGLETON_SETS[word]
    try:
        tree = ast.parse(python, mode="eval").body
    except SyntaxError as error:
        raise ConditionError(f"{python!r}: {error.msg}") from error
    names = {node.id for node in ast.walk(tree) if isinstance(node, ast.Name)}
    return _expression(tree), frozenset(names & (CONDITION_WORDS | POSE_FUNCTIONS))


def _expression(node: ast.expr) -> Expression:
    match node:
        case ast.Constant(value=bool() | int() | float() | str() as value):
            return literal(value)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]) if name in _CALLABLE_NAMES:
            return _call(name, arguments)
        case ast.Call(func=ast.Attribute(value=item, attr=name), args=options, keywords=[]) if name in _METHODS:
            return _call(f"{_text_on_one_line(_operand(item))}.{name}", options)
        case ast.Tuple(elts=elements):
            return make_brackets("(", tuple(map(_expression, elements)), ",)" if len(elements) == 1 else ")")
        case ast.UnaryOp(op=ast.Invert(), operand=operand):
            return _add_prefix("~", _operand(operand))
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return _add_prefix("-", _operand(operand))
        case ast.Compare(left=left, ops=[operator], comparators=[right]) if type(operator) in _COMPARISONS:
            return Chain(_comparison_side(left), ((_COMPARISONS[type(operator)], _comparison_side(right)),))
        case ast.BinOp(op=operator) if type(operator) in _OPERATORS:
            return _chain(node)
    raise ConditionError(f"{ast.unparse(node)!r} is not in the words of conditions")


def _call(function: str, arguments: list[ast.expr]) -> Brackets:
    return make_brackets(f"{function}(", tuple(map(_expression, arguments)), ")")


def _operand(node: ast.expr) -> Expression:
    """Return an operand, in parentheses unless it is a call, a constant or a tuple."""
    expression = _expression(node)
    is_atomic = isinstance(node, (ast.Call, ast.Constant, ast.Tuple))
    return expression if is_atomic else Grouped("", expression)


def _comparison_side(node: ast.expr) -> Expression:
    """Return one side of a comparison.

    Arithmetic and unary operations are written without parentheses. Other operations have parentheses, because they are
    then easier to read.
    """
    is_bare = isinstance(node, ast.UnaryOp) or (isinstance(node, ast.BinOp) and _precedence(node) > _LOGICAL_PRECEDENCE)
    return _expression(node) if is_bare else _operand(node)


def _add_prefix(sign: str, operand: Expression) -> Expression:
    if isinstance(operand, Brackets):
        return make_brackets(sign + operand.opening, operand.items, operand.closing)
    if isinstance(operand, Grouped):
        return replace(operand, prefix=sign + operand.prefix)
    return sign + _text_on_one_line(operand)


def _chain(node: ast.BinOp) -> Chain:
    """Return operators of equal precedence as one chain. Python nests the left operands, so a loop collects them."""
    operator, precedence = _OPERATORS[type(node.op)]
    rest = [(operator, _right_operand(node))]
    first = node.left
    while isinstance(first, ast.BinOp) and _continues(first, operator, precedence):
        rest.append((_OPERATORS[type(first.op)][0], _right_operand(first)))
        first = first.left
    return Chain(_chain_operand(first, precedence), tuple(reversed(rest)))


def _continues(node: ast.BinOp, operator: str, precedence: int) -> bool:
    """Return whether a left operand belongs to the chain; `&` and `|` are never mixed without parentheses."""
    symbol, node_precedence = _OPERATORS.get(type(node.op), ("", 0))
    return node_precedence == precedence and (precedence > _LOGICAL_PRECEDENCE or symbol == operator)


def _right_operand(node: ast.BinOp) -> Expression:
    """Return a right operand. An operation of equal precedence keeps its parentheses, because it is evaluated first."""
    return _chain_operand(node.right, _precedence(node))


def _chain_operand(node: ast.expr, precedence: int) -> Expression:
    binds_tighter = isinstance(node, ast.BinOp) and _precedence(node) > precedence > _LOGICAL_PRECEDENCE
    return _expression(node) if binds_tighter or isinstance(node, ast.UnaryOp) else _operand(node)


def _precedence(node: ast.BinOp) -> int:
    return _OPERATORS.get(type(node.op), ("", 0))[1]


def _text_on_one_line(expression: Expression) -> str:
    return lay_out(expression, before=-UNLIMITED_WIDTH)
