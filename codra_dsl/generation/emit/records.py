"""Write the files beside the code: the dependency graph, the manifest, and the places of all elements in the spec.

Lists and mappings are written with one entry per line, so that a diff shows only the entries that changed.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
from collections.abc import Callable, Iterable, Iterator, Mapping
from enum import Enum
from json.encoder import encode_basestring_ascii as json_text
from operator import attrgetter
from typing import Any

from codra_dsl.generation.build_plan import BuildPlan, Edge, Node, NodeKind
from codra_dsl.generation.emit.graph_nodes import knowledge_nodes, knowledge_places, node_id, variable_entry
from codra_dsl.generation.emit.loop_nodes import loop_nodes, loop_places
from codra_dsl.language.behavior_trees.values import NodeModel
from codra_dsl.language.check import CheckedSpec
from codra_dsl.language.diagnostics import Place, Span
from codra_dsl.language.model import (
    Agent,
    Algorithm,
    Course,
    HardRule,
    Output,
    Parameter,
    Rate,
    RateKind,
    Site,
    Skill,
    Spec,
    Variable,
)
from codra_dsl.language.project import MANIFEST_FORMAT

GRAPH = "graph.json"
SOURCES = "sources.json"
FORMAT_VERSION = 1

# The place of an element and its parsed form are not part of a spec's meaning.
_FIELDS_WITHOUT_MEANING = frozenset({"letters", "place", "places", "tree"})
# Conduct is digested with the knowledge, and these fields of variables with the loops or derivations. The other fields
# are digested only if they are stated, so that the digests of specs without them stay the same.
_SEPARATELY_DIGESTED_FIELDS = frozenset(
    {
        (Agent, "conduct"),
        (Agent, "period_s"),
        (Algorithm, "host"),
        (Course, "node"),
        (HardRule, "for_s"),
        (Output, "hold_s"),
        (Parameter, "otherwise"),
        (Rate, "kind"),
        (Skill, "preview_names"),
        (Skill, "preview_conditions"),
        *((Variable, name) for name in ("terms", "rate", "is_derived", "pose_condition", "derived", "resolution_m")),
        (Variable, "ros"),
    }
)
# A checked algorithm holds an algorithm's conditions a second time, translated to Python.
_REPEATED_FIELDS = frozenset((Algorithm, name) for name in ("observable_when", "accept_when", "identifies"))
_FIELDS_FOR_EDITORS = frozenset({(NodeModel, "description"), (NodeModel, "metadata")})


def graph_nodes(plan: BuildPlan) -> Iterator[tuple[Node, dict[str, object]]]:
    """Yield the nodes of the dependency graph with their entries, kind by kind in the order of the plan."""
    checked = plan.checked
    for name in plan.in_force:
        yield Node(NodeKind.CONTEXT, name), variable_entry(checked.variables[name])
    for tree in plan.forest:
        for branch in tree.branches:
            call = branch.algorithm.algorithm.call
            yield Node(NodeKind.PERCEPTION, branch.name), {"label": branch.name, "call": call}
    for tree in plan.forest:
        yield Node(NodeKind.OBSERVER, tree.name), {"label": tree.name, "period_s": tree.period_s}
    for skill in checked.spec.skills:
        yield Node(NodeKind.SKILL, skill.name), {"label": skill.name}
    if checked.knowledge is not None:
        yield from knowledge_nodes(plan, checked.knowledge)
    if checked.mape is not None:
        yield from loop_nodes(plan, checked.mape)


def graph_edge(plan: BuildPlan, edge: Edge) -> dict[str, object]:
    """Return an edge as it is written to files. An edge reads as a sentence: source, kind, target."""
    return {"source": node_id(plan, edge.source), "target": node_id(plan, edge.target), "kind": edge.kind.value}


def graph_text(plan: BuildPlan) -> str:
    """Return the text of `graph.json`, without places."""
    nodes = [
        f'{{"id": {json_text(node_id(plan, node))}, "kind": "{node.kind}", {_entries(entry)}}}'
        for node, entry in graph_nodes(plan)
    ]
    name = plan.name
    edges = [
        f'{{"source": {json_text(f"{name}/{source.kind}/{source.name}")}, '
        f'"target": {json_text(f"{name}/{target.kind}/{target.name}")}, "kind": "{kind}"}}'
        for source, target, kind in plan.edges
    ]
    return object_json(format_version="1", nodes=_json_list(nodes), edges=_json_list(edges))


def manifest_text(plan: BuildPlan, outputs: Mapping[str, str]) -> str:
    """Return the text of `manifest.json`.

    The manifest has digests of the checked model and of `outputs`. It has no digest of `sources.json`, because places
    can change while everything else stays the same.
    """
    variables = {name: _type_entries(variable) for name, variable in plan.checked.variables.items()}
    digests = {path: _digest(outputs[path]) for path in sorted(outputs)}
    site = plan.checked.spec.site
    return object_json(
        format=json.dumps(MANIFEST_FORMAT),
        format_version=str(FORMAT_VERSION),
        name=json.dumps(plan.name),
        spec=json.dumps(plan.checked.spec.file),
        **({} if site is None else {"site": json.dumps(site.file)}),
        model=json.dumps(model_digest(plan)),
        variables=mapping_json(variables),
        outputs=mapping_json(digests),
    )


def _type_entries(variable: Variable) -> dict[str, object]:
    """Return the type of a variable, for tools that read only the manifest."""
    declared_type = variable.type
    entry = {
        "type": declared_type.kind.value,
        "unit": declared_type.unit,
        "range": declared_type.range,
        "values": declared_type.values,
    }
    return {key: value for key, value in entry.items() if value}


def sources_text(plan: BuildPlan) -> str:
    """Return the text of `sources.json`: file and line of each element and condition, and of its template's use.

    For a spec with a site, elements and conditions also have the place in the other file.
    """
    site = plan.checked.spec.site
    return _json_object([f"{json_text(name)}: {_place_text(place, site)}" for name, place in places(plan)]) + "\n"


def places(plan: BuildPlan) -> Iterator[tuple[str, Place]]:
    """Yield, for each element of a spec and each of its conditions, its name in files and its place."""
    spec = plan.checked.spec
    for variable in spec.context:
        name = node_id(plan, Node(NodeKind.CONTEXT, variable.name))
        yield name, variable.place
        if variable.derived is not None:
            yield f"{name}/derived", variable.derived.place
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
        name = node_id(plan, Node(NodeKind.SKILL, skill.name))
        yield name, skill.place
        for number, condition in enumerate(plan.checked.previews.get(skill.name, ())):
            yield f"{name}/preview/{number}", condition.place
    if plan.checked.knowledge is not None:
        yield from knowledge_places(plan, plan.checked.knowledge)
    if plan.checked.mape is not None:
        yield from loop_places(plan, plan.checked.mape)


def _place_text(place: Place, site: Site | None) -> str:
    use = "" if place.use is None else f', "use": {{{_span_entries(place.use)}}}'
    in_other_file = "" if site is None else _other_place_text(place, site)
    return f"{{{_span_entries(place.span)}{use}{in_other_file}}}"


def _other_place_text(place: Place, site: Site) -> str:
    """Return the entry for the place in the site of an element of the spec, or in the spec of a value of the site."""
    value = site.replacement_around(place)
    if value is not None:
        return "" if value.replaced is None else f', "replaces": {{{_span_entries(value.replaced.span)}}}'
    arguments = [value for value in site.replacements_of.get(place.use, ()) if value.section == "use"]
    values = [value for value in site.replacements_of.get(place.span, ()) if value.element == place]
    first_value = next(iter((*values, *arguments)), None)
    return "" if first_value is None else f', "site": {{{_span_entries(first_value.place.span)}}}'


def _span_entries(span: Span) -> str:
    return f'"file": {json_text(span.file)}, "line": {span.line}'


def object_json(**parts: str) -> str:
    """Return a JSON object, with one entry per line; the values are already JSON."""
    inner = ",\n".join(f"{json.dumps(key)}: {text}" for key, text in parts.items())
    return f"{{\n{inner}\n}}\n"


def list_json(items: Iterable[object]) -> str:
    """Return a JSON list, with one item per line."""
    return _json_list(list(map(json.dumps, items)))


def mapping_json(items: Mapping[str, object]) -> str:
    """Return a JSON object, with one entry per line."""
    return _json_object([f"{json.dumps(key)}: {json.dumps(value)}" for key, value in items.items()])


def _json_list(lines: list[str]) -> str:
    return "[\n" + ",\n".join(lines) + "\n]" if lines else "[]"


def _json_object(lines: list[str]) -> str:
    return "{\n" + ",\n".join(lines) + "\n}" if lines else "{}"


def _entries(items: Mapping[str, object]) -> str:
    """Return the entries of a JSON object, without its braces and on one line."""
    texts = (json_text(value) if type(value) is str else json.dumps(value) for value in items.values())
    return ", ".join([f'"{key}": {text}' for key, text in zip(items, texts, strict=True)])


def _digest(text: str) -> str:
    return f"sha256:{hashlib.sha256(text.encode()).hexdigest()}"


def model_digest(plan: BuildPlan) -> str:
    """Return a digest of the meaning of a checked spec. The digest does not depend on the places of elements."""
    checked, spec = plan.checked, plan.checked.spec
    basic_values = (
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
    knowledge_values = (spec.types, spec.nodes, spec.edges, spec.tasks, tuple(agent.conduct for agent in spec.agents))
    meaningful_values = (*basic_values, *knowledge_values) if spec.knows else basic_values
    if checked.mape is not None:
        meaningful_values = (*meaningful_values, *_loop_values(checked))
    if spec.site is not None:
        meaningful_values = (*meaningful_values, *spec.site.handles)
    meaningful_values = (*meaningful_values, *_optional_values(spec))
    if checked.derived:
        resolutions_m = tuple(checked.variables[name].resolution_m for name in checked.derived)
        meaningful_values = (*meaningful_values, tuple(checked.derived.items()), resolutions_m)
    return _digest(_meaning(meaningful_values))


def _optional_values(spec: Spec) -> Iterator[tuple[object, ...]]:
    """Yield the values of keys that most specs do not state, each with the name of its element."""
    for agent in spec.agents:
        if agent.period_s is not None:
            yield agent.name, agent.period_s
    yield from ((algorithm.name, "host", algorithm.host) for algorithm in spec.perception if algorithm.host)
    yield from ((variable.name, variable.ros) for variable in spec.context if variable.ros is not None)
    for adaptation in spec.adaptation:
        does = adaptation.does
        if isinstance(does, Parameter) and does.otherwise is not None:
            yield adaptation.name, does.otherwise
        if isinstance(does, Course):
            yield from () if does.node is None else ((adaptation.name, "of", does.node.name),)
            yield from ((adaptation.name, number, rule.for_s) for number, rule in enumerate(does.always) if rule.for_s)
    kinds = ((variable.name, variable.rate.kind) for variable in spec.context if variable.rate is not None)
    yield from ((name, kind.name.lower()) for name, kind in kinds if kind is not RateKind.RATE)
    yield from ((action.name, "hold", action.hold_s) for action in spec.actions if action.hold_s is not None)
    if any(skill.preview_conditions for skill in spec.skills):
        yield from ((skill.name, skill.preview_names, skill.preview_conditions) for skill in spec.skills)


def _loop_values(checked: CheckedSpec) -> tuple[object, ...]:
    """Return the values that make up the meaning of a spec's loops, including the contents of its tree files."""
    spec = checked.spec
    terms_and_rates = tuple((variable.terms, variable.rate) for variable in spec.context)
    trees = tuple(tree.forest for tree in checked.mape.trees) if checked.mape is not None else ()
    return (spec.metrics, spec.actions, spec.adaptation, spec.trees, spec.loops, terms_and_rates, trees)


