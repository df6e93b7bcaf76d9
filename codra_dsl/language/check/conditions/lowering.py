"""Typed conditions -> Python text that uses `codra_dsl.runtime.values.conditions`.

Both sides of a comparison are written in the same unit: the unit of a side that is not a literal, unless both sides are
literals. Literals are converted to this unit here, and not at run time. In Python, `&` and `|` bind more tightly than
comparisons. Parentheses are added where Python or a reader needs them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import IntEnum
from itertools import pairwise

from codra_dsl.language.check.conditions.types import Typed, is_age
from codra_dsl.language.expression import (
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
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.units import ONE, UNITS, Unit, convert, ratio


class Precedence(IntEnum):
    """The precedence of an expression in Python."""

    COMPARE = 1
    OR = 2
    AND = 3
    SUM = 4
    PRODUCT = 5
    UNARY = 6
    ATOM = 7


@dataclass(frozen=True, slots=True)
class PythonExpression:
    """The Python text of an expression.

    Attributes:
        constant: whether the text is a plain Python literal. In an operation on two literals, one of them must become a
            term.
    """

    text: str
    precedence: Precedence = Precedence.ATOM
    constant: bool = False

    def at(self, precedence: Precedence) -> str:
        """Return the text as an operand with at least this precedence, in parentheses if needed."""
        return self.text if self.precedence >= precedence else f"({self.text})"

    def term(self) -> PythonExpression:
        """Return the expression as a term, so that Python's operators build further terms from it."""
        return PythonExpression(f"literal({self.text})") if self.constant else self


def to_python(typed: Typed, unit: Unit = ONE) -> str:
    """Return the Python text of a typed condition or value; numbers are in the given unit."""
    if type(typed.node) is Name and _unit(typed) is unit:  # most preconditions are a single name
        return f'value("{typed.node.name}")'
    return _to_python(typed, unit).term().text


def python_text(value: str) -> str:
    """Return a Python literal of a text, in double quotes unless double quotes would need escapes."""
    plain = repr(value)
    return f'"{plain[1:-1]}"' if plain[0] == "'" and '"' not in plain and "\\'" not in plain else plain


def _to_python(typed: Typed, unit: Unit) -> PythonExpression:
    return _WRITERS[type(typed.node)](typed, unit)


def _unit(typed: Typed) -> Unit:
    return ONE if typed.type is None else typed.type.unit


def _name(typed: Typed, unit: Unit) -> PythonExpression:
    assert isinstance(typed.node, Name)
    return _scaled(PythonExpression(f'value("{typed.node.name}")'), _unit(typed), unit)


def _number(typed: Typed, unit: Unit) -> PythonExpression:
    assert isinstance(typed.node, Number)
    value, own_unit = typed.node.value, _unit(typed)
    is_zero = typed.type is not None and typed.type.is_zero
    return PythonExpression(
        repr(value if is_zero or own_unit is unit or own_unit == unit else convert(value, own_unit, unit)),
        constant=True,
    )


def _text(typed: Typed, _: Unit) -> PythonExpression:
    assert isinstance(typed.node, Text)
    return PythonExpression(python_text(typed.node.value), constant=True)


def _truth(typed: Typed, _: Unit) -> PythonExpression:
    assert isinstance(typed.node, Truth)
    return PythonExpression(repr(typed.node.value), constant=True)


def _not(typed: Typed, _: Unit) -> PythonExpression:
    return PythonExpression(f"~{_to_python(typed.parts[0], ONE).term().at(Precedence.ATOM)}", Precedence.UNARY)


def _and(typed: Typed, _: Unit) -> PythonExpression:
    return PythonExpression(
        " & ".join(_to_python(part, ONE).term().at(Precedence.SUM) for part in typed.parts), Precedence.AND
    )


def _or(typed: Typed, _: Unit) -> PythonExpression:
    return PythonExpression(
        " | ".join(_to_python(part, ONE).term().at(Precedence.SUM) for part in typed.parts), Precedence.OR
    )


def _compare(typed: Typed, _: Unit) -> PythonExpression:
    assert isinstance(typed.node, Compare)
    operators = [operator for operator, _ in typed.node.rest]
    links = [_link(operator, *sides) for operator, sides in zip(operators, pairwise(typed.parts), strict=True)]
    if len(links) == 1:
        return links[0]
    return PythonExpression(" & ".join(link.at(Precedence.SUM) for link in links), Precedence.AND)


def _link(operator: str, left: Typed, right: Typed) -> PythonExpression:
    if isinstance(right.node, Truth) and not isinstance(left.node, Truth) and operator in ("==", "!="):
        expression = _to_python(left, ONE)  # `x == true` equals `x`, also while x is unknown, and linters prefer `x`
        is_plain = right.node.value == (operator == "==")
        return (
            expression if is_plain else PythonExpression(f"~{expression.term().at(Precedence.ATOM)}", Precedence.UNARY)
        )
    return _binary(
        operator, left, right, _common_unit(left, right), (Precedence.SUM, Precedence.SUM, Precedence.COMPARE)
    )


