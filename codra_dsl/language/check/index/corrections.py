"""Corrections of misspelt names in a spec, so that a reported misspelling causes no further findings."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import field, fields, replace
from typing import Any, TypeVar

from codra_dsl.language.expression import Name, Node, Path, names_in
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import (
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
"""The owner of declared names: a section or, for returned values, a tuple with only the name of the algorithm."""

IntendedNames = Mapping[str, str]
"""A mapping from misspelt names to intended names."""

Declared = TypeVar("Declared", Variable, Resource, Agent, Returned)
Typed = TypeVar("Typed", Variable, Returned)

_NO_CORRECTIONS: IntendedNames = {}


@dataclass(frozen=True)
class Corrections:
    """The intended names for misspelt names. The checks collect these names while they run.

    Attributes:
        declarations: for each owner, the intended names for misspelt names of declarations.
        references: for each owner, the intended names for misspelt names in references to declarations.
        members: for each enum with a wrong member, the intended members. A key is the owner and the name of an enum.
    """

    declarations: dict[Owner, dict[str, str]] = field(default_factory=dict)
    references: dict[Owner, dict[str, str]] = field(default_factory=dict)
    members: dict[tuple[Owner, str], tuple[str, ...]] = field(default_factory=dict)

    def add_misspelt_declaration(self, owner: Owner, misspelt_name: str, intended_name: str) -> None:
        """Record a misspelt declaration."""
        self.declarations.setdefault(owner, {})[misspelt_name] = intended_name

    def add_misspelt_reference(self, owner: Owner, misspelt_name: str, intended_name: str) -> None:
        """Record a misspelt reference."""
        self.references.setdefault(owner, {})[misspelt_name] = intended_name

    def __bool__(self) -> bool:
        """Return whether anything is misspelt."""
        return bool(self.declarations or self.references or self.members)


def apply_corrections(spec: Spec, corrections: Corrections) -> Spec:
    """Return a spec with the intended names instead of the misspelt names. All places stay the same."""
    return _Corrector(corrections).spec(spec)


class _Corrector:
    """Corrects names, element by element. An element without a misspelt name is not changed."""

    def __init__(self, corrections: Corrections) -> None:
        self._corrections = corrections
        self._variable_corrections = corrections.references.get("context", _NO_CORRECTIONS)
        self._agent_corrections = corrections.references.get("agents", _NO_CORRECTIONS)

    def spec(self, spec: Spec) -> Spec:
        """Return a spec with all corrections."""
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
        return section, self._corrections.declarations.get(section, _NO_CORRECTIONS).get(name, name)

    def _keys(self, key: tuple[str, str], keys: frozenset[str]) -> frozenset[str]:
        """Return the damaged keys of an element. Keys of returned values contain the intended names."""
        returned_corrections = (
            self._corrections.declarations.get((key[1],), _NO_CORRECTIONS)
            if key[0] == "perception"
            else _NO_CORRECTIONS
        )
        return frozenset(
            f"returns.{returned_corrections[key[8:]]}" if key[8:] in returned_corrections else key for key in keys
        )

    def _declared(self, owner: Owner, elements: Iterable[Declared]) -> tuple[Declared, ...]:
        names = self._corrections.declarations.get(owner, _NO_CORRECTIONS)
        return tuple(
            replace(element, name=names[element.name]) if element.name in names else element for element in elements
        )

    def _variable(self, variable: Variable) -> Variable:
        sources = self._references(variable.sources, self._agent_corrections)
        return self._with_members(replace(variable, sources=sources), "context")

    def _with_members(self, element: Typed, owner: Owner) -> Typed:
        members = self._corrections.members.get((owner, element.name))
        if members is None:
            return element
        declared_type: ValueType = replace(element.type, values=members)
        return replace(element, type=declared_type)

    def _algorithm(self, algorithm: Algorithm) -> Algorithm:
        returned_corrections = self._corrections.references.get((algorithm.name,), _NO_CORRECTIONS)
        resources = self._corrections.references.get("resources", _NO_CORRECTIONS)
        returns = self._declared((algorithm.name,), algorithm.returns)
        return replace(
            algorithm,
            uses=tuple(replace(usage, resource=_reference(usage.resource, resources)) for usage in algorithm.uses),
            given=self._references(algorithm.given, self._variable_corrections),
            returns=tuple(self._with_members(returned, (algorithm.name,)) for returned in returns),
            observable_when=tuple(
                _condition(condition, self._variable_corrections) for condition in algorithm.observable_when
            ),
            accept_when=tuple(_condition(condition, returned_corrections) for condition in algorithm.accept_when),
            identifies=tuple(self._identification(entry, returned_corrections) for entry in algorithm.identifies),
        )

    def _identification(self, entry: Identification, returned_corrections: IntendedNames) -> Identification:
        by = entry.by
        if isinstance(by, Members):
            by = replace(
                by, cases=tuple((member, _condition(condition, returned_corrections)) for member, condition in by.cases)
            )
        elif isinstance(by, Hysteresis):
            leave_condition = None if by.leave is None else _condition(by.leave, returned_corrections)
            by = replace(by, enter=_condition(by.enter, returned_corrections), leave=leave_condition)
        else:
            by = _condition(by, returned_corrections)
        return Identification(variable=_reference(entry.variable, self._variable_corrections), by=by)

    def _skill(self, skill: Skill) -> Skill:
        return replace(
            skill,
            preview=self._references(skill.preview, self._variable_corrections),
            preview_names=self._references(skill.preview_names, self._variable_corrections),
            preview_conditions=tuple(
                _condition(condition, self._variable_corrections) for condition in skill.preview_conditions
            ),
            monitor=tuple(map(self._expectation, skill.monitor)),
            changes=self._references(skill.changes, self._variable_corrections),
        )

    def _expectation(self, expectation: Expectation) -> Expectation:
        condition = expectation.condition
        return replace(
            expectation,
            variable=_reference(expectation.variable, self._variable_corrections),
            condition=None if condition is None else _condition(condition, self._variable_corrections),
        )

    def _observer(self, setting: ObserverSetting) -> ObserverSetting:
        return replace(setting, identifies=self._references(setting.identifies, self._variable_corrections))

    def _agent(self, agent: Agent) -> Agent:
        if agent.conduct.is_bare or not self._variable_corrections:
            return agent
        conduct = agent.conduct
        rules = tuple(map(self._rule, conduct.rules))
        return replace(agent, conduct=replace(conduct, wakes=self._patterns(conduct.wakes), rules=rules))

    def _rule(self, rule: AgentRule) -> AgentRule:
        before, during, after = (self._patterns(patterns) for patterns in (rule.before, rule.during, rule.after))
        return replace(rule, before=before, during=during, after=after)

    def _patterns(self, patterns: Iterable[Condition]) -> tuple[Condition, ...]:
        return tuple(
            pattern if isinstance(pattern.tree, Path) else _condition(pattern, self._variable_corrections)
            for pattern in patterns
        )

    def _node_type(self, kind: NodeType) -> NodeType:
        return replace(kind, sources=self._writers(kind.sources), attributes=self._attributes(kind.attributes))

    def _edge(self, edge: EdgeType) -> EdgeType:
        return replace(edge, sources=self._writers(edge.sources), attributes=self._attributes(edge.attributes))

    def _attributes(self, attributes: Iterable[Attribute]) -> tuple[Attribute, ...]:
        return tuple(replace(attribute, sources=self._writers(attribute.sources)) for attribute in attributes)

    def _writers(self, writers: Iterable[Writer]) -> tuple[Writer, ...]:
        return tuple(replace(writer, name=self._agent_corrections.get(writer.name, writer.name)) for writer in writers)

    def _task(self, task: Task) -> Task:
        requesters = self._references(task.requesters, self._agent_corrections)
        return replace(task, by=_reference(task.by, self._agent_corrections), requesters=requesters)

    def _references(self, references: Iterable[Reference], names: IntendedNames) -> tuple[Reference, ...]:
        return tuple(_reference(reference, names) for reference in references)


def _reference(reference: Reference, names: IntendedNames) -> Reference:
    intended_name = names.get(reference.name)
    return reference if intended_name is None else replace(reference, name=intended_name)


def _condition(condition: Condition, names: IntendedNames) -> Condition:
    tree = condition.tree
    if tree is None or not names or not any(name.name in names for name in names_in(tree)):
        return condition
    return replace(condition, tree=_correct_tree(tree, names))


def _correct_tree(node: Node, names: IntendedNames) -> Node:
    """Return a syntax tree with the intended names. The positions of its nodes stay the same."""
    if isinstance(node, Name):
        return replace(node, name=names.get(node.name, node.name))
    return replace(
        node, **{node_field.name: _correct_field(getattr(node, node_field.name), names) for node_field in fields(node)}
    )


def _correct_field(value: Any, names: IntendedNames) -> Any:
    """Return the value of a field of a node, with the intended names in all nodes that the value contains."""
    if isinstance(value, tuple):
        return tuple(_correct_field(part, names) for part in value)
    return _correct_tree(value, names) if isinstance(value, Node) else value
