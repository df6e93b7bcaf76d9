"""Phase 4 for rules: each can begin, because something brings about what it needs before (P2, section 3.1).

What is there from the start is there, and who has no rules may write what it owns at any time. An agent whose rules
speak of something brings that about by those rules alone. A rule can begin once all that it needs before can be: the
least fixed point of that says which rules can.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from functools import cached_property

from codra_dsl import graph
from codra_dsl.check.conditions import Role
from codra_dsl.check.knowledge.mentions import Pattern, Step, names_read, patterns_in, steps
from codra_dsl.check.knowledge.owners import is_whole, may_write
from codra_dsl.check.knowledge.world import Thing, World
from codra_dsl.check.possible import can_hold
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.diagnostics import Diagnostic, Related
from codra_dsl.expression import Path
from codra_dsl.model import Agent, AgentRule, EdgeType, Task, TaskState


def unreachable_rules(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What a rule needs before it begins, and what wakes an agent, can be brought about."""
    if not is_whole(scope, faults):
        return
    chains = _Chains(scope.world)
    stuck = [each for each in chains.rules if chains.missing(each, chains.everything) is not None]
    for each in stuck:
        yield _never(scope.world, each, chains)
    for agent in scope.spec.agents:
        yield from _asleep(scope.world, agent, chains)
    yield from _circles(chains, frozenset(each.name for each in stuck))


@dataclass(frozen=True, eq=False)
class _Rule:
    """A rule with its patterns."""

    agent: Agent
    rule: AgentRule

    @property
    def name(self) -> str:
        """Return a name that no other rule has."""
        return f"{self.agent.name}.{self.rule.name}"

    @property
    def said(self) -> str:
        """Return it as messages name it."""
        return f"rule '{self.rule.name}' of agent '{self.agent.name}'"

    @cached_property
    def before(self) -> tuple[Pattern, ...]:
        """What it needs."""
        return tuple(each for each in patterns_in(self.agent, self.rule) if each.role is Role.BEFORE)

    @cached_property
    def effects(self) -> tuple[Pattern, ...]:
        """What it brings about: all that holds while it acts or after, but that there is none of something."""
        found = (each for each in patterns_in(self.agent, self.rule) if each.role is not Role.BEFORE)
        return tuple(each for each in found if not (isinstance(each.tree, Path) and each.tree.negated))


_Startable = frozenset[str]
"""The names of rules that can begin."""


