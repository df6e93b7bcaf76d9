"""Explain an element of the knowledge graph: its writers, instants and changes, and refused writes."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping

from codra_dsl.logic import Value
from codra_dsl.runtime.errors import UnknownNameError, unknown
from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.journal.latest_events import LatestEvents
from codra_dsl.runtime.journal.spec_summary import Place, SpecSummary
from codra_dsl.runtime.values.cell import FOREVER_S, Reading, Reason
from codra_dsl.runtime.why.values import Why, instant, shown

_STAGES = ("wants", "is", "finished", "aborted")
_RULES = ("begun", "broken", "fulfilled", "unfulfilled")
_DOING = {
    "node_inserted": "inserted",
    "node_deleted": "deleted",
    "edge_inserted": "inserted",
    "edge_deleted": "deleted",
}
_STEPS = {"wants": "requested", "is": "begun", "finished": "finished", "aborted": "aborted"}

_ASKED = re.compile(r"\b(?:distance|in_view)\((\w+), (\w+)\)")

_SOME = re.compile(r"\bsome (\w+)")
_MOST_NAMED = 10

_Past = Mapping[str, Event]
"""The last event of each `what` about one element, ordered by time."""


def explain_knowledge(summary: SpecSummary, latest_events: LatestEvents, name: str, at_s: float) -> Why:
    """Return the explanation of a node, an attribute, an edge or a task at an instant.

    Raises:
        UnknownNameError: if there is no event about it by then.
    """
    name = _named(summary, latest_events, name)
    past = latest_events.knowledge[name]
    reading = _reading(name, past, latest_events, at_s)
    unit = str(past["written"].details.get("unit") or "") if "written" in past else ""
    story = tuple(_story(past))
    return Why(at_s=at_s, reading=reading, unit=unit, place=_place(name, past, summary), story=story)


def poses_between(latest_events: LatestEvents, condition: str) -> tuple[str, ...]:
    """Return the edges with poses that determine the result of a comparison with poses, without duplicates.

    Args:
        latest_events: the latest events.
        condition: the comparison, e.g. `distance(a, b) < 0.9 m`.
    """
    edges = {
        edge.partition("-> ")[2]: edge
        for edge, past in sorted(latest_events.knowledge.items(), key=_inserted)
        if _is_placed(past)
    }
    determining: dict[str, None] = {}
    for first, second in _ASKED.findall(condition):
        one, other = _climbed(edges, first), _climbed(edges, second)
        determining |= dict.fromkeys(edge for edge in (*one, *other) if not (edge in one and edge in other))
    return tuple(determining)


def _climbed(edges: Mapping[str, str], node: str) -> list[str]:
    """Return the edges with poses from a node up to the root of its frames."""
    climbed: list[str] = []
    while node in edges and edges[node] not in climbed:
        climbed.append(edges[node])
        node = climbed[-1].partition(" -")[0]
    return climbed


def _is_placed(past: _Past) -> bool:
    """Return whether an edge exists and has a pose."""
    if "placed" not in past or "edge_inserted" not in past:
        return False
    return "edge_deleted" not in past or _order(past["edge_deleted"]) < _order(past["edge_inserted"])


def _inserted(entry: tuple[str, _Past]) -> tuple[float, int]:
    return _order(entry[1]["edge_inserted"]) if "edge_inserted" in entry[1] else (-math.inf, 0)


def _named(summary: SpecSummary, latest_events: LatestEvents, name: str) -> str:
    """Return the name of an element as in events; an edge may be given by its label."""
    origin, arrow, rest = name.partition(" -")
    label, _, target = rest.partition("-> ")
    task = latest_events.knowledge.get(target, {}) if label in _STAGES else {}
    if any(stage in task for stage in _STAGES):
        return target  # events about the edge of a task carry the name of the task
    if name in latest_events.knowledge:
        return name
    for other, past in latest_events.knowledge.items():
        is_between = arrow and other.startswith(f"{origin} -") and other.endswith(f"-> {target}")
        if is_between and any(event.details.get("label") == label for event in past.values()):
            return other
    kind = "variable, and until then no knowledge," if latest_events.knowledge else "variable"
    raise _of_pattern(latest_events, name) or unknown(kind, name, (*summary.variables, *latest_events.knowledge))


def _of_pattern(latest_events: LatestEvents, name: str) -> UnknownNameError | None:
    """Return the error for a pattern with `some TYPE`, which names no single node or edge; None for any other name."""
    match = _SOME.search(name)
    if match is None:
        return None
    nodes = [
        node
        for node, past in latest_events.knowledge.items()
        if any(event.what == "node_inserted" and event.details.get("type") == match[1] for event in past.values())
    ]
    existing = f"there were {', '.join(sorted(nodes)[:_MOST_NAMED])}" if nodes else "there was none until then"
    return UnknownNameError(f"{name!r} names no single node or edge: ask about one {match[1]} by its name; {existing}")


def _reading(name: str, past: _Past, latest_events: LatestEvents, at_s: float) -> Reading[Value]:
    """Return the reading of an element; for a node or an edge, whether it exists; for a task or a rule, its state."""
    stages = [event for event in past.values() if event.what in (*_STAGES, *_RULES)]
    if "written" in past:
        return _of_attribute(name, past["written"], latest_events, at_s)
    if stages:
        return _known(name, stages[-1].what, stages[-1])
    changes = [event for what, event in past.items() if what in (*_DOING, "placed")]
    if not changes:  # all its events are refusals
        return Reading(name=name, reason=Reason.NEVER_OBSERVED)
    return _known(name, not changes[-1].what.endswith("deleted"), changes[-1])


def _of_attribute(name: str, event: Event, latest_events: LatestEvents, at_s: float) -> Reading[Value]:
    gone = _gone(latest_events.knowledge.get(name.rpartition(".")[0], {}), event)
    if gone is not None:
        detail = f"its {gone.what.partition('_')[0]} was deleted"
        return Reading(name=name, reason=Reason.FORGOTTEN, detail=detail, evidence_s=gone.instant_s)
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


def _gone(past: _Past, written: Event) -> Event | None:
    """Return the event that deleted the node or edge of an attribute after the write, or finally in the same change."""
    events = [event for event in past.values() if event.what in _DOING]
    gone = next((event for event in events if event.what.endswith("deleted")), None)
    if gone is None:
        return None
    is_for_good = gone is events[-1] and _order(gone) == _order(written)
    return gone if is_for_good or _order(gone) > _order(written) else None


def _known(name: str, content: Value, event: Event) -> Reading[Value]:
    at_s = event.instant_s
    return Reading(name=name, content=content, evidence_s=at_s, identified_s=at_s, source=str(event.details["agent"]))


def _story(past: _Past) -> Iterator[str]:
    """Yield the history of an element, in order of time."""
    for event in sorted(past.values(), key=_order):
        details, at = event.details, instant(event.instant_s)
        who = f"agent {details['agent']}" if details["agent"] else "the graph itself"
        change = f", change {details['version']}" if "version" in details else ""
        if event.what == "refused":
            yield f"{who} was refused at {at}: {details['message']}"
        elif event.what in _RULES:
            message = f": {details['message']}" if details.get("message") else ""
            yield f"rule {details['rule']} of {who} {event.what} at {at}{message}"
        elif event.what in _STAGES:
            yield f"{_STEPS[event.what]} by {who} at {at}{change}{_of_task(details)}"
        elif not details["agent"] and details["version"] == 1:
            done = "present" if event.what.endswith("inserted") else _doing(event)
            yield f"{done} from the start, {at}{_of_evidence(event)}"
        else:
            yield f"{_doing(event)} by {who} at {at}{change}{_of_evidence(event)}"


def _of_task(details: Mapping[str, object]) -> str:
    parts = [f"request {details['request']} of {details['requester']}"]
    parts += [f"result {details['result']}"] if details.get("result") else []
    parts += [str(details["message"])] if details.get("message") else []
    deadline_s = details.get("deadline_s")
    parts += [f"until {instant(deadline_s)} at the latest"] if isinstance(deadline_s, float) else []
    return f" ({', '.join(parts)})"


def _doing(event: Event) -> str:
    details = event.details
    if event.what == "written":
        return "written as unknown" if details.get("value") is None else f"written as {shown(details['value'])}"
    if event.what == "placed":
        return f"placed at ({', '.join(f'{number:.6g}' for number in details['translation_m'])}) m"
    return _DOING[event.what]


def _of_evidence(event: Event) -> str:
    text, details = "", event.details
    evidence_s, expires_s = details.get("evidence_s"), details.get("expires_s")
    if evidence_s is not None and evidence_s != event.instant_s:
        text += f", from evidence taken at {instant(evidence_s)}"
    if expires_s is not None and expires_s < math.inf:
        text += f", valid until {instant(expires_s)}"
    return text


def _order(event: Event) -> tuple[float, int]:
    return event.instant_s, int(event.details.get("version", 0))


def _place(name: str, past: _Past, summary: SpecSummary) -> Place | None:
    """Return the place in the spec that declares an element, or its type."""
    kinds = {str(event.details["type"]) for event in past.values() if "type" in event.details}
    inner = name.partition(" -")[2].partition("-> ")[0]
    keys = [f"task/{name}", f"node/{name}", f"node/{name.partition('.')[0]}", f"edge/{inner}"]
    keys += [f"{section}/{kind}" for kind in kinds for section in ("edge", "type")]
    return next((summary.places[key] for key in keys if key in summary.places), None)
