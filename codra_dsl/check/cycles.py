"""Phase 4: every variable can become known, be it that its observers need each other.

What can be known is the least fixed point of "one of its algorithms can run with every variable not yet reached
unknown". What is left over waits, directly or through others, on a cycle, which is shown whole.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import combinations, pairwise

from codra_dsl import graph
from codra_dsl.check.contradictions import Stated, contradiction, never_true, related_to, stated
from codra_dsl.check.possible import can_hold, known
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import OBSERVER, Faults, Scope
from codra_dsl.diagnostics import Diagnostic, Place, Related
from codra_dsl.expression import And, Name, Node, names_in, spelt_out
from codra_dsl.model import Algorithm, Condition

MAX_COMBINED = 8
"""If one condition reads more unknown names, each of them counts as one that it waits for."""

MAX_WAITING = 5
"""How many algorithms that wait for one that never runs are named with it."""


def cycles(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """No variable can only become known once it is known; one finding per cause."""
    if scope.lost("perception", "identifies"):
        return
    search = _Search(scope, faults)
    search.run(scope.algorithms)
    while search.blocked:
        never = [name for name in search.blocked if not search.could_run(name)]
        if never:
            yield from (_never_runs(scope, search, name) for name in never)
            search.let_run(never)
            continue
        waits = search.waits()
        for component in _innermost(waits):
            yield _cycle(scope, search, graph.shortest_cycle({name: waits[name] for name in component}))
            search.reach(component)


def feedback(scope: Scope) -> Mapping[str, tuple[str, ...]]:
    """Return, for each algorithm that needs what needs it, the variables that it reads without waiting for them."""
    needs = {
        name: [need for producer in producers for need in scope.needs[producer]]
        for name, producers in scope.producers.items()
    }
    circles = graph.strong_components(_without_ends(needs))
    circle_of = {name: index for index, circle in enumerate(circles) for name in circle}
    found: dict[str, tuple[str, ...]] = {}
    for algorithm in scope.algorithms.values() if circles else ():
        own = {circle_of.get(entry.variable.name) for entry in algorithm.identifies} - {None}
        near = [need for need in scope.needs[algorithm.name] if circle_of.get(need) in own]
        found[algorithm.name] = tuple(sorted(need for need in near if _runs_without(scope, algorithm, need)))
    return found


def _without_ends(needs: Mapping[str, Sequence[str]]) -> Mapping[str, Sequence[str]]:
    """Return a graph without names that need nothing that is left: no cycle goes through them."""
    open_needs = {name: sum(need in needs for need in wanted) for name, wanted in needs.items()}
    users: dict[str, list[str]] = {}
    for name, wanted in needs.items():
        for need in wanted:
            users.setdefault(need, []).append(name)
    ends = [name for name, count in open_needs.items() if count == 0]
    while ends:
        end = ends.pop()
        del open_needs[end]
        for user in users.get(end, ()):
            open_needs[user] -= 1
            if open_needs[user] == 0:
                ends.append(user)
    return {name: needs[name] for name in open_needs}


GRAPH = (cycles,)
"""The rules of this phase."""


@dataclass(frozen=True, slots=True)
class _Requirement:
    """What must be true before an algorithm starts: conditions, judged together, or a value that it is given."""

    conditions: tuple[Node, ...]
    given: str | None = None

    @property
    def names(self) -> frozenset[str]:
        """Return the names that it reads."""
        read = frozenset(name.name for condition in self.conditions for name in names_in(condition))
        return read if self.given is None else read | {self.given}


def _requirements(scope: Scope, algorithm: Algorithm) -> Iterator[_Requirement]:
    """Yield an algorithm's requirements one by one, the parts of an `and` each on its own.

    Conditions that have been found wrong are left out.
    """
    for _, tree in _sound_conditions(scope, algorithm):
        parts = tree.operands if isinstance(tree, And) else (tree,)
        yield from (_Requirement((part,)) for part in parts)
    for reference in algorithm.given:
        yield _Requirement((), reference.name)


def _sound_conditions(scope: Scope, algorithm: Algorithm) -> Iterator[tuple[Condition, Node]]:
    for condition in algorithm.observable_when:
        judgement = scope.judgement(condition)
        if judgement is not None and not judgement.problems:
            yield condition, spelt_out(judgement.typed.node)


class _Search:
    """The fixed point as it grows: which variables are reached and which algorithms are still blocked."""

    def __init__(self, scope: Scope, faults: Faults) -> None:
        self._scope = scope
        self._faults = faults
        self._reached = {name for name in scope.variables if self._from_elsewhere(name)}
        self._readers: dict[str, list[str]] = {}
        for name, needs in scope.needs.items():
            for need in needs:
                self._readers.setdefault(need, []).append(name)
        self.blocked: dict[str, Algorithm] = {}

    def _from_elsewhere(self, name: str) -> bool:
        """Return whether someone else may write a variable, or whether nothing more can be said about it."""
        others = any(source.name != OBSERVER for source in self._scope.variables[name].sources)
        sound = self._faults.sound("context", name) and self._scope.readable("context", name, "source")
        return others or name not in self._scope.producers or not sound

    def run(self, names: Iterable[str]) -> None:
        """Judge algorithms, and again those that read what they reach, until nothing changes."""
        waiting = list(names)[::-1]
        while waiting:
            name = waiting.pop()
            algorithm = self._scope.algorithms[name]
            if self._can_run(algorithm):
                self.blocked.pop(name, None)
                waiting.extend(self._newly_possible(entry.variable.name for entry in algorithm.identifies))
            else:
                self.blocked[name] = algorithm

    def reach(self, names: Iterable[str]) -> None:
        """Take variables for reached, so that the search goes on behind a cycle that has been reported."""
        self.run(self._newly_possible(names))

    def let_run(self, names: Iterable[str]) -> None:
        """Take algorithms for running, so that the search goes on behind what has been reported."""
        for name in names:
            algorithm = self.blocked.pop(name)
            self.reach([entry.variable.name for entry in algorithm.identifies])

    def could_run(self, name: str) -> bool:
        """Return whether an algorithm could run if everything were reached."""
        return _holds(self._scope, tuple(_requirements(self._scope, self.blocked[name])), frozenset())

    def waits(self) -> Mapping[str, tuple[str, ...]]:
        """Return, for each variable that is not reached, those that it waits for."""
        waits: dict[str, list[str]] = {}
        for algorithm in self.blocked.values():
            blocking = self.blocking(algorithm)
            for entry in algorithm.identifies:
                if entry.variable.name not in self._reached:
                    waits.setdefault(entry.variable.name, []).extend(blocking)
        return {name: tuple(dict.fromkeys(needs)) for name, needs in waits.items()}

    def blocking(self, algorithm: Algorithm) -> tuple[str, ...]:
        """Return the variables that keep an algorithm from running: with some of them reached, it could."""
        requirements = tuple(_requirements(self._scope, algorithm))
        unknown = self._unknown(algorithm)
        failing = [each for each in requirements if not _holds(self._scope, (each,), unknown)]
        groups: list[tuple[_Requirement, ...]] = [(each,) for each in failing] or [requirements]
        return tuple(dict.fromkeys(name for group in groups for name in self._relevant(group, unknown)))

    def _relevant(self, group: Sequence[_Requirement], unknown: frozenset[str]) -> list[str]:
        names = sorted(unknown & frozenset().union(*(each.names for each in group)))
        if len(names) > MAX_COMBINED:
            return names
        others = unknown - frozenset(names)
        holds = {
            frozenset(reached): _holds(self._scope, group, others | (frozenset(names) - frozenset(reached)))
            for size in range(len(names) + 1)
            for reached in combinations(names, size)
        }
        return [name for name in names if any(not held and holds[without | {name}] for without, held in holds.items())]

    def _can_run(self, algorithm: Algorithm) -> bool:
        unknown = self._unknown(algorithm)
        if not unknown and all(type(condition.tree) is Name for condition in algorithm.observable_when):
            return True  # as most of them can, once all that they need is reached
        return _holds(self._scope, tuple(_requirements(self._scope, algorithm)), unknown)

    def _unknown(self, algorithm: Algorithm) -> frozenset[str]:
        needs, declared = self._scope.needs[algorithm.name], self._scope.variables
        return frozenset(name for name in needs if name not in self._reached and name in declared)

    def _newly_possible(self, names: Iterable[str]) -> list[str]:
        """Reach variables and return the blocked algorithms that read one of them for the first time."""
        new = [name for name in names if name not in self._reached]
        self._reached.update(new)
        readers = dict.fromkeys(reader for name in new for reader in self._readers.get(name, ()))
        return [reader for reader in readers if reader in self.blocked]


def _holds(scope: Scope, requirements: Sequence[_Requirement], unknown: frozenset[str]) -> bool:
    if any(each.given in unknown for each in requirements):
        return False
    conditions = [condition for each in requirements for condition in each.conditions]
    asked = {name for each in requirements if each.given is None for name in each.names}
    conditions += [known(each.given) for each in requirements if each.given is not None and each.given in asked]
    return can_hold(conditions, unknown & {name for each in requirements for name in each.names}, scope.context_types)


def _runs_without(scope: Scope, algorithm: Algorithm, name: str) -> bool:
    return _holds(scope, tuple(_requirements(scope, algorithm)), frozenset({name}))


def _innermost(waits: Mapping[str, tuple[str, ...]]) -> Iterator[tuple[str, ...]]:
    """Yield the sets of variables that wait for each other and for nothing else that is not reached."""
    for component in graph.strong_components(waits):
        members = frozenset(component)
        if all(members.issuperset(waits[name]) for name in component):
            yield component


def _cycle(scope: Scope, search: _Search, path: tuple[str, ...]) -> Diagnostic:
    edges = [_edge(scope, search, name, need) for name, need in pairwise((*path, path[0]))]
    whole = " -> ".join((*path, path[0]))
    if len(path) == 1:
        message = f"context-variable '{path[0]}' waits for itself: {whole}"
        way_out = f"let it be identified without itself, e.g. when 'not known({path[0]}) or age({path[0]}) > 10 s'"
    else:
        message = f"context-variables wait for each other: {whole}"
        way_out = "let one of them be identified without the rest, or say with 'source' who else writes it"
    return finding(
        "cycle",
        message,
        edges[0].place,
        path=f"context.{path[0]}",
        way_out=way_out,
        related=tuple(edges),
    )


def _edge(scope: Scope, search: _Search, name: str, need: str) -> Related:
    """Return why a variable waits for another, and where that is said."""
    algorithms = [scope.algorithms[producer] for producer in scope.producers[name]]
    algorithm = next(each for each in algorithms if need in search.blocking(each))
    place, reason = _place_of_need(algorithm, need)
    return Related(f"'{name}' needs '{need}': algorithm '{algorithm.name}' {reason}", place)


def _place_of_need(algorithm: Algorithm, need: str) -> tuple[Place, str]:
    for condition in algorithm.observable_when:
        names = () if condition.tree is None else names_in(condition.tree)
        mention = next((name for name in names if name.name == need), None)
        if mention is not None:
            return condition.place_of(mention), f"runs when '{condition.text}'"
    given = next(reference for reference in algorithm.given if reference.name == need)
    return given.place, "is given its value"


def _never_runs(scope: Scope, search: _Search, name: str) -> Diagnostic:
    algorithm = scope.algorithms[name]
    conditions = [stated(each, tree) for each, tree in _sound_conditions(scope, algorithm)]
    given = [Stated(known(each.name), f"given: {each.name}", each.place) for each in algorithm.given]
    core = contradiction((*given, *conditions), scope.context_types)
    variables = [
        scope.variables[name.name] for each in core for name in names_in(each.tree) if name.name in scope.variables
    ]
    return finding(
        "never-runs",
        f"algorithm '{name}' can never run: {never_true(core)}",
        core[-1].place,
        path=f"perception.{name}.observable_when",
        way_out="change the condition, or remove the algorithm",
        related=(
            *related_to(core, scope.context_types, dict.fromkeys(variables)),
            *_waiting_for(scope, search, algorithm),
        ),
    )


def _waiting_for(scope: Scope, search: _Search, algorithm: Algorithm) -> Iterator[Related]:
    """Yield the algorithms that wait for what one that never runs would identify."""
    identified = {entry.variable.name for entry in algorithm.identifies}
    others = [
        each for each in search.blocked.values() if each is not algorithm and identified & set(scope.needs[each.name])
    ]
    for each in others[:MAX_WAITING]:
        need = next((need for need in search.blocking(each) if need in identified), None)
        if need is not None:
            yield Related(f"algorithm '{each.name}' waits for '{need}'", _place_of_need(each, need)[0])
