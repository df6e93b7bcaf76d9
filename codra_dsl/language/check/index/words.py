"""The nouns for the kinds of elements in messages."""

from __future__ import annotations

from collections.abc import Mapping

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
