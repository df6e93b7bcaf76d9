"""A spec as it was meant: misspelt names put right, so that nothing follows from a slip that has been reported."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, TypeVar

from codra_dsl.expression import Name, Node, Path, names_in
from codra_dsl.model import (
    Agent,
    AgentRule,
    Algorithm,
    Attribute,
    Condition,
    EdgeType,
    Expectation,
    Hysteresis,
    Identification,
    Members,
    NodeType,
    ObserverSetting,
    Reference,
    Resource,
    Returned,
    Skill,
    Spec,
    Task,
    ValueType,
    Variable,
    Writer,
)

Owner = str | tuple[str]
"""Who declares names: a section, or the algorithm, alone in a tuple, for what it returns."""

Names = Mapping[str, str]
"""What is meant, by what is written."""

Declared = TypeVar("Declared", Variable, Resource, Agent, Returned)
Typed = TypeVar("Typed", Variable, Returned)

_NONE: Names = {}


@dataclass(frozen=True)
class Meant:
    """What is meant by names that are misspelt, as findings are made.

    Attributes:
        declared: by section, or by algorithm for what it returns, the names of declarations.
        used: by section, or by algorithm for what it returns, the names by which they are referred to.
        members: by section and name, or by algorithm and returned value, the members that an enum was to have.
    """

    declared: dict[Owner, dict[str, str]] = field(default_factory=dict)
    used: dict[Owner, dict[str, str]] = field(default_factory=dict)
    members: dict[tuple[Owner, str], tuple[str, ...]] = field(default_factory=dict)

    def declaration(self, owner: Owner, written: str, meant: str) -> None:
        """Note a declaration that is misspelt."""
        self.declared.setdefault(owner, {})[written] = meant

    def use(self, owner: Owner, written: str, meant: str) -> None:
        """Note a name that is misspelt where it is used."""
        self.used.setdefault(owner, {})[written] = meant

    def __bool__(self) -> bool:
        """Return whether anything is misspelt."""
        return bool(self.declared or self.used or self.members)


def read_as_meant(spec: Spec, meant: Meant) -> Spec:
    """Return a spec with the names that are meant in place of those that are misspelt; places stay."""
    return _Reading(meant).spec(spec)


class _Reading:
    """Puts names right, element by element; what holds none that is misspelt stays as it is."""

    def __init__(self, meant: Meant) -> None:
        self._meant = meant
        self._context = meant.used.get("context", _NONE)
        self._agents = meant.used.get("agents", _NONE)

    def spec(self, spec: Spec) -> Spec:
        """Return a whole spec."""
        return replace(
            spec,
            context=tuple(map(self._variable, self._declared("context", spec.context))),
            perception=tuple(map(self._algorithm, spec.perception)),
            skills=tuple(map(self._skill, spec.skills)),
            observers=tuple(map(self._observer, spec.observers)),
            resources=self._declared("resources", spec.resources),
            agents=tuple(map(self._agent, self._declared("agents", spec.agents))),
            types=tuple(map(self._node_type, spec.types)),
            edges=tuple(map(self._edge, spec.edges)),
            tasks=tuple(map(self._task, spec.tasks)),
            damaged_keys={self._key(key): self._keys(key, keys) for key, keys in spec.damaged_keys.items()},
        )

    def _key(self, key: tuple[str, str]) -> tuple[str, str]:
        section, name = key
        return section, self._meant.declared.get(section, _NONE).get(name, name)

    def _keys(self, key: tuple[str, str], keys: frozenset[str]) -> frozenset[str]:
        """Return which keys of an element are damaged, returned values by the names that are meant."""
        returned = self._meant.declared.get((key[1],), _NONE) if key[0] == "perception" else _NONE
        return frozenset(f"returns.{returned[each[8:]]}" if each[8:] in returned else each for each in keys)

    def _declared(self, owner: Owner, elements: Iterable[Declared]) -> tuple[Declared, ...]:
        names = self._meant.declared.get(owner, _NONE)
        return tuple(replace(each, name=names[each.name]) if each.name in names else each for each in elements)

    def _variable(self, variable: Variable) -> Variable:
        sources = self._references(variable.sources, self._agents)
        return self._with_members(replace(variable, sources=sources), "context")

    def _with_members(self, typed: Typed, owner: Owner) -> Typed:
        members = self._meant.members.get((owner, typed.name))
        if members is None:
            return typed
        declared: ValueType = replace(typed.type, values=members)
        return replace(typed, type=declared)

    def _algorithm(self, algorithm: Algorithm) -> Algorithm:
        seen = self._meant.used.get((algorithm.name,), _NONE)
        resources = self._meant.used.get("resources", _NONE)
        returns = self._declared((algorithm.name,), algorithm.returns)
        return replace(
            algorithm,
            uses=tuple(replace(each, resource=_reference(each.resource, resources)) for each in algorithm.uses),
            given=self._references(algorithm.given, self._context),
            returns=tuple(self._with_members(each, (algorithm.name,)) for each in returns),
            observable_when=tuple(_condition(each, self._context) for each in algorithm.observable_when),
            accept_when=tuple(_condition(each, seen) for each in algorithm.accept_when),
            identifies=tuple(self._identification(each, seen) for each in algorithm.identifies),
        )

    def _identification(self, entry: Identification, seen: Names) -> Identification:
        by = entry.by
        if isinstance(by, Members):
            by = replace(by, cases=tuple((member, _condition(each, seen)) for member, each in by.cases))
        elif isinstance(by, Hysteresis):
            leave = None if by.leave is None else _condition(by.leave, seen)
            by = replace(by, enter=_condition(by.enter, seen), leave=leave)
        else:
            by = _condition(by, seen)
        return Identification(variable=_reference(entry.variable, self._context), by=by)

    def _skill(self, skill: Skill) -> Skill:
        return replace(
            skill,
            preview=self._references(skill.preview, self._context),
            monitor=tuple(map(self._expectation, skill.monitor)),
            changes=self._references(skill.changes, self._context),
        )

    def _expectation(self, expectation: Expectation) -> Expectation:
        condition = expectation.condition
        return replace(
            expectation,
            variable=_reference(expectation.variable, self._context),
            condition=None if condition is None else _condition(condition, self._context),
        )

    def _observer(self, setting: ObserverSetting) -> ObserverSetting:
        return replace(setting, identifies=self._references(setting.identifies, self._context))

    def _agent(self, agent: Agent) -> Agent:
        if agent.conduct.is_bare or not self._context:
            return agent
        conduct = agent.conduct
        rules = tuple(map(self._rule, conduct.rules))
        return replace(agent, conduct=replace(conduct, wakes=self._patterns(conduct.wakes), rules=rules))

    def _rule(self, rule: AgentRule) -> AgentRule:
        before, during, after = (self._patterns(each) for each in (rule.before, rule.during, rule.after))
        return replace(rule, before=before, during=during, after=after)

    def _patterns(self, patterns: Iterable[Condition]) -> tuple[Condition, ...]:
        return tuple(each if isinstance(each.tree, Path) else _condition(each, self._context) for each in patterns)

    def _node_type(self, kind: NodeType) -> NodeType:
        return replace(kind, sources=self._writers(kind.sources), attributes=self._attributes(kind.attributes))

    def _edge(self, edge: EdgeType) -> EdgeType:
        return replace(edge, sources=self._writers(edge.sources), attributes=self._attributes(edge.attributes))

    def _attributes(self, attributes: Iterable[Attribute]) -> tuple[Attribute, ...]:
        return tuple(replace(each, sources=self._writers(each.sources)) for each in attributes)

    def _writers(self, writers: Iterable[Writer]) -> tuple[Writer, ...]:
        return tuple(replace(each, name=self._agents.get(each.name, each.name)) for each in writers)

    def _task(self, task: Task) -> Task:
        requesters = self._references(task.requesters, self._agents)
        return replace(task, by=_reference(task.by, self._agents), requesters=requesters)

    def _references(self, references: Iterable[Reference], names: Names) -> tuple[Reference, ...]:
        return tuple(_reference(each, names) for each in references)


def _reference(reference: Reference, names: Names) -> Reference:
    meant = names.get(reference.name)
    return reference if meant is None else replace(reference, name=meant)


def _condition(condition: Condition, names: Names) -> Condition:
    tree = condition.tree
    if tree is None or not names or not any(name.name in names for name in names_in(tree)):
        return condition
    return replace(condition, tree=_renamed(tree, names))


def _renamed(node: Node, names: Names) -> Node:
    """Return a syntax tree with other names; its parts stand where they stood."""
    if isinstance(node, Name):
        return replace(node, name=names.get(node.name, node.name))
    return replace(node, **{each.name: _all_renamed(getattr(node, each.name), names) for each in fields(node)})


def _all_renamed(value: Any, names: Names) -> Any:
    """Return what a part of a syntax tree holds, with other names in the trees that it holds."""
    if isinstance(value, tuple):
        return tuple(_all_renamed(each, names) for each in value)
    return _renamed(value, names) if isinstance(value, Node) else value
