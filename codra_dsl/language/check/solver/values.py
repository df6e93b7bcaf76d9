"""The possible values of a part of a condition, given the possible values of each name in it, in Kleene's logic.

Each mention of a name is treated independently. Therefore the answer contains every possible value, and may contain
impossible values as well. The answer is exact if no name occurs twice. `case_split` distinguishes cases of the names
that occur several times, and computes the possible values in each case.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import field
from enum import Enum
from fractions import Fraction
from functools import lru_cache, partial, reduce
from itertools import pairwise, product

from codra_dsl.language.check.conditions.types import Type
from codra_dsl.language.check.solver import intervals
from codra_dsl.language.check.solver.budget import spend, spend_on_digits
from codra_dsl.language.check.solver.intervals import FULL, Interval, in_base, point
from codra_dsl.language.check.solver.linear import Pair
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
from codra_dsl.language.model import Kind
from codra_dsl.language.units import ONE, parse_unit

MAX_PIECES = 8
"""The maximum number of separate intervals. If there are more intervals, their hull replaces them."""

MAX_CHOICE_PIECES = 64
"""The same for the results of a choice. Without this limit, nested choices would double the number at each level."""


class UnspecifiedText(Enum):
    """Texts that are not known literally: any text, or a text that the conditions do not mention."""

    ANY = "any"
    UNMENTIONED = "unmentioned"


Value = bool | str | UnspecifiedText | Interval | None
"""A value, a set of values, or None for unknown."""

Values = frozenset[Value]
"""The possible values of a name or of a part of a condition."""


@dataclass(frozen=True, slots=True)
class Context:
    """The possible values in one case.

    Attributes:
        values: a mapping from each name to its possible values. There are three kinds of further keys: the `age_key` of
            a name for its age, the `known_key` of a name for whether the name is known, and the key of a pair for the
            difference of two numbers.
        pairs: the pairs whose difference occurs more than once or is 0. A key consists of the `id` of each side.
    """

    values: Mapping[str, Values]
    pairs: Mapping[tuple[int, int], Pair] = field(default_factory=dict)


UNKNOWN: Values = frozenset({None})
_TRUE: Values = frozenset({True})
_FALSE: Values = frozenset({False})
EITHER: Values = frozenset({True, False})
_NUMBERS: Values = frozenset({FULL})
_ANY_VALUES: Values = frozenset({True, False, FULL, None})
AGES: Values = frozenset({Interval(Fraction(0), FULL.high)})


def known_values(declared: Type | None) -> Values:
    """Return the possible values of a known name with the given type."""
    if declared is None:  # a wrong declaration causes no findings about its readers
        return _ANY_VALUES
    if declared.kind is Kind.BOOL:
        return EITHER
    if declared.kind is Kind.ENUM:
        return frozenset(declared.values)
    if declared.kind is Kind.STR:
        return frozenset({UnspecifiedText.ANY})
    if declared.range is None:
        return _NUMBERS
    low, high = (in_base(end, declared.unit) for end in declared.range)
    return frozenset({Interval(low, high)}) if low <= high else _ANY_VALUES


def age_key(name: str) -> str:
    """Return the key for a name's age in a context."""
    return f"age({name})"


def known_key(name: str) -> str:
    """Return the key, in a context, for whether a name is known, independent of its value."""
    return f"known({name})"


def possible_values(node: Node, context: Context) -> Values:
    """Return the possible values of a part of a condition."""
    spend(1)
    return _EVALUATORS[type(node)](node, context)


def own_comparisons(node: Node) -> Iterator[tuple[str, Node, Node]]:
    """Yield each comparison of two values in a node itself, without the comparisons in its parts."""
    if isinstance(node, Compare):
        operands = (node.first, *(operand for _, operand in node.rest))
        for (operator, _), (left, right) in zip(node.rest, pairwise(operands), strict=True):
            yield operator, left, right
    elif isinstance(node, In):
        yield from (("==", node.item, option) for option in node.options)


