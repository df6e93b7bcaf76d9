"""Why something of the knowledge graph is what it is: who wrote it, when, in which change, and what was refused."""

from __future__ import annotations

import math
import re
from collections.abc import Iterator, Mapping

from codra_dsl.logic import Value
from codra_dsl.runtime.cell import FOREVER_S, Reading, Reason
from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.journal.ledger import Ledger
from codra_dsl.runtime.names import UnknownNameError, unknown
from codra_dsl.runtime.outline import Outline, Place
from codra_dsl.runtime.why.values import Why, instant, shown

_STAGES = ("wants", "is", "finished", "aborted")
_RULES = ("begun", "broken", "fulfilled", "unfulfilled")
_DOING = {
    "node_inserted": "inserted",
    "node_deleted": "deleted",
    "edge_inserted": "drawn",
    "edge_deleted": "deleted",
}
_STEPS = {"wants": "asked for", "is": "begun", "finished": "finished", "aborted": "aborted"}

_ASKED = re.compile(r"\b(?:distance|in_view)\((\w+), (\w+)\)")

_SOME = re.compile(r"\bsome (\w+)")
_MOST_NAMED = 10

_Past = Mapping[str, Event]
"""The last event of each kind that became of one thing, the latest last."""


def explain_knowledge(outline: Outline, ledger: Ledger, name: str, at_s: float) -> Why:
    """Return why a node, an attribute, an edge or a task is what it is at an instant.

    Raises:
        UnknownNameError: if nothing had become of it by then.
    """
    name = _named(outline, ledger, name)
    past = ledger.knowledge[name]
    reading = _reading(name, past, ledger, at_s)
    unit = str(past["written"].details.get("unit") or "") if "written" in past else ""
    story = tuple(_story(past))
    return Why(at_s=at_s, reading=reading, unit=unit, place=_place(name, past, outline), story=story)


def poses_between(ledger: Ledger, condition: str) -> tuple[str, ...]:
    """Return the edges with poses from which it follows what a comparison with poses comes to, each once.

    Args:
        ledger: what had happened.
        condition: the comparison, e.g. `distance(a, b) < 0.9 m`.
    """
    standing = {
        edge.partition("-> ")[2]: edge for edge, past in sorted(ledger.knowledge.items(), key=_drawn) if _stands(past)
    }
    found: dict[str, None] = {}
    for first, second in _ASKED.findall(condition):
        one, other = _climbed(standing, first), _climbed(standing, second)
        found |= dict.fromkeys(edge for edge in (*one, *other) if not (edge in one and edge in other))
    return tuple(found)


def _climbed(standing: Mapping[str, str], node: str) -> list[str]:
    """Return the edges from a node up to what stands in nothing."""
    found: list[str] = []
    while node in standing and standing[node] not in found:
        found.append(standing[node])
        node = found[-1].partition(" -")[0]
    return found


def _stands(past: _Past) -> bool:
    """Return whether an edge has a pose and is there."""
    if "placed" not in past or "edge_inserted" not in past:
        return False
    return "edge_deleted" not in past or _order(past["edge_deleted"]) < _order(past["edge_inserted"])


def _drawn(entry: tuple[str, _Past]) -> tuple[float, int]:
    return _order(entry[1]["edge_inserted"]) if "edge_inserted" in entry[1] else (-math.inf, 0)


def _named(outline: Outline, ledger: Ledger, name: str) -> str:
    """Return the name of a thing as events have it: an edge may be called by its label."""
    origin, arrow, rest = name.partition(" -")
    label, _, target = rest.partition("-> ")
    task = ledger.knowledge.get(target, {}) if label in _STAGES else {}
    if any(stage in task for stage in _STAGES):
        return target  # the edge of a task is told of the task
    if name in ledger.knowledge:
        return name
    for other, past in ledger.knowledge.items():
        is_between = arrow and other.startswith(f"{origin} -") and other.endswith(f"-> {target}")
        if is_between and any(event.details.get("label") == label for event in past.values()):
            return other
    kind = "variable, and no knowledge up to then," if ledger.knowledge else "variable"
    raise _of_no_one_thing(ledger, name) or unknown(kind, name, (*outline.variables, *ledger.knowledge))


def _of_no_one_thing(ledger: Ledger, name: str) -> UnknownNameError | None:
    """Return the error about what is asked as patterns ask, of some node of a type; None where a name is asked."""
    found = _SOME.search(name)
    if found is None:
        return None
    nodes = [
        node
        for node, past in ledger.knowledge.items()
        if any(each.what == "node_inserted" and each.details.get("type") == found[1] for each in past.values())
    ]
    those = f"there were {', '.join(sorted(nodes)[:_MOST_NAMED])}" if nodes else "there was none up to then"
    return UnknownNameError(f"{name!r} is no one thing: ask about one {found[1]} by its name; {those}")


