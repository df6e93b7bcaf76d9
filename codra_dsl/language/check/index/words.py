"""The nouns for the kinds of elements in messages, and the words that a spec declares."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping

from codra_dsl.language.load.yaml.findings import MAX_LISTED, list_names
from codra_dsl.language.model import Spec

NOUNS: Mapping[str, str] = {
    "context": "a context-variable",
    "resources": "a resource",
    "agents": "an agent",
    "types": "a type of nodes",
    "nodes": "a node",
    "edges": "an edge",
    "tasks": "a task",
    "skills": "a skill",
    "perception": "a perception algorithm",
    "observers": "an observer",
    "metrics": "a metric",
    "actions": "an action",
    "adaptation": "an adaptation",
    "trees": "a tree",
    "loops": "a loop",
}
"""For each section, the noun for its elements, with an article."""

USERS: Mapping[str, str] = {
    "context": "context-variable",
    "resources": "resource",
    "agents": "agent",
    "types": "type",
    "nodes": "node",
    "edges": "edge",
    "tasks": "task",
    "skills": "skill",
    "perception": "algorithm",
    "observers": "observer",
    "metrics": "metric",
    "actions": "action",
    "adaptation": "adaptation",
    "trees": "tree",
    "loops": "loop",
}
"""For each section, the noun for its elements, to be followed by a name."""


def declaration_help(name: str, place_text: str, declared_names: Iterable[str]) -> str:
    """Return the help for an undeclared name: the declared names if they are few, and where to declare the name."""
    names, help = sorted(declared_names), f"declare '{name}' under {place_text}"
    if not 0 < len(names) <= MAX_LISTED:
        return help
    return f"write {'one of ' if len(names) > 1 else ''}{list_names(names)}, or {help}"


def texts_of(spec: Spec) -> Iterator[str]:
    """Yield the declared names and texts of a spec."""
    for variable in spec.context:
        yield from (variable.name, variable.label, variable.description, *variable.type.values)
    for algorithm in spec.perception:
        yield from (algorithm.name, algorithm.call, *(name for name, _ in algorithm.parameters))
        yield from (text for _, text in algorithm.parameters if isinstance(text, str))
        for returned in algorithm.returns:
            yield from (returned.name, *returned.type.values)
    yield from (skill.name for skill in spec.skills)
    yield from (setting.name for setting in spec.observers)
    yield from (resource.name for resource in spec.resources)
    yield from (agent.name for agent in spec.agents)
