"""The worst-case time from the declaration of a context-variable until the variable is known.

At first, no observer runs, and all variables that observers identify are unknown. Then the main execution declares one
variable. The bound limits the time from this instant until the variable is known. The bound is computed under these
assumptions:

- A condition holds as soon as the variables that it waits for are known, and continues to hold.
- Every look gives an accepted result within its `timeout`, and the results of all looks agree.
- No other user takes slots: neither the main execution, nor another decision, nor a look at a variable that is already
  known.

`docs/reference/graph.md` explains the bound to users.

Observers are due as soon as they start. When a variable becomes known, the observers that wait for this variable run in
the same instant. Therefore the periods of observers add nothing to the bound: all time is spent in looks and in waiting
for looks. The looks that delayed the variable form a path, which ends with a look at the variable. While a look on the
path waits, there are two cases: either a rival runs (an algorithm that identifies one of the same variables), or looks
that are not on the path take all slots of a resource. Each algorithm looks once, or as many times as `confirm` needs.
All looks for one `confirm`, with the pauses between these looks, are treated as one look. For each path, the timeouts
of the looks on the path and the delays by other looks are added. The bound is the maximum of these sums over all paths
(R. L. Graham's bound for list scheduling). The bound holds for every order of priorities, and also if looks take less
time than their timeouts.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from graphlib import TopologicalSorter
from itertools import pairwise

from codra_dsl.language import graph
from codra_dsl.language.check.checked.spec import CheckedAlgorithm, CheckedSpec
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import DEFAULT_PERIOD_S, Access, Spec, needed_of

MAX_STEPS = 100_000
"""The maximum number of visited looks, for all variables that rivals or contended slots can delay.

After this number, the bound of each further variable is the sum of all timeouts, which is never too small.
"""

MAX_PATHS = 16
"""The maximum number of paths that are kept for each look.

A path meets a crowd if a look on the path is a member of the crowd. Paths are distinguished by the crowds that they
meet. If there are more paths than this number, one path replaces all of them. This path meets the crowds of all of
them, and takes as long as the longest of them.
"""

_DIGITS = 9


def worst_cases(checked: CheckedSpec) -> Mapping[str, float]:
    """Return a mapping from each variable that an algorithm identifies to its worst-case time in seconds."""
    inputs = {name: condition.variables for name, condition in checked.derived.items()}
    looks = {name: _look(checked.spec, algorithm, inputs) for name, algorithm in checked.algorithms.items()}
    return _WorstCases(looks, checked.spec, checked.producers).bounds_by_variable()


@dataclass(frozen=True, slots=True)
class _Look:
    """One run of an algorithm, or as many runs as the algorithm needs to confirm its result.

    Attributes:
        waits_for: the variables that must be known before the algorithm can run.
        needs: the variables that the algorithm reads. The observers of these variables run as well.
        timeout_s: the maximum duration of the look. It includes the pauses between runs if several runs are needed.
        needed_run_count: the number of runs.
    """

    identifies: tuple[str, ...]
    waits_for: tuple[str, ...]
    needs: tuple[str, ...]
    timeout_s: float
    slots: tuple[str, ...]
    needed_run_count: int


def _look(spec: Spec, checked: CheckedAlgorithm, inputs: Mapping[str, Sequence[str]]) -> _Look:
    """Return a look. The inputs of derived variables are among the variables that the look needs and waits for."""
    algorithm = checked.algorithm
    identifies = tuple(dict.fromkeys(variable for variable, _ in checked.identifies))
    needed_run_count = max((needed_of(entry) for entry in algorithm.identifies), default=1)
    timeout_s = algorithm.timeout_s
    if needed_run_count > 1:
        periods = [
            setting.period_s
            for setting in spec.observers
            if {variable.name for variable in setting.identifies} & {*identifies}
        ]
        pause_s = max(algorithm.min_interval_s, timeout_s, *(periods or [DEFAULT_PERIOD_S]))
        timeout_s += (needed_run_count - 1) * pause_s
    slots = (usage.resource.name for usage in algorithm.uses if usage.access is Access.SLOT)
    return _Look(
        identifies=identifies,
        waits_for=graph.closure(inputs, checked.waits_for),
        needs=graph.closure(inputs, checked.needs),
        timeout_s=timeout_s,
        slots=tuple(dict.fromkeys(slots)),
        needed_run_count=needed_run_count,
    )


@dataclass(frozen=True, slots=True)
class _Crowd:
    """Looks that can delay each other.

    Attributes:
        capacity: how many of these looks run while another one of them waits.
        total_s: the sum of the timeouts of these looks.
    """

    members: tuple[str, ...]
    capacity: int
    total_s: float

    @property
    def share(self) -> float:
        """Return the fraction of a member's timeout that is added to `delay_s` if this member is on the path."""
        return 1 - 1 / self.capacity

    @property
    def delay_s(self) -> float:
        """Return the time that the crowd adds to each path that meets the crowd."""
        return self.total_s / self.capacity


