"""Conditions in a normal form that says the same whichever way they were written.

Numbers become sums of symbols in SI units, `2 * x - y + 3`; a comparison is of such a sum without its constant against
a bound. A symbol is a name, `age(x)`, or a calculation that is no sum (`abs(x)`, `x * y`), which counts as one number
that may be anything. Two conditions with the same form have the same value in Kleene's logic, whatever is unknown.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from fractions import Fraction

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
from codra_dsl.model import Kind, ValueType
from codra_dsl.units import ONE, Unit, parse_unit

Types = Mapping[str, ValueType]
"""What each name is that a condition can see."""

_NUMERIC = frozenset({Kind.INT, Kind.FLOAT})
_PI_BY_180 = Fraction(math.pi / 180)
_OPPOSITE = {"<": ">=", ">=": "<", ">": "<=", "<=": ">", "==": "!=", "!=": "=="}
_MIRRORED = {"<": ">", ">": "<", "<=": ">=", ">=": "<=", "==": "==", "!=": "!="}


@dataclass(frozen=True, slots=True)
class Symbol:
    """A number that is no sum of others.

    Attributes:
        key: equal for equal numbers.
        names: what must be known for it to be known.
        may_fail: whether it can be unknown though they are known.
    """

    key: str
    names: frozenset[str]
    may_fail: bool = False


@dataclass(frozen=True, slots=True)
class Sum:
    """A sum of symbols, each with a factor, and a constant; sorted by key, no factor is zero.

    Attributes:
        names: what must be known for it to be known, be it multiplied by zero.
    """

    parts: tuple[tuple[Symbol, Fraction], ...]
    constant: Fraction
    names: frozenset[str]

    @property
    def key(self) -> str:
        """Return a text that is equal for equal sums."""
        told = [f"{factor}*{symbol.key}" for symbol, factor in self.parts]
        hidden = sorted(self.names - {name for symbol, _ in self.parts for name in symbol.names})
        return " + ".join([*told, str(self.constant), *(f"0*{name}" for name in hidden)])

    def times(self, factor: Fraction) -> Sum:
        """Return the sum multiplied by a constant."""
        parts = tuple((symbol, each * factor) for symbol, each in self.parts if factor)
        return Sum(parts, self.constant * factor, self.names)

    def plus(self, other: Sum) -> Sum:
        """Return the sum of both."""
        factors = dict(self.parts)
        for symbol, factor in other.parts:
            factors[symbol] = factors.get(symbol, Fraction(0)) + factor
        parts = tuple(sorted(((each, by) for each, by in factors.items() if by), key=lambda part: part[0].key))
        return Sum(parts, self.constant + other.constant, self.names | other.names)


@dataclass(frozen=True, slots=True)
class Constant:
    """Certainly true or certainly false."""

    value: bool


@dataclass(frozen=True, slots=True)
class Holds:
    """The value of a bool."""

    name: str


@dataclass(frozen=True, slots=True)
class Known:
    """Whether a name is known; `is_known` says which of both is true."""

    name: str
    is_known: bool = True


@dataclass(frozen=True, slots=True)
class Is:
    """Whether an enum or a str has a value."""

    name: str
    value: str
    equal: bool = True


@dataclass(frozen=True, slots=True)
class Bound:
    """A comparison of a sum without constant with a number."""

    total: Sum
    operator: str
    limit: Fraction


@dataclass(frozen=True, slots=True)
class Opaque:
    """A truth that is not looked into."""

    key: str
    names: frozenset[str]
    may_fail: bool
    negated: bool = False


@dataclass(frozen=True, slots=True)
class Every:
    """All of some conditions."""

    parts: frozenset[Form]


@dataclass(frozen=True, slots=True)
class Some:
    """Any of some conditions."""

    parts: frozenset[Form]


@dataclass(frozen=True, slots=True)
class Inverse:
    """The opposite of a bool's value."""

    form: Holds


@dataclass(frozen=True, slots=True)
class Pick:
    """One truth or another by a third; where that is unknown it is known only if both agree."""

    condition: Form
    then: Form
    otherwise: Form


@dataclass(frozen=True, slots=True)
class Agree:
    """Whether two truths are the same; unknown where one of them is. The two are sorted."""

    sides: tuple[Form, Form]
    equal: bool = True


Form = Constant | Holds | Known | Is | Bound | Opaque | Every | Some | Inverse | Pick | Agree


def every(parts: Iterator[Form] | tuple[Form, ...]) -> Form:
    """Return the conjunction, flattened."""
    found: set[Form] = set()
    for part in parts:
        found |= part.parts if isinstance(part, Every) else {part}
    found.discard(Constant(True))
    return next(iter(found)) if len(found) == 1 else Every(frozenset(found)) if found else Constant(True)


def some(parts: Iterator[Form] | tuple[Form, ...]) -> Form:
    """Return the disjunction, flattened."""
    found: set[Form] = set()
    for part in parts:
        found |= part.parts if isinstance(part, Some) else {part}
    found.discard(Constant(False))
    return next(iter(found)) if len(found) == 1 else Some(frozenset(found)) if found else Constant(False)


