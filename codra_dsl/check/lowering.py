"""Typed conditions -> Python text over `codra_dsl.runtime.conditions`.

Numbers stand in one unit on both sides of an operator: that of a variable where one is involved, so that literals are
converted here and nothing is at run time. Python binds `&` and `|` tighter than comparisons; parentheses are put where
Python needs them and where a reader does.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from enum import IntEnum
from itertools import pairwise

from codra_dsl.check.types import Typed, is_age
from codra_dsl.expression import (
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
from codra_dsl.units import ONE, UNITS, Unit, convert, ratio


class Power(IntEnum):
    """How tightly Python holds an expression together."""

    COMPARE = 1
    OR = 2
    AND = 3
    SUM = 4
    PRODUCT = 5
    UNARY = 6
    ATOM = 7


@dataclass(frozen=True, slots=True)
class Lowered:
    """Python text.

    Attributes:
        constant: whether it is a plain Python literal: two of them need a term between them.
    """

    text: str
    power: Power = Power.ATOM
    constant: bool = False

    def at(self, power: Power) -> str:
        """Return the text as an operand that must hold together at least so tightly."""
        return self.text if self.power >= power else f"({self.text})"

    def term(self) -> Lowered:
        """Return the same as a term on which Python's operators build terms."""
        return Lowered(f"literal({self.text})") if self.constant else self


def lower(typed: Typed, unit: Unit = ONE) -> str:
    """Return the Python text of a condition or value that has a type; numbers come in the given unit."""
    if type(typed.node) is Name and _unit(typed) is unit:  # as most preconditions are
        return f'value("{typed.node.name}")'
    return _lower(typed, unit).term().text


def python_text(value: str) -> str:
    """Return a Python literal of a text, in double quotes unless they would need escapes."""
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
        said = _lower(left, ONE)  # `x == true` says what `x` says, known or not, and Python's linters want it so
        is_plain = right.node.value == (operator == "==")
        return said if is_plain else Lowered(f"~{said.term().at(Power.ATOM)}", Power.UNARY)
    return _binary(operator, left, right, _common_unit(left, right), (Power.SUM, Power.SUM, Power.COMPARE))


def _common_unit(left: Typed, right: Typed) -> Unit:
    """Return the unit to compare in: seconds for an age, else that of the first side that is no literal."""
    if is_age(left.node) or is_age(right.node):
        return UNITS["s"]
    types = [each for each in (left.type, right.type) if each is not None and each.numeric and not each.zero]
    return next((each.unit for each in types if not each.fixed), types[0].unit if types else ONE)


def _binary(
    operator: str, left: Typed, right: Typed, units: Unit | tuple[Unit, Unit], powers: tuple[Power, Power, Power]
) -> Lowered:
    """Return an operation; `powers` are those that its left and right side need, and its own."""
    left_unit, right_unit = units if isinstance(units, tuple) else (units, units)
    first, second = _lower(left, left_unit), _lower(right, right_unit)
    first = first.term() if second.constant else first
    return Lowered(f"{first.at(powers[0])} {operator} {second.at(powers[1])}", powers[2])


def _in(typed: Typed, _: Unit) -> Lowered:
    assert isinstance(typed.node, In)
    item, *options = typed.parts
    unit = next((_common_unit(item, option) for option in options if _common_unit(item, option) != ONE), ONE)
    lowered = [_lower(option, unit) for option in options]
    if all(option.constant for option in lowered):
        listed = ", ".join(option.text for option in lowered)
        found = Lowered(f"{_lower(item, unit).term().at(Power.ATOM)}.is_in({listed})")
    else:
        found = Lowered(" | ".join(_link("==", item, option).at(Power.SUM) for option in options), Power.OR)
    return Lowered(f"~{found.at(Power.ATOM)}", Power.UNARY) if typed.node.negated else found


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
    return Lowered(f"{name}({', '.join(each.text for each in lowered)})")


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
