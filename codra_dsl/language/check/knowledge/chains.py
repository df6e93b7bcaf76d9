"""Checks of agents' rules (phase 4): each rule can begin, because its `before` patterns can become true.

See P2, section 3.1. An element that exists from the start needs no rule. An agent without rules may write, at any time,
any element that it owns. If the rules of an agent mention an element, the agent changes the element only by these
rules. A rule can begin once all of its `before` patterns can be true. The rules that can begin are the least fixed
point of these statements.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import field
from functools import cached_property

from codra_dsl.language import graph
from codra_dsl.language.check.conditions.conditions import Role
from codra_dsl.language.check.index.graph_schema import DeclaredGraph, KnowledgeElement
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.knowledge.mentions import Pattern, Step, names_in_pattern, patterns_in, steps
from codra_dsl.language.check.knowledge.owners import is_knowledge_checkable, state_writers
from codra_dsl.language.check.solver.satisfiable import can_hold
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.expression import Path
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import Agent, AgentRule, EdgeType, Task, TaskState


def unreachable_rules(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """The `before` patterns of each rule, and the `wakes` patterns of each agent, can become true."""
    if not is_knowledge_checkable(spec_index, faults):
        return
    rule_dependencies = _RuleDependencies(spec_index.declared_graph)
    stuck_rules = [
        rule
        for rule in rule_dependencies.rules
        if rule_dependencies.impossible_pattern(rule, rule_dependencies.all_rule_names) is not None
    ]
    for rule in stuck_rules:
        yield _rule_finding(spec_index.declared_graph, rule, rule_dependencies)
    for agent in spec_index.spec.agents:
        yield from _wakes_findings(spec_index.declared_graph, agent, rule_dependencies)
    yield from _cycle_findings(rule_dependencies, frozenset(rule.name for rule in stuck_rules))


@dataclass(frozen=True, eq=False)
class _Rule:
    """A rule of an agent, with its patterns."""

    agent: Agent
    rule: AgentRule

    @property
    def name(self) -> str:
        """Return a name that no other rule has."""
        return f"{self.agent.name}.{self.rule.name}"

    @property
    def label(self) -> str:
        """Return the name of the rule in messages."""
        return f"rule '{self.rule.name}' of agent '{self.agent.name}'"

    @cached_property
    def before_patterns(self) -> tuple[Pattern, ...]:
        """The patterns that must be true before the rule begins."""
        return tuple(pattern for pattern in patterns_in(self.agent, self.rule) if pattern.role is Role.BEFORE)

    @cached_property
    def effects(self) -> tuple[Pattern, ...]:
        """The patterns that the rule makes true: the patterns of `during` and `after`, except negated paths."""
        later_patterns = (pattern for pattern in patterns_in(self.agent, self.rule) if pattern.role is not Role.BEFORE)
        return tuple(
            pattern for pattern in later_patterns if not (isinstance(pattern.tree, Path) and pattern.tree.negated)
        )


_RuleNames = frozenset[str]
"""The names of rules that can begin."""


@dataclass(frozen=True)
class _RuleDependencies:
    """Finds the rules that make patterns of other rules true."""

    declared_graph: DeclaredGraph
    _achievers_by_pattern: dict[int, tuple[tuple[_Rule, ...], ...] | None] = field(default_factory=dict)

    @cached_property
    def rules(self) -> tuple[_Rule, ...]:
        """All rules, in file order."""
        return tuple(_Rule(agent, rule) for agent in self.declared_graph.spec.agents for rule in agent.conduct.rules)

    @cached_property
    def all_rule_names(self) -> _RuleNames:
        """The names of all rules, as if every rule could begin."""
        return frozenset(rule.name for rule in self.rules)

    def startable_names_from(self, given_names: _RuleNames) -> _RuleNames:
        """Return the names of the rules that can begin if the given rules can begin."""
        names = given_names
        while True:
            next_names = (
                frozenset(rule.name for rule in self.rules if self.impossible_pattern(rule, names) is None) | names
            )
            if next_names == names:
                return names
            names = next_names

    def impossible_pattern(self, rule: _Rule, startable_names: _RuleNames) -> Pattern | None:
        """Return the first `before` pattern that cannot become true if only the rules `startable_names` can begin.

        Return None if all `before` patterns can become true.
        """
        return next(
            (pattern for pattern in rule.before_patterns if not self.is_possible(pattern, startable_names)), None
        )

    def is_possible(self, pattern: Pattern, startable_names: _RuleNames) -> bool:
        """Return whether a pattern can become true if only the rules in `startable_names` can begin."""
        achievers_of_parts = self._achievers_of_parts(pattern)
        return achievers_of_parts is not None and all(
            not achievers or any(rule.name in startable_names for rule in achievers) for achievers in achievers_of_parts
        )

    def achievers(self, pattern: Pattern) -> Iterator[_Rule]:
        """Yield the rules that can make a pattern, or a part of the pattern, true; at least one of them must act."""
        for achievers_of_part in self._achievers_of_parts(pattern) or ():
            yield from achievers_of_part

    def _achievers_of_parts(self, pattern: Pattern) -> tuple[tuple[_Rule, ...], ...] | None:
        """Return, for each part of a pattern, the rules that can make the part true; at least one of them must act.

        The entry of a part that can become true without rules is (). If nothing can make some part true, return None.
        """
        key = id(pattern.condition)
        if key not in self._achievers_by_pattern:
            self._achievers_by_pattern[key] = self._find_achievers_of_parts(pattern)
        return self._achievers_by_pattern[key]

    def _find_achievers_of_parts(self, pattern: Pattern) -> tuple[tuple[_Rule, ...], ...] | None:
        if not isinstance(pattern.tree, Path):
            achievers = self._achievers_of_condition(pattern)
            return None if achievers is None else (achievers,)
        if pattern.tree.negated:
            return None if self.declared_graph.always_exists(pattern.tree) else ()
        achievers_of_steps = [self._achievers_of_step(step) for step in steps(pattern)]
        return (
            None
            if any(rules is None for rules in achievers_of_steps)
            else tuple(rules for rules in achievers_of_steps if rules is not None)
        )

    def _achievers_of_step(self, step: Step) -> tuple[_Rule, ...] | None:
        """Return the rules that can make an edge exist; one of them must act. () if the edge may exist without one."""
        task = self.declared_graph.task_of(step.origin, step.link.edge, step.target)
        if task is not None:
            if step.link.edge == TaskState.ABORTED:  # a deadline can always abort a task
                return ()
            writers = state_writers(task, step.link.edge)
            return self._achievers(
                writers, lambda effect: self._is_task_state(effect, task, step.link.edge), lambda _: True
            )
        if step.link.edge in {state.value for state in TaskState}:
            return ()
        achievers_of_edges: list[_Rule] = []
        for edge in self.declared_graph.edges_between(step.origin, step.link.edge, step.target):
            names = [writer.name for writer in self.declared_graph.writers(KnowledgeElement("edges", edge.name))]
            achievers = self._achievers(
                names, _make_edge_filter(self.declared_graph, edge), lambda effect: self._can_be_same_edge(effect, step)
            )
            if self.declared_graph.exists_initially(edge) or achievers == ():
                return ()
            achievers_of_edges += achievers or ()
        return tuple(dict.fromkeys(achievers_of_edges)) or None

    def _is_task_state(self, step: Step, task: Task, state: str) -> bool:
        named_task = self.declared_graph.task_of(step.origin, step.link.edge, step.target)
        return named_task is task and step.link.edge == state

    def _can_be_same_edge(self, effect: Step, step: Step) -> bool:
        may_be_same_node = self.declared_graph.may_be_same_node
        return may_be_same_node(effect.origin, step.origin) and may_be_same_node(effect.target, step.target)

    def _achievers(
        self, writers: Sequence[str], concerns: Callable[[Step], bool], fits: Callable[[Step], bool]
    ) -> tuple[_Rule, ...] | None:
        """Return the rules that make a step true.

        Return () if a writer has no rule about the step, and None if the writers' rules never make the step true.
        """
        achievers: list[_Rule] = []
        for writer in writers:
            effects = [
                (rule, step)
                for rule in self.rules
                if rule.agent.name == writer
                for effect in rule.effects
                for step in steps(effect)
                if concerns(step)
            ]
            if not effects:
                return ()
            achievers += [rule for rule, step in effects if fits(step)]
        return tuple(dict.fromkeys(achievers)) or None

    def _achievers_of_condition(self, pattern: Pattern) -> tuple[_Rule, ...] | None:
        """Return the rules that can make a condition over one value true; one must act. () if no rule must act."""
        names = {name.name for name in names_in_pattern(pattern)}
        name = names.pop() if len(names) == 1 else ""
        element = self.declared_graph.element_read_by(name) if name else None
        if element is None or any(
            value.name == element.attribute for node in self.declared_graph.spec.nodes for value in node.values
        ):
            return ()
        types = {name: self.declared_graph.name_type(name)}
        if not can_hold([pattern.tree], (), types):  # another check reports this contradiction
            return ()
        if element.section == "context" and not self.declared_graph.writers(
            element
        ):  # an observer may identify it at any time
            return ()
        achievers: list[_Rule] = []
        for writer in self.declared_graph.writers(element):
            effects = [
                (rule, effect)
                for rule in self.rules
                if rule.agent.name == writer.name
                for effect in rule.effects
                if {read_name.name for read_name in names_in_pattern(effect)} == {name}
            ]
            if not effects:
                return ()
            achievers += [rule for rule, effect in effects if can_hold([effect.tree, pattern.tree], (), types)]
        return tuple(dict.fromkeys(achievers)) or None

    def writers(self, pattern: Pattern) -> Iterable[str]:
        """Return the names of the writers of the elements in a pattern."""
        names: list[str] = []
        for step in steps(pattern):
            task = self.declared_graph.task_of(step.origin, step.link.edge, step.target)
            names += state_writers(task, step.link.edge) if task is not None else ()
            for edge in self.declared_graph.edges_between(step.origin, step.link.edge, step.target):
                names += [writer.name for writer in self.declared_graph.writers(KnowledgeElement("edges", edge.name))]
        for name in names_in_pattern(pattern):
            element = self.declared_graph.element_read_by(name.name)
            names += [writer.name for writer in self.declared_graph.writers(element)] if element is not None else ()
        return dict.fromkeys(names)


def _make_edge_filter(declared_graph: DeclaredGraph, edge: EdgeType) -> Callable[[Step], bool]:
    """Return a function that decides whether a step of a path can be an edge of this type."""
    return lambda step: edge in declared_graph.edges_between(step.origin, step.link.edge, step.target)


def _rule_finding(declared_graph: DeclaredGraph, rule: _Rule, rule_dependencies: _RuleDependencies) -> Diagnostic:
    pattern = rule_dependencies.impossible_pattern(rule, rule_dependencies.all_rule_names)
    assert pattern is not None
    return _pattern_finding(declared_graph, pattern, rule_dependencies, f"{rule.label} never begins")


def _wakes_findings(
    declared_graph: DeclaredGraph, agent: Agent, rule_dependencies: _RuleDependencies
) -> Iterator[Diagnostic]:
    """Yield the findings about patterns that never wake an agent."""
    wake_patterns = [
        Pattern(agent, Role.WAKES, None, condition, condition.tree)
        for condition in agent.conduct.wakes
        if condition.tree is not None
    ]
    for pattern in wake_patterns:
        if not rule_dependencies.is_possible(pattern, rule_dependencies.all_rule_names):
            yield _pattern_finding(
                declared_graph, pattern, rule_dependencies, f"this pattern never wakes agent '{agent.name}'"
            )


def _pattern_finding(
    declared_graph: DeclaredGraph, pattern: Pattern, rule_dependencies: _RuleDependencies, subject: str
) -> Diagnostic:
    if isinstance(pattern.tree, Path) and pattern.tree.negated:
        message = f"{subject}: '{pattern.condition.text}' is false from the start, and no agent removes these edges"
        help = "under 'source' of the edges, add an agent that removes them, or change the pattern"
    else:
        writers_text = " and ".join(f"'{name}'" for name in rule_dependencies.writers(pattern)) or "an agent"
        message = f"{subject}: nothing makes '{pattern.condition.text}' true"
        help = f"add the pattern to 'during' or 'after' of a rule of {writers_text}, or change the pattern"
    related = tuple(
        Related("declared here", edge.place)
        for step in steps(pattern)
        for edge in declared_graph.edges_between(step.origin, step.link.edge, step.target)
    )
    place = pattern.condition.place
    return finding("unreachable-rule", message, place, path=pattern.path, help=help, related=related)


def _cycle_findings(rule_dependencies: _RuleDependencies, stuck_names: _RuleNames) -> Iterator[Diagnostic]:
    """Yield findings about rules that wait for each other, one finding for each cycle."""
    startable_names = rule_dependencies.startable_names_from(stuck_names)
    waiting_rules = {rule.name: rule for rule in rule_dependencies.rules if rule.name not in startable_names}
    dependencies = {
        name: _awaited_names(rule_dependencies, rule, startable_names, waiting_rules)
        for name, rule in waiting_rules.items()
    }
    for component in graph.strong_components(dependencies):
        cycle = graph.shortest_cycle(
            {name: tuple(need for need in dependencies[name] if need in component) for name in component}
        )
        cycle_rules = [waiting_rules[name] for name in cycle]
        pattern = rule_dependencies.impossible_pattern(cycle_rules[0], startable_names)
        assert pattern is not None
        cycle_text = " -> ".join((*cycle, cycle[0]))
        yield finding(
            "unreachable-rule",
            f"rules wait for each other, so they never begin: {cycle_text}",
            pattern.condition.place,
            path=pattern.path,
            help="let one of these rules begin without the others, "
            "or let something else make its 'before' patterns true",
            related=tuple(_waiting_place(rule_dependencies, rule, startable_names) for rule in cycle_rules[1:]),
        )


def _awaited_names(
    rule_dependencies: _RuleDependencies, rule: _Rule, startable_names: _RuleNames, waiting_names: Iterable[str]
) -> tuple[str, ...]:
    """Return the names of the rules that a rule waits for, if they are among `waiting_names`."""
    unmet_patterns = [
        pattern for pattern in rule.before_patterns if not rule_dependencies.is_possible(pattern, startable_names)
    ]
    return tuple(
        dict.fromkeys(
            achiever.name
            for pattern in unmet_patterns
            for achiever in rule_dependencies.achievers(pattern)
            if achiever.name in waiting_names
        )
    )


def _waiting_place(rule_dependencies: _RuleDependencies, rule: _Rule, startable_names: _RuleNames) -> Related:
    pattern = rule_dependencies.impossible_pattern(rule, startable_names)
    assert pattern is not None
    return Related(f"{rule.label} waits for this", pattern.condition.place)


CHAIN_CHECKS = (unreachable_rules,)
"""The checks of this module."""