def opposite(form: Form) -> Form:
    """Return the negation, pushed down to the leaves; Kleene's logic keeps De Morgan's laws."""
    match form:
        case Constant(value):
            return Constant(not value)
        case Holds():
            return Inverse(form)
        case Inverse(inner):
            return inner
        case Known(name, is_known):
            return Known(name, not is_known)
        case Is(name, value, equal):
            return Is(name, value, not equal)
        case Bound(total, operator, limit):
            return Bound(total, _OPPOSITE[operator], limit)
        case Opaque(key, names, may_fail, negated):
            return Opaque(key, names, may_fail, not negated)
        case Every(parts):
            return some(tuple(opposite(part) for part in parts))
        case Some(parts):
            return every(tuple(opposite(part) for part in parts))
        case Pick(condition, then, otherwise):
            return Pick(condition, opposite(then), opposite(otherwise))
        case Agree(sides, equal):
            return Agree(sides, not equal)


def condition_form(node: Node, types: Types) -> Form:
    """Return the form of a condition that `check` has found to be one."""
    return _FORMS[type(node)](node, types)


def value_key(node: Node, types: Types) -> str:
    """Return a text that is equal for values that are equal: numbers are in SI units."""
    kind = _kind(node, types)
    if kind in _NUMERIC:
        return _sum(node, types).key
    if kind is Kind.BOOL:
        return shown(condition_form(node, types))
    match node:
        case Text(value=value):
            return repr(value)
        case Name(name=name):
            return name
        case Choice(then=then, condition=condition, otherwise=otherwise):
            chosen = shown(condition_form(condition, types))
            return f"({value_key(then, types)} if {chosen} else {value_key(otherwise, types)})"
    raise AssertionError(f"{type(node).__name__} is no text")  # `check` lets no other be one


def shown(form: Form) -> str:
    """Return a text that is equal for equal forms, whatever the order of sets."""
    match form:
        case Every(parts):
            return f"({' and '.join(sorted(map(shown, parts)))})"
        case Some(parts):
            return f"({' or '.join(sorted(map(shown, parts)))})"
        case Pick(condition, then, otherwise):
            return f"({shown(then)} if {shown(condition)} else {shown(otherwise)})"
        case Agree((one, other), equal):
            return f"({shown(one)} {'==' if equal else '!='} {shown(other)})"
        case Bound(total, operator, limit):
            return f"{total.key} {operator} {limit}"
        case Opaque(key, _, _, negated):
            return f"not {key}" if negated else key
    return repr(form)


def si_factor(unit_text: str | None) -> Fraction:
    """Return how many of the base unit make one of a unit; an angle's is as exact as pi is."""
    unit: Unit = (parse_unit(unit_text) if unit_text is not None else None) or ONE
    return unit.factor * _PI_BY_180**unit.degrees


def _kind(node: Node, types: Types) -> Kind:
    match node:
        case Name(name=name):
            return types[name].kind
        case Text():
            return Kind.STR
        case Choice(then=then, otherwise=otherwise):
            return _kind(otherwise if isinstance(then, Text) else then, types)
        case Number() | Arithmetic() | Negative():
            return Kind.FLOAT
        case Call(function=function):
            return Kind.BOOL if function == "known" else Kind.FLOAT
    return Kind.BOOL


# Conditions


def _truth(node: Node, _: Types) -> Form:
    assert isinstance(node, Truth)
    return Constant(node.value)


def _named(node: Node, _: Types) -> Form:
    assert isinstance(node, Name)
    return Holds(node.name)


def _negated(node: Node, types: Types) -> Form:
    assert isinstance(node, Not)
    return opposite(condition_form(node.operand, types))


def _all(node: Node, types: Types) -> Form:
    assert isinstance(node, And)
    return every(tuple(condition_form(operand, types) for operand in node.operands))


def _any(node: Node, types: Types) -> Form:
    assert isinstance(node, Or)
    return some(tuple(condition_form(operand, types) for operand in node.operands))


def _asked(node: Node, _: Types) -> Form:
    assert isinstance(node, Call)
    assert isinstance(node.arguments[0], Name)
    return Known(node.arguments[0].name)


def _picked(node: Node, types: Types) -> Form:
    assert isinstance(node, Choice)
    condition, then, otherwise = (condition_form(each, types) for each in (node.condition, node.then, node.otherwise))
    return Pick(condition, then, otherwise)


def _compared(node: Node, types: Types) -> Form:
    assert isinstance(node, Compare)
    links, left = [], node.first
    for operator, right in node.rest:
        links.append(_link(left, operator.value, right, types))
        left = right
    return every(tuple(links))


def _among(node: Node, types: Types) -> Form:
    assert isinstance(node, In)
    found = some(tuple(_link(node.item, "==", option, types) for option in node.options))
    return opposite(found) if node.negated else found


