"""How two guards relate: the same, weaker, stronger, or neither.

A guard is a list of conditions that must all be certainly true. It is implied by another where it is true in every case
in which the other is: bools and enums are tried with each value and with unknown, numbers on each side of every bound
and on the bound. What counts as one number that may be anything gives more cases than there are, never fewer, so that
an implication which is found is one; what cannot be decided within MAX_WORK is none.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from fractions import Fraction
from itertools import chain, pairwise, product

from codra_dsl.model import Kind, ValueType
from codra_dsl.review.terms import (
    Agree,
    Bound,
    Constant,
    Every,
    Form,
    Holds,
    Inverse,
    Is,
    Known,
    Opaque,
    Pick,
    Some,
    Sum,
    si_factor,
)

MAX_WORK = 200_000
"""How many values of the leaves of conditions are looked at to decide on one guard."""

_SOME = object()
"""Stands for a known value that nothing asks for."""


class Relation(StrEnum):
    """What became of a guard."""

    SAME = "same"
    WEAKER = "weaker"
    STRONGER = "stronger"
    OTHER = "other"


@dataclass(frozen=True, slots=True)
class Domain:
    """What a name can be, in both versions: in SI units where it is a number."""

    kind: Kind
    values: frozenset[str] = frozenset()
    low: Fraction | None = None
    high: Fraction | None = None
    whole: bool = False


Domains = Mapping[str, Domain]


def relation(old: Sequence[Form], new: Sequence[Form], domains: Domains) -> Relation:
    """Return what became of a guard, each given as conditions that must all be true."""
    before, after = _conjuncts(old), _conjuncts(new)
    if before == after:
        return Relation.SAME
    holds_after, held_before = implied(before, after, domains), implied(after, before, domains)
    if holds_after and held_before:
        return Relation.SAME
    if holds_after:
        return Relation.WEAKER
    return Relation.STRONGER if held_before else Relation.OTHER


def implied(premises: frozenset[Form], conclusions: frozenset[Form], domains: Domains) -> bool:
    """Return whether some conditions are certainly true wherever others are."""
    work = MAX_WORK // max(1, len(conclusions))
    return all(each in premises or _entailed(premises, each, domains, work) for each in sorted(conclusions, key=repr))


def equal(one: Form, other: Form, domains: Domains) -> bool:
    """Return whether two conditions have the same value, true, false or unknown, in every case."""
    if one == other:
        return True
    cases = _cases((one, other), domains)
    return cases is not None and all(_value(one, case) is _value(other, case) for case in cases)


def same_choice(one: Sequence[tuple[str, Form]], other: Sequence[tuple[str, Form]], domains: Domains) -> bool:
    """Return whether the first condition that holds always names the same member."""
    if tuple(one) == tuple(other):
        return True
    cases = _cases([form for _, form in chain(one, other)], domains)
    return cases is not None and all(_first(one, case) == _first(other, case) for case in cases)


def domain(old: ValueType | None, new: ValueType | None) -> Domain | None:
    """Return what a name can be in either version, or None where these have nothing in common."""
    one, other = old or new, new or old
    assert one is not None
    assert other is not None
    numeric = (Kind.INT, Kind.FLOAT)
    if one.kind in numeric and other.kind in numeric:
        return _numbers(one, other)
    if {one.kind, other.kind} <= {Kind.STR, Kind.ENUM} and one.kind is not other.kind:
        return Domain(Kind.STR)
    return Domain(one.kind, frozenset(one.values) | frozenset(other.values)) if one.kind is other.kind else None


def _numbers(one: ValueType, other: ValueType) -> Domain:
    ranges = [_in_si(each) for each in (one, other)]
    lows, highs = [low for low, _ in ranges], [high for _, high in ranges]
    whole = all(each.kind is Kind.INT and si_factor(each.unit) == 1 for each in (one, other))
    low = None if None in lows else min(each for each in lows if each is not None)
    high = None if None in highs else max(each for each in highs if each is not None)
    return Domain(Kind.FLOAT, low=low, high=high, whole=whole)


def _in_si(declared: ValueType) -> tuple[Fraction | None, Fraction | None]:
    factor = si_factor(declared.unit)
    if declared.range is None:
        return None, None
    low, high = (None if math.isinf(end) else Fraction(repr(end)) * factor for end in declared.range)
    return low, high


def _conjuncts(guard: Iterable[Form]) -> frozenset[Form]:
    parts = chain.from_iterable(form.parts if isinstance(form, Every) else (form,) for form in guard)
    return frozenset(parts) - {Constant(True)}


def _entailed(premises: frozenset[Form], conclusion: Form, domains: Domains, work: int) -> bool:
    """Return whether a condition follows from those premises that have anything to do with it."""
    for chosen in _related(premises, conclusion):
        cases = _cases((*chosen, conclusion), domains, work)
        if cases is not None:
            held = (case for case in cases if all(_value(premise, case) is True for premise in chosen))
            return all(_value(conclusion, case) is True for case in held)
    return False


def _related(premises: frozenset[Form], conclusion: Form) -> Iterator[Sequence[Form]]:
    """Yield premises that share names with a condition, be it through others; then those that share them directly."""
    named = {premise: names_of(premise) for premise in sorted(premises, key=repr)}
    direct = [premise for premise, names in named.items() if names & names_of(conclusion)]
    reached = names_of(conclusion)
    grown = True
    while grown:
        wider = reached.union(*(names for names in named.values() if names & reached))
        grown, reached = wider != reached, wider
    yield [premise for premise, names in named.items() if names & reached or not names]
    yield direct


def base_names(forms: Iterable[Form]) -> set[str]:
    """Return every name that some conditions read."""
    return set(_base_names(chain.from_iterable(map(_leaves, forms))))


def names_of(form: Form) -> frozenset[str]:
    """Return the names that a condition depends on, and the keys of what it does not look into."""
    return frozenset(chain.from_iterable(_leaf_names(leaf) for leaf in _leaves(form)))


def _leaves(form: Form) -> Iterator[Form]:
    match form:
        case Every(parts) | Some(parts):
            yield from chain.from_iterable(map(_leaves, parts))
        case Pick(condition, then, otherwise):
            yield from chain.from_iterable(map(_leaves, (condition, then, otherwise)))
        case Agree(sides):
            yield from chain.from_iterable(map(_leaves, sides))
        case Inverse(inner):
            yield inner
        case _:
            yield form


def _leaf_names(leaf: Form) -> Iterator[str]:
    match leaf:
        case Holds(name) | Known(name) | Is(name):
            yield name
        case Bound(total):
            yield from total.names
            yield from (symbol.key for symbol, _ in total.parts if not symbol.names)
        case Opaque(key, names):
            yield from names or (key,)


# Cases


@dataclass(frozen=True, slots=True)
class _Case:
    """One way that things can be: the value of each name (None where unknown), sum and opaque truth."""

    names: Mapping[str, object]
    rest: Mapping[object, object]


def _cases(forms: Iterable[Form], domains: Domains, work: int = MAX_WORK) -> Iterator[_Case] | None:
    """Return every case that matters to some conditions, or None where looking at them is too much work."""
    mentioned = list(chain.from_iterable(map(_leaves, forms)))
    leaves = sorted(set(mentioned), key=repr)
    choices = {name: _values(name, leaves, domains) for name in _base_names(leaves)}
    rest: dict[object, tuple[object, ...]] = {}
    for leaf in leaves:
        if isinstance(leaf, Opaque):
            rest[leaf.key] = (True, False, None) if leaf.may_fail else (True, False)
    for total, limits in _limits(leaves).items():
        rest[total] = _samples(total, limits, domains)
    count = math.prod(len(values) for values in (*choices.values(), *rest.values()))
    return _combined(choices, rest) if count * len(mentioned) <= work else None


def _combined(choices: Mapping[str, Sequence[object]], rest: Mapping[object, Sequence[object]]) -> Iterator[_Case]:
    for chosen in product(*choices.values()):
        names = dict(zip(choices, chosen, strict=True))
        unknown = {name for name, value in names.items() if value is None}
        open_ = {
            key: (None,) if isinstance(key, Sum) and key.names & unknown else values for key, values in rest.items()
        }
        for others in product(*open_.values()):
            yield _Case(names, dict(zip(open_, others, strict=True)))


def _base_names(leaves: Iterable[Form]) -> Iterator[str]:
    found: dict[str, None] = {}
    for leaf in leaves:
        match leaf:
            case Holds(name) | Known(name) | Is(name):
                found[name] = None
            case Bound(total):
                found |= dict.fromkeys(sorted(total.names))
            case Opaque(_, names):
                found |= dict.fromkeys(sorted(names))
    yield from found


def _values(name: str, leaves: Iterable[Form], domains: Domains) -> tuple[object, ...]:
    found = domains[name]
    if found.kind is Kind.BOOL:
        return (True, False, None)
    if found.kind is Kind.FLOAT:
        return (_SOME, None)
    asked = {leaf.value for leaf in leaves if isinstance(leaf, Is) and leaf.name == name}
    if found.kind is Kind.ENUM:
        return (*sorted(found.values), None)
    return (*sorted(asked), _SOME, None)


def _limits(leaves: Iterable[Form]) -> Mapping[Sum, set[Fraction]]:
    found: dict[Sum, set[Fraction]] = {}
    for leaf in leaves:
        if isinstance(leaf, Bound):
            found.setdefault(leaf.total, set()).add(leaf.limit)
    return found


def _samples(total: Sum, limits: set[Fraction], domains: Domains) -> tuple[object, ...]:
    """Return a value on each limit, between each two, and beyond: all that matters of a number."""
    low, high, whole = _extent(total, domains)
    ends = sorted(limits | {end for end in (low, high) if end is not None})
    around = [ends[0] - 1, *ends, ends[-1] + 1]
    found: list[Fraction] = []
    for one, other in pairwise(around):
        between = Fraction(math.floor(one) + 1) if whole else (one + other) / 2
        found += [one, *([between] if one < between < other else [])]
    found.append(around[-1])
    inside = [each for each in found if (low is None or each >= low) and (high is None or each <= high)]
    kept = [each for each in inside if not whole or each.denominator == 1] or inside
    return (*kept, None) if any(symbol.may_fail for symbol, _ in total.parts) else tuple(kept)


def _extent(total: Sum, domains: Domains) -> tuple[Fraction | None, Fraction | None, bool]:
    if not total.parts:
        return Fraction(0), Fraction(0), False
    if len(total.parts) == 1:
        symbol = total.parts[0][0]
        if symbol.key in domains:
            found = domains[symbol.key]
            return found.low, found.high, found.whole
        if symbol.key.startswith(("abs(", "age(")):
            return Fraction(0), None, False
    return None, None, False


# Values, in Kleene's logic


def _value(form: Form, case: _Case) -> object:
    match form:
        case Constant(value):
            return value
        case Holds(name):
            return case.names[name]
        case Inverse(Holds(name)):
            return _not(case.names[name])
        case Known(name, is_known):
            return (case.names[name] is not None) is is_known
        case Is(name, value, is_equal):
            held = case.names[name]
            return None if held is None else (held == value) is is_equal
        case Bound(total, operator, limit):
            number = case.rest[total]
            return None if number is None else _compared(number, operator, limit)
        case Opaque(key, names, _, negated):
            unknown = any(case.names[name] is None for name in names)
            truth = None if unknown else case.rest[key]
            return _not(truth) if negated else truth
        case Every(parts):
            return _kleene(parts, case, decisive=False)
        case Some(parts):
            return _kleene(parts, case, decisive=True)
        case Pick(condition, then, otherwise):
            return _picked(condition, then, otherwise, case)
        case Agree((one, other), is_equal):
            values = _value(one, case), _value(other, case)
            return None if None in values else (values[0] is values[1]) is is_equal


def _not(value: object) -> object:
    return None if value is None else not value


def _kleene(parts: Iterable[Form], case: _Case, *, decisive: bool) -> object:
    found = {_value(part, case) for part in parts}
    return decisive if decisive in found else None if None in found else not decisive


def _compared(number: object, operator: str, limit: Fraction) -> bool:
    assert isinstance(number, Fraction)
    match operator:
        case "<":
            return number < limit
        case "<=":
            return number <= limit
        case ">":
            return number > limit
        case ">=":
            return number >= limit
        case "==":
            return number == limit
    return number != limit


def _picked(condition: Form, then: Form, otherwise: Form, case: _Case) -> object:
    held = _value(condition, case)
    if held is not None:
        return _value(then if held else otherwise, case)
    one, other = _value(then, case), _value(otherwise, case)
    return one if one is other else None


def _first(cases: Sequence[tuple[str, Form]], case: _Case) -> str | None:
    for member, form in cases:
        held = _value(form, case)
        if held is not False:
            return member if held else None
    return None
