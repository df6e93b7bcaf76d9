"""Checks of knowledge (phase 3): edges in patterns have their declared ends, and initial values fit attributes."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.check.index.graph_schema import STATES, DeclaredGraph
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.knowledge.mentions import Step, names_in_pattern, paths, patterns, steps
from codra_dsl.language.check.knowledge.owners import is_knowledge_checkable
from codra_dsl.language.diagnostics import Diagnostic, Place, Related, suggest
from codra_dsl.language.expression import reads_of
from codra_dsl.language.model import Attribute, Kind, NodeElement, StartingValue, ValueType
from codra_dsl.language.units import convert, parse_unit


def wrong_ends(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """An edge in a path connects nodes that the declaration of the edge allows."""
    if not is_knowledge_checkable(spec_index, faults):
        return
    declared_graph = spec_index.declared_graph
    for path in paths(spec_index):
        for step in steps(path):
            if step.link.edge in STATES and declared_graph.task_of(step.origin, step.link.edge, step.target) is None:
                yield from _state_without_task_findings(declared_graph, step)
            elif step.link.edge not in STATES and not declared_graph.edges_between(
                step.origin, step.link.edge, step.target
            ):
                yield _wrong_ends_finding(declared_graph, step)
    for pattern in patterns(spec_index):
        for name in names_in_pattern(pattern):
            function, _, camera = reads_of(name.name)
            kind = declared_graph.types.get(declared_graph.type_of(camera)) if function == "in_view" else None
            if function == "in_view" and (kind is None or kind.view is None):
                message = f"agent '{pattern.agent.name}' uses in_view() with '{camera}', which has no view"
                place = pattern.condition.place_of(name)
                help = f"give type '{declared_graph.type_of(camera)}' a 'view'"
                yield finding("wrong-ends", message, place, path=pattern.path, help=help)


def _state_without_task_findings(declared_graph: DeclaredGraph, step: Step) -> Iterator[Diagnostic]:
    """Yield the finding about a task state on an edge that is not the edge of a task.

    `some task` and `anything` match any task, so such a target is allowed.
    """
    task = declared_graph.tasks.get(step.target.name)
    if not step.target.name and step.target.type in ("", "task"):
        return
    place = step.pattern.condition.place_of(step.link)
    if task is None:
        reversed_task = declared_graph.tasks.get(step.origin.name)
        reversed_edge_help = (
            f"write {reversed_task.origin.name} -{step.link.edge}-> {reversed_task.name}"
            if reversed_task is not None
            else ""
        )
        message = f"'{step.link.edge}' must lead to a task, and '{step.target}' is not a task ({step.pattern.user})"
        help = reversed_edge_help or "write the name of a task, or declare the task under 'tasks' of 'knowledge'"
        yield finding("wrong-ends", message, place, path=step.pattern.path, help=help)
        return
    message = f"task '{task.name}' is done by '{task.origin.name}', not by '{step.origin}' ({step.pattern.user})"
    help = f"write {task.origin.name} -{step.link.edge}-> {task.name}"
    related = (Related("declared here", task.places.get("from", task.place)),)
    yield finding("wrong-ends", message, place, path=step.pattern.path, help=help, related=related)


def _wrong_ends_finding(declared_graph: DeclaredGraph, step: Step) -> Diagnostic:
    edges = declared_graph.edges_of_word(step.link.edge)
    origins = " or ".join(dict.fromkeys(f"'{origin.name}'" for edge in edges for origin in edge.origins))
    targets = " or ".join(dict.fromkeys(f"'{target.name}'" for edge in edges for target in edge.targets))
    is_reversed = any(declared_graph.can_lead(edge, step.target, step.origin) for edge in edges)
    help = f"write {step.target} -{step.link.edge}-> {step.origin}" if is_reversed else ""
    similar_name = suggest(step.link.edge, (name for name in declared_graph.edges if name != step.link.edge))
    if (
        not help
        and similar_name
        and declared_graph.can_lead(declared_graph.edges[similar_name], step.origin, step.target)
    ):
        help = f"did you mean '{similar_name}'?"
    return finding(
        "wrong-ends",
        f"edge '{step.link.edge}' leads from {origins} to {targets}, "
        f"not from '{step.origin}' to '{step.target}' ({step.pattern.user})",
        step.pattern.condition.place_of(step.link),
        path=step.pattern.path,
        help=help or "change the pattern, or 'from' and 'to' of the edge",
        related=tuple(Related("declared here", edge.place) for edge in edges),
    )


def wrong_starting_values(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """An initial value of a node fits the type and the unit of its attribute, and is in the attribute's range."""
    if not is_knowledge_checkable(spec_index, faults):
        return
    for node in spec_index.spec.nodes:
        kind = spec_index.declared_graph.types.get(node.type.name)
        attributes = {attribute.name: attribute for attribute in kind.attributes} if kind is not None else {}
        for value in node.values:
            attribute = attributes.get(value.name)
            if attribute is None:
                message = f"'{value.name}' of node '{node.name}' is a context-variable, which is unknown at first"
                yield _starting_value_finding(
                    node, value, message, "remove it: the variable's 'source' writes it", value.place
                )
            elif (problem := _mismatch(value, attribute.type)) is not None:
                message = f"'{value.name}' of node '{node.name}' {problem[0]}"
                yield _starting_value_finding(node, value, message, problem[1], attribute.place)