@dataclass(frozen=True)
class _Chains:
    """Which rules bring about what others need."""

    world: World
    _sources: dict[int, tuple[tuple[_Rule, ...], ...] | None] = field(default_factory=dict)

    @cached_property
    def rules(self) -> tuple[_Rule, ...]:
        """All rules, in file order."""
        return tuple(_Rule(agent, rule) for agent in self.world.spec.agents for rule in agent.conduct.rules)

    @cached_property
    def everything(self) -> _Startable:
        """As if every rule could begin."""
        return frozenset(each.name for each in self.rules)

    def startable(self, given: _Startable) -> _Startable:
        """Return the rules that can begin, if some are taken to."""
        found = given
        while True:
            more = frozenset(each.name for each in self.rules if self.missing(each, found) is None) | found
            if more == found:
                return found
            found = more

    def missing(self, rule: _Rule, startable: _Startable) -> Pattern | None:
        """Return the first pattern before a rule that cannot be brought about if just some rules can begin."""
        return next((each for each in rule.before if not self.possible(each, startable)), None)

    def possible(self, pattern: Pattern, startable: _Startable) -> bool:
        """Return whether a pattern can be brought about if just some rules can begin."""
        needed = self._needed(pattern)
        return needed is not None and all(
            not several or any(rule.name in startable for rule in several) for several in needed
        )

    def makers(self, pattern: Pattern) -> Iterator[_Rule]:
        """Yield the rules that alone can bring about a pattern, or a part of it."""
        for several in self._needed(pattern) or ():
            yield from several

    def _needed(self, pattern: Pattern) -> tuple[tuple[_Rule, ...], ...] | None:
        """Return, for each part of a pattern, the rules of which one must act; none where others may bring it about.

        It is None where nothing brings a part about.
        """
        key = id(pattern.said)
        if key not in self._sources:
            self._sources[key] = self._found(pattern)
        return self._sources[key]

    def _found(self, pattern: Pattern) -> tuple[tuple[_Rule, ...], ...] | None:
        if not isinstance(pattern.tree, Path):
            makers = self._makers_of_condition(pattern)
            return None if makers is None else (makers,)
        if pattern.tree.negated:
            return None if self.world.is_there(pattern.tree) else ()
        found = [self._makers_of_step(step) for step in steps(pattern)]
        return None if any(each is None for each in found) else tuple(each for each in found if each is not None)

    def _makers_of_step(self, step: Step) -> tuple[_Rule, ...] | None:
        """Return the rules of which one must act before there is an edge; () where it may be there without."""
        task = self.world.task_of(step.origin, step.link.edge, step.target)
        if task is not None:
            if step.link.edge == TaskState.ABORTED:  # by a deadline, if by nothing else
                return ()
            writers = may_write(task, step.link.edge)
            return self._makers(writers, lambda each: self._says(each, task, step.link.edge), lambda _: True)
        if step.link.edge in {state.value for state in TaskState}:
            return ()
        found: list[_Rule] = []
        for edge in self.world.edges_between(step.origin, step.link.edge, step.target):
            names = [writer.name for writer in self.world.writers(Thing("edges", edge.name))]
            makers = self._makers(names, _draws(self.world, edge), lambda each: self._meets(each, step))
            if self.world.starts_with(edge) or makers == ():
                return ()
            found += makers or ()
        return tuple(dict.fromkeys(found)) or None

    def _says(self, step: Step, task: Task, state: str) -> bool:
        found = self.world.task_of(step.origin, step.link.edge, step.target)
        return found is task and step.link.edge == state

    def _meets(self, effect: Step, step: Step) -> bool:
        may_be = self.world.may_be
        return may_be(effect.origin, step.origin) and may_be(effect.target, step.target)

    def _makers(
        self, writers: Sequence[str], concerns: Callable[[Step], bool], fits: Callable[[Step], bool]
    ) -> tuple[_Rule, ...] | None:
        """Return the rules that bring something about; () where a writer has none about it, None where nobody does."""
        found: list[_Rule] = []
        for writer in writers:
            told = [
                (rule, step)
                for rule in self.rules
                if rule.agent.name == writer
                for effect in rule.effects
                for step in steps(effect)
                if concerns(step)
            ]
            if not told:
                return ()
            found += [rule for rule, step in told if fits(step)]
        return tuple(dict.fromkeys(found)) or None

    def _makers_of_condition(self, pattern: Pattern) -> tuple[_Rule, ...] | None:
        """Return the rules of which one must act before a condition over one value can hold; () where none must."""
        names = {name.name for name in names_read(pattern)}
        name = names.pop() if len(names) == 1 else ""
        thing = self.world.read(name) if name else None
        if thing is None or any(
            value.name == thing.attribute for node in self.world.spec.nodes for value in node.values
        ):
            return ()
        types = {name: self.world.read_type(name)}
        if not can_hold([pattern.tree], (), types):  # which is told as a contradiction
            return ()
        if thing.section == "context" and not self.world.writers(thing):  # an observer identifies it, whenever it can
            return ()
        found: list[_Rule] = []
        for writer in self.world.writers(thing):
            told = [
                (rule, effect)
                for rule in self.rules
                if rule.agent.name == writer.name
                for effect in rule.effects
                if {each.name for each in names_read(effect)} == {name}
            ]
            if not told:
                return ()
            found += [rule for rule, effect in told if can_hold([effect.tree, pattern.tree], (), types)]
        return tuple(dict.fromkeys(found)) or None

    def writers(self, pattern: Pattern) -> Iterable[str]:
        """Return who may write what a pattern names."""
        found: list[str] = []
        for step in steps(pattern):
            task = self.world.task_of(step.origin, step.link.edge, step.target)
            found += may_write(task, step.link.edge) if task is not None else ()
            for edge in self.world.edges_between(step.origin, step.link.edge, step.target):
                found += [writer.name for writer in self.world.writers(Thing("edges", edge.name))]
        for name in names_read(pattern):
            thing = self.world.read(name.name)
            found += [writer.name for writer in self.world.writers(thing)] if thing is not None else ()
        return dict.fromkeys(found)


