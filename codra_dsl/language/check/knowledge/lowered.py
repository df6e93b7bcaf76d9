"""The construction of `CheckedKnowledge`: lowered patterns, owned and read elements, and initial values."""

from __future__ import annotations

import ast
from collections.abc import Iterator

from codra_dsl.language.check.checked.knowledge import CheckedAgent, CheckedKnowledge, CheckedPattern, CheckedRule
from codra_dsl.language.check.index.graph_schema import DeclaredGraph
from codra_dsl.language.check.index.spec_index import OBSERVER, SpecIndex
from codra_dsl.language.check.knowledge.ends import starting_value
from codra_dsl.language.check.knowledge.owners import owns, reads
from codra_dsl.language.expression import Path, reads_of
from codra_dsl.language.model import Agent, AgentRule, Condition, Literal

_READERS = frozenset({"value", "known", "age"})


def checked_knowledge(scope: SpecIndex) -> CheckedKnowledge | None:
    """Return the knowledge of a sound spec; None if it declares none."""
    if not scope.spec.knows:
        return None
    world = scope.world
    return CheckedKnowledge(
        world=world,
        agents=tuple(_agent(scope, agent) for agent in scope.spec.agents),
        writers=tuple(dict.fromkeys((*world.agents, *_writers(world)))),
        values={node.name: dict(_values(world, node.name)) for node in scope.spec.nodes},
    )


def _agent(scope: SpecIndex, agent: Agent) -> CheckedAgent:
    return CheckedAgent(
        agent=agent,
        owns=owns(scope.world, agent.name),
        reads=reads(scope.world, agent),
        wakes=_patterns(scope, agent.conduct.wakes),
        rules=tuple(_rule(scope, rule) for rule in agent.conduct.rules),
    )


def _rule(scope: SpecIndex, rule: AgentRule) -> CheckedRule:
    return CheckedRule(
        name=rule.name,
        place=rule.place,
        before=_patterns(scope, rule.before),
        during=_patterns(scope, rule.during),
        after=_patterns(scope, rule.after),
    )


def _patterns(scope: SpecIndex, patterns: tuple[Condition, ...]) -> tuple[CheckedPattern, ...]:
    return tuple(_pattern(scope, pattern) for pattern in patterns)


def _pattern(scope: SpecIndex, pattern: Condition) -> CheckedPattern:
    path = pattern.tree if isinstance(pattern.tree, Path) else None
    python = "" if path is not None else over_knowledge(scope.world, scope.python(pattern, None))
    return CheckedPattern(text=pattern.text, place=pattern.place, path=path, python=python)


def over_knowledge(world: DeclaredGraph, python: str) -> str:
    """Return a lowered condition in which each name is read as an attribute of a node."""
    return ast.unparse(_Naming(world).visit(ast.parse(python, mode="eval")))


class _Naming(ast.NodeTransformer):
    """Puts the node of each context-variable before its name, and replaces readings of poses by runtime functions."""

    def __init__(self, world: DeclaredGraph) -> None:
        self._world = world

    def visit_Call(self, node: ast.Call) -> ast.AST:
        """Return a call that reads a name from knowledge; other calls stay as they are."""
        self.generic_visit(node)
        match node:
            case ast.Call(func=ast.Name(id=reader), args=[ast.Constant(value=str(name))]) if reader in _READERS:
                return self._reading(reader, name)
        return node

    def _reading(self, reader: str, name: str) -> ast.Call:
        function, first, second = reads_of(name)
        if function and reader == "value":
            return _make_call(function, first, second)
        return _make_call(reader, name if function or first else f"{self._world.variables[second].node}.{second}")


def _make_call(function: str, *arguments: str) -> ast.Call:
    return ast.Call(
        func=ast.Name(id=function), args=[ast.Constant(value=argument) for argument in arguments], keywords=[]
    )


def _writers(world: DeclaredGraph) -> Iterator[str]:
    """Yield the names of all writers of the graph except `observer`, which is not an agent."""
    for element in world.elements():
        yield from (writer.name for writer in world.writers(element) if writer.name != OBSERVER)
    for task in world.tasks.values():
        yield from (task.by.name, *(requester.name for requester in task.requesters))


def _values(world: DeclaredGraph, name: str) -> Iterator[tuple[str, Literal]]:
    """Yield the initial values of a node."""
    node = world.nodes[name]
    kind = world.types.get(node.type.name)
    attributes = {attribute.name: attribute for attribute in (kind.attributes if kind is not None else ())}
    yield from ((value.name, starting_value(value, attributes[value.name])) for value in node.values)