def _starting_value_finding(
    node: NodeElement, value: StartingValue, message: str, help: str, declaration_place: Place
) -> Diagnostic:
    path = f"knowledge.nodes.{node.name}.with.{value.name}"
    related = () if declaration_place is value.place else (Related("declared here", declaration_place),)
    return finding("wrong-starting-value", message, value.place, path=path, help=help, related=related)


def starting_value(value: StartingValue, attribute: Attribute) -> bool | int | float | str:
    """Return an initial value in the unit of its attribute. The value must fit the attribute."""
    if isinstance(value.value, bool | str):
        return value.value
    number = _number(value, attribute.type)
    assert number is not None
    return int(number) if attribute.type.kind is Kind.INT else float(number)


def _mismatch(value: StartingValue, declared_type: ValueType) -> tuple[str, str] | None:
    """Return why a value does not fit a type, and the help; None if the value fits."""
    raw_value, kind = value.value, declared_type.kind
    if kind is Kind.ENUM:
        if raw_value in declared_type.values:
            return None
        nearest_value = suggest(str(raw_value), declared_type.values)
        values_text = f"values are {', '.join(declared_type.values[:10])}"
        return f"cannot be '{raw_value}'", f"did you mean '{nearest_value}'?" if nearest_value else values_text
    required_class = {Kind.BOOL: bool, Kind.STR: str}.get(kind)
    if required_class is not None:
        return None if isinstance(raw_value, required_class) else ("must be " + _NOUNS[kind], _EXAMPLES[kind])
    return _misfit_of_number(value, declared_type)


_NOUNS = {Kind.BOOL: "true or false", Kind.STR: "a text"}
_EXAMPLES = {Kind.BOOL: "write true or false", Kind.STR: "put it in quotes"}


def _misfit_of_number(value: StartingValue, declared_type: ValueType) -> tuple[str, str] | None:
    unit = declared_type.unit
    if isinstance(value.value, bool | str):
        return "must be a number", f"write a number in {unit}" if unit else "write a number"
    number = _number(value, declared_type)
    if number is None:
        if unit is None:
            return "is declared without a unit", "remove the unit, or declare the attribute with a unit"
        return f"must be a quantity in {unit}", f"write a number with a unit that converts to {unit}"
    if declared_type.kind is Kind.INT and not float(number).is_integer():
        return "must be a whole number", "write a whole number"
    if declared_type.range is not None and not declared_type.range[0] <= number <= declared_type.range[1]:
        low, high = declared_type.range
        limits_text = f"{low:g} and {high:g}{f' {unit}' if unit else ''}"
        return f"is out of its range: {number:g}", f"write a number between {limits_text}"
    return None


def _number(value: StartingValue, declared_type: ValueType) -> float | None:
    """Return a number in the unit of a type; None if the units do not fit, or if only one of the two has a unit.

    The number 0 needs no unit.
    """
    assert not isinstance(value.value, bool | str)
    target = parse_unit(declared_type.unit) if declared_type.unit is not None else None
    source = parse_unit(value.unit) if value.unit is not None else None
    if target is None or source is None:
        return value.value if target is source or (source is None and value.value == 0) else None
    return convert(value.value, source, target) if source.dimension == target.dimension else None


KNOWLEDGE_TYPE_CHECKS = (wrong_ends, wrong_starting_values)
"""The checks of this module."""
