"""The files beside the code: the dependency graph, the manifest, and where everything stands in the spec.

Lists and mappings are written one entry a line: what a change of the spec changes is what a diff shows.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Iterable, Iterator, Mapping
from enum import Enum
from functools import cache
from typing import Any

from codra_dsl import __version__
from codra_dsl.build_plan import BuildPlan, Edge, Node, NodeKind
from codra_dsl.diagnostics import Place
from codra_dsl.model import Algorithm, Variable

GRAPH = "graph.json"
MANIFEST = "manifest.json"
SOURCES = "sources.json"
FORMAT = "codra-manifest"
FORMAT_VERSION = 1

# Where something stands and how it was parsed is no part of what a spec means.
_NOT_MEANT = frozenset({"letters", "place", "places", "tree"})
# An algorithm's conditions stand in the checked algorithm once more, as they were lowered.
_CHECKED_TOO = frozenset((Algorithm, name) for name in ("observable_when", "accept_when", "identifies"))
_PLAIN = frozenset({bool, int, float, str, type(None)})


def node_id(plan: BuildPlan, node: Node) -> str:
    """Return the name of a node in files and pictures, e.g. `lab/context/centrifuge_open`."""
    return f"{plan.name}/{node.kind}/{node.name}"


def graph_nodes(plan: BuildPlan) -> Iterator[tuple[Node, dict[str, object]]]:
    """Yield the nodes of the dependency graph, kind by kind in the order of the plan, with what is said of each."""
    checked = plan.checked
    for name in plan.in_force:
        variable = checked.variables[name]
        yield Node(NodeKind.CONTEXT, name), {"label": variable.label, "type": variable.type.kind.value}
    for tree in plan.forest:
        for branch in tree.branches:
            call = branch.algorithm.algorithm.call
            yield Node(NodeKind.PERCEPTION, branch.name), {"label": branch.name, "call": call}
    for tree in plan.forest:
        yield Node(NodeKind.OBSERVER, tree.name), {"label": tree.name, "period_s": tree.period_s}
    for skill in checked.spec.skills:
        yield Node(NodeKind.SKILL, skill.name), {"label": skill.name}


def graph_edge(plan: BuildPlan, edge: Edge) -> dict[str, object]:
    """Return an edge as files tell it: it reads as a sentence, `source kind target`."""
    return {"source": node_id(plan, edge.source), "target": node_id(plan, edge.target), "kind": edge.kind.value}


def graph_text(plan: BuildPlan) -> str:
    """Return the text of `graph.json`, without places."""
    nodes = ({"id": node_id(plan, node), "kind": node.kind.value, **about} for node, about in graph_nodes(plan))
    edges = (graph_edge(plan, edge) for edge in plan.edges)
    return object_of(format_version="1", nodes=list_of(nodes), edges=list_of(edges))


def manifest_text(plan: BuildPlan, outputs: Mapping[str, str]) -> str:
    """Return the text of `manifest.json`.

    It holds digests of the checked model and of `outputs`, but none of `sources.json`, whose places may change alone.
    """
    variables = {name: _about(variable) for name, variable in plan.checked.variables.items()}
    digests = {path: _digest(outputs[path]) for path in sorted(outputs)}
    return object_of(
        format=json.dumps(FORMAT),
        format_version=str(FORMAT_VERSION),
        codra=json.dumps(__version__),
        name=json.dumps(plan.name),
        spec=json.dumps(plan.checked.spec.file),
        model=json.dumps(model_digest(plan)),
        variables=mapping_of(variables),
        outputs=mapping_of(digests),
    )


def _about(variable: Variable) -> dict[str, object]:
    """Return the type of a variable, for tools that read the manifest alone."""
    declared = variable.type
    told = {"type": declared.kind.value, "unit": declared.unit, "range": declared.range, "values": declared.values}
    return {key: value for key, value in told.items() if value}


def sources_text(plan: BuildPlan) -> str:
    """Return the text of `sources.json`: for each element and condition its file and line, and those of its use."""
    return mapping_of({name: _where(place) for name, place in places(plan)}) + "\n"


def places(plan: BuildPlan) -> Iterator[tuple[str, Place]]:
    """Yield the place of each element of a spec and of each of its conditions, by its name in files."""
    spec = plan.checked.spec
    for variable in spec.context:
        yield node_id(plan, Node(NodeKind.CONTEXT, variable.name)), variable.place
    for algorithm in plan.checked.algorithms.values():
        name = node_id(plan, Node(NodeKind.PERCEPTION, algorithm.name))
        yield name, algorithm.algorithm.place
        for key in ("observable_when", "accept_when"):
            for number, condition in enumerate(getattr(algorithm, key)):
                yield f"{name}/{key}/{number}", condition.place
        yield from ((f"{name}/identifies/{variable}", by.place) for variable, by in algorithm.identifies)
    settings = {setting.name: setting.place for setting in spec.observers}
    for tree in plan.forest:
        place = settings.get(tree.name, tree.branches[0].algorithm.algorithm.place)
        yield node_id(plan, Node(NodeKind.OBSERVER, tree.name)), place
    for skill in spec.skills:
        yield node_id(plan, Node(NodeKind.SKILL, skill.name)), skill.place


def _where(place: Place) -> dict[str, object]:
    use = {} if place.use is None else {"use": {"file": place.use.file, "line": place.use.line}}
    return {"file": place.span.file, "line": place.span.line, **use}


def object_of(**parts: str) -> str:
    """Return a JSON object of parts that are JSON already, one a line."""
    inner = ",\n".join(f"{json.dumps(key)}: {text}" for key, text in parts.items())
    return f"{{\n{inner}\n}}\n"


def list_of(items: Iterable[object]) -> str:
    """Return a JSON list, one item a line."""
    lines = ",\n".join(map(json.dumps, items))
    return f"[\n{lines}\n]" if lines else "[]"


def mapping_of(items: Mapping[str, object]) -> str:
    """Return a JSON object, one entry a line."""
    lines = ",\n".join(f"{json.dumps(key)}: {json.dumps(value)}" for key, value in items.items())
    return f"{{\n{lines}\n}}" if lines else "{}"


def _digest(text: str) -> str:
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"


def model_digest(plan: BuildPlan) -> str:
    """Return a digest of what the checked spec means: the same wherever its elements stand in its files."""
    checked, spec = plan.checked, plan.checked.spec
    meant = (
        spec.name,
        tuple(checked.variables.values()),
        tuple(checked.algorithms.values()),
        tuple(checked.producers.items()),
        checked.decisions,
        spec.skills,
        spec.observers,
        spec.resources,
        spec.agents,
    )
    return _digest(ascii(_meaning(meant)))


def _meaning(value: object) -> object:
    """Return a value as tuples and plain values, which differ whenever the meaning does."""
    kind: Any = type(value)
    if kind in _PLAIN:
        return value
    if isinstance(value, tuple):
        return tuple(map(_meaning, value))
    if isinstance(value, Enum):
        return value.value
    return (kind.__name__, *(_meaning(getattr(value, name)) for name in _meant(kind)))


@cache
def _meant(kind: Any) -> tuple[str, ...]:
    """Return the fields of a frozen value that count for its meaning."""
    names = tuple(field.name for field in dataclasses.fields(kind))
    return tuple(name for name in names if name not in _NOT_MEANT and (kind, name) not in _CHECKED_TOO)
