"""A normal form for comparisons of two numbers: `a - b < 3`, `a < b + 3` and `2 * b > 2 * a - 6` have the same key."""

from __future__ import annotations

from collections.abc import Mapping
from fractions import Fraction

from codra_dsl.language.check.solver.budget import spend, spend_on_digits
from codra_dsl.language.check.solver.intervals import in_base
from codra_dsl.language.expression import Arithmetic, Call, Name, Negative, Node, Number, to_text
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.units import ONE, parse_unit


@dataclass(frozen=True, slots=True)
class Pair:
    """Two numbers that are compared. Their difference is `factor * (number - limit)`.

    Attributes:
        key: the text of `number`, which is computed from names. Two keys are equal only if their numbers are equal, and
            are known in the same cases. If `number` is always 0, the key is empty.
    """

    key: str
    limit: Fraction
    factor: Fraction


def pair(left: Node, right: Node) -> Pair:
    """Return two numbers as a pair. Comparisons of the same number with different constants have the same key."""
    difference = _sum(left).plus(_sum(right), Fraction(-1))
    factor = difference.first_factor
    key = difference.times(1 / factor).key if any(difference.factors_by_key.values()) else ""
    return Pair(key, -difference.constant / factor, factor)


@dataclass(frozen=True, slots=True)
class _Sum:
    """The sum of a constant and summands. `factors_by_key` is a mapping from the key of each summand to its factor.

    No summand is itself a sum. A summand with the factor 0 stays in the sum, because the sum is unknown while this
    summand is unknown.
    """

    factors_by_key: Mapping[str, Fraction]
    constant: Fraction = Fraction(0)

    def __post_init__(self) -> None:
        spend(1 + sum(map(len, self.factors_by_key)) // 64)
        spend_on_digits(self.constant, *self.factors_by_key.values())

    @property
    def first_factor(self) -> Fraction:
        """Return the first factor that is not 0, in the alphabetical order of the keys; 1 if all factors are 0."""
        return next(
            (self.factors_by_key[key] for key in sorted(self.factors_by_key) if self.factors_by_key[key]), Fraction(1)
        )

    @property
    def key(self) -> str:
        """Return a text that is the same for all sums that differ only in the constant."""
        return " + ".join(f"{_number_text(self.factors_by_key[key])}*{key}" for key in sorted(self.factors_by_key))

    def text(self) -> str:
        """Return a text that is the same for equal sums."""
        return f"({self.key} + {_number_text(self.constant)})"

    def times(self, factor: Fraction) -> _Sum:
        return _Sum(
            {key: own_factor * factor for key, own_factor in self.factors_by_key.items()}, self.constant * factor
        )

    def plus(self, other: _Sum, factor: Fraction = Fraction(1)) -> _Sum:
        addend = other.times(factor)
        zero = Fraction(0)
        factors = {
            key: self.factors_by_key.get(key, zero) + addend.factors_by_key.get(key, zero)
            for key in (*self.factors_by_key, *addend.factors_by_key)
        }
        return _Sum(factors, self.constant + addend.constant)


def _sum(node: Node) -> _Sum:
    match node:
        case Number(value=value, unit=unit):
            parsed_unit = ONE if unit is None else parse_unit(unit)
            base_value = None if parsed_unit is None else in_base(value, parsed_unit)
            return _Sum({}, base_value) if isinstance(base_value, Fraction) else _single_summand(to_text(node))
        case Name(name=name):
            return _single_summand(name)
        case Negative(operand=operand):
            return _sum(operand).times(Fraction(-1))
        case Arithmetic(operator=operator, left=left, right=right):
            return _calculate(operator, _sum(left), _sum(right))
        case Call(function="abs", arguments=(operand,)):
            inner_sum = _sum(operand)
            positive_sum = inner_sum.times(Fraction(-1)) if inner_sum.first_factor < 0 else inner_sum
            return (
                _single_summand(f"abs{positive_sum.text()}")
                if inner_sum.factors_by_key
                else _Sum({}, abs(inner_sum.constant))
            )
        case Call(function="min" | "max" as function, arguments=arguments):
            keys = sorted({_sum(argument).text() for argument in arguments})
            return _single_summand(f"{function}({', '.join(keys)})") if len(keys) > 1 else _sum(arguments[0])
    return _single_summand(to_text(node))


def _number_text(number: Fraction) -> str:
    """Return a text that is the same for equal numbers: hexadecimal, because Python limits the decimal digits."""
    return f"{number.numerator:x}/{number.denominator:x}"


def _single_summand(key: str) -> _Sum:
    return _Sum({key: Fraction(1)})


def _calculate(operator: str, left: _Sum, right: _Sum) -> _Sum:
    if operator in "+-":
        return left.plus(right, Fraction(1 if operator == "+" else -1))
    if operator == "/":
        is_constant = not right.factors_by_key and right.constant
        return left.times(1 / right.constant) if is_constant else _single_summand(f"{left.text()} / {right.text()}")
    for one, other in ((left, right), (right, left)):
        if not one.factors_by_key:
            return other.times(one.constant)
    return _single_summand(" * ".join(sorted((left.text(), right.text()))))
