"""Changes of perception algorithms: their functions, guards and identified variables, and the time that they wait."""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace
from functools import partial
from itertools import starmap
from typing import Any

from codra_dsl.language.check import Types
from codra_dsl.language.check.solver.satisfiable import known
from codra_dsl.language.expression import Node, names_in, reads_of, spelt_out
from codra_dsl.language.model import (
    Access,
    Algorithm,
    Condition,
    Hysteresis,
    Identification,
    Kind,
    Literal,
    Members,
    Reference,
    Returned,
    Usage,
    ValueType,
)
from codra_dsl.tooling.diff.changes import Category, Change
from codra_dsl.tooling.diff.comparers import guard, hidden, inline, ordered, quoted
from codra_dsl.tooling.diff.guards import either, equal, same_choice, same_value
from codra_dsl.tooling.diff.version import Pair, Side, seconds
from codra_dsl.tooling.diff.walk import Scope, Wording, differs, entries, text_of

_LENGTH = ValueType(kind=Kind.FLOAT, unit="m", range=(0.0, math.inf))
_VALUES = differs(Category.PERCEIVED_OTHERWISE, "gets another value", value=frozenset)
_OPTIONAL = ordered((Category.EASED, "is optional now"), (Category.CONTRACT, "is no longer optional"), hidden)
_OF_FUNCTION = frozenset({"parameters", "given", "returns", "uses"})


def algorithms(scope: Scope, *_: Any) -> Iterator[Change]:
    """Yield the changes of each algorithm that observers run in both versions.

    For an algorithm that took the place of another one, yield only the changes of its observability preconditions.
    """
    for name, new_name in scope.pair.algorithms.items():
        inner = _scope(scope, name, new_name)
        old, new = inner.values
        yield from inner.changes(skip=_OF_FUNCTION if old.call != new.call else frozenset())
        yield from _waiting(inner, name, new_name)
    for name, new_name in _successions(scope.pair):
        yield from observability(_scope(scope, name, new_name), "observable_when")


def _scope(scope: Scope, name: str, new_name: str) -> Scope:
    old, new = scope.pair.old.algorithms[name], scope.pair.new.algorithms[new_name]
    return scope.element("perception", new_name, old.algorithm, new.algorithm)


def _successions(pair: Pair) -> Iterable[tuple[str, str]]:
    """Return the first algorithm in A and the first one in B of each variable that has lost all its algorithms of A."""
    replaced: dict[tuple[str, str], None] = {}
    for variable, before in pair.old.producers.items():
        after = pair.new.producers.get(variable, ())
        if after and not {pair.algorithms.get(name) for name in before} & {*after}:
            replaced[before[0], after[0]] = None
    return replaced


# Arguments of the function


def literals(scope: Scope, key: str, old: Sequence[tuple[str, Literal]], new: Any) -> Iterator[Change]:
    """Yield a change if the function gets other literals."""
    before, after = ([f"{name} {type(value).__name__}" for name, value in side] for side in (old, new))
    yield from _arguments(scope, key, before, after)
    if {*before} == {*after}:
        yield from _VALUES(scope, key, old, new)


def given(scope: Scope, key: str, old: Sequence[Reference], new: Sequence[Reference]) -> Iterator[Change]:
    """Yield a change if the function gets the values of other variables."""
    yield from _arguments(scope, key, [*map(text_of, old)], [*map(text_of, new)])


def usages(scope: Scope, key: str, old: Sequence[Usage], new: Sequence[Usage]) -> Iterator[Change]:
    """Yield a change if the function gets other handles, and the changes of how it uses resources."""
    before, after = ([use.resource.name for use in side if use.access is Access.READ] for side in (old, new))
    yield from _arguments(scope, key, before, after)
    yield from entries("")(scope, key, old, new)


def _arguments(scope: Scope, key: str, old: list[str], new: list[str]) -> Iterator[Change]:
    if {*old} != {*new}:
        message = f"the function gets other arguments from '{key}'"
        yield scope.change(Category.CONTRACT, key, message, ", ".join(old) or "none", ", ".join(new) or "none")


def result(new: Returned | None) -> Wording:
    """Return the category and message for a result that only one version has."""
    if new is None:
        return Category.CONTRACT, "must no longer return '{}'"
    return (Category.EASED, "may now return '{}'") if new.optional else (Category.CONTRACT, "must now return '{}'")


def optional(scope: Scope, _: str, old: bool, new: bool) -> Iterator[Change]:
    """Yield a change if a result may now be absent, or may no longer be absent. It is reported at the result itself."""
    yield from _OPTIONAL(scope, "", old, new)


# Guards


def observability(scope: Scope, key: str, *_: Any) -> Iterator[Change]:
    """Yield a change if the guard that `observable_when` and `given` form together has changed."""
    guards = ([*_spelt_out(algorithm.observable_when), *_given(algorithm)] for algorithm in scope.values)
    yield from guard(_context_types)(scope, key, *guards)


def _context_types(scope: Scope, _: object) -> Types:
    return either(*(dict(_read(side)) for side in scope.pair.sides))


def returned_types(scope: Scope, _: object) -> Types:
    """Return the types of the values that an algorithm returns in either version."""
    return either(*map(_returned, scope.elements))


def _spelt_out(conditions: Iterable[Condition]) -> Iterator[Condition]:
    """Yield conditions with the comparisons of poses in place of the names of their variables."""
    for condition in conditions:
        yield replace(condition, tree=None if condition.tree is None else spelt_out(condition.tree))


