"""How long it takes, at worst, from declaring a context-variable until it is known.

The main execution declares one variable; nothing runs and nothing is known that observers identify. What is bounded is
the time until the variable is known, provided that conditions hold as soon as what they wait for is known and go on to
hold, that every look brings an accepted result within its `timeout`, and all the same one, and that nobody else takes
slots: neither the main execution, nor another decision, nor a look at what is known already. `docs/reference/graph.md`
explains it to users.

Observers that start are due at once, and what becomes known wakes its readers within the same instant, so that periods
add nothing. All time is spent in looks and in waiting for one. Follow the looks that held a variable up, back from
itself: a path. While a look on it waits, either a rival (an algorithm that shares a variable) is at work, or all slots
of a resource are taken, by looks that are not on the path. Each algorithm looks once, or as often as `confirm` needs,
which counts as one look with its pauses. So the bound is, over all paths, the largest sum of the timeouts on the path
and of what the others can hold it up (R. L. Graham's bound for list scheduling), which holds for every order of
priorities and for looks that take any shorter time.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from graphlib import TopologicalSorter
from itertools import pairwise

from codra_dsl import graph
from codra_dsl.check.checked import CheckedAlgorithm, CheckedSpec
from codra_dsl.model import DEFAULT_PERIOD_S, Access, Spec, needed_of

MAX_STEPS = 100_000
"""Looks visited where slots are contended; beyond, the bound is the sum of all timeouts, which is never too small."""

MAX_PATHS = 16
"""Paths told apart by the resources they hold, for each look; beyond, the longest is taken to hold them all."""

_DIGITS = 9


def worst_cases(checked: CheckedSpec) -> Mapping[str, float]:
    """Return the seconds from declared to known, at worst, for each variable that an algorithm identifies."""
    looks = {name: _look(checked.spec, each) for name, each in checked.algorithms.items()}
    return _WorstCases(looks, checked.spec, checked.producers).of_variables()


@dataclass(frozen=True, slots=True)
class _Look:
    """One run of an algorithm, or as many as it needs to confirm what it sees.

    Attributes:
        waits_for: what must be known before it can run.
        needs: what it reads, so that the observers of these run as well.
        timeout_s: what it takes at most, with the pauses between runs where it needs several.
        needed: how many runs.
    """

    identifies: tuple[str, ...]
    waits_for: tuple[str, ...]
    needs: tuple[str, ...]
    timeout_s: float
    slots: tuple[str, ...]
    needed: int


def _look(spec: Spec, checked: CheckedAlgorithm) -> _Look:
    algorithm = checked.algorithm
    identifies = tuple(dict.fromkeys(variable for variable, _ in checked.identifies))
    needed = max((needed_of(entry) for entry in algorithm.identifies), default=1)
    timeout_s = algorithm.timeout_s
    if needed > 1:
        periods = [each.period_s for each in spec.observers if {one.name for one in each.identifies} & {*identifies}]
        pause_s = max(algorithm.min_interval_s, timeout_s, *(periods or [DEFAULT_PERIOD_S]))
        timeout_s += (needed - 1) * pause_s
    slots = (usage.resource.name for usage in algorithm.uses if usage.access is Access.SLOT)
    return _Look(
        identifies=identifies,
        waits_for=tuple(dict.fromkeys(checked.waits_for)),
        needs=tuple(dict.fromkeys(checked.needs)),
        timeout_s=timeout_s,
        slots=tuple(dict.fromkeys(slots)),
        needed=needed,
    )


@dataclass(frozen=True, slots=True)
class _Crowd:
    """Looks that can hold each other up.

    Attributes:
        capacity: how many of them run while another waits.
        total_s: of their timeouts.
    """

    members: tuple[str, ...]
    capacity: int
    total_s: float

    @property
    def share(self) -> float:
        """Return which part of a look's time comes on top of `delay_s` where the look is on the path."""
        return 1 - 1 / self.capacity

    @property
    def delay_s(self) -> float:
        """Return what the crowd adds to a path that goes through it."""
        return self.total_s / self.capacity


_Paths = dict[frozenset[int], float]
"""The longest time spent on a path outside the crowds that it meets, by these crowds."""

_Names = tuple[str, ...]