class _Writers(dict[type, Callable[[Any], str]]):
    """The functions that write the values of each type as text. The function of a type is made on first use."""

    def __missing__(self, kind: Any) -> Callable[[Any], str]:
        """Return the function for an enumeration or a dataclass."""
        writer = self[kind] = _make_writer(kind)
        return writer


def _make_writer(kind: Any) -> Callable[[Any], str]:
    if issubclass(kind, Enum):
        return lambda value: ascii(value.value)
    names = [field.name for field in dataclasses.fields(kind)]
    relevant_names = [
        name
        for name in names
        if name not in _FIELDS_WITHOUT_MEANING
        and (kind, name) not in _REPEATED_FIELDS | _SEPARATELY_DIGESTED_FIELDS | _FIELDS_FOR_EDITORS
    ]
    template = f"({', '.join([ascii(kind.__name__), *('%s' for _ in relevant_names)])}{'' if relevant_names else ','})"
    if len(relevant_names) < 2:  # then `attrgetter` would not return a tuple
        return lambda value: template % tuple([_meaning(getattr(value, name)) for name in relevant_names])
    fields = attrgetter(*relevant_names)
    return lambda value: template % tuple([_WRITERS[type(item)](item) for item in fields(value)])


def _tuple_meaning(values: tuple[Any, ...]) -> str:
    """Return the meanings of some values as the text of a tuple."""
    return f"({', '.join([_WRITERS[type(item)](item) for item in values])}{',' if len(values) == 1 else ''})"


_WRITERS = _Writers({**dict.fromkeys((bool, int, float, str, type(None)), ascii), tuple: _tuple_meaning})


def _meaning(value: Any) -> str:
    """Return a value as the text of tuples and plain values; different meanings give different texts."""
    return _WRITERS[type(value)](value)
