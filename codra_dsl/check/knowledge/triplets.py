"""Phase 4 for rules: what one moment of a rule says can hold together, and goes with what holds before."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from codra_dsl.check.conditions import Role
from codra_dsl.check.contradictions import contradiction, never_true, related_to, stated
from codra_dsl.check.knowledge.mentions import Pattern, names_read, patterns_in, patterns_of, steps
from codra_dsl.check.knowledge.owners import is_whole, may_write
from codra_dsl.check.knowledge.world import Thing, World
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.check.types import Types
from codra_dsl.diagnostics import Diagnostic, Place, Related
from codra_dsl.expression import Path
from codra_dsl.model import Agent, AgentRule


def contradictory_rules(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What a rule says of one moment can hold together; so can what holds before and what goes on to hold."""
    if not is_whole(scope, faults):
        return
    for agent in scope.spec.agents:
        for pattern in patterns_of(agent):
            if pattern.role is Role.WAKES:
                yield from _excluded(scope, [pattern])
        for rule in agent.conduct.rules:
            yield from _of_rule(scope, agent, rule)


def _of_rule(scope: Scope, agent: Agent, rule: AgentRule) -> Iterator[Diagnostic]:
    moments: dict[Role, list[Pattern]] = {Role.BEFORE: [], Role.DURING: [], Role.AFTER: []}
    for pattern in patterns_in(agent, rule):
        moments[pattern.role].append(pattern)
    found = [list(_excluded(scope, patterns)) for patterns in moments.values()]
    for several in found:
        yield from several
    lasting = [pattern for pattern in moments[Role.DURING] if not _is_own(scope.world, pattern)]
    if not any(found) and lasting:
        yield from _excluded(scope, [*moments[Role.BEFORE], *lasting])


def _excluded(scope: Scope, patterns: Sequence[Pattern]) -> Iterator[Diagnostic]:
    """Yield findings about patterns that cannot hold together."""
    conditions = [each for each in patterns if not isinstance(each.tree, Path) and not _is_wrong(scope, each)]
    if conditions:
        types: Types = {name.name: scope.world.read_type(name.name) for each in conditions for name in names_read(each)}
        core = contradiction([stated(each.said, each.tree) for each in conditions], types)
        if core:
            offender = next(each for each in conditions[::-1] if each.said.place.span.line <= core[-1].place.span.line)
            related = tuple(related_to(core, types, scope.spec.context))
            yield _told(
                offender,
                never_true(core),
                "change one of them" if len(core) > 1 else "change it",
                core[-1].place,
                related,
            )
    for index, pattern in enumerate(patterns):
        for other in patterns[:index]:
            reason = _clash(scope.world, other, pattern)
            if reason:
                related = (Related("cannot hold together with this", other.said.place),)
                yield _told(pattern, reason, "remove one of them", pattern.said.place, related)
                break


def _is_wrong(scope: Scope, pattern: Pattern) -> bool:
    judgement = scope.judgement(pattern.said)
    return judgement is None or bool(judgement.problems)


def _clash(world: World, one: Pattern, other: Pattern) -> str:
    """Return why two paths cannot hold together, or nothing."""
    if not isinstance(one.tree, Path) or not isinstance(other.tree, Path):
        return ""
    if one.tree.negated != other.tree.negated:
        same = replace(one.tree, negated=False) == replace(other.tree, negated=False)
        return f"'{other.tree}' says the contrary of '{one.tree}'" if same else ""
    if one.tree.negated:
        return ""
    states = dict(_states(world, one))
    for task, state in _states(world, other):
        if states.get(task, state) != state:
            return f"the edge of task '{task}' says one thing at a time, not '{states[task]}' and '{state}'"
    return ""


def _states(world: World, pattern: Pattern) -> Iterator[tuple[str, str]]:
    for step in steps(pattern):
        task = world.task_of(step.origin, step.link.edge, step.target)
        if task is not None:
            yield task.name, step.link.edge


def _is_own(world: World, pattern: Pattern) -> bool:
    """Return whether an agent itself makes what holds while it acts, so that it may differ from what held before."""
    name = pattern.agent.name
    for step in steps(pattern):
        task = world.task_of(step.origin, step.link.edge, step.target)
        edges = world.edges_between(step.origin, step.link.edge, step.target)
        if task is not None and name in may_write(task, step.link.edge):
            return True
        if any(world.owns(name, Thing("edges", edge.name)) for edge in edges):
            return True
    things = (world.read(each.name) for each in names_read(pattern))
    return any(thing is not None and world.owns(name, thing) for thing in things)


def _told(pattern: Pattern, reason: str, way_out: str, place: Place, related: Iterable[Related]) -> Diagnostic:
    where = (
        f"rule '{pattern.rule.name}' of {pattern.user}" if pattern.rule is not None else f"what wakes {pattern.user}"
    )
    message = f"{reason} ({where})"
    return finding("contradictory-rule", message, place, path=pattern.path, way_out=way_out, related=tuple(related))


TRIPLETS = (contradictory_rules,)
"""The rules of this subject."""
