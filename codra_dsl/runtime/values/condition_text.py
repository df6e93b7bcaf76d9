"""Conditions as text: parse the Python text that builds a condition, and format a condition as in a spec."""

from __future__ import annotations

import ast
import operator
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from typing import Any

from codra_dsl.logic import Term, Value, age, choose, first_of, known, literal, maximum, minimum, value
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.values.derived import first_known
from codra_dsl.runtime.values.hysteresis import between, confirmed

_FUNCTIONS: Mapping[str, Callable[..., Term]] = {
    "age": age,
    "between": between,
    "choose": choose,
    "confirmed": confirmed,
    "first_known": first_known,
    "first_of": first_of,
    "known": known,
    "literal": literal,
    "maximum": maximum,
    "minimum": minimum,
    "value": value,
}
_OPERATORS: Mapping[type[ast.AST], Callable[[Any, Any], Any]] = {
    ast.Add: operator.add,
    ast.BitAnd: operator.and_,
    ast.BitOr: operator.or_,
    ast.Div: operator.truediv,
    ast.Eq: operator.eq,
    ast.Gt: operator.gt,
    ast.GtE: operator.ge,
    ast.Lt: operator.lt,
    ast.LtE: operator.le,
    ast.Mult: operator.mul,
    ast.NotEq: operator.ne,
    ast.Sub: operator.sub,
}


_PARSE_LOCK = new_lock()


class ConditionTextError(ValueError):
    """A text is not the Python text of a condition."""


@lru_cache(maxsize=4096)
def _parse(text: str) -> ast.expr:
    # before Python 3.11.8 and 3.12.2, all threads that parse share one counter for the depth of their syntax trees
    with _PARSE_LOCK:
        return ast.parse(text, mode="eval").body


@lru_cache(maxsize=4096)
def parse_condition(text: str) -> Term:
    """Return the condition that a text builds. The text is the `repr` of a condition. No code in the text is run.

    Raises:
        ConditionTextError: if the text does not build a condition.
    """
    try:
        term = _build_node(_parse(text))
    except ConditionTextError:
        raise
    except Exception as error:
        raise ConditionTextError(f"{text[:60]!r} is not a condition: {type(error).__name__}") from error
    if not isinstance(term, Term):
        raise ConditionTextError(f"{text[:60]!r} is not a condition")
    return term


def _build_node(node: ast.expr) -> Any:
    match node:
        case ast.Constant(value=bool() | int() | float() | str() as constant):
            return constant
        case ast.Tuple(elts=elements):
            return tuple(_build_node(element) for element in elements)
        case ast.UnaryOp(op=ast.Invert(), operand=operand):
            return ~_build_term(operand)
        case ast.UnaryOp(op=ast.USub(), operand=operand):
            return -_build_node(operand)
        case ast.BinOp(left=left, op=symbol, right=right) if type(symbol) in _OPERATORS:
            return _apply_operator(symbol, left, right)
        case ast.Compare(left=left, ops=[symbol], comparators=[right]) if type(symbol) in _OPERATORS:
            return _apply_operator(symbol, left, right)
        case ast.Call(func=ast.Name(id=name), args=arguments, keywords=[]):
            return _call_function(name, [_build_node(argument) for argument in arguments])
        case ast.Call(func=ast.Attribute(value=term, attr="is_in"), args=options, keywords=[]):
            return _build_term(term).is_in(*(_build_node(option) for option in options))
        case _:
            raise ConditionTextError(f"{ast.unparse(node)[:60]!r} cannot be part of a condition")


def _apply_operator(symbol: ast.AST, left: ast.expr, right: ast.expr) -> Any:
    """Return the term of two operands.

    One of them must be a term: an operator with two constants would be computed at once, and `"a" * 3000000000` would
    need 3 GB. The `repr` of a condition contains no such operator.
    """
    operands = (_build_node(left), _build_node(right))
    if not any(isinstance(operand, Term) for operand in operands):
        raise ConditionTextError(f"the operands in {ast.unparse(left)[:60]!r} are not conditions")
    return _OPERATORS[type(symbol)](*operands)


def _build_term(node: ast.expr) -> Term:
    term = _build_node(node)
    if not isinstance(term, Term):
        raise ConditionTextError(f"{ast.unparse(node)[:60]!r} is not a condition")
    return term


def _call_function(name: str, arguments: Sequence[Any]) -> Any:
    if name == "abs":
        return abs(arguments[0])
    if name == "float":
        return float(arguments[0])
    if name not in _FUNCTIONS:
        raise ConditionTextError(f"{name[:60]!r} is not a function of conditions")
    return _FUNCTIONS[name](*arguments)


