"""Typed conditions -> Python text that uses `codra_dsl.runtime.values.conditions`.

Both sides of a comparison are written in the same unit: the unit of a variable if one is involved. Literals are
converted to this unit here, and not at run time. In Python, `&` and `|` bind more tightly than comparisons. Parentheses
are added where Python or a reader needs them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise

from codra_dsl.language.check.conditions.types import Typed, is_age
from codra_dsl.language.expression import (
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
from codra_dsl.language.units import ONE, UNITS, Unit, convert, ratio


class Power(IntEnum):
    """The precedence of an expression in Python."""

    COMPARE = 1
    OR = 2
    AND = 3
    SUM = 4
    PRODUCT = 5
    UNARY = 6
    ATOM = 7


@dataclass(frozen=True, slots=True)
class Lowered:
    """The Python text of an expression.

    Attributes:
        constant: whether the text is a plain Python literal. In an operation on two literals, one of them must become a
            term.
    """

    text: str
    power: Power = Power.ATOM
    constant: bool = False

    def at(self, power: Power) -> str:
        """Return the text as an operand with at least this precedence, in parentheses if needed."""
        return self.text if self.power >= power else f"({self.text})"

    def term(self) -> Lowered:
        """Return the expression as a term, so that Python's operators build further terms from it."""
        return Lowered(f"literal({self.text})") if self.constant else self


def lower(typed: Typed, unit: Unit = ONE) -> str:
    """Return the Python text of a typed condition or value; numbers are in the given unit."""
    if type(typed.node) is Name and _unit(typed) is unit:  # as most preconditions are
        return f'value("{typed.node.name}")'
    return _lower(typed, unit).term().text


def python_text(value: str) -> str:
    """Return a Python literal of a text, in double quotes unless these would need escapes."""
    plain = repr(value)
    return f'"{plain[1:-1]}"' if plain[0] == "'" and '"' not in plain and "\\'" not in plain else plain


def _lower(typed: Typed, unit: Unit) -> Lowered:
    return _WRITERS[type(typed.node)](typed, unit)


def _unit(typed: Typed) -> Unit:
    return ONE if typed.type is None else typed.type.unit


def _name(typed: Typed, unit: Unit) -> Lowered:
    assert isinstance(typed.node, Name)
    return _scaled(Lowered(f'value("{typed.node.name}")'), _unit(typed), unit)


def _number(typed: Typed, unit: Unit) -> Lowered:
    assert isinstance(typed.node, Number)
    value, own = typed.node.value, _unit(typed)
    zero = typed.type is not None and typed.type.zero
    return Lowered(repr(value if zero or own is unit or own == unit else convert(value, own, unit)), constant=True)


def _text(typed: Typed, _: Unit) -> Lowered:
    assert isinstance(typed.node, Text)
    return Lowered(python_text(typed.node.value), constant=True)


def _truth(typed: Typed, _: Unit) -> Lowered:
    assert isinstance(typed.node, Truth)
    return Lowered(repr(typed.node.value), constant=True)


def _not(typed: Typed, _: Unit) -> Lowered:
    return Lowered(f"~{_lower(typed.parts[0], ONE).term().at(Power.ATOM)}", Power.UNARY)


def _and(typed: Typed, _: Unit) -> Lowered:
    return Lowered(" & ".join(_lower(part, ONE).term().at(Power.SUM) for part in typed.parts), Power.AND)


def _or(typed: Typed, _: Unit) -> Lowered:
    return Lowered(" | ".join(_lower(part, ONE).term().at(Power.SUM) for part in typed.parts), Power.OR)


def _compare(typed: Typed, _: Unit) -> Lowered:
    assert isinstance(typed.node, Compare)
    operators = [operator for operator, _ in typed.node.rest]
    links = [_link(operator, *sides) for operator, sides in zip(operators, pairwise(typed.parts), strict=True)]
    if len(links) == 1:
        return links[0]
    return Lowered(" & ".join(link.at(Power.SUM) for link in links), Power.AND)


def _link(operator: str, left: Typed, right: Typed) -> Lowered:
    if isinstance(right.node, Truth) and not isinstance(left.node, Truth) and operator in ("==", "!="):
        lowered = _lower(left, ONE)  # `x == true` equals `x`, known or not, and linters prefer `x`
        is_plain = right.node.value == (operator == "==")
        return lowered if is_plain else Lowered(f"~{lowered.term().at(Power.ATOM)}", Power.UNARY)
    return _binary(operator, left, right, _common_unit(left, right), (Power.SUM, Power.SUM, Power.COMPARE))


