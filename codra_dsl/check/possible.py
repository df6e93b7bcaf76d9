"""Which outcomes a condition can have when some variables are unknown for certain and others may be anything.

The answer is exact, in Kleene's logic, where every name stands once, and where those that stand several times are bools
or enums. It errs only towards "can hold": for a number or a str that is compared several times (`x > 3 and x < 2`), and
past MAX_CASES combinations.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from itertools import product

from codra_dsl.check.types import Types
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
    names_in,
)
from codra_dsl.model import Kind

MAX_CASES = 4096

_SOME = object()
"""Stands for any known number or text."""

Values = frozenset[object]
"""The values that something can have: concrete ones, _SOME, and None for unknown."""

_UNKNOWN: Values = frozenset({None})
_NUMBER: Values = frozenset({_SOME})
_ANYTHING: Values = frozenset({_SOME, None})
_UNJUDGED: Values = frozenset({True, False, _SOME, None})
_EITHER: Values = frozenset({True, False})
_ANY_TRUTH: Values = frozenset({True, False, None})


def can_hold(conditions: Sequence[Node], unknown: Iterable[str], types: Types) -> bool:
    """Return whether conditions can be true together.

    Args:
        conditions: what must be true.
        unknown: names that are unknown for certain; every other name can have any value of its type or be unknown.
        types: what each name is.
    """
    hidden = frozenset(unknown)
    if all(type(condition) is Name for condition in conditions):  # as in most preconditions
        return not any(condition.name in hidden for condition in conditions if isinstance(condition, Name))
    names = [name.name for condition in conditions for name in names_in(condition)]
    context = {name: _values(types, name) for name in names} | dict.fromkeys(hidden, _UNKNOWN)
    if not all(True in _outcomes(condition, context) for condition in conditions):
        return False
    repeated = sorted(name for name, count in Counter(names).items() if count > 1 and _SOME not in context[name])
    return not repeated or any(
        all(True in _outcomes(condition, case) for condition in conditions) for case in _cases(context, repeated)
    )


def _values(types: Types, name: str) -> Values:
    found = types.get(name)
    if found is None:  # a name that is itself wrong is no reason to complain about what reads it
        return _UNJUDGED
    if found.kind is Kind.BOOL:
        return _ANY_TRUTH
    return frozenset({*found.values, None}) if found.kind is Kind.ENUM else _ANYTHING


def _cases(context: Mapping[str, Values], repeated: Sequence[str]) -> Iterator[Mapping[str, Values]]:
    """Yield a context for each combination of what repeated names can be; without the last of them if too many."""
    count = 1
    chosen: list[str] = []
    for name in repeated:
        count *= len(context[name])
        if count > MAX_CASES:
            break
        chosen.append(name)
    for combination in product(*(context[name] for name in chosen)):
        fixed = {name: frozenset({value}) for name, value in zip(chosen, combination, strict=True)}
        yield {**context, **fixed}


Context = Mapping[str, Values]


def _outcomes(node: Node, context: Context) -> Values:
    """Return the values that a part of a condition can have, each name on its own."""
    return _READERS[type(node)](node, context)


def _name(node: Node, context: Context) -> Values:
    assert isinstance(node, Name)
    return context[node.name]


def _literal(node: Node, _: Context) -> Values:
    assert isinstance(node, (Number, Text, Truth))
    return _NUMBER if isinstance(node, Number) else frozenset({node.value})


def _not(node: Node, context: Context) -> Values:
    assert isinstance(node, Not)
    return frozenset(None if value is None else not value for value in _outcomes(node.operand, context))


def _and(node: Node, context: Context) -> Values:
    assert isinstance(node, And)
    return _conjunction(_outcomes(operand, context) for operand in node.operands)


def _or(node: Node, context: Context) -> Values:
    assert isinstance(node, Or)
    return _disjunction(_outcomes(operand, context) for operand in node.operands)


def _conjunction(operands: Iterable[Values]) -> Values:
    found: Values = frozenset({True})
    for operand in operands:
        found = frozenset(_kleene_and(one, other) for one in found for other in operand)
    return found


def _disjunction(operands: Iterable[Values]) -> Values:
    found: Values = frozenset({False})
    for operand in operands:
        found = frozenset(_kleene_or(one, other) for one in found for other in operand)
    return found


def _kleene_and(one: object, other: object) -> object:
    if one is False or other is False:
        return False
    return None if one is None or other is None else True


def _kleene_or(one: object, other: object) -> object:
    if one is True or other is True:
        return True
    return None if one is None or other is None else False


def _compare(node: Node, context: Context) -> Values:
    assert isinstance(node, Compare)
    links, left = [], _outcomes(node.first, context)
    for operator, operand in node.rest:
        right = _outcomes(operand, context)
        links.append(_link(operator, left, right))
        left = right
    return _conjunction(links)


def _link(operator: str, left: Values, right: Values) -> Values:
    found: set[object] = set()
    for one in left:
        for other in right:
            if one is None or other is None:
                found.add(None)
            elif one is _SOME or other is _SOME or operator not in ("==", "!="):
                found |= _EITHER
            else:
                found.add((one == other) == (operator == "=="))
    return frozenset(found)


def _in(node: Node, context: Context) -> Values:
    assert isinstance(node, In)
    options = [_outcomes(option, context) for option in node.options]
    found: set[object] = set()
    for value in _outcomes(node.item, context):
        found |= _disjunction(_link("==", frozenset({value}), option) for option in options)
    return frozenset(None if value is None else value is not node.negated for value in found)


def _calculation(node: Node, context: Context) -> Values:
    """Any result is possible, but none of what is unknown; a division may be by zero."""
    assert isinstance(node, (Arithmetic, Negative, Call))
    if isinstance(node, Call) and node.function == "known":
        return frozenset(value is not None for value in _outcomes(node.arguments[0], context))
    if isinstance(node, Arithmetic):
        operands: tuple[Node, ...] = (node.left, node.right)
    else:
        operands = node.arguments if isinstance(node, Call) else (node.operand,)
    found = [_outcomes(operand, context) for operand in operands]
    if _UNKNOWN in found:
        return _UNKNOWN
    may_fail = isinstance(node, Arithmetic) and node.operator == "/"
    return _ANYTHING if may_fail or any(None in values for values in found) else _NUMBER


def _choice(node: Node, context: Context) -> Values:
    assert isinstance(node, Choice)
    then, otherwise = _outcomes(node.then, context), _outcomes(node.otherwise, context)
    found: set[object] = set()
    for held in _outcomes(node.condition, context):
        if held is None:
            found |= {value for one in then for other in otherwise for value in _agreed(one, other)}
        else:
            found |= then if held else otherwise
    return frozenset(found)


def _agreed(one: object, other: object) -> Values:
    """Return what a choice can be when its condition is unknown: known only if both sides agree."""
    if one is None or other is None:
        return _UNKNOWN
    if one is _SOME or other is _SOME:
        return frozenset({other if one is _SOME else one, None})
    return frozenset({one}) if one == other else _UNKNOWN


_READERS: Mapping[type[Node], Callable[[Node, Context], Values]] = {
    Name: _name,
    Number: _literal,
    Text: _literal,
    Truth: _literal,
    Not: _not,
    And: _and,
    Or: _or,
    Compare: _compare,
    In: _in,
    Arithmetic: _calculation,
    Negative: _calculation,
    Choice: _choice,
    Call: _calculation,
}