def _draws(world: World, edge: EdgeType) -> Callable[[Step], bool]:
    """Return what tells whether a step is about an edge of a type."""
    return lambda step: edge in world.edges_between(step.origin, step.link.edge, step.target)


def _never(world: World, rule: _Rule, chains: _Chains) -> Diagnostic:
    pattern = chains.missing(rule, chains.everything)
    assert pattern is not None
    return _unmet(world, pattern, chains, f"{rule.said} never begins")


def _asleep(world: World, agent: Agent, chains: _Chains) -> Iterator[Diagnostic]:
    """Yield the finding about an agent that nothing wakes."""
    wakes = [Pattern(agent, Role.WAKES, None, each, each.tree) for each in agent.conduct.wakes if each.tree is not None]
    for pattern in wakes:
        if not chains.possible(pattern, chains.everything):
            yield _unmet(world, pattern, chains, f"agent '{agent.name}' is never woken by it")


def _unmet(world: World, pattern: Pattern, chains: _Chains, what: str) -> Diagnostic:
    if isinstance(pattern.tree, Path) and pattern.tree.negated:
        message = f"{what}: what '{pattern.said.text}' rules out is there from the start, and nobody takes it away"
        way_out = "say with 'source' who does, or change the pattern"
    else:
        who = " and ".join(f"'{name}'" for name in chains.writers(pattern)) or "nobody"
        message = f"{what}: nothing brings about '{pattern.said.text}'"
        way_out = f"add it to what a rule of {who} has under 'during' or 'after', or change the pattern"
    related = tuple(
        Related("declared here", edge.place)
        for step in steps(pattern)
        for edge in world.edges_between(step.origin, step.link.edge, step.target)
    )
    place = pattern.said.place
    return finding("unreachable-rule", message, place, path=pattern.path, way_out=way_out, related=related)


def _circles(chains: _Chains, stuck: _Startable) -> Iterator[Diagnostic]:
    """Yield findings about rules that wait for each other, each circle once."""
    startable = chains.startable(stuck)
    left = {each.name: each for each in chains.rules if each.name not in startable}
    waits = {name: _awaited(chains, rule, startable, left) for name, rule in left.items()}
    for names in graph.strong_components(waits):
        cycle = graph.shortest_cycle({name: tuple(each for each in waits[name] if each in names) for name in names})
        circle = [left[name] for name in cycle]
        pattern = chains.missing(circle[0], startable)
        assert pattern is not None
        shown = " -> ".join((*cycle, cycle[0]))
        yield finding(
            "unreachable-rule",
            f"rules wait for each other, so that none of them ever begins: {shown}",
            pattern.said.place,
            path=pattern.path,
            way_out="let one of them begin without the others, or let something else bring about what it needs",
            related=tuple(_related(chains, each, startable) for each in circle[1:]),
        )


def _awaited(chains: _Chains, rule: _Rule, startable: _Startable, left: Iterable[str]) -> tuple[str, ...]:
    """Return the rules that a rule waits for, of those that never begin."""
    found = [each for each in rule.before if not chains.possible(each, startable)]
    return tuple(dict.fromkeys(maker.name for each in found for maker in chains.makers(each) if maker.name in left))


def _related(chains: _Chains, rule: _Rule, startable: _Startable) -> Related:
    pattern = chains.missing(rule, startable)
    assert pattern is not None
    return Related(f"{rule.said} waits for this", pattern.said.place)


CHAINS = (unreachable_rules,)
"""The rules of this subject."""