_Paths = dict[frozenset[int], float]
"""A mapping from a set of crowds to the longest time of a path that meets these crowds.

A key contains the indices of the crowds. The time does not include the delays by these crowds.
"""

_Names = tuple[str, ...]


class _WorstCases:
    """Computes the worst cases of one spec."""

    def __init__(self, looks: Mapping[str, _Look], spec: Spec, producers: Mapping[str, Sequence[str]]) -> None:
        self._looks = looks
        self._producers = producers
        self._slots = {resource.name: resource.slots for resource in spec.resources if resource.slots is not None}
        self._rivals = _connected_names(looks, producers.values())
        observer_groups = [self._producers_of(reference.name for reference in one.identifies) for one in spec.observers]
        self._observer_of = _connected_names(looks, [*self._rivals.values(), *observer_groups])
        self._looks_started_with = {
            name: (*self._producers_of(look.needs), *self._observer_of[name]) for name, look in looks.items()
        }
        self._looks_before = {name: self._producers_of(look.waits_for) for name, look in looks.items()}
        self._looks_in_order = _topological_parts(self._looks_before)
        self._position = {name: position for position, part in enumerate(self._looks_in_order) for name in part}
        self._crowd_of_all_looks = _Crowd(tuple(looks), 1, sum(look.timeout_s for look in looks.values()))
        self._steps = 0

    def bounds_by_variable(self) -> dict[str, float]:
        """Return the bound for each variable.

        The bounds of all variables of an observer are computed together, since the same looks run for these variables.
        """
        uncrowded_paths, delayed_looks = self._paths(self._looks_in_order, ()), self._delayed_looks()
        bounds: dict[str, float] = {}
        for observer in dict.fromkeys(self._observer_of.values()):
            paths, crowds = (
                (uncrowded_paths, ()) if delayed_looks.isdisjoint(observer) else self._crowded_paths(observer)
            )
            for variable in dict.fromkeys(variable for name in observer for variable in self._looks[name].identifies):
                candidate_bounds_s = (
                    _longest_path_s(paths[name], crowds) - self._spared_s(name, variable, crowds)
                    for name in self._producers[variable]
                )
                bounds[variable] = round(max(candidate_bounds_s), _DIGITS)
        return bounds

    def _producers_of(self, variables: Iterable[str]) -> _Names:
        return tuple(dict.fromkeys(name for variable in variables for name in self._producers.get(variable, ())))

    def _delayed_looks(self) -> frozenset[str]:
        """Return the looks that may run together with a crowd.

        The crowds are those that exist if all observers run. The result contains the members of the crowds, and all
        looks that start a member directly or through other looks.
        """
        starters: dict[str, list[str]] = {}
        for name, started_looks in self._looks_started_with.items():
            for other in started_looks:
                starters.setdefault(other, []).append(name)
        crowded_looks = sorted(name for crowd in self._crowds(self._looks) for name in crowd.members)
        return frozenset(graph.closure(starters, crowded_looks))

    def _crowded_paths(self, observer: _Names) -> tuple[Mapping[str, _Paths], Sequence[_Crowd]]:
        """Return the paths to an observer's looks, and the crowds among the looks that run because of this observer."""
        if self._steps > MAX_STEPS:
            return {name: {frozenset({0}): 0.0} for name in observer}, [self._crowd_of_all_looks]
        running_looks = graph.closure(self._looks_started_with, observer)
        self._steps += len(running_looks)
        crowds = self._crowds(running_looks)
        positions = sorted({self._position[name] for name in running_looks})
        return self._paths([self._looks_in_order[position] for position in positions], crowds), crowds

    def _crowds(self, running_looks: Iterable[str]) -> Sequence[_Crowd]:
        """Return the crowds among looks that run together."""
        users: dict[str, list[str]] = {}
        rivals: dict[_Names, list[str]] = {}
        for name in running_looks:
            rivals.setdefault(self._rivals[name], []).append(name)
            for slot in self._looks[name].slots:
                users.setdefault(slot, []).append(name)
        slot_groups = [(names, self._slots[slot]) for slot, names in users.items() if slot in self._slots]
        groups = [
            (names, limit)
            for names, limit in (*((rival_names, 1) for rival_names in rivals.values()), *slot_groups)
            if len(names) > limit
        ]
        members = _connected_names([name for names, _ in groups for name in names], [names for names, _ in groups])
        capacities: dict[_Names, list[int]] = {}
        for names, limit in groups:
            capacities.setdefault(members[names[0]], []).append(limit)
        return [
            _Crowd(
                crowd,
                crowd_limits[0] if len(crowd_limits) == 1 else 1,
                sum(self._looks[name].timeout_s for name in crowd),
            )
            for crowd, crowd_limits in capacities.items()
        ]

    def _spared_s(self, last_look: str, variable: str, crowds: Sequence[_Crowd]) -> float:
        """Return the part of the crowds' delays that is not added to the paths that end with `last_look`.

        This part is the time of those rivals of `last_look` that identify the variable with one run: after such a rival
        has run, the variable is known from the rival's result.
        """
        rival_timeouts_s = [
            self._looks[name].timeout_s
            for name in self._rivals[last_look]
            if name != last_look
            and variable in self._looks[name].identifies
            and self._looks[name].needed_run_count == 1
        ]
        crowds_of_last = (crowd for crowd in (crowds if rival_timeouts_s else ()) if last_look in crowd.members)
        return sum(sum(rival_timeouts_s) / crowd.capacity for crowd in crowds_of_last)

    def _paths(self, parts: Iterable[_Names], crowds: Sequence[_Crowd]) -> dict[str, _Paths]:
        """Return a mapping from each look to the paths that end with this look.

        If there are alternatives, looks can wait for each other. Looks that wait for each other are treated as one
        look, which takes as long as all of them together.
        """
        crowd_of = {name: index for index, crowd in enumerate(crowds) for name in crowd.members}
        paths_by_look: dict[str, _Paths] = {}
        for part in parts:
            earlier_looks = dict.fromkeys(
                name for member in part for name in self._looks_before[member] if name not in part
            )
            earlier_paths = _merge_paths(paths_by_look[name] for name in earlier_looks) or {frozenset(): 0.0}
            crowd_indices = frozenset(crowd_of[name] for name in part if name in crowd_of)
            spent_s = sum(
                self._looks[name].timeout_s * (crowds[crowd_of[name]].share if name in crowd_of else 1.0)
                for name in part
            )
            paths_through_part = (
                {path | crowd_indices: longest_s + spent_s} for path, longest_s in earlier_paths.items()
            )
            paths = _reduce_paths(_merge_paths(paths_through_part))
            paths_by_look |= dict.fromkeys(part, paths)
        return paths_by_look


