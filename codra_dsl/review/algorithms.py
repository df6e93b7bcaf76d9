"""What became of perception algorithms: what their functions get and give, guards, results, times."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import starmap

from codra_dsl.check import Types
from codra_dsl.check.checked import CheckedAlgorithm
from codra_dsl.check.possible import known
from codra_dsl.diagnostics import Place
from codra_dsl.expression import Node, names_in, reads_of, spelt_out
from codra_dsl.model import (
    Access,
    Algorithm,
    Condition,
    Hysteresis,
    Identification,
    Kind,
    Literal,
    Members,
    ValueType,
    Variable,
)
from codra_dsl.review.changes import Category, Change
from codra_dsl.review.guards import Relation, either, equal, relation, same_choice, same_value
from codra_dsl.review.variables import described, lost_and_gained, same_measure
from codra_dsl.review.version import Pair, Side, seconds

_NUMERIC = (Kind.INT, Kind.FLOAT)

_GUARDS: Mapping[Relation, tuple[Category, str]] = {
    Relation.WEAKER: (Category.WEAKER, "holds more often"),
    Relation.STRONGER: (Category.STRONGER, "holds less often"),
    Relation.OTHER: (Category.GUARD_CHANGED, "holds in other situations"),
}


def algorithm_changes(pair: Pair) -> Iterator[Change]:
    """Yield what became of each algorithm that observers run in both versions, or that took the place of another."""
    for name, successor in pair.algorithms.items():
        yield from _Comparison(pair, pair.old.algorithms[name], pair.new.algorithms[successor]).changes()
    yield from _successions(pair)


def _successions(pair: Pair) -> Iterator[Change]:
    """Yield how the guards of algorithms differ from those whose place they took altogether."""
    told: dict[tuple[str, str], None] = {}
    for variable, before in pair.old.producers.items():
        after = pair.new.producers.get(variable, ())
        kept = {pair.algorithms.get(name) for name in before} & set(after)
        if after and not kept:
            told[before[0], after[0]] = None
    for old, new in told:
        yield from _Comparison(pair, pair.old.algorithms[old], pair.new.algorithms[new]).observability()


class _Comparison:
    """The comparison of an algorithm in A with one in B."""

    def __init__(self, pair: Pair, old: CheckedAlgorithm, new: CheckedAlgorithm) -> None:
        self._pair = pair
        self._sides = pair.old, pair.new
        self._old, self._new = old.algorithm, new.algorithm
        self._checked = old, new

    def changes(self) -> Iterator[Change]:
        """Yield all that is another."""
        if self._old.name != self._new.name:
            yield self._change(Category.RENAMED, "name", "has another name", self._old.name, self._new.name)
        if self._old.call == self._new.call:
            yield from self._arguments()
            yield from self._results()
        else:
            message = "another function is called"
            yield self._change(Category.PERCEIVED_OTHERWISE, "call", message, self._old.call, self._new.call)
        yield from self._execution()
        yield from self.observability()
        yield from self._acceptance()
        yield from self._identification()
        yield from self._waiting()

    def _change(
        self,
        category: Category,
        key: str,
        message: str,
        *told: str | None,
        places: tuple[Place, Place] | None = None,
    ) -> Change:
        was, now = told or (None, None)
        before, after = places or (_at(self._old, key), _at(self._new, key))
        return Change(
            category=category,
            element=self._pair.new.id("perception", self._new.name),
            key=key,
            message=message,
            was=was,
            now=now,
            before=before,
            after=after,
        )

    # What the function gets and gives

    def _arguments(self) -> Iterator[Change]:
        old, new = dict(self._old.parameters), dict(self._new.parameters)
        kinds = ({name: _kind(value) for name, value in each.items()} for each in (old, new))
        before, after = kinds
        if before != after:
            yield self._contract("with", before, after)
        elif old != new:
            changed = [name for name in old if old[name] != new[name]]
            was, now = (", ".join(f"{name}: {each[name]!r}" for name in changed) for each in (old, new))
            yield self._change(Category.PERCEIVED_OTHERWISE, "with", "gets another value", was, now)
        for key, read in _ARGUMENTS.items():
            one, other = read(self._old), read(self._new)
            if set(one) != set(other):
                yield self._contract(key, dict.fromkeys(one, ""), dict.fromkeys(other, ""))

    def _contract(self, key: str, old: Mapping[str, str], new: Mapping[str, str]) -> Change:
        was, now = (_listed(f"{name} {kind}".rstrip() for name, kind in each.items()) for each in (old, new))
        return self._change(Category.CONTRACT, key, f"the function gets other arguments by '{key}'", was, now)

    def _results(self) -> Iterator[Change]:
        old, new = ({each.name: each for each in algorithm.returns} for algorithm in (self._old, self._new))
        for name in dict.fromkeys((*old, *new)):
            one, other = old.get(name), new.get(name)
            was, now = (None if each is None else _told(each.type, optional=each.optional) for each in (one, other))
            if one is None or other is None:
                eased = other is not None and other.optional
                category = Category.EASED if eased else Category.CONTRACT
                message = (
                    f"may now return '{name}'" if eased else f"must {'no longer' if one else 'now'} return '{name}'"
                )
            else:
                category, message = _given_otherwise(one.type, other.type, one.optional, other.optional, name)
            if message:
                places = (one.place if one else self._old.place, other.place if other else self._new.place)
                yield self._change(category, f"returns.{name}", message, was, now, places=places)

    def _execution(self) -> Iterator[Change]:
        old, new = self._old, self._new
        if old.isolate is not new.isolate:
            yield self._change(Category.PERCEIVED_OTHERWISE, "isolate", "runs elsewhere", old.isolate, new.isolate)
        if old.timeout_s != new.timeout_s:
            longer = new.timeout_s > old.timeout_s
            category = Category.SLOWER if longer else Category.STRONGER
            message = f"'timeout' is {'longer' if longer else 'shorter'}"
            yield self._change(category, "timeout", message, seconds(old.timeout_s), seconds(new.timeout_s))
        if old.min_interval_s != new.min_interval_s:
            longer = new.min_interval_s > old.min_interval_s
            category = Category.SLOWER if longer else Category.FASTER
            message = f"'min_interval' is {'longer' if longer else 'shorter'}"
            yield self._change(
                category, "min_interval", message, seconds(old.min_interval_s), seconds(new.min_interval_s)
            )

    # Guards

    def observability(self) -> Iterator[Change]:
        """Yield what became of `observable_when` and `given` together."""
        before, after = (dict(_seen(side.variables.values())) for side in self._sides)
        guards = [[*_items(each.observable_when), *_given(each)] for each in (self._old, self._new)]
        yield from self._guard("observable_when", guards, either(before, after))

    def _acceptance(self) -> Iterator[Change]:
        guards = [_items(each.accept_when) for each in (self._old, self._new)]
        yield from self._guard("accept_when", guards, either(_returned(self._old), _returned(self._new)))

    def _guard(self, key: str, guards: Sequence[Sequence[_Item]], types: Types) -> Iterator[Change]:
        old, new = guards
        decided = relation([each.tree for each in old], [each.tree for each in new], types)
        if decided is not Relation.SAME:
            category, message = _GUARDS[decided]
            strange = _strange(old, new, types), _strange(new, old, types)
            was, now = (" and ".join(f"'{each.text}'" for each in side) or "no such condition" for side in strange)
            before, after = (
                next((each.place for each in side if each.place is not None), _at(algorithm, key))
                for side, algorithm in zip(strange, (self._old, self._new), strict=True)
            )
            yield self._change(category, key, f"'{key}' {message}", was, now, places=(before, after))

    # What a result means

    def _identification(self) -> Iterator[Change]:
        old, new = ({each.variable.name: each for each in one.identifies} for one in (self._old, self._new))
        for name in old:
            if name in new and name in self._pair.old.variables and name in self._pair.new.variables:
                yield from self._identified(old[name], new[name])

    def _identified(self, old: Identification, new: Identification) -> Iterator[Change]:
        places = old.variable.place, new.variable.place
        key = f"identifies.{old.variable.name}"
        if not self._means_the_same(old, new):
            was, now = _said(old), _said(new)
            message = f"'{old.variable.name}' follows otherwise from the result"
            yield self._change(Category.REDEFINED, key, message, was, now, places=places)
        before, after = _confirmed(old), _confirmed(new)
        if before != after:
            category, message = _confirmation(before, after)
            was, now = (f"{count} of {total}" for count, total in (before, after))
            yield self._change(category, key, message, was, now, places=places)

    def _means_the_same(self, old: Identification, new: Identification) -> bool:
        name = old.variable.name
        variables = self._pair.old.variables[name], self._pair.new.variables[name]
        if variables[0].type.kind is not variables[1].type.kind:
            return True  # told as another type
        before, after = _returned(self._old), _returned(self._new)
        types = either(before, after)
        if any(types[name] is None for name in before.keys() & after.keys()):
            return _said(old) == _said(new)
        return _same_meaning(old, new, types, variables[0].type.kind)

    # Time

    def _waiting(self) -> Iterator[Change]:
        """Yield whether it waits for what takes longer than what it waited for, by the times of one version."""
        needs = [set(each.waits_for) for each in self._checked]
        was_s, now_s = _longest(needs[0], self._pair.new, self._pair.old), _longest(needs[1], self._pair.new)
        if now_s > was_s:
            named = _listed(f"'{each}'" for each in sorted(needs[1] - needs[0]))
            message = f"waits for {named}, which takes longer"
            yield self._change(Category.SLOWER, "observable_when", message, seconds(was_s), seconds(now_s))
        was_s, now_s = _longest(needs[0], self._pair.old), _longest(needs[1], self._pair.old, self._pair.new)
        if now_s < was_s:
            named = _listed(f"'{each}'" for each in sorted(needs[0] - needs[1]))
            message = f"no longer waits for {named}"
            yield self._change(Category.FASTER, "observable_when", message, seconds(was_s), seconds(now_s))


_ARGUMENTS: Mapping[str, Callable[[Algorithm], tuple[str, ...]]] = {
    "given": lambda each: tuple(reference.name for reference in each.given),
    "uses": lambda each: tuple(use.resource.name for use in each.uses if use.access is Access.READ),
}
"""The names of arguments by the key that gives them."""


def _at(algorithm: Algorithm, key: str) -> Place:
    return algorithm.places.get(key, algorithm.place)


def _returned(algorithm: Algorithm) -> dict[str, ValueType]:
    return {each.name: each.type for each in algorithm.returns}


def _kind(value: Literal) -> str:
    return type(value).__name__


def _listed(names: Iterable[str]) -> str:
    return ", ".join(names) or "none"


def _told(declared: ValueType, *, optional: bool) -> str:
    return f"{described(declared)}{', optional' if optional else ''}"


def _given_otherwise(
    old: ValueType, new: ValueType, was_optional: bool, is_optional: bool, name: str
) -> tuple[Category, str]:
    """Return the category of a returned value's change, and what it means: nothing where there is none."""
    if not same_measure(old, new):
        return Category.CONTRACT, f"must return '{name}' as something else"
    lost, gained = lost_and_gained(old, new)
    if lost or (was_optional and not is_optional):
        return Category.CONTRACT, f"may return less as '{name}'"
    eased = gained or is_optional is not was_optional
    return Category.EASED, f"may return more as '{name}'" if eased else ""


