"""Explain an element of the knowledge graph: its writers, instants and changes, and refused writes."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping

from codra_dsl.logic import Value
from codra_dsl.runtime.errors import UnknownNameError, unknown_name_error
from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.journal.latest_events import LatestEventsView
from codra_dsl.runtime.journal.spec_summary import Place, SpecSummary
from codra_dsl.runtime.values.cell import FOREVER_S, Reading, Reason
from codra_dsl.runtime.why.values import Why, instant_text, value_text

_TASK_STAGES = ("wants", "is", "finished", "aborted")
_RULE_STATES = ("begun", "broken", "fulfilled", "unfulfilled")
_CHANGE_TEXTS = {
    "node_inserted": "inserted",
    "node_deleted": "deleted",
    "edge_inserted": "inserted",
    "edge_deleted": "deleted",
}
_STAGE_TEXTS = {"wants": "requested", "is": "begun", "finished": "finished", "aborted": "aborted"}

_POSE_COMPARISON_PATTERN = re.compile(r"\b(?:distance|in_view)\((\w+), (\w+)\)")

_SOME_TYPE_PATTERN = re.compile(r"\bsome (\w+)")
_MAX_LISTED_NODES = 10

_ElementEvents = Mapping[str, Event]
"""The last event of each `what` about one element, ordered by time."""


def explain_knowledge(summary: SpecSummary, latest_events: LatestEventsView, name: str, at_s: float) -> Why:
    """Return the explanation of a node, an attribute, an edge or a task at an instant.

    Raises:
        UnknownNameError: if there is no event about the element up to the instant.
    """
    name = _name_in_events(summary, latest_events, name)
    events = latest_events.knowledge_events[name]
    reading = _reading(name, events, latest_events, at_s)
    unit = str(events["written"].details.get("unit") or "") if "written" in events else ""
    story = tuple(_story(events))
    return Why(at_s=at_s, reading=reading, unit=unit, place=_declaration_place(name, events, summary), story=story)


def pose_edges_between(latest_events: LatestEventsView, condition: str) -> tuple[str, ...]:
    """Return the edges whose poses determine the result of a comparison of poses, without duplicates.

    Args:
        latest_events: the latest events.
        condition: the comparison, e.g. `distance(a, b) < 0.9 m`.
    """
    edge_by_target = {
        edge.partition("-> ")[2]: edge
        for edge, events in sorted(latest_events.knowledge_events.items(), key=_insertion_sort_key)
        if _has_pose(events)
    }
    determining_edges: dict[str, None] = {}
    for first_node, second_node in _POSE_COMPARISON_PATTERN.findall(condition):
        first_chain, second_chain = (
            _pose_edges_above(edge_by_target, first_node),
            _pose_edges_above(edge_by_target, second_node),
        )
        determining_edges |= dict.fromkeys(
            edge for edge in (*first_chain, *second_chain) if not (edge in first_chain and edge in second_chain)
        )
    return tuple(determining_edges)


def _pose_edges_above(edge_by_target: Mapping[str, str], node: str) -> list[str]:
    """Return the edges with poses from a node up to the root of its frames."""
    chain: list[str] = []
    while node in edge_by_target and edge_by_target[node] not in chain:
        chain.append(edge_by_target[node])
        node = chain[-1].partition(" -")[0]
    return chain


def _has_pose(events: _ElementEvents) -> bool:
    """Return whether an edge exists and has a pose."""
    if "placed" not in events or "edge_inserted" not in events:
        return False
    return "edge_deleted" not in events or _time_sort_key(events["edge_deleted"]) < _time_sort_key(
        events["edge_inserted"]
    )


def _insertion_sort_key(entry: tuple[str, _ElementEvents]) -> tuple[float, int]:
    return _time_sort_key(entry[1]["edge_inserted"]) if "edge_inserted" in entry[1] else (-math.inf, 0)


def _name_in_events(summary: SpecSummary, latest_events: LatestEventsView, name: str) -> str:
    """Return the name that events use for an element. `name` may have the label of an edge instead of its type."""
    origin, arrow, label_and_target = name.partition(" -")
    label, _, target = label_and_target.partition("-> ")
    task_events = latest_events.knowledge_events.get(target, {}) if label in _TASK_STAGES else {}
    if any(stage in task_events for stage in _TASK_STAGES):
        return target  # events about the edge of a task carry the name of the task
    if name in latest_events.knowledge_events:
        return name
    for other_name, other_events in latest_events.knowledge_events.items():
        is_between = arrow and other_name.startswith(f"{origin} -") and other_name.endswith(f"-> {target}")
        if is_between and any(event.details.get("label") == label for event in other_events.values()):
            return other_name
    kind_text = (
        "variable, and until then no element of the graph, named" if latest_events.knowledge_events else "variable"
    )
    raise _pattern_error(latest_events, name) or unknown_name_error(
        kind_text, name, (*summary.variables, *latest_events.knowledge_events)
    )


def _pattern_error(latest_events: LatestEventsView, name: str) -> UnknownNameError | None:
    """Return the error for a pattern with `some TYPE`, which names no single node or edge; None for any other name."""
    type_match = _SOME_TYPE_PATTERN.search(name)
    if type_match is None:
        return None
    nodes_of_type = [
        node
        for node, events in latest_events.knowledge_events.items()
        if any(
            event.what == "node_inserted" and event.details.get("type") == type_match[1] for event in events.values()
        )
    ]
    existing_text = (
        f"there were {', '.join(sorted(nodes_of_type)[:_MAX_LISTED_NODES])}"
        if nodes_of_type
        else "there was none until then"
    )
    return UnknownNameError(
        f"{name!r} names no single node or edge: ask about one {type_match[1]} by its name; {existing_text}"
    )


def _reading(name: str, events: _ElementEvents, latest_events: LatestEventsView, at_s: float) -> Reading[Value]:
    """Return the reading of an element.

    The value for a node or an edge is whether it exists; the value for a task or a rule is its state.
    """
    state_events = [event for event in events.values() if event.what in (*_TASK_STAGES, *_RULE_STATES)]
    if "written" in events:
        return _attribute_reading(name, events["written"], latest_events, at_s)
    if state_events:
        return _known_reading(name, state_events[-1].what, state_events[-1])
    change_events = [event for what, event in events.items() if what in (*_CHANGE_TEXTS, "placed")]
    if not change_events:  # all events about the element are refusals
        return Reading(name=name, reason=Reason.NEVER_OBSERVED)
    return _known_reading(name, not change_events[-1].what.endswith("deleted"), change_events[-1])


def _attribute_reading(name: str, event: Event, latest_events: LatestEventsView, at_s: float) -> Reading[Value]:
    deletion = _deletion_after(latest_events.knowledge_events.get(name.rpartition(".")[0], {}), event)
    if deletion is not None:
        detail = f"its {deletion.what.partition('_')[0]} was deleted"
        return Reading(name=name, reason=Reason.FORGOTTEN, detail=detail, evidence_s=deletion.instant_s)
    details = event.details
    reason = details.get("reason")
    if reason is not None:
        return Reading(name=name, reason=Reason(reason), evidence_s=details["evidence_s"], source=details["agent"])
    expires_s = details.get("expires_s")
    reading: Reading[Value] = Reading(
        name=name,
        content=details.get("value"),
        evidence_s=details["evidence_s"],
        identified_s=event.instant_s,
        expires_s=FOREVER_S if expires_s is None else float(expires_s),
        source=str(details["agent"]),
    )
    return reading.at(at_s)


def _deletion_after(events: _ElementEvents, write_event: Event) -> Event | None:
    """Return the event that deleted the node or edge of an attribute after the attribute was written.

    A deletion in the same change counts if the node or edge was not inserted again.
    """
    change_events = [event for event in events.values() if event.what in _CHANGE_TEXTS]
    deletion = next((event for event in change_events if event.what.endswith("deleted")), None)
    if deletion is None:
        return None
    is_final_in_change = deletion is change_events[-1] and _time_sort_key(deletion) == _time_sort_key(write_event)
    return deletion if is_final_in_change or _time_sort_key(deletion) > _time_sort_key(write_event) else None


def _known_reading(name: str, content: Value, event: Event) -> Reading[Value]:
    at_s = event.instant_s
    return Reading(name=name, content=content, evidence_s=at_s, identified_s=at_s, source=str(event.details["agent"]))


def _story(events: _ElementEvents) -> Iterator[str]:
    """Yield the history of an element, in order of time."""
    for event in sorted(events.values(), key=_time_sort_key):
        details, at_text = event.details, instant_text(event.instant_s)
        writer_text = f"agent {details['agent']}" if details["agent"] else "the graph itself"
        change_text = f", change {details['version']}" if "version" in details else ""
        if event.what == "refused":
            yield f"{writer_text} was refused at {at_text}: {details['message']}"
        elif event.what in _RULE_STATES:
            message_text = f": {details['message']}" if details.get("message") else ""
            yield f"rule {details['rule']} of {writer_text} {event.what} at {at_text}{message_text}"
        elif event.what in _TASK_STAGES:
            yield f"{_STAGE_TEXTS[event.what]} by {writer_text} at {at_text}{change_text}{_task_text(details)}"
        elif not details["agent"] and details["version"] == 1:
            action_text = "present" if event.what.endswith("inserted") else _change_text(event)
            yield f"{action_text} from the start, {at_text}{_evidence_text(event)}"
        else:
            yield f"{_change_text(event)} by {writer_text} at {at_text}{change_text}{_evidence_text(event)}"


def _task_text(details: Mapping[str, object]) -> str:
    clauses = [f"request {details['request']} of {details['requester']}"]
    clauses += [f"result {details['result']}"] if details.get("result") else []
    clauses += [str(details["message"])] if details.get("message") else []
    deadline_s = details.get("deadline_s")
    clauses += [f"until {instant_text(deadline_s)} at the latest"] if isinstance(deadline_s, float) else []
    return f" ({', '.join(clauses)})"


def _change_text(event: Event) -> str:
    details = event.details
    if event.what == "written":
        return "written as unknown" if details.get("value") is None else f"written as {value_text(details['value'])}"
    if event.what == "placed":
        return f"placed at ({', '.join(f'{coordinate:.6g}' for coordinate in details['translation_m'])}) m"
    return _CHANGE_TEXTS[event.what]


def _evidence_text(event: Event) -> str:
    text, details = "", event.details
    evidence_s, expires_s = details.get("evidence_s"), details.get("expires_s")
    if evidence_s is not None and evidence_s != event.instant_s:
        text += f", from evidence taken at {instant_text(evidence_s)}"
    if expires_s is not None and expires_s < math.inf:
        text += f", valid until {instant_text(expires_s)}"
    return text


def _time_sort_key(event: Event) -> tuple[float, int]:
    return event.instant_s, int(event.details.get("version", 0))


def _declaration_place(name: str, events: _ElementEvents, summary: SpecSummary) -> Place | None:
    """Return the place in the spec that declares an element or the element's type."""
    type_names = {str(event.details["type"]) for event in events.values() if "type" in event.details}
    edge_type = name.partition(" -")[2].partition("-> ")[0]
    place_keys = [f"task/{name}", f"node/{name}", f"node/{name.partition('.')[0]}", f"edge/{edge_type}"]
    place_keys += [f"{section}/{type_name}" for type_name in type_names for section in ("edge", "type")]
    return next((summary.places[key] for key in place_keys if key in summary.places), None)
