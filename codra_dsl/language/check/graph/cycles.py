"""Rules of phase 4: every variable can become known, even if observers need each other.

A variable is knowable if it can become known. The knowable variables are the least fixed point of this rule: a variable
is knowable if one of its algorithms can run while all variables that are not yet found to be knowable are unknown. The
remaining variables wait, directly or through other variables, for the variables of a cycle. The finding shows the
complete cycle.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from itertools import combinations, pairwise

from codra_dsl.language import graph
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import OBSERVER, FaultyElements, SpecIndex
from codra_dsl.language.check.solver.case_split import names_of
from codra_dsl.language.check.solver.contradictions import (
    StatedCondition,
    contradiction,
    never_true_message,
    related_places,
    state_condition,
)
from codra_dsl.language.check.solver.satisfiable import can_be_known, can_hold, known_call
from codra_dsl.language.diagnostics import Diagnostic, Place, Related
from codra_dsl.language.expression import And, Fallback, Name, Node, Not, Or, names_in, variables_in, walk
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import Algorithm, Condition, Kind, Variable

MAX_COMBINED_NAMES = 8
"""The maximum number of unknown names in one condition. With more names, the condition is assumed to wait for each."""

MAX_WAITING_ALGORITHMS = 5
"""The maximum number of waiting algorithms in a finding about an algorithm that never runs."""


def cycles(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """No variable waits for itself, directly or through other variables. There is one finding per cause."""
    if spec_index.has_damage("perception", "identifies"):
        return
    search = _Search(spec_index, faults)
    search.run(search.producers)
    while search.blocked:
        never_running_names = [name for name in search.blocked if not search.could_run(name)]
        if never_running_names:
            yield from (_never_runs_finding(spec_index, search, name) for name in never_running_names)
            search.assume_running(never_running_names)
            continue
        waiting_producers = search.waiting_producers()
        awaited_names = {name: tuple(producers) for name, producers in waiting_producers.items()}
        components = tuple(_innermost_components(awaited_names))
        if not components:  # an algorithm with wrong conditions can wait without a cycle: another finding has the cause
            return
        for component in components:
            path = graph.shortest_cycle({name: awaited_names[name] for name in component})
            yield _cycle_finding(spec_index, waiting_producers, path)
            search.assume_knowable(component)


def feedback(spec_index: SpecIndex) -> Mapping[str, tuple[str, ...]]:
    """Return, for each algorithm, the variables on a cycle of needs that the algorithm reads without waiting."""
    needs = dict(spec_index.derived_inputs) | {
        name: tuple(need for producer in producers for need in spec_index.needs[producer])
        for name, producers in spec_index.producers.items()
    }
    components = graph.strong_components(_drop_acyclic_names(needs))
    component_index_by_name = {name: index for index, component in enumerate(components) for name in component}
    feedback_by_algorithm: dict[str, tuple[str, ...]] = {}
    definitions = _definitions(spec_index) if components else {}
    for algorithm in spec_index.algorithms.values() if components else ():
        own_component_indices = {component_index_by_name.get(entry.variable.name) for entry in algorithm.identifies} - {
            None
        }
        cycle_needs = [
            need
            for need in spec_index.needs[algorithm.name]
            if component_index_by_name.get(need) in own_component_indices
        ]
        requirements = tuple(_requirements(spec_index, algorithm, definitions)) if cycle_needs else ()
        feedback_by_algorithm[algorithm.name] = tuple(
            need for need in sorted(cycle_needs) if _hold(spec_index, requirements, frozenset({need}))
        )
    return feedback_by_algorithm


def _drop_acyclic_names(needs: Mapping[str, Sequence[str]]) -> Mapping[str, Sequence[str]]:
    """Return a graph with only those names that need a name on a cycle, directly or through other names."""
    open_need_counts = {name: sum(need in needs for need in needed_names) for name, needed_names in needs.items()}
    users: dict[str, list[str]] = {}
    for name, needed_names in needs.items():
        for need in needed_names:
            users.setdefault(need, []).append(name)
    free_names = [name for name, count in open_need_counts.items() if count == 0]
    while free_names:
        free_name = free_names.pop()
        del open_need_counts[free_name]
        for user in users.get(free_name, ()):
            open_need_counts[user] -= 1
            if open_need_counts[user] == 0:
                free_names.append(user)
    return {name: needs[name] for name in open_need_counts}


CYCLE_CHECKS = (cycles,)
"""The rules of this phase."""


@dataclass(frozen=True, slots=True)
class _Requirement:
    """A requirement of an algorithm: a condition, or a `given` name that must be known.

    Attributes:
        names: the names that the requirement reads, also in the definitions.
        condition: the condition; None for a `given` name.
        definitions: the definitions of the derived variables that the condition reads, judged together with it.
    """

    names: frozenset[str]
    condition: Node | None = None
    definitions: tuple[Node, ...] = ()


def _requirements(
    spec_index: SpecIndex, algorithm: Algorithm, definitions: Mapping[str, _Requirement]
) -> Iterator[_Requirement]:
    """Yield the requirements of an algorithm. Each part of an `and` is a separate requirement.

    Conditions with a reported problem are left out.
    """
    for _, tree in _sound_conditions(spec_index, algorithm):
        for part in tree.operands if isinstance(tree, And) else (tree,):
            needs = graph.closure(spec_index.derived_inputs, variables_in(part)) if definitions else ()
            own_definitions = [definitions[name] for name in needs if name in definitions]
            names = frozenset(names_of((part,))).union(*(definition.names for definition in own_definitions))
            conditions = (definition.condition for definition in own_definitions)
            yield _Requirement(names, part, tuple(condition for condition in conditions if condition is not None))
    for reference in algorithm.given:
        yield _Requirement(frozenset((reference.name,)))


def _definitions(spec_index: SpecIndex) -> Mapping[str, _Requirement]:
    """Return, for each derived bool, the requirement that it has the value of its expression.

    Without them, a condition on a derived variable seems to hold although the expression cannot be true. Expressions
    with a fallback are left out.
    """
    definitions: dict[str, _Requirement] = {}
    for name in spec_index.derived_inputs:
        type_, tree = spec_index.context_types.get(name), spec_index.sound_tree(spec_index.variables[name].derived)
        if tree is None or type_ is None or type_.kind is not Kind.BOOL:
            continue
        if not any(isinstance(part, Fallback) for part in walk(tree)):
            variable = Name(start=0, end=0, name=name)
            is_true, is_false = (variable, tree), (_negated(variable), _negated(tree))
            cases = (_negated(known_call(name)), *(And(start=0, end=0, operands=case) for case in (is_true, is_false)))
            condition = Or(start=0, end=0, operands=cases)
            definitions[name] = _Requirement(frozenset(names_of((condition,))), condition)
    return definitions


def _negated(condition: Node) -> Node:
    return Not(start=0, end=0, operand=condition)


def _sound_conditions(spec_index: SpecIndex, algorithm: Algorithm) -> Iterator[tuple[Condition, Node]]:
    for condition in algorithm.observable_when:
        tree = spec_index.sound_tree(condition)
        if tree is not None:
            yield condition, tree


_Producer = Algorithm | Variable
"""An algorithm, or a derived variable."""


def _needs(spec_index: SpecIndex, producer: _Producer) -> tuple[str, ...]:
    if isinstance(producer, Variable):
        return spec_index.derived_inputs[producer.name]
    needs = spec_index.needs[producer.name]
    return graph.closure(spec_index.derived_inputs, needs) if spec_index.derived_inputs else needs


def _identified_names(spec_index: SpecIndex, producer: _Producer) -> list[str]:
    if isinstance(producer, Variable):
        return [producer.name]
    names = (entry.variable.name for entry in producer.identifies)
    return [name for name in names if name not in spec_index.derived_inputs]  # another rule refuses derived variables


class _Search:
    """The search for the fixed point: the variables found to be knowable, and the algorithms that are still blocked."""

    def __init__(self, spec_index: SpecIndex, faults: FaultyElements) -> None:
        self._spec_index = spec_index
        self._faults = faults
        self._definitions = _definitions(spec_index)
        self._requirements: dict[str, tuple[_Requirement, ...]] = {}
        derivations = [spec_index.variables[name] for name in spec_index.derived_inputs]
        self.producers: dict[str, _Producer] = {
            **spec_index.algorithms,
            **{f"derived {variable.name}": variable for variable in derivations},  # no algorithm can have this name
        }
        self._knowable_names = {name for name in spec_index.variables if self._has_other_source(name)}
        self._needs = {id(producer): _needs(spec_index, producer) for producer in self.producers.values()}
        self._readers: dict[str, list[str]] = {}
        for name, producer in self.producers.items():
            for need in self._needs[id(producer)]:
                self._readers.setdefault(need, []).append(name)
        self.blocked: dict[str, _Producer] = {}

    def _has_other_source(self, name: str) -> bool:
        """Return whether a variable may have writers other than its algorithms. If this is undecided, return True."""
        derived = self._spec_index.variables[name].derived
        if derived is not None:
            return derived.tree is None
        has_others = any(source.name != OBSERVER for source in self._spec_index.variables[name].sources)
        is_sound = self._faults.is_sound("context", name) and self._spec_index.is_readable("context", name, "source")
        return has_others or name not in self._spec_index.producers or not is_sound

    def run(self, names: Iterable[str]) -> None:
        """Judge algorithms. Whenever a variable is found to be knowable, judge its blocked readers again."""
        pending_names = list(names)[::-1]
        while pending_names:
            name = pending_names.pop()
            producer = self.producers[name]
            if self._can_run(producer):
                self.blocked.pop(name, None)
                pending_names.extend(self._mark_knowable(_identified_names(self._spec_index, producer)))
            else:
                self.blocked[name] = producer

    def assume_knowable(self, names: Iterable[str]) -> None:
        """Assume that variables are knowable, so that the search continues after a reported cycle."""
        self.run(self._mark_knowable(names))

    def assume_running(self, names: Iterable[str]) -> None:
        """Assume that algorithms can run, so that the search continues after a reported problem."""
        producers = [self.blocked.pop(name) for name in names]  # all of them first: the search may find that others run
        self.assume_knowable(name for producer in producers for name in _identified_names(self._spec_index, producer))

    def could_run(self, name: str) -> bool:
        """Return whether an algorithm could run if all variables were knowable."""
        producer = self.blocked[name]
        return isinstance(producer, Variable) or _hold(self._spec_index, self._requirements_of(producer), frozenset())

    def _requirements_of(self, algorithm: Algorithm) -> tuple[_Requirement, ...]:
        if algorithm.name not in self._requirements:
            self._requirements[algorithm.name] = tuple(_requirements(self._spec_index, algorithm, self._definitions))
        return self._requirements[algorithm.name]

    def waiting_producers(self) -> Mapping[str, Mapping[str, _Producer]]:
        """Return, for each variable that is not knowable, the variables that it waits for, each with its producer.

        A finding uses these producers: once the budget is used up, `blocking_names` may give another answer.
        """
        waiting_producers: dict[str, dict[str, _Producer]] = {}
        for producer in self.blocked.values():
            blocking_names = self.blocking_names(producer)
            for name in _identified_names(self._spec_index, producer):
                if name not in self._knowable_names:
                    producer_by_need = waiting_producers.setdefault(name, {})
                    for need in blocking_names:
                        producer_by_need.setdefault(need, producer)
        return waiting_producers

    def blocking_names(self, producer: _Producer) -> tuple[str, ...]:
        """Return the variables that block a producer: if some of these were knowable, the producer could run."""
        unknown_names = self._unknown_names(producer)
        if isinstance(producer, Variable):
            names = tuple(name for name in self._needs[id(producer)] if name in unknown_names)
            return tuple(name for name in names if name in self._spec_index.derived_inputs) or names
        requirements = self._requirements_of(producer)
        unmet_requirements = [
            requirement for requirement in requirements if not _hold(self._spec_index, (requirement,), unknown_names)
        ]
        groups: list[tuple[_Requirement, ...]] = [(requirement,) for requirement in unmet_requirements] or [
            requirements
        ]
        names = tuple(dict.fromkeys(name for group in groups for name in self._relevant_names(group, unknown_names)))
        direct_needs = frozenset(self._spec_index.needs[producer.name])
        return tuple(name for name in names if name in direct_needs) or names  # the inputs of known derived variables

    def _relevant_names(self, group: Sequence[_Requirement], unknown_names: frozenset[str]) -> list[str]:
        names = sorted(unknown_names & frozenset().union(*(requirement.names for requirement in group)))
        if len(names) > MAX_COMBINED_NAMES:
            return names
        other_names = unknown_names - frozenset(names)
        truths = {
            frozenset(known_names): _hold(
                self._spec_index, group, other_names | (frozenset(names) - frozenset(known_names))
            )
            for size in range(len(names) + 1)
            for known_names in combinations(names, size)
        }
        return [
            name
            for name in names
            if any(not truth and truths[known_names | {name}] for known_names, truth in truths.items())
        ]

    def _can_run(self, producer: _Producer) -> bool:
        if isinstance(producer, Algorithm) and any(
            self._is_unknown(condition.tree) for condition in producer.observable_when
        ):
            return False  # cheap: an algorithm is judged again for each variable that becomes knowable
        unknown_names = self._unknown_names(producer)
        if isinstance(producer, Variable):
            # derived variables are computed in order, so each of them waits for all derived variables that it reads
            is_in_order = unknown_names.isdisjoint(self._spec_index.derived_inputs)
            tree = self._spec_index.sound_tree(producer.derived) if unknown_names else None
            types = self._spec_index.context_types
            return is_in_order and (tree is None or can_be_known(tree, unknown_names, types))
        if not unknown_names and all(type(condition.tree) is Name for condition in producer.observable_when):
            return True  # the common case: all needed variables are knowable
        return _hold(self._spec_index, self._requirements_of(producer), unknown_names)

    def _is_unknown(self, tree: Node | None) -> bool:
        return (
            isinstance(tree, Name) and tree.name not in self._knowable_names and tree.name in self._spec_index.variables
        )

    def _unknown_names(self, producer: _Producer) -> frozenset[str]:
        unknown_names = frozenset(self._needs[id(producer)]).difference(self._knowable_names)
        return unknown_names.intersection(self._spec_index.variables)

    def _mark_knowable(self, names: Iterable[str]) -> list[str]:
        """Mark variables as knowable. Return the blocked algorithms that read a variable that was not marked before."""
        new_names = [name for name in names if name not in self._knowable_names]
        self._knowable_names.update(new_names)
        readers = dict.fromkeys(reader for name in new_names for reader in self._readers.get(name, ()))
        return [reader for reader in readers if reader in self.blocked]


def _hold(spec_index: SpecIndex, requirements: Sequence[_Requirement], unknown_names: frozenset[str]) -> bool:
    """Return whether requirements can be met while some names are unknown."""
    given_names = {name for requirement in requirements if requirement.condition is None for name in requirement.names}
    if not given_names.isdisjoint(unknown_names):
        return False
    types = spec_index.context_types
    conditions = [requirement.condition for requirement in requirements if requirement.condition is not None]
    definitions = [definition for requirement in requirements for definition in requirement.definitions]
    if definitions and not can_hold(conditions, unknown_names.intersection(names_of(conditions)), types):
        return False  # the most frequent case, and cheap
    conditions += definitions
    read_names = frozenset[str]().union(
        *(requirement.names for requirement in requirements if requirement.condition is not None)
    )
    conditions += [known_call(name) for name in sorted(given_names & read_names)]
    return can_hold(conditions, unknown_names & read_names, types)


def _innermost_components(awaited_names: Mapping[str, tuple[str, ...]]) -> Iterator[tuple[str, ...]]:
    """Yield the sets of variables that wait for each other and for no other variable."""
    for component in graph.strong_components(awaited_names):
        members = frozenset(component)
        if all(members.issuperset(awaited_names[name]) for name in component):
            yield component


def _cycle_finding(
    spec_index: SpecIndex, waiting_producers: Mapping[str, Mapping[str, _Producer]], path: tuple[str, ...]
) -> Diagnostic:
    steps = pairwise((*path, path[0]))
    edges = [_cycle_edge(spec_index, waiting_producers[name][need], name, need) for name, need in steps]
    cycle_text = " -> ".join((*path, path[0]))
    if len(path) == 1:
        message = f"context-variable '{path[0]}' waits for itself: {cycle_text}"
        example_condition = f"not known({path[0]}) or age({path[0]}) > 10 s"
        help = f"identify it with an algorithm that does not wait for it, e.g. with the condition '{example_condition}'"
        help = "write an expression that does not read it" if path[0] in spec_index.derived_inputs else help
    else:
        message = f"context-variables wait for each other: {cycle_text}"
        help = "identify one of these variables without the others, or name another writer of it under 'source'"
        if all(name in spec_index.derived_inputs for name in path):
            help = "write one of these expressions without the others"
    return finding(
        "cycle",
        message,
        edges[0].place,
        path=f"context.{path[0]}",
        help=help,
        related=tuple(edges),
    )


def _cycle_edge(spec_index: SpecIndex, producer: _Producer, name: str, need: str) -> Related:
    """Return the reason why a variable waits for another variable, with the place of the cause."""
    if isinstance(producer, Algorithm):
        place, reason = _place_of_need(spec_index, producer, need)
        return Related(f"'{name}' needs '{need}': algorithm '{producer.name}' {reason}", place)
    derived = producer.derived
    assert derived is not None
    assert derived.tree is not None
    mention = next(mention for mention in names_in(derived.tree) if mention.name == need)
    return Related(f"'{name}' needs '{need}': it is derived from '{need}'", derived.place_of(mention))


def _place_of_need(spec_index: SpecIndex, algorithm: Algorithm, need: str) -> tuple[Place, str]:
    for condition in algorithm.observable_when:
        names = () if condition.tree is None else names_in(condition.tree)
        mention = next((name for name in names if need in graph.closure(spec_index.derived_inputs, (name.name,))), None)
        if mention is not None:
            return condition.place_of(mention), f"runs when '{condition.text}'"
    given = next(reference for reference in algorithm.given if reference.name == need)
    return given.place, "gets its value with 'given'"


def _never_runs_finding(spec_index: SpecIndex, search: _Search, name: str) -> Diagnostic:
    algorithm = spec_index.algorithms[name]
    conditions = [state_condition(condition, tree) for condition, tree in _sound_conditions(spec_index, algorithm)]
    given_conditions = [
        StatedCondition(known_call(reference.name), f"given: {reference.name}", reference.place)
        for reference in algorithm.given
    ]
    all_conditions = (*given_conditions, *conditions)
    core = contradiction(all_conditions, spec_index.context_types) or all_conditions  # () if the budget is used up
    variables = [
        spec_index.variables[name.name]
        for condition in core
        for name in names_in(condition.tree)
        if name.name in spec_index.variables
    ]
    return finding(
        "never-runs",
        f"algorithm '{name}' can never run: {never_true_message(core)}",
        core[-1].place,
        path=f"perception.{name}.observable_when",
        help="change the condition, or remove the algorithm",
        related=(
            *related_places(core, spec_index.context_types, dict.fromkeys(variables)),
            *_waiting_algorithms(spec_index, search, algorithm),
        ),
    )


def _waiting_algorithms(spec_index: SpecIndex, search: _Search, algorithm: Algorithm) -> Iterator[Related]:
    """Yield the algorithms that wait for a variable of an algorithm that never runs."""
    identified_names = {entry.variable.name for entry in algorithm.identifies}
    others = [
        other
        for other in search.blocked.values()
        if isinstance(other, Algorithm)
        and other is not algorithm
        and identified_names & set(spec_index.needs[other.name])
    ]
    for other in others[:MAX_WAITING_ALGORITHMS]:
        need = next((need for need in search.blocking_names(other) if need in identified_names), None)
        if need is not None:
            yield Related(f"algorithm '{other.name}' waits for '{need}'", _place_of_need(spec_index, other, need)[0])