def _name(node: Node, context: Context) -> Values:
    assert isinstance(node, Name)
    return context.values[node.name]


def _literal(node: Node, _: Context) -> Values:
    assert isinstance(node, (Text, Truth))
    return frozenset({node.value})


@lru_cache(maxsize=4096)
def _quantity(value: float, unit: str | None) -> Values:
    parsed_unit = ONE if unit is None else parse_unit(unit)
    return frozenset({FULL if parsed_unit is None else point(in_base(value, parsed_unit))})


def _number(node: Node, _: Context) -> Values:
    assert isinstance(node, Number)
    return _quantity(node.value, node.unit)


def _not(node: Node, context: Context) -> Values:
    assert isinstance(node, Not)
    return frozenset(None if value is None else not value for value in possible_values(node.operand, context))


def _and(node: Node, context: Context) -> Values:
    assert isinstance(node, And)
    return _conjunction(possible_values(operand, context) for operand in node.operands)


def _or(node: Node, context: Context) -> Values:
    assert isinstance(node, Or)
    return _disjunction(possible_values(operand, context) for operand in node.operands)


def _conjunction(operands: Iterable[Values]) -> Values:
    results: Values = frozenset({True})
    for operand in operands:
        results = frozenset(_kleene_and(one, other) for one in results for other in operand)
    return results


def _disjunction(operands: Iterable[Values]) -> Values:
    results: Values = frozenset({False})
    for operand in operands:
        results = frozenset(_kleene_or(one, other) for one in results for other in operand)
    return results


def _kleene_and(one: Value, other: Value) -> bool | None:
    if one is False or other is False:
        return False
    return None if one is None or other is None else True


def _kleene_or(one: Value, other: Value) -> bool | None:
    if one is True or other is True:
        return True
    return None if one is None or other is None else False


def _compare(node: Node, context: Context) -> Values:
    return _conjunction(compare_values(*link, context) for link in own_comparisons(node))


def _in(node: Node, context: Context) -> Values:
    assert isinstance(node, In)
    truths = _disjunction(compare_values("==", node.item, option, context) for option in dict.fromkeys(node.options))
    return frozenset(None if value is None else value is not node.negated for value in truths)


def compare_values(operator: str, left: Node, right: Node, context: Context) -> Values:
    """Return the possible results of a comparison.

    If the context contains the difference of the two sides, the results are computed from this difference.
    """
    left_values, right_values = possible_values(left, context), possible_values(right, context)
    truths = _possible_judgements(operator, left_values, right_values)
    pair = context.pairs.get((id(left), id(right))) if context.pairs else None
    differences = None if pair is None else context.values.get(pair.key)
    if pair is None or differences is None or truths == UNKNOWN:
        return truths
    pair_operator = operator if pair.factor > 0 else _MIRRORED_OPERATORS[operator]
    exact_truths = frozenset(
        truth for difference in differences for truth in _judge(pair_operator, difference, point(pair.limit))
    )
    return exact_truths | UNKNOWN if None in truths and not pair.key else exact_truths