class _WorstCases:
    """The computation for one spec."""

    def __init__(self, looks: Mapping[str, _Look], spec: Spec, producers: Mapping[str, Sequence[str]]) -> None:
        self._looks = looks
        self._producers = producers
        self._slots = {each.name: each.slots for each in spec.resources if each.slots is not None}
        self._rivals = _connected(looks, producers.values())
        named = [self._producers_of(each.name for each in one.identifies) for one in spec.observers]
        self._observer_of = _connected(looks, [*self._rivals.values(), *named])
        self._started_with = {
            name: (*self._producers_of(look.needs), *self._observer_of[name]) for name, look in looks.items()
        }
        self._before = {name: self._producers_of(look.waits_for) for name, look in looks.items()}
        self._parts = _in_order(self._before)
        self._position = {name: position for position, part in enumerate(self._parts) for name in part}
        self._everything = _Crowd(tuple(looks), 1, sum(look.timeout_s for look in looks.values()))
        self._steps = 0

    def of_variables(self) -> dict[str, float]:
        """Return the bound for each variable, observer by observer, since what runs is the same for all of one."""
        free, held_up = self._paths(self._parts, ()), self._held_up()
        bounds: dict[str, float] = {}
        for observer in dict.fromkeys(self._observer_of.values()):
            paths, crowds = (free, ()) if held_up.isdisjoint(observer) else self._crowded(observer)
            for variable in dict.fromkeys(each for name in observer for each in self._looks[name].identifies):
                found = (
                    _longest(paths[name], crowds) - self._spared_s(name, variable, crowds)
                    for name in self._producers[variable]
                )
                bounds[variable] = round(max(found), _DIGITS)
        return bounds

    def _producers_of(self, variables: Iterable[str]) -> _Names:
        return tuple(dict.fromkeys(name for each in variables for name in self._producers.get(each, ())))

    def _held_up(self) -> frozenset[str]:
        """Return the looks that run beside a crowd, or would if all observers ran."""
        starters: dict[str, list[str]] = {}
        for name, started in self._started_with.items():
            for each in started:
                starters.setdefault(each, []).append(name)
        crowded = sorted(name for crowd in self._crowds(self._looks) for name in crowd.members)
        return frozenset(graph.closure(starters, crowded))

    def _crowded(self, observer: _Names) -> tuple[Mapping[str, _Paths], Sequence[_Crowd]]:
        """Return the paths to the looks of an observer, with the crowds among all that runs for its sake."""
        if self._steps > MAX_STEPS:
            return {name: {frozenset({0}): 0.0} for name in observer}, [self._everything]
        running = graph.closure(self._started_with, observer)
        self._steps += len(running)
        crowds = self._crowds(running)
        positions = sorted({self._position[name] for name in running})
        return self._paths([self._parts[position] for position in positions], crowds), crowds

    def _crowds(self, running: Iterable[str]) -> Sequence[_Crowd]:
        """Return the looks that can hold each other up, if these run together."""
        users: dict[str, list[str]] = {}
        rivals: dict[_Names, list[str]] = {}
        for name in running:
            rivals.setdefault(self._rivals[name], []).append(name)
            for slot in self._looks[name].slots:
                users.setdefault(slot, []).append(name)
        limits = [(names, self._slots[slot]) for slot, names in users.items() if slot in self._slots]
        groups = [
            (names, many) for names, many in (*((each, 1) for each in rivals.values()), *limits) if len(names) > many
        ]
        members = _connected([name for names, _ in groups for name in names], [names for names, _ in groups])
        capacities: dict[_Names, list[int]] = {}
        for names, many in groups:
            capacities.setdefault(members[names[0]], []).append(many)
        return [
            _Crowd(crowd, found[0] if len(found) == 1 else 1, sum(self._looks[name].timeout_s for name in crowd))
            for crowd, found in capacities.items()
        ]

    def _spared_s(self, last: str, variable: str, crowds: Sequence[_Crowd]) -> float:
        """Return what a crowd does not add to a path: a rival of its last look, had it run, would have told as well."""
        rivals = [
            self._looks[name].timeout_s
            for name in self._rivals[last]
            if name != last and variable in self._looks[name].identifies and self._looks[name].needed == 1
        ]
        crowds_of_last = (crowd for crowd in (crowds if rivals else ()) if last in crowd.members)
        return sum(sum(rivals) / crowd.capacity for crowd in crowds_of_last)

    def _paths(self, parts: Iterable[_Names], crowds: Sequence[_Crowd]) -> dict[str, _Paths]:
        """Return, for each look, the paths that end with it.

        Looks that wait for each other, which alternatives make possible, are taken as one that takes the time of all.
        """
        crowd_of = {name: index for index, crowd in enumerate(crowds) for name in crowd.members}
        ends: dict[str, _Paths] = {}
        for part in parts:
            before = dict.fromkeys(name for member in part for name in self._before[member] if name not in part)
            reached = _merged(ends[name] for name in before) or {frozenset(): 0.0}
            met = frozenset(crowd_of[name] for name in part if name in crowd_of)
            spent_s = sum(
                self._looks[name].timeout_s * (crowds[crowd_of[name]].share if name in crowd_of else 1.0)
                for name in part
            )
            through = ({path | met: longest_s + spent_s} for path, longest_s in reached.items())
            paths = _fewer(_merged(through))
            ends |= dict.fromkeys(part, paths)
        return ends


def _longest(paths: _Paths, crowds: Sequence[_Crowd]) -> float:
    return max(spent_s + sum(crowds[each].delay_s for each in sorted(met)) for met, spent_s in paths.items())


def _merged(several: Iterable[_Paths]) -> _Paths:
    merged: _Paths = {}
    for paths in several:
        for met, spent_s in paths.items():
            merged[met] = max(spent_s, merged.get(met, 0.0))
    return merged


def _fewer(paths: _Paths) -> _Paths:
    """Return the paths without those that another one exceeds in every respect."""
    if len(paths) > MAX_PATHS:
        return {frozenset().union(*paths): max(paths.values())}
    return {
        met: spent_s
        for met, spent_s in paths.items()
        if not any(met < other and spent_s <= more_s for other, more_s in paths.items())
    }


def _connected(names: Iterable[str], groups: Iterable[Sequence[str]]) -> dict[str, _Names]:
    """Return, for each name, those that it is connected to by groups with a common member, itself included."""
    links: dict[str, list[str]] = {name: [] for name in names}
    for group in groups:
        for one, other in pairwise(group):
            links[one].append(other)
            links[other].append(one)
    found: dict[str, _Names] = {}
    for name in links:
        if name not in found:
            members = graph.closure(links, [name])
            found |= dict.fromkeys(members, members)
    return found


def _in_order(before: Mapping[str, _Names]) -> Sequence[_Names]:
    """Return the names, each after those before it; names on a cycle stand together."""
    part_of: dict[str, _Names] = {name: (name,) for name in before}
    part_of |= {name: part for part in graph.strong_components(before) for name in part}
    waits = {
        part: dict.fromkeys(part_of[other] for name in part for other in before[name] if part_of[other] != part)
        for part in dict.fromkeys(part_of.values())
    }
    return tuple(TopologicalSorter(waits).static_order())
