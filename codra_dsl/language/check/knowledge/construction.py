"""The construction of `CheckedKnowledge`: patterns as Python text, owned and read elements, and initial values."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from codra_dsl.language.check.checked.knowledge import CheckedAgent, CheckedKnowledge, CheckedPattern, CheckedRule
from codra_dsl.language.check.index.graph_schema import DeclaredGraph
from codra_dsl.language.check.index.spec_index import OBSERVER, SpecIndex
from codra_dsl.language.check.knowledge.ends import starting_value
from codra_dsl.language.check.knowledge.owners import read_elements, writable_elements
from codra_dsl.language.expression import Path, reads_of
from codra_dsl.language.model import Agent, AgentRule, Condition, Literal

_READERS = frozenset({"value", "known", "age"})


def checked_knowledge(spec_index: SpecIndex) -> CheckedKnowledge | None:
    """Return the knowledge of a sound spec; None if the spec declares no knowledge."""
    if not spec_index.spec.knows:
        return None
    declared_graph = spec_index.declared_graph
    return CheckedKnowledge(
        world=declared_graph,
        agents=tuple(_agent(spec_index, agent) for agent in spec_index.spec.agents),
        writers=tuple(dict.fromkeys((*declared_graph.agents, *_writers(declared_graph)))),
        values={node.name: dict(_values(declared_graph, node.name)) for node in spec_index.spec.nodes},
    )


def _agent(spec_index: SpecIndex, agent: Agent) -> CheckedAgent:
    return CheckedAgent(
        agent=agent,
        owns=writable_elements(spec_index.declared_graph, agent.name),
        reads=read_elements(spec_index.declared_graph, agent),
        wakes=_patterns(spec_index, agent.conduct.wakes),
        rules=tuple(_rule(spec_index, rule) for rule in agent.conduct.rules),
    )


def _rule(spec_index: SpecIndex, rule: AgentRule) -> CheckedRule:
    return CheckedRule(
        name=rule.name,
        place=rule.place,
        before=_patterns(spec_index, rule.before),
        during=_patterns(spec_index, rule.during),
        after=_patterns(spec_index, rule.after),
    )


def _patterns(spec_index: SpecIndex, patterns: tuple[Condition, ...]) -> tuple[CheckedPattern, ...]:
    return tuple(_pattern(spec_index, pattern) for pattern in patterns)


def _pattern(spec_index: SpecIndex, pattern: Condition) -> CheckedPattern:
    path = pattern.tree if isinstance(pattern.tree, Path) else None
    python = (
        "" if path is not None else python_over_knowledge(spec_index.declared_graph, spec_index.python(pattern, None))
    )
    return CheckedPattern(text=pattern.text, place=pattern.place, path=path, python=python)


def python_over_knowledge(declared_graph: DeclaredGraph, python: str) -> str:
    """Return the Python text of a condition, changed so that each name is read as an attribute of a node."""
    return ast.unparse(_NodeNameTransformer(declared_graph).visit(ast.parse(python, mode="eval")))


class _NodeNameTransformer(ast.NodeTransformer):
    """Adds nodes to the names of context-variables, and replaces readings of poses by calls of runtime functions."""

    def __init__(self, declared_graph: DeclaredGraph) -> None:
        self._declared_graph = declared_graph

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Return the call that reads the same name from knowledge. Calls that read no name are not changed."""
        self.generic_visit(node)
        match node:
            case ast.Call(func=ast.Name(id=reader), args=[ast.Constant(value=str(name))]) if reader in _READERS:
                return self._renamed_call(reader, name)
        return node

    def _renamed_call(self, reader: str, name: str) -> ast.Call:
        function, first, second = reads_of(name)
        if function and reader == "value":
            return _make_call(function, first, second)
        return _make_call(
            reader, name if function or first else f"{self._declared_graph.variables[second].node}.{second}"
        )


def _make_call(function: str, *arguments: str) -> ast.Call:
    return ast.Call(
        func=ast.Name(id=function), args=[ast.Constant(value=argument) for argument in arguments], keywords=[]
    )


def _writers(declared_graph: DeclaredGraph) -> Iterator[str]:
    """Yield the names of all writers of the graph except `observer`, which is not an agent."""
    for element in declared_graph.elements():
        yield from (writer.name for writer in declared_graph.writers(element) if writer.name != OBSERVER)
    for task in declared_graph.tasks.values():
        yield from (task.by.name, *(requester.name for requester in task.requesters))


def _values(declared_graph: DeclaredGraph, name: str) -> Iterator[tuple[str, Literal]]:
    """Yield the initial values of a node."""
    node = declared_graph.nodes[name]
    kind = declared_graph.types.get(node.type.name)
    attributes = {attribute.name: attribute for attribute in (kind.attributes if kind is not None else ())}
    yield from ((value.name, starting_value(value, attributes[value.name])) for value in node.values)