_FORMS: Mapping[type[Node], Callable[[Node, Types], Form]] = {
    Truth: _truth,
    Name: _named,
    Not: _negated,
    And: _all,
    Or: _any,
    Call: _asked,
    Choice: _picked,
    Compare: _compared,
    In: _among,
}


def _link(left: Node, operator: str, right: Node, types: Types) -> Form:
    kind = _kind(left, types)
    if kind in _NUMERIC:
        return _bound(_sum(left, types).plus(_sum(right, types).times(Fraction(-1))), operator)
    if kind is Kind.BOOL:
        return _agreement(condition_form(left, types), condition_form(right, types), operator == "==")
    return _texts(left, operator == "==", right, types)


def _agreement(one: Form, other: Form, equal: bool) -> Form:
    for fixed, free in ((one, other), (other, one)):
        if isinstance(fixed, Constant):
            return free if fixed.value is equal else opposite(free)
    first, second = sorted((one, other), key=shown)
    return Agree((first, second), equal)


def _bound(difference: Sum, operator: str) -> Form:
    """Return `difference operator 0` with the constant on the other side and a leading factor of 1."""
    if not difference.parts:
        return Bound(Sum((), Fraction(0), difference.names), operator, -difference.constant)
    lead = difference.parts[0][1]
    scaled = difference.times(1 / lead)
    sense = operator if lead > 0 else _MIRRORED[operator]
    return Bound(Sum(scaled.parts, Fraction(0), scaled.names), sense, -scaled.constant)


def _texts(left: Node, equal: bool, right: Node, types: Types) -> Form:
    for one, other in ((left, right), (right, left)):
        if isinstance(one, Name) and isinstance(other, Text):
            return Is(one.name, other.value, equal)
    if isinstance(left, Text) and isinstance(right, Text):
        return Constant((left.value == right.value) is equal)
    key = " == ".join(sorted((value_key(left, types), value_key(right, types))))
    plain = isinstance(left, Name) and isinstance(right, Name)
    names = frozenset(each.name for each in (left, right) if isinstance(each, Name))
    return Opaque(key, names if plain else frozenset(), not plain, not equal)


# Numbers


def _fixed(value: Fraction) -> Sum:
    return Sum((), value, frozenset())


def _single(key: str, names: frozenset[str], *, may_fail: bool = False) -> Sum:
    return Sum(((Symbol(key, names, may_fail), Fraction(1)),), Fraction(0), names)


def _sum(node: Node, types: Types) -> Sum:
    """Return a number in SI units."""
    match node:
        case Number(value=value, unit=unit):
            return _fixed(Fraction(repr(value)) * si_factor(unit))
        case Name(name=name):
            return _single(name, frozenset({name}))
        case Negative(operand=operand):
            return _sum(operand, types).times(Fraction(-1))
        case Arithmetic(operator=operator, left=left, right=right):
            return _calculated(operator, _sum(left, types), _sum(right, types))
        case Call(function="age", arguments=(Name(name=name),)):
            return _single(f"age({name})", frozenset({name}))
        case Call(function="abs", arguments=(operand,)):
            return _absolute(_sum(operand, types))
        case Call(function=function, arguments=arguments):
            return _extreme(function, [_sum(argument, types) for argument in arguments])
        case Choice():
            return _chosen(node, types)
    raise AssertionError(f"{type(node).__name__} is no number")  # `check` lets no other be one


def _calculated(operator: str, left: Sum, right: Sum) -> Sum:
    if operator in "+-":
        return left.plus(right if operator == "+" else right.times(Fraction(-1)))
    if operator == "/":
        if not right.parts and not right.names and right.constant:
            return left.times(1 / right.constant)
        return _single(f"({left.key}) / ({right.key})", left.names | right.names, may_fail=True)
    for one, other in ((left, right), (right, left)):
        if not one.parts and not one.names:
            return other.times(one.constant)
    key = " * ".join(f"({each})" for each in sorted((left.key, right.key)))
    return _single(key, left.names | right.names, may_fail=_may_fail(left) or _may_fail(right))


def _absolute(inner: Sum) -> Sum:
    if not inner.parts and not inner.names:
        return _fixed(abs(inner.constant))
    positive = inner.times(Fraction(-1)) if inner.parts and inner.parts[0][1] < 0 else inner
    return _single(f"abs({positive.key})", inner.names, may_fail=_may_fail(inner))


def _extreme(function: str, values: list[Sum]) -> Sum:
    keys = sorted({value.key for value in values})
    if len(keys) == 1:
        return values[0]
    names = frozenset[str]().union(*(value.names for value in values))
    return _single(f"{function}({', '.join(keys)})", names, may_fail=any(map(_may_fail, values)))


def _chosen(node: Choice, types: Types) -> Sum:
    then, otherwise = _sum(node.then, types).key, _sum(node.otherwise, types).key
    key = f"({then} if {shown(condition_form(node.condition, types))} else {otherwise})"
    return _single(key, frozenset(), may_fail=True)


def _may_fail(value: Sum) -> bool:
    return any(symbol.may_fail for symbol, _ in value.parts)
