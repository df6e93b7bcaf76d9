"""Checks of agents' rules (phase 4): patterns that must hold at the same time can hold together."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import replace

from codra_dsl.language.check.conditions.conditions import Role
from codra_dsl.language.check.conditions.types import Types
from codra_dsl.language.check.index.graph_schema import DeclaredGraph, KnowledgeElement
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.knowledge.mentions import Pattern, names_in_pattern, patterns_in, patterns_of, steps
from codra_dsl.language.check.knowledge.owners import is_knowledge_checkable, state_writers
from codra_dsl.language.check.solver.contradictions import (
    contradiction,
    never_true_message,
    related_places,
    state_condition,
)
from codra_dsl.language.diagnostics import Diagnostic, Place, Related
from codra_dsl.language.expression import Path
from codra_dsl.language.model import Agent, AgentRule


def contradictory_rules(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """The patterns under each key of a rule can hold together, and each pattern of `wakes` can hold.

    The patterns of `before` and `during` can hold together as well, except those patterns of `during` that the agent
    itself makes true.
    """
    if not is_knowledge_checkable(spec_index, faults):
        return
    for agent in spec_index.spec.agents:
        for pattern in patterns_of(agent):
            if pattern.role is Role.WAKES:
                yield from _exclusion_findings(spec_index, [pattern])
        for rule in agent.conduct.rules:
            yield from _contradictory_rule_findings(spec_index, agent, rule)


def _contradictory_rule_findings(spec_index: SpecIndex, agent: Agent, rule: AgentRule) -> Iterator[Diagnostic]:
    patterns_by_moment: dict[Role, list[Pattern]] = {Role.BEFORE: [], Role.DURING: [], Role.AFTER: []}
    for pattern in patterns_in(agent, rule):
        patterns_by_moment[pattern.role].append(pattern)
    findings_by_moment = [list(_exclusion_findings(spec_index, patterns)) for patterns in patterns_by_moment.values()]
    for findings in findings_by_moment:
        yield from findings
    lasting_patterns = [
        pattern for pattern in patterns_by_moment[Role.DURING] if not _is_own_effect(spec_index.declared_graph, pattern)
    ]
    if not any(findings_by_moment) and lasting_patterns:
        yield from _exclusion_findings(spec_index, [*patterns_by_moment[Role.BEFORE], *lasting_patterns])


def _exclusion_findings(spec_index: SpecIndex, patterns: Sequence[Pattern]) -> Iterator[Diagnostic]:
    """Yield findings about patterns that cannot hold together."""
    conditions = [
        pattern for pattern in patterns if not isinstance(pattern.tree, Path) and not _has_problem(spec_index, pattern)
    ]
    if conditions:
        types: Types = {
            name.name: spec_index.declared_graph.name_type(name.name)
            for pattern in conditions
            for name in names_in_pattern(pattern)
        }
        core = contradiction([state_condition(pattern.condition, pattern.tree) for pattern in conditions], types)
        if core:
            offender = next(
                pattern for pattern in conditions[::-1] if pattern.condition.place.span.line <= core[-1].place.span.line
            )
            related = tuple(related_places(core, types, spec_index.spec.context))
            yield _contradiction_finding(
                offender,
                never_true_message(core),
                "change one of them" if len(core) > 1 else "change it",
                core[-1].place,
                related,
            )
    for index, pattern in enumerate(patterns):
        for other in patterns[:index]:
            reason = _clash_reason(spec_index.declared_graph, other, pattern)
            if reason:
                related = (Related("cannot hold together with this", other.condition.place),)
                yield _contradiction_finding(pattern, reason, "remove one of them", pattern.condition.place, related)
                break


def _has_problem(spec_index: SpecIndex, pattern: Pattern) -> bool:
    judgement = spec_index.judgement(pattern.condition)
    return judgement is None or bool(judgement.problems)


def _clash_reason(declared_graph: DeclaredGraph, one: Pattern, other: Pattern) -> str:
    """Return why two paths cannot hold together; empty if they can hold together."""
    if not isinstance(one.tree, Path) or not isinstance(other.tree, Path):
        return ""
    if one.tree.negated != other.tree.negated:
        is_opposite = replace(one.tree, negated=False) == replace(other.tree, negated=False)
        return f"'{other.tree}' is the opposite of '{one.tree}'" if is_opposite else ""
    if one.tree.negated:
        return ""
    states = dict(_task_states(declared_graph, one))
    for task, state in _task_states(declared_graph, other):
        if states.get(task, state) != state:
            return f"task '{task}' has one state at a time, not '{states[task]}' and '{state}'"
    return ""


def _task_states(declared_graph: DeclaredGraph, pattern: Pattern) -> Iterator[tuple[str, str]]:
    for step in steps(pattern):
        task = declared_graph.task_of(step.origin, step.link.edge, step.target)
        if task is not None:
            yield task.name, step.link.edge


def _is_own_effect(declared_graph: DeclaredGraph, pattern: Pattern) -> bool:
    """Return whether an agent itself makes a pattern true, so that the pattern need not hold before the action."""
    name = pattern.agent.name
    for step in steps(pattern):
        task = declared_graph.task_of(step.origin, step.link.edge, step.target)
        edges = declared_graph.edges_between(step.origin, step.link.edge, step.target)
        if task is not None and name in state_writers(task, step.link.edge):
            return True
        if any(declared_graph.owns(name, KnowledgeElement("edges", edge.name)) for edge in edges):
            return True
    elements = (declared_graph.element_read_by(read_name.name) for read_name in names_in_pattern(pattern))
    return any(element is not None and declared_graph.owns(name, element) for element in elements)


def _contradiction_finding(
    pattern: Pattern, reason: str, help: str, place: Place, related: Iterable[Related]
) -> Diagnostic:
    location_text = (
        f"rule '{pattern.rule.name}' of {pattern.user}" if pattern.rule is not None else f"'wakes' of {pattern.user}"
    )
    message = f"{reason} ({location_text})"
    return finding("contradictory-rule", message, place, path=pattern.path, help=help, related=tuple(related))


TRIPLET_CHECKS = (contradictory_rules,)
"""The checks of this module."""