def _longest_path_s(paths: _Paths, crowds: Sequence[_Crowd]) -> float:
    return max(
        spent_s + sum(crowds[index].delay_s for index in sorted(met_crowds)) for met_crowds, spent_s in paths.items()
    )


def _merge_paths(path_tables: Iterable[_Paths]) -> _Paths:
    merged_paths: _Paths = {}
    for paths in path_tables:
        for met_crowds, spent_s in paths.items():
            merged_paths[met_crowds] = max(spent_s, merged_paths.get(met_crowds, 0.0))
    return merged_paths


def _reduce_paths(paths: _Paths) -> _Paths:
    """Return the paths without those that cannot be the longest; if there are too many paths, return only one path.

    A path cannot be the longest if another path takes at least as long, and meets the same crowds and more.
    """
    if len(paths) > MAX_PATHS:
        return {frozenset().union(*paths): max(paths.values())}
    return {
        met_crowds: spent_s
        for met_crowds, spent_s in paths.items()
        if not any(
            met_crowds < other_crowds and spent_s <= other_spent_s for other_crowds, other_spent_s in paths.items()
        )
    }


def _connected_names(names: Iterable[str], groups: Iterable[Sequence[str]]) -> dict[str, _Names]:
    """Return a mapping from each name to the names that are connected with this name, including the name itself.

    All names of a group are connected. If two groups have a common member, all names of both groups are connected.
    """
    links: dict[str, list[str]] = {name: [] for name in names}
    for group in groups:
        for one, other in pairwise(group):
            links[one].append(other)
            links[other].append(one)
    connected_names_by_name: dict[str, _Names] = {}
    for name in links:
        if name not in connected_names_by_name:
            members = graph.closure(links, [name])
            connected_names_by_name |= dict.fromkeys(members, members)
    return connected_names_by_name


def _topological_parts(before: Mapping[str, _Names]) -> Sequence[_Names]:
    """Return the names as parts in topological order.

    All names on a cycle form one part. Every other name is a part of its own.
    """
    part_of: dict[str, _Names] = {name: (name,) for name in before}
    part_of |= {name: part for part in graph.strong_components(before) for name in part}
    parts_before = {
        part: dict.fromkeys(part_of[other] for name in part for other in before[name] if part_of[other] != part)
        for part in dict.fromkeys(part_of.values())
    }
    return tuple(TopologicalSorter(parts_before).static_order())