def format_condition(text: str) -> str:
    """Return a condition as a spec would write it, in SI units: `lid_angle > 0.6`.

    Args:
        text: the text that builds the condition.

    Raises:
        ConditionTextError: if the text does not build a condition.
    """
    parse_condition(text)
    return _format_node(_parse(text))


def literals_of(text: str) -> tuple[Value, ...]:
    """Return the constants in the text of a condition; the names of variables are constants too."""
    constants = (node.value for node in ast.walk(_parse(text)) if isinstance(node, ast.Constant))
    return tuple(constant for constant in constants if isinstance(constant, (bool, int, float, str)))


_SYMBOLS: Mapping[type[ast.AST], str] = {
    ast.Add: "+",
    ast.BitAnd: "and",
    ast.BitOr: "or",
    ast.Div: "/",
    ast.Eq: "==",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Mult: "*",
    ast.NotEq: "!=",
    ast.Sub: "-",
}


def _format_node(node: ast.expr) -> str:
    match node:
        case ast.Call(func=ast.Name(id="value"), args=[ast.Constant(value=str() as name)]):
            return name
        case ast.Call(func=ast.Name(id="literal"), args=[constant]):
            return _format_node(constant)
        case ast.Call(func=ast.Name(id="known" | "age" as function), args=[ast.Constant(value=str() as name)]):
            return f"{function}({name})"
        case ast.Call(func=ast.Name(id="choose"), args=[then, condition, otherwise]):
            return f"{_format_operand(then)} if {_format_operand(condition)} else {_format_operand(otherwise)}"
        case ast.Call(func=ast.Name(id="first_known"), args=[term, otherwise]):
            return f"{_format_operand(term)} else {_format_operand(otherwise)}"
        case ast.Call(func=ast.Name(id="first_of"), args=arguments):
            cases = [case.elts for case in arguments if isinstance(case, ast.Tuple)]
            return ", ".join(f"{_format_node(case[0])}: {_format_node(case[1])}" for case in cases)
        case ast.Call(func=ast.Name(id="between"), args=[enter, leave]):
            return f"enter: {_format_node(enter)}, leave: {_format_node(leave)}"
        case ast.Call(func=ast.Name(id="confirmed"), args=[term, needed, among]):
            return f"{_format_node(term)}, confirm: {_format_node(needed)} of {_format_node(among)}"
        case ast.Call(func=ast.Name(id=function), args=arguments):
            name = {"minimum": "min", "maximum": "max"}.get(function, function)
            return f"{name}({', '.join(map(_format_node, arguments))})"
        case ast.Call(func=ast.Attribute(value=term), args=options):
            return f"{_format_operand(term)} in ({', '.join(map(_format_node, options))})"
        case ast.UnaryOp(op=ast.Invert(), operand=operand):
            return f"not {_format_operand(operand)}"
        case ast.UnaryOp(operand=operand):
            return f"-{_format_operand(operand)}"
        case ast.BinOp(left=left, op=ast.BitAnd() | ast.BitOr() as symbol, right=right):
            return f" {_SYMBOLS[type(symbol)]} ".join(
                _format_logical_operand(side, type(symbol)) for side in (left, right)
            )
        case ast.BinOp(left=left, op=symbol, right=right):
            return f"{_format_operand(left)} {_SYMBOLS[type(symbol)]} {_format_operand(right)}"
        case ast.Compare(left=left, ops=[symbol], comparators=[right]):
            return f"{_format_operand(left)} {_SYMBOLS[type(symbol)]} {_format_operand(right)}"
        case ast.Constant(value=bool() as truth):
            return str(truth).lower()
        case _:
            return ast.unparse(node)


def _format_logical_operand(node: ast.expr, symbol: type[ast.operator]) -> str:
    needs_brackets = isinstance(node, ast.BinOp) and type(node.op) in {ast.BitAnd, ast.BitOr} - {symbol}
    return f"({_format_node(node)})" if needs_brackets else _format_node(node)


def _format_operand(node: ast.expr) -> str:
    is_compound = isinstance(node, (ast.BinOp, ast.Compare)) or (
        isinstance(node, ast.Call)
        and isinstance(node.func, ast.Name)
        and node.func.id in ("choose", "between", "first_known")
    )
    return f"({_format_node(node)})" if is_compound else _format_node(node)