def _given(algorithm: Algorithm) -> Iterator[Condition]:
    for reference in algorithm.given:
        yield Condition(text=f"known({reference.name})", tree=known(reference.name), place=reference.place)


def _read(side: Side) -> Iterator[tuple[str, ValueType]]:
    """Yield the name and type of each variable, and of each function of poses that occurs in a pose condition."""
    for variable in side.variables.values():
        yield variable.name, variable.type
        for name in () if variable.pose_condition is None else names_in(variable.pose_condition.tree):
            yield name.name, _LENGTH if reads_of(name.name)[0] == "distance" else ValueType(kind=Kind.BOOL)


def _returned(algorithm: Algorithm) -> dict[str, ValueType]:
    return {returned.name: returned.type for returned in algorithm.returns}


# Identified variables


def identified(scope: Scope, _: str, *by: Any) -> Iterator[Change]:
    """Yield a change if the value of a variable is computed in another way, and one if it is confirmed otherwise."""
    old, new = scope.values
    if old.variable.name in scope.pair.one_sided:
        return
    if not _same_identification(scope, old, new):
        yield scope.change(Category.REDEFINED, "", "the value is computed in another way", _text(old), _text(new))
    before, after = map(_confirmed, by)
    if before != after:
        category, message = _confirmation(before, after)
        yield scope.change(category, "", message, *(f"{count} of {total}" for count, total in (before, after)))
    yield from inline(scope, "", *by)


def _same_identification(scope: Scope, old: Identification, new: Identification) -> bool:
    kinds = [side.variables[old.variable.name].type.kind for side in scope.pair.sides]
    if kinds[0] is not kinds[1]:
        return True  # the variable is reported as retyped
    before, after = map(_returned, scope.elements)
    types = either(before, after)
    if any(types[name] is None for name in before.keys() & after.keys()):
        return _text(old) == _text(new)
    return _same_value(old.by, new.by, types, kinds[0])


def _same_value(
    old: Condition | Members | Hysteresis, new: Condition | Members | Hysteresis, types: Types, kind: Kind
) -> bool:
    if isinstance(old, Members) and isinstance(new, Members):
        chosen, now = ([(member.name, _tree(case)) for member, case in by.cases] for by in (old, new))
        return same_choice(chosen, now, types)
    before, after = _parts(old), _parts(new)
    same = partial(equal if kind is Kind.BOOL else same_value, types=types)
    return len(before) == len(after) > 0 and all(starmap(same, zip(before, after, strict=True)))


def _parts(by: Condition | Members | Hysteresis) -> tuple[Node, ...]:
    if isinstance(by, Members):
        return ()
    conditions = (by,) if isinstance(by, Condition) else (by.enter, by.leave)
    return tuple(_tree(condition) for condition in conditions if condition is not None)


def _tree(condition: Condition) -> Node:
    assert condition.tree is not None  # the spec is checked
    return spelt_out(condition.tree)


def _text(entry: Identification) -> str:
    by = entry.by
    if isinstance(by, Members):
        return "; ".join(f"{member.name}: {condition.text}" for member, condition in by.cases)
    if isinstance(by, Hysteresis):
        leave = "" if by.leave is None else f"; leave: {by.leave.text}"
        return f"enter: {by.enter.text}{leave}"
    return f"'{by.text}'"


def _confirmed(by: object) -> tuple[int, int]:
    return (by.confirm if isinstance(by, Hysteresis) else None) or (1, 1)


def _confirmation(before: tuple[int, int], after: tuple[int, int]) -> Wording:
    (count, total), (new_count, new_total) = before, after
    if new_count <= count and (new_count == 1 or new_total >= total):
        return Category.WEAKER, "is confirmed by fewer looks"
    if new_count >= count and (count == 1 or new_total <= total):
        return Category.STRONGER, "needs more looks to be confirmed"
    return Category.GUARD_CHANGED, "is confirmed by another rule"


# Time


def _waiting(scope: Scope, name: str, new_name: str) -> Iterator[Change]:
    """Yield a change if an algorithm waits for variables that take longer, or less long, than those before.

    To leave out changes of the variables' own times, both times are taken from one version: from B if the wait becomes
    longer, from A if it becomes shorter.
    """
    old, new = scope.pair.sides
    before, after = {*old.algorithms[name].waits_for}, {*new.algorithms[new_name].waits_for}
    was_s, now_s = _longest(before, new, old), _longest(after, new)
    if now_s > was_s:
        message = f"waits for {quoted(after - before) or 'none'}, which takes longer"
        yield scope.change(Category.SLOWER, "observable_when", message, seconds(was_s), seconds(now_s))
    was_s, now_s = _longest(before, old), _longest(after, old, new)
    if now_s < was_s:
        message = f"no longer waits for {quoted(before - after) or 'none'}"
        yield scope.change(Category.FASTER, "observable_when", message, seconds(was_s), seconds(now_s))


def _longest(names: Iterable[str], side: Side, other: Side | None = None) -> float:
    """Return the longest worst-case time of some variables in one version.

    For a variable that this version does not have, the time of the other version counts.
    """
    missing = {} if other is None else other.worst_s
    return max((side.worst_s.get(name, missing.get(name, 0.0)) for name in names), default=0.0)