@dataclass(frozen=True, slots=True)
class _Item:
    """One condition of a guard; those that `given` makes have no place of their own."""

    tree: Node
    text: str
    place: Place | None


def _items(conditions: Iterable[Condition]) -> list[_Item]:
    return [_Item(_tree(each), each.text, each.place) for each in conditions]


def _given(algorithm: Algorithm) -> list[_Item]:
    return [_Item(known(each.name), f"known({each.name})", None) for each in algorithm.given]


def _tree(condition: Condition) -> Node:
    assert condition.tree is not None  # of a checked spec
    return spelt_out(condition.tree)


def _seen(variables: Iterable[Variable]) -> Iterator[tuple[str, ValueType]]:
    """Yield the type of each variable, and of what is asked of poses for those that follow from them."""
    for variable in variables:
        yield variable.name, variable.type
        for name in () if variable.posed is None else names_in(variable.posed.tree):
            yield name.name, _LENGTH if reads_of(name.name)[0] == "distance" else ValueType(kind=Kind.BOOL)


_LENGTH = ValueType(kind=Kind.FLOAT, unit="m", range=(0.0, math.inf))


def _strange(guard: Sequence[_Item], other: Sequence[_Item], types: Types) -> list[_Item]:
    """Return the conditions of a guard that another has not."""
    return [each for each in guard if not any(equal(each.tree, theirs.tree, types) for theirs in other)]