def _possible_judgements(operator: str, left_values: Values, right_values: Values) -> Values:
    """Return the possible results of a comparison of any of the left values with any of the right values.

    The work for large sets of members is proportional to their sizes, and not to the product of their sizes.
    """
    spend(1 + (len(left_values) + len(right_values)) // 8)
    is_unknown_possible = (None in left_values and right_values) or (None in right_values and left_values)
    unknown_truths = UNKNOWN if is_unknown_possible else frozenset[Value]()
    left, right = left_values - UNKNOWN, right_values - UNKNOWN
    if operator in ("==", "!=") and left and right and all(isinstance(value, str) for value in (*left, *right)):
        can_be_equal, can_be_unequal = not left.isdisjoint(right), len(left | right) > 1
        is_equality = operator == "=="
        return unknown_truths | _possible_truths(
            can_be_equal if is_equality else can_be_unequal, can_be_unequal if is_equality else can_be_equal
        )
    truths: set[Value] = set()
    for one, other in product(left, right):
        spend(1)
        truths |= _judge(operator, one, other)
        if len(truths) == len(EITHER):
            break
    return unknown_truths | truths


def _judge(operator: str, one: Value, other: Value) -> Values:
    if one is None or other is None:
        return UNKNOWN
    if isinstance(one, Interval) and isinstance(other, Interval):
        return _COMPARISONS[operator](one, other)
    has_same_type = isinstance(one, (bool, str)) and type(one) is type(other)
    if operator not in ("==", "!=") or not (has_same_type or UnspecifiedText.UNMENTIONED in (one, other)):
        return EITHER
    return (
        EITHER
        if one is other is UnspecifiedText.UNMENTIONED or UnspecifiedText.ANY in (one, other)
        else _truth((one == other) == (operator == "=="))
    )


def _truth(value: bool) -> Values:
    return _TRUE if value else _FALSE


def _less(one: Interval, other: Interval) -> Values:
    return _possible_truths(intervals.can_be_less(one, other), _can_be_at_least(one, other))


def _at_most(one: Interval, other: Interval) -> Values:
    return _possible_truths(_can_be_at_least(other, one), intervals.can_be_less(other, one))


def _equal(one: Interval, other: Interval) -> Values:
    is_same_point = one.is_point and other.is_point and one.low == other.low
    return _possible_truths(intervals.can_be_equal(one, other), not is_same_point)


def _unequal(one: Interval, other: Interval) -> Values:
    is_same_point = one.is_point and other.is_point and one.low == other.low
    return _possible_truths(not is_same_point, intervals.can_be_equal(one, other))


def _can_be_at_least(one: Interval, other: Interval) -> bool:
    return intervals.can_be_less(other, one) or intervals.can_be_equal(one, other)


def _possible_truths(can_hold: bool, can_fail: bool) -> Values:
    if can_hold and can_fail:
        return EITHER
    return _TRUE if can_hold else _FALSE


_COMPARISONS: Mapping[str, Callable[[Interval, Interval], Values]] = {
    "<": _less,
    "<=": _at_most,
    ">": lambda one, other: _less(other, one),
    ">=": lambda one, other: _at_most(other, one),
    "==": _equal,
    "!=": _unequal,
}


_MIRRORED_OPERATORS: Mapping[str, str] = {"<": ">", "<=": ">=", ">": "<", ">=": "<=", "==": "==", "!=": "!="}


def _negative(node: Node, context: Context) -> Values:
    assert isinstance(node, Negative)
    return _calculate(intervals.negative, possible_values(node.operand, context))


def _arithmetic(node: Node, context: Context) -> Values:
    """Return the possible results. The result of a division by zero is unknown."""
    assert isinstance(node, Arithmetic)
    left, right = possible_values(node.left, context), possible_values(node.right, context)
    if node.operator == "/" and all(map(_is_no_divisor, right)):
        return UNKNOWN
    results = _calculate(_OPERATIONS[node.operator], left, right)
    if node.operator != "/" or results == UNKNOWN or not any(_may_be_zero(value) for value in right):
        return results
    return results | UNKNOWN


def _is_no_divisor(value: Value) -> bool:
    return value is None or (isinstance(value, Interval) and value.is_point and value.low == 0)


def _may_be_zero(value: Value) -> bool:
    return not isinstance(value, Interval) or intervals.can_be_equal(value, _ZERO)


def _calculate(operation: Callable[..., Interval], *operands: Values) -> Values:
    """Return the possible results of an operation on numbers; unknown if an operand is unknown."""
    if any(values == UNKNOWN for values in operands):
        return UNKNOWN
    operand_ranges = [
        [value if isinstance(value, Interval) else FULL for value in values - UNKNOWN] for values in operands
    ]
    ranges = []
    for combination in product(*operand_ranges):
        spend(1)
        ranges.append(operation(*combination))
        spend_on_digits(ranges[-1].low, ranges[-1].high)
    results: Values = frozenset(ranges if len(ranges) <= MAX_PIECES else [intervals.hull(ranges)])
    return results | UNKNOWN if any(None in values for values in operands) else results


_ZERO = point(Fraction(0))
_OPERATIONS: Mapping[str, Callable[[Interval, Interval], Interval]] = {
    "+": intervals.total,
    "-": lambda one, other: intervals.total(one, intervals.negative(other)),
    "*": intervals.product,
    "/": intervals.quotient,
    "min": intervals.smallest,
    "max": intervals.largest,
}


def _call(node: Node, context: Context) -> Values:
    assert isinstance(node, Call)
    if node.function in ("known", "age"):
        (argument,) = node.arguments
        assert isinstance(argument, Name)
        return _known(argument.name, context) if node.function == "known" else _age(argument.name, context)
    if node.function == "abs":
        return _calculate(intervals.magnitude, possible_values(node.arguments[0], context))
    operation = _OPERATIONS[node.function]
    return reduce(partial(_calculate, operation), (possible_values(argument, context) for argument in node.arguments))


def _known(name: str, context: Context) -> Values:
    known_truths = context.values.get(known_key(name))
    return frozenset(value is not None for value in context.values[name]) if known_truths is None else known_truths


def _age(name: str, context: Context) -> Values:
    """Return the possible ages of a name's evidence; unknown while the name is unknown."""
    values = context.values[name]
    if values == UNKNOWN:
        return UNKNOWN
    ages = context.values.get(age_key(name), AGES)
    return ages | UNKNOWN if None in values else ages


def _choice(node: Node, context: Context) -> Values:
    assert isinstance(node, Choice)
    then, otherwise = possible_values(node.then, context), possible_values(node.otherwise, context)
    values: set[Value] = set()
    for truth in possible_values(node.condition, context):
        if truth is None:
            values |= _agreements(then, otherwise)
        else:
            values |= then if truth else otherwise
    return _merge_intervals(values)


def _fallback(node: Node, context: Context) -> Values:
    assert isinstance(node, Fallback)
    values = possible_values(node.value, context)
    if None not in values:
        return values
    return _merge_intervals(values - UNKNOWN | possible_values(node.otherwise, context))


def _merge_intervals(values: Iterable[Value]) -> Values:
    """Return values without equal intervals. If there are too many intervals, their hull replaces them."""
    ranges = {
        (value.low, value.high, value.low_open, value.high_open): value
        for value in values
        if isinstance(value, Interval)
    }
    merged = ranges.values() if len(ranges) <= MAX_CHOICE_PIECES else [intervals.hull(ranges.values())]
    return frozenset((*merged, *(value for value in values if not isinstance(value, Interval))))


def _agreements(then: Values, otherwise: Values) -> Values:
    """Return the possible values of a choice with an unknown condition."""
    if all(value is None or isinstance(value, str) for value in (*then, *otherwise)):
        return (then & otherwise) | (UNKNOWN if len(then | otherwise) > 1 else frozenset())
    values: set[Value] = set()
    for one, other in product(then, otherwise):
        spend(2)
        values |= _agreement(one, other)
    return frozenset(values)


def _agreement(one: Value, other: Value) -> Values:
    """Return the possible values if the sides have these values. A value is known only if both sides agree."""
    if one is None or other is None:
        return UNKNOWN
    if isinstance(one, Interval) and isinstance(other, Interval):
        shared_interval = intervals.intersection(one, other)
        return UNKNOWN if shared_interval.is_empty else frozenset({shared_interval, None})
    if isinstance(one, (bool, str)) and isinstance(other, (bool, str)):
        return frozenset({one}) if one == other else UNKNOWN
    return frozenset({one, other, None})


_EVALUATORS: Mapping[type[Node], Callable[[Node, Context], Values]] = {
    Name: _name,
    Number: _number,
    Text: _literal,
    Truth: _literal,
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
