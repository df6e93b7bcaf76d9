"""Views of the graph for people: a snapshot as plain JSON values.

Metrics, weights and courses are recognised by the agents that may write them. So the page works with any rule base.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from math import isfinite
from typing import Any

from codra_dsl.runtime import Reading, ValueType, VariableModel
from codra_dsl.runtime.geometry import FrameError
from codra_dsl.runtime.knowledge import Knowledge, KnowledgeModel, Phase, Refusal, Snapshot, nodes_of_variables
from codra_papers.store.knowledge import floor_pose_of

View = Mapping[str, Any]

ANALYST = "analysis"
"""The agent that writes metrics, weights and rates."""

ADAPTER = "adaptation"
"""The agent that writes courses and parameters."""

WEIGHT = "weight_of_"
"""Prefix of a weight's name, before the name of its action."""

FILTERED_WEIGHT = "filtered_weight_of_"
"""Prefix of a filtered weight's name, before the name of its action."""

MOST_ORDERS = 12
MOST_REFUSALS = 5


class Part(StrEnum):
    """The part of the page where an attribute is shown."""

    READING = "readings"
    METRIC = "metrics"
    WEIGHT = "weights"
    COURSE = "courses"
    PARAMETER = "parameters"


@dataclass(frozen=True, slots=True, kw_only=True)
class ShownAttribute:
    """An attribute of a node that exists from the start.

    Attributes:
        label: the name that people read.
        sources: the agents that may write the attribute.
    """

    node: str
    name: str
    label: str
    type: ValueType
    sources: tuple[str, ...]

    @property
    def part(self) -> Part:
        """Return the part of the page for the attribute, chosen by its writers and its type."""
        if ANALYST in self.sources:
            return Part.WEIGHT if self.name.startswith((WEIGHT, FILTERED_WEIGHT)) else Part.METRIC
        if ADAPTER in self.sources:
            return Part.COURSE if self.type.members else Part.PARAMETER
        return Part.READING


def shown_attributes(model: KnowledgeModel, variables: Sequence[VariableModel] = ()) -> tuple[ShownAttribute, ...]:
    """Return the shown attributes: those of nodes that exist from the start, and context-variables.

    Values that only the graph determines, such as a count, are not shown: they are inputs of context-variables.

    Args:
        model: the model of the graph.
        variables: the variables of the graph's context manager, if it has one.
    """
    shown: dict[tuple[str, str], ShownAttribute] = {}
    types = {node_type.name: node_type.attributes for node_type in model.node_types}
    for node in model.nodes:
        for attribute in (*types.get(node.type, ()), *node.attributes):
            shown[node.name, attribute.name] = ShownAttribute(
                node=node.name,
                name=attribute.name,
                label=_label(attribute.name, attribute.label),
                type=attribute.type,
                sources=tuple(writer.agent for writer in attribute.sources),
            )
    nodes = nodes_of_variables(model, variables)
    for variable in variables:
        node_name = nodes.get(variable.name)
        if node_name is None:
            continue
        shown[node_name, variable.name] = ShownAttribute(
            node=node_name,
            name=variable.name,
            label=_label(variable.name, variable.label),
            type=variable.type,
            sources=variable.sources,
        )
    return tuple(shown.values())


def view_of(knowledge: Knowledge, shown: Sequence[ShownAttribute]) -> View:
    """Return the current view."""
    snapshot = knowledge.snapshot()
    readings = [(attribute, snapshot.get(attribute.node, attribute.name)) for attribute in shown]
    parts: dict[str, Any] = {
        part.value: [_attribute_view(attribute, reading) for attribute, reading in readings if attribute.part is part]
        for part in Part
    }
    return {
        "instant_s": _json_number(snapshot.instant_s),
        "version": snapshot.version,
        "robot": _node_place(snapshot, "robot"),
        "goal": _node_place(snapshot, "goal"),
        "people": [_node_place(snapshot, node.name) for node in snapshot.nodes("person")],
        "containers": [_container_view(snapshot, node.name) for node in snapshot.nodes("roll_container")],
        "orders": [_order_view(snapshot, node.name) for node in snapshot.nodes("order")[-MOST_ORDERS:]],
        "tasks": [_task_view(knowledge, snapshot, task.name) for task in knowledge.model.tasks],
        "loop": list(_phase_views(knowledge.model, [reading for _, reading in readings])),
        "refusals": [_refusal_view(refusal) for refusal in knowledge.refusals()[-MOST_REFUSALS:]],
        **parts,
    }