def _reading(name: str, past: _Past, ledger: Ledger, at_s: float) -> Reading[Value]:
    """Return what is known of a thing; of a node or an edge, whether it is there; of a task or a rule, how far."""
    stages = [event for event in past.values() if event.what in (*_STAGES, *_RULES)]
    if "written" in past:
        return _of_attribute(name, past["written"], ledger, at_s)
    if stages:
        return _known(name, stages[-1].what, stages[-1])
    found = [event for what, event in past.items() if what in (*_DOING, "placed")]
    if not found:  # all that became of it was refused
        return Reading(name=name, reason=Reason.NEVER_OBSERVED)
    return _known(name, not found[-1].what.endswith("deleted"), found[-1])


def _of_attribute(name: str, event: Event, ledger: Ledger, at_s: float) -> Reading[Value]:
    gone = _gone(ledger.knowledge.get(name.rpartition(".")[0], {}), event)
    if gone is not None:
        detail = f"its {gone.what.partition('_')[0]} was deleted"
        return Reading(name=name, reason=Reason.FORGOTTEN, detail=detail, evidence_s=gone.instant_s)
    details = event.details
    reason = details.get("reason")
    if reason is not None:
        return Reading(name=name, reason=Reason(reason), evidence_s=details["evidence_s"], source=details["agent"])
    expires_s = details.get("expires_s")
    found: Reading[Value] = Reading(
        name=name,
        content=details.get("value"),
        evidence_s=details["evidence_s"],
        identified_s=event.instant_s,
        expires_s=FOREVER_S if expires_s is None else float(expires_s),
        source=str(details["agent"]),
    )
    return found.at(at_s)


def _gone(past: _Past, written: Event) -> Event | None:
    """Return what deleted the node or edge of an attribute after it was written, or in the same change for good."""
    there = [event for event in past.values() if event.what in _DOING]
    gone = next((event for event in there if event.what.endswith("deleted")), None)
    if gone is None:
        return None
    is_for_good = gone is there[-1] and _order(gone) == _order(written)
    return gone if is_for_good or _order(gone) > _order(written) else None


def _known(name: str, content: Value, event: Event) -> Reading[Value]:
    at_s = event.instant_s
    return Reading(name=name, content=content, evidence_s=at_s, identified_s=at_s, source=str(event.details["agent"]))


def _story(past: _Past) -> Iterator[str]:
    """Yield what became of a thing, in the order in which it did."""
    for event in sorted(past.values(), key=_order):
        details, at = event.details, instant(event.instant_s)
        who = f"agent {details['agent']}" if details["agent"] else "the graph itself"
        change = f", change {details['version']}" if "version" in details else ""
        if event.what == "refused":
            yield f"refused to {who} at {at}: {details['message']}"
        elif event.what in _RULES:
            said = f": {details['message']}" if details.get("message") else ""
            yield f"rule {details['rule']} of {who} {event.what} at {at}{said}"
        elif event.what in _STAGES:
            yield f"{_STEPS[event.what]} by {who} at {at}{change}{_of_task(details)}"
        elif not details["agent"] and details["version"] == 1:
            done = "there" if event.what.endswith("inserted") else _doing(event)
            yield f"{done} from the start, {at}{_of_evidence(event)}"
        else:
            yield f"{_doing(event)} by {who} at {at}{change}{_of_evidence(event)}"


def _of_task(details: Mapping[str, object]) -> str:
    told = [f"request {details['request']} of {details['requester']}"]
    told += [f"result {details['result']}"] if details.get("result") else []
    told += [str(details["message"])] if details.get("message") else []
    deadline_s = details.get("deadline_s")
    told += [f"until {instant(deadline_s)} at the latest"] if isinstance(deadline_s, float) else []
    return f" ({', '.join(told)})"


def _doing(event: Event) -> str:
    details = event.details
    if event.what == "written":
        return "written as unknown" if details.get("value") is None else f"written as {shown(details['value'])}"
    if event.what == "placed":
        return f"placed at ({', '.join(f'{number:.6g}' for number in details['translation_m'])}) m"
    return _DOING[event.what]


def _of_evidence(event: Event) -> str:
    told, details = "", event.details
    evidence_s, expires_s = details.get("evidence_s"), details.get("expires_s")
    if evidence_s is not None and evidence_s != event.instant_s:
        told += f", from evidence taken at {instant(evidence_s)}"
    if expires_s is not None and expires_s < math.inf:
        told += f", valid until {instant(expires_s)}"
    return told


def _order(event: Event) -> tuple[float, int]:
    return event.instant_s, int(event.details.get("version", 0))


def _place(name: str, past: _Past, outline: Outline) -> Place | None:
    """Return where the spec declares a thing, or its type."""
    kinds = {str(event.details["type"]) for event in past.values() if "type" in event.details}
    inner = name.partition(" -")[2].partition("-> ")[0]
    keys = [f"task/{name}", f"node/{name}", f"node/{name.partition('.')[0]}", f"edge/{inner}"]
    keys += [f"{section}/{kind}" for kind in kinds for section in ("edge", "type")]
    return next((outline.places[key] for key in keys if key in outline.places), None)