def _said(entry: Identification) -> str:
    by = entry.by
    if isinstance(by, Members):
        return "; ".join(f"{member.name}: {condition.text}" for member, condition in by.cases)
    if isinstance(by, Hysteresis):
        leave = "" if by.leave is None else f"; leave: {by.leave.text}"
        return f"enter: {by.enter.text}{leave}"
    return f"'{by.text}'"


def _confirmed(entry: Identification) -> tuple[int, int]:
    by = entry.by
    return by.confirm if isinstance(by, Hysteresis) and by.confirm is not None else (1, 1)


def _confirmation(before: tuple[int, int], after: tuple[int, int]) -> tuple[Category, str]:
    (count, total), (new_count, new_total) = before, after
    if new_count <= count and (new_count == 1 or new_total >= total):
        return Category.WEAKER, "is confirmed by fewer looks"
    if new_count >= count and (count == 1 or new_total <= total):
        return Category.STRONGER, "needs more looks to be confirmed"
    return Category.GUARD_CHANGED, "is confirmed by another rule"


def _same_meaning(old: Identification, new: Identification, types: Types, kind: Kind) -> bool:
    one, other = old.by, new.by
    if isinstance(one, Members) and isinstance(other, Members):
        before, after = ([(member.name, _tree(condition)) for member, condition in by.cases] for by in (one, other))
        return same_choice(before, after, types)
    parts = _parts(one), _parts(other)
    same = equal if kind is Kind.BOOL else same_value
    return len(parts[0]) == len(parts[1]) > 0 and all(starmap(partial(same, types=types), zip(*parts, strict=True)))


def _parts(by: Condition | Members | Hysteresis) -> tuple[Node, ...]:
    if isinstance(by, Members):
        return ()
    conditions = (by,) if isinstance(by, Condition) else (by.enter, by.leave)
    return tuple(_tree(each) for each in conditions if each is not None)


def _longest(names: Iterable[str], side: Side, otherwise: Side | None = None) -> float:
    """Return the longest time that one of some variables takes; those that a side lacks take that of the other."""
    missing = {} if otherwise is None else otherwise.worst_s
    return max((side.worst_s.get(name, missing.get(name, 0.0)) for name in names), default=0.0)