def _label(name: str, label: str) -> str:
    return label if label not in ("", name) else _display_name(name.removeprefix(WEIGHT))


def _attribute_view(shown: ShownAttribute, reading: Reading[Any]) -> View:
    value = reading.value if reading.known else None
    return {
        "name": f"{shown.node}.{shown.name}",
        "label": shown.label,
        "value": _json_number(value) if isinstance(value, float) else value,
        "unit": shown.type.unit or "",
        "reason": "" if reading.reason is None else _display_name(reading.reason),
        "source": reading.source,
        "sources": list(shown.sources),
    }


def _node_place(snapshot: Snapshot, name: str) -> View | None:
    """Return the place of a node on the floor; None if the node was never placed."""
    try:
        transform = snapshot.transform("world", name)
    except FrameError:
        return None
    floor_pose = floor_pose_of(transform.pose)
    return {
        "name": name,
        "x_m": _json_number(floor_pose.x_m),
        "y_m": _json_number(floor_pose.y_m),
        "heading_rad": _json_number(floor_pose.heading_rad),
        "outcome": transform.outcome.name.lower(),
    }


def _container_view(snapshot: Snapshot, name: str) -> View | None:
    place = _node_place(snapshot, name)
    return None if place is None else {**place, "is_carried": snapshot.has_edge("robot", "carries", name)}


def _order_view(snapshot: Snapshot, name: str) -> View:
    kind, state = snapshot.get(name, "kind"), snapshot.get(name, "state")
    return {
        "name": name,
        "kind": kind.value if kind.known else "",
        "state": state.value if state.known else "",
        "of_area": _target_area(snapshot, name, "of_area"),
        "to_area": _target_area(snapshot, name, "to_area"),
        "since_s": _json_number(snapshot.node(name).since_s),
    }


def _target_area(snapshot: Snapshot, order: str, edge: str) -> str:
    return next((match.target for match in snapshot.edges(edge, origin=order)), "")


def _task_view(knowledge: Knowledge, snapshot: Snapshot, name: str) -> View:
    handover = snapshot.handover(name)
    executor = next(task.by for task in knowledge.model.tasks if task.name == name)
    return {
        "name": name,
        "by": executor,
        "stage": "" if handover.stage is None else handover.stage.value,
        "requester": handover.requester,
        "outcome": handover.result or handover.reason,
        "since_s": _json_number(handover.since_s),
    }


def _phase_views(model: KnowledgeModel, readings: Iterable[Reading[Any]]) -> Iterator[View]:
    """Yield, for each phase of the loop, its agents and the time of their newest evidence (P2, Figure 4)."""
    newest_evidence_s: dict[str, float] = {}
    for reading in readings:
        newest_evidence_s[reading.source] = max(
            newest_evidence_s.get(reading.source, reading.evidence_s), reading.evidence_s
        )
    for phase in Phase:
        agents = [agent.name for agent in model.agents if agent.phase is phase]
        last_write_s = max(
            (newest_evidence_s[name] for name in agents if name in newest_evidence_s), default=float("-inf")
        )
        yield {"phase": phase.value, "agents": agents, "wrote_s": _json_number(last_write_s)}


def _refusal_view(refusal: Refusal) -> View:
    return {"instant_s": _json_number(refusal.instant_s), "agent": refusal.agent, "why": refusal.why}


def _json_number(value: float) -> float | None:
    """Return a rounded number for JSON; None if the number is not finite, because JSON allows only finite numbers."""
    return round(value, 3) if isfinite(value) else None


def _display_name(name: str) -> str:
    return name.replace("_", " ").capitalize()