def _common_unit(left: Typed, right: Typed) -> Unit:
    """Return the unit of a comparison.

    The unit is seconds if one side is an age. Otherwise it is the unit of the first side that is not a literal, or of
    the first literal if both sides are literals.
    """
    if is_age(left.node) or is_age(right.node):
        return UNITS["s"]
    types = [type_ for type_ in (left.type, right.type) if type_ is not None and type_.is_number and not type_.is_zero]
    return next((type_.unit for type_ in types if not type_.is_literal), types[0].unit if types else ONE)


def _binary(
    operator: str,
    left: Typed,
    right: Typed,
    units: Unit | tuple[Unit, Unit],
    precedences: tuple[Precedence, Precedence, Precedence],
) -> PythonExpression:
    """Return an operation.

    `precedences` contains the precedence that the left side needs, the precedence that the right side needs, and the
    precedence of the operation.
    """
    left_unit, right_unit = units if isinstance(units, tuple) else (units, units)
    first, second = _to_python(left, left_unit), _to_python(right, right_unit)
    first = first.term() if second.constant else first
    return PythonExpression(f"{first.at(precedences[0])} {operator} {second.at(precedences[1])}", precedences[2])


def _in(typed: Typed, _: Unit) -> PythonExpression:
    assert isinstance(typed.node, In)
    left, *options = typed.parts
    unit = next((_common_unit(left, option) for option in options if _common_unit(left, option) != ONE), ONE)
    expressions = [_to_python(option, unit) for option in options]
    if all(option.constant for option in expressions):
        option_texts = ", ".join(option.text for option in expressions)
        membership = PythonExpression(f"{_to_python(left, unit).term().at(Precedence.ATOM)}.is_in({option_texts})")
    else:
        membership = PythonExpression(
            " | ".join(_link("==", left, option).at(Precedence.SUM) for option in options), Precedence.OR
        )
    return (
        PythonExpression(f"~{membership.at(Precedence.ATOM)}", Precedence.UNARY) if typed.node.negated else membership
    )


def _negative(typed: Typed, unit: Unit) -> PythonExpression:
    operand = _to_python(typed.parts[0], unit)
    if operand.constant:
        text = operand.text.removeprefix("-") if operand.text.startswith("-") else f"-{operand.text}"
        return PythonExpression(text, Precedence.UNARY if text.startswith("-") else Precedence.ATOM, constant=True)
    return PythonExpression(f"-{operand.at(Precedence.ATOM)}", Precedence.UNARY)


def _arithmetic(typed: Typed, unit: Unit) -> PythonExpression:
    assert isinstance(typed.node, Arithmetic)
    operator, (left, right) = typed.node.operator, typed.parts
    if operator in "+-":
        return _binary(operator, left, right, unit, (Precedence.SUM, Precedence.PRODUCT, Precedence.SUM))
    precedences = (Precedence.PRODUCT, Precedence.UNARY, Precedence.PRODUCT)
    product = _binary(operator, left, right, (_unit(left), _unit(right)), precedences)
    return _scaled(product, _unit(typed), unit)


def _scaled(expression: PythonExpression, own_unit: Unit, wanted_unit: Unit) -> PythonExpression:
    if own_unit is wanted_unit or own_unit == wanted_unit:
        return expression
    return PythonExpression(
        f"{expression.at(Precedence.PRODUCT)} * {ratio(own_unit, wanted_unit)!r}", Precedence.PRODUCT
    )


def _choice(typed: Typed, unit: Unit) -> PythonExpression:
    then, condition, otherwise = typed.parts
    texts = _to_python(then, unit).text, _to_python(condition, ONE).text, _to_python(otherwise, unit).text
    return PythonExpression(f"choose({', '.join(texts)})")


def _fallback(typed: Typed, unit: Unit) -> PythonExpression:
    value, otherwise = typed.parts
    return PythonExpression(f"first_known({_to_python(value, unit).text}, {_to_python(otherwise, unit).text})")


def _call(typed: Typed, unit: Unit) -> PythonExpression:
    assert isinstance(typed.node, Call)
    function, arguments = typed.node.function, typed.node.arguments
    if isinstance(arguments[0], Name) and function in ("known", "age"):
        return PythonExpression(f'{function}("{arguments[0].name}")')
    expressions = [_to_python(part, unit) for part in typed.parts]
    if function == "abs":
        return PythonExpression(f"abs({expressions[0].term().text})")
    name = "minimum" if function == "min" else "maximum"
    return PythonExpression(f"{name}({', '.join(argument.text for argument in expressions)})")


_WRITERS: Mapping[type[Node], Callable[[Typed, Unit], PythonExpression]] = {
    Name: _name,
    Number: _number,
    Text: _text,
    Truth: _truth,
    Not: _not,
    And: _and,
    Or: _or,
    Compare: _compare,
    In: _in,
    Arithmetic: _arithmetic,
    Negative: _negative,
    Choice: _choice,
    Fallback: _fallback,
    Call: _call,
}
