"""Random well-typed conditions, values of their names, and their meaning, computed independently.

The meaning is computed on the syntax tree with exact fractions in base units, without lowering and terms.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from fractions import Fraction
from itertools import pairwise

from hypothesis import strategies as st

from codra_dsl.language.check.conditions.types import Type
from codra_dsl.language.expression import (
    And,
    Arithmetic,
    Call,
    Choice,
    Compare,
    Comparison,
    In,
    Name,
    Negative,
    Node,
    Not,
    Number,
    Or,
    Text,
    Truth,
    parts,
)
from codra_dsl.language.model import Kind
from codra_dsl.language.units import ONE, UNITS, Unit, parse_unit

Trees = st.SearchStrategy[Node]

AT = {"start": 0, "end": 0}
DOOR, SIDE = ("open", "closed", "ajar"), ("open", "shut")
TYPES: Mapping[str, Type] = {
    "b1": Type(Kind.BOOL),
    "b2": Type(Kind.BOOL),
    "n": Type(Kind.INT),
    "r": Type(Kind.FLOAT),
    "x": Type(Kind.FLOAT, UNITS["m"]),
    "y": Type(Kind.INT, UNITS["mm"]),
    "d": Type(Kind.FLOAT, UNITS["deg"]),
    "a": Type(Kind.FLOAT, UNITS["rad"]),
    "t": Type(Kind.FLOAT, UNITS["min"]),
    "door": Type(Kind.ENUM, values=DOOR),
    "side": Type(Kind.ENUM, values=SIDE),
    "label": Type(Kind.STR),
}
MEASURED = {
    "length": (("x", "y"), ("m", "cm", "mm", "km")),
    "angle": (("d", "a"), ("deg", "rad")),
    "time": (("t",), ("s", "ms", "min")),
}


def name(text: str) -> Node:
    return Name(name=text, **AT)


def number(value: float, unit: str | None = None) -> Node:
    return Number(value=value, unit=unit, **AT)


def call(function: str, *arguments: Node) -> Node:
    return Call(function=function, arguments=arguments, **AT)


def compare(first: Node, *rest: tuple[Comparison, Node]) -> Node:
    return Compare(first=first, rest=rest, **AT)


LITERALS = st.one_of(st.integers(0, 12), st.sampled_from([0.5, 0.25, 1.5, 0.1, 3.7]))


def _bare_leaves() -> Trees:
    return st.one_of(st.sampled_from([name("n"), name("r")]), st.builds(number, LITERALS))


def _measured_leaves(kind: str) -> Trees:
    names, units = MEASURED[kind]
    return st.one_of(
        st.sampled_from([name(variable) for variable in names]),
        st.builds(number, LITERALS, st.sampled_from(units)),
    )


def _or_zero(values: Trees) -> Trees:
    """Return values and the literal 0, which needs no unit."""
    return st.one_of(values, st.just(number(0)))


def _quotients(values: Trees, divisors: Trees) -> Trees:
    """Return quotients whose divisor is not the literal 0, which is an error."""
    other_divisors = divisors.filter(lambda divisor: not (isinstance(divisor, Number) and divisor.value == 0))
    return st.builds(lambda a, b: Arithmetic(operator="/", left=a, right=b, **AT), values, other_divisors)


def _same_dimension_expressions(values: Trees, bare: Trees, truths: Trees) -> Trees:
    """Return expressions over quantities of one dimension that keep the dimension."""
    seconds = _or_zero(values)
    return st.one_of(
        st.builds(
            lambda op, a, b: Arithmetic(operator=op, left=a, right=b, **AT), st.sampled_from("+-"), values, seconds
        ),
        st.builds(lambda a, b: Arithmetic(operator="*", left=a, right=b, **AT), values, bare),
        _quotients(values, bare),
        values.map(lambda operand: Negative(operand=operand, **AT)),
        values.map(lambda operand: call("abs", operand)),
        st.builds(call, st.sampled_from(["min", "max"]), values, seconds),
        st.builds(lambda a, c, b: Choice(then=a, condition=c, otherwise=b, **AT), values, truths, seconds),
    )


def _simple_truths() -> Trees:
    known_calls = st.sampled_from(sorted(TYPES)).map(lambda variable: call("known", name(variable)))
    return st.one_of(
        st.sampled_from([name("b1"), name("b2")]), known_calls, st.booleans().map(lambda v: Truth(value=v, **AT))
    )


def bare_numbers() -> Trees:
    return st.recursive(
        _bare_leaves(), lambda values: _same_dimension_expressions(values, values, _simple_truths()), max_leaves=4
    )


def quantities(kind: str) -> Trees:
    return st.recursive(
        _measured_leaves(kind),
        lambda values: _same_dimension_expressions(values, bare_numbers(), _simple_truths()),
        max_leaves=4,
    )


def ratios() -> Trees:
    """Return quotients of equal dimensions, which are bare numbers again."""
    lengths = quantities("length")
    return _quotients(lengths, lengths)


def _chain(values: Trees) -> Trees:
    links = st.lists(st.tuples(st.sampled_from(Comparison), _or_zero(values)), min_size=1, max_size=2)
    return st.builds(lambda first, rest: compare(first, *rest), values, links)


def _membership(values: Trees) -> Trees:
    option_lists = st.lists(values, min_size=1, max_size=3).map(tuple)
    return st.builds(
        lambda item, options, no: In(item=item, options=options, negated=no, **AT), values, option_lists, st.booleans()
    )


def _texts() -> Trees:
    def text(value: str) -> Node:
        return Text(value=value, **AT)

    doors = st.sampled_from([name("door"), *map(text, DOOR)])
    labels = st.sampled_from([name("label"), text("x"), text('say "no"'), text("it's")])
    equal = st.sampled_from([Comparison.EQUAL, Comparison.NOT_EQUAL])
    door = st.builds(lambda op, other: compare(name("door"), (op, other)), equal, doors)
    mixed = st.builds(lambda op: compare(name("side"), (op, name("door"))), equal)
    label = st.builds(lambda op, one, other: compare(one, (op, other)), equal, labels, labels)
    return st.one_of(door, mixed, label, st.builds(lambda tree: tree, _membership(labels)), _in_doors(doors))


def _in_doors(doors: Trees) -> Trees:
    option_lists = st.lists(doors, min_size=1, max_size=3).map(tuple)
    return st.builds(
        lambda options, no: In(item=name("door"), options=options, negated=no, **AT), option_lists, st.booleans()
    )


def _ages() -> Trees:
    limits = st.one_of(st.builds(number, LITERALS, st.sampled_from(["s", "ms", "min"])), st.just(name("t")))
    order_operators = st.sampled_from(
        [Comparison.LESS, Comparison.LESS_OR_EQUAL, Comparison.GREATER, Comparison.GREATER_OR_EQUAL]
    )
    ages = st.sampled_from(["x", "b1", "door"]).map(lambda variable: call("age", name(variable)))
    age_first_comparisons = st.builds(lambda age, op, limit: compare(age, (op, limit)), ages, order_operators, limits)
    return st.one_of(
        age_first_comparisons,
        st.builds(lambda age, op, limit: compare(limit, (op, age)), ages, order_operators, limits),
    )


def _atoms() -> Trees:
    numbers = [quantities("length"), quantities("angle"), quantities("time"), bare_numbers(), ratios()]
    comparisons = [strategy for values in numbers for strategy in (_chain(values), _membership(values))]
    return st.one_of(_simple_truths(), _texts(), _ages(), *comparisons)


def composite_conditions(truths: Trees) -> Trees:
    """Return conditions that combine other conditions."""
    operand_lists = st.lists(truths, min_size=2, max_size=3).map(tuple)
    return st.one_of(
        truths.map(lambda operand: Not(operand=operand, **AT)),
        operand_lists.map(lambda operands: And(operands=operands, **AT)),
        operand_lists.map(lambda operands: Or(operands=operands, **AT)),
        st.builds(lambda a, c, b: Choice(then=a, condition=c, otherwise=b, **AT), truths, truths, truths),
    )


def _logic(truths: Trees) -> Trees:
    return st.one_of(
        composite_conditions(truths),
        st.builds(lambda a, b: compare(a, (Comparison.EQUAL, b)), truths, truths),
    )


CONDITIONS: Trees = st.recursive(_atoms(), _logic, max_leaves=5)
"""Well-typed conditions over TYPES."""


@dataclass(frozen=True)
class World:
    """Values and ages of the names; both None where unknown."""

    values: Mapping[str, bool | int | float | str | None]
    ages: Mapping[str, float]

    def value(self, name: str) -> bool | int | float | str | None:
        return self.values[name]

    def age_s(self, name: str) -> float | None:
        return None if self.values[name] is None else self.ages[name]


def worlds() -> st.SearchStrategy[World]:
    numbers = st.sampled_from([0, 1, -1, 2, 3, 5, 10, 1000])
    floats = st.sampled_from([0.0, 0.5, -1.5, 2.0, 0.001, 180.0, math.pi, 60.0])
    kinds: Mapping[Kind, st.SearchStrategy[bool | int | float | str]] = {
        Kind.BOOL: st.booleans(),
        Kind.INT: numbers,
        Kind.FLOAT: floats,
        Kind.STR: st.sampled_from(["x", "it's", 'say "no"']),
    }
    value_strategies = {
        variable: st.one_of(st.none(), st.sampled_from(kind.values) if kind.kind is Kind.ENUM else kinds[kind.kind])
        for variable, kind in TYPES.items()
    }
    ages = st.fixed_dictionaries({variable: st.sampled_from([0.0, 0.25, 1.5, 3.0, 90.0]) for variable in TYPES})
    return st.builds(World, st.fixed_dictionaries(value_strategies), ages)


class TooCloseError(Exception):
    """Two numbers are so close to each other that rounding decides."""


@dataclass(frozen=True)
class Exact:
    """A number in base units; `is_unrounded` if floating point gives it without rounding."""

    number: Fraction
    is_unrounded: bool


Result = bool | str | Exact | None


def meaning(node: Node, world: World) -> Result:
    """Return the value of a condition in a world: None for unknown."""
    match node:
        case Name(name=variable):
            return _in_base(world.values[variable], TYPES[variable].unit)
        case Number(value=value, unit=unit):
            return _in_base(value, _unit(unit))
        case Text(value=text):
            return text
        case Truth(value=truth):
            return truth
        case Call(function="known", arguments=(Name(name=variable),)):
            return world.values[variable] is not None
        case Call(function="age", arguments=(Name(name=variable),)):
            return _in_base(world.age_s(variable), ONE)
        case Not(operand=operand):
            operand_value = meaning(operand, world)
            return None if operand_value is None else not operand_value
        case And(operands=operands):
            return _all([meaning(operand, world) for operand in operands])
        case Or(operands=operands):
            return _any([meaning(operand, world) for operand in operands])
        case Compare(first=first, rest=rest):
            sides = [meaning(first, world), *(meaning(operand, world) for _, operand in rest)]
            return _all([_compare_values(op, *pair) for (op, _), pair in zip(rest, pairwise(sides), strict=True)])
        case In(item=item, options=options, negated=negated):
            one = meaning(item, world)
            is_member = _any([_compare_values(Comparison.EQUAL, one, meaning(option, world)) for option in options])
            return None if is_member is None else is_member != negated
        case Choice(then=then, condition=condition, otherwise=otherwise):
            return _choose(meaning(then, world), meaning(condition, world), meaning(otherwise, world))
    return _calculate(node, world)


def _calculate(node: Node, world: World) -> Result:
    operators = {Negative: "negative", Arithmetic: getattr(node, "operator", ""), Call: getattr(node, "function", "")}
    operator = operators[type(node)]
    values = [meaning(operand, world) for operand in parts(node)]
    numbers = [value.number for value in values if isinstance(value, Exact)]
    if len(numbers) < len(values) or (operator == "/" and numbers[1] == 0):
        return None
    return Exact(CALCULATIONS[operator](numbers), False)


CALCULATIONS: Mapping[str, Callable[[list[Fraction]], Fraction]] = {
    "negative": lambda numbers: -numbers[0],
    "+": lambda numbers: numbers[0] + numbers[1],
    "-": lambda numbers: numbers[0] - numbers[1],
    "*": lambda numbers: numbers[0] * numbers[1],
    "/": lambda numbers: numbers[0] / numbers[1],
    "abs": lambda numbers: abs(numbers[0]),
    "min": min,
    "max": max,
}


def _unit(text: str | None) -> Unit:
    unit = ONE if text is None else parse_unit(text)
    assert unit is not None
    return unit


def _in_base(value: bool | int | float | str | None, unit: Unit) -> Result:
    if value is None or isinstance(value, (bool, str)):
        return value
    exact = Fraction(value) * unit.factor
    return Exact(exact * Fraction(math.pi / 180) if unit.degrees else exact, is_unrounded=unit == ONE)


def _compare_values(operator: str, one: Result, other: Result) -> bool | None:
    if one is None or other is None:
        return None
    if isinstance(one, Exact) and isinstance(other, Exact):
        largest = max(abs(one.number), abs(other.number), Fraction(1))
        is_near = abs(one.number - other.number) <= largest / 10**9
        if is_near and not (one.is_unrounded and other.is_unrounded):
            raise TooCloseError
        return _comparison_holds(operator, one.number, other.number)
    return (one == other) == (operator == "==")


def _comparison_holds(operator: str, one: Fraction, other: Fraction) -> bool:
    return {
        "<": one < other,
        "<=": one <= other,
        ">": one > other,
        ">=": one >= other,
        "==": one == other,
        "!=": one != other,
    }[operator]


def _all(values: list[Result]) -> bool | None:
    if any(value is False for value in values):
        return False
    return None if any(value is None for value in values) else True


def _any(values: list[Result]) -> bool | None:
    if any(value is True for value in values):
        return True
    return None if any(value is None for value in values) else False


def _choose(then: Result, condition: Result, otherwise: Result) -> Result:
    if condition is not None:
        return then if condition else otherwise
    if then is None or otherwise is None:
        return None
    if isinstance(then, Exact) and isinstance(otherwise, Exact):
        return then if _compare_values("==", then, otherwise) else None
    return then if then == otherwise else None