def _common_unit(left: Typed, right: Typed) -> Unit:
    """Return the unit of a comparison.

    This is seconds for an age; else the unit of the first side that is not a literal, or of the first literal if both
    sides are literals.
    """
    if is_age(left.node) or is_age(right.node):
        return UNITS["s"]
    types = [type_ for type_ in (left.type, right.type) if type_ is not None and type_.numeric and not type_.zero]
    return next((type_.unit for type_ in types if not type_.fixed), types[0].unit if types else ONE)


def _binary(
    operator: str, left: Typed, right: Typed, units: Unit | tuple[Unit, Unit], powers: tuple[Power, Power, Power]
) -> Lowered:
    """Return an operation. `powers` are the precedence needed on its left side, that on its right side, and its own."""
    left_unit, right_unit = units if isinstance(units, tuple) else (units, units)
    first, second = _lower(left, left_unit), _lower(right, right_unit)
    first = first.term() if second.constant else first
    return Lowered(f"{first.at(powers[0])} {operator} {second.at(powers[1])}", powers[2])


def _in(typed: Typed, _: Unit) -> Lowered:
    assert isinstance(typed.node, In)
    left, *options = typed.parts
    unit = next((_common_unit(left, option) for option in options if _common_unit(left, option) != ONE), ONE)
    lowered = [_lower(option, unit) for option in options]
    if all(option.constant for option in lowered):
        option_texts = ", ".join(option.text for option in lowered)
        membership = Lowered(f"{_lower(left, unit).term().at(Power.ATOM)}.is_in({option_texts})")
    else:
        membership = Lowered(" | ".join(_link("==", left, option).at(Power.SUM) for option in options), Power.OR)
    return Lowered(f"~{membership.at(Power.ATOM)}", Power.UNARY) if typed.node.negated else membership


def _negative(typed: Typed, unit: Unit) -> Lowered:
    operand = _lower(typed.parts[0], unit)
    if operand.constant:
        text = operand.text.removeprefix("-") if operand.text.startswith("-") else f"-{operand.text}"
        return Lowered(text, Power.UNARY if text.startswith("-") else Power.ATOM, constant=True)
    return Lowered(f"-{operand.at(Power.ATOM)}", Power.UNARY)


def _arithmetic(typed: Typed, unit: Unit) -> Lowered:
    assert isinstance(typed.node, Arithmetic)
    operator, (left, right) = typed.node.operator, typed.parts
    if operator in "+-":
        return _binary(operator, left, right, unit, (Power.SUM, Power.PRODUCT, Power.SUM))
    powers = (Power.PRODUCT, Power.UNARY, Power.PRODUCT)
    product = _binary(operator, left, right, (_unit(left), _unit(right)), powers)
    return _scaled(product, _unit(typed), unit)


def _scaled(lowered: Lowered, own: Unit, wanted: Unit) -> Lowered:
    if own is wanted or own == wanted:
        return lowered
    return Lowered(f"{lowered.at(Power.PRODUCT)} * {ratio(own, wanted)!r}", Power.PRODUCT)


def _choice(typed: Typed, unit: Unit) -> Lowered:
    then, condition, otherwise = typed.parts
    texts = _lower(then, unit).text, _lower(condition, ONE).text, _lower(otherwise, unit).text
    return Lowered(f"choose({', '.join(texts)})")


def _call(typed: Typed, unit: Unit) -> Lowered:
    assert isinstance(typed.node, Call)
    function, arguments = typed.node.function, typed.node.arguments
    if isinstance(arguments[0], Name) and function in ("known", "age"):
        return Lowered(f'{function}("{arguments[0].name}")')
    lowered = [_lower(part, unit) for part in typed.parts]
    if function == "abs":
        return Lowered(f"abs({lowered[0].term().text})")
    name = "minimum" if function == "min" else "maximum"
    return Lowered(f"{name}({', '.join(argument.text for argument in lowered)})")


_WRITERS: Mapping[type[Node], Callable[[Typed, Unit], Lowered]] = {
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
    Call: _call,
}
