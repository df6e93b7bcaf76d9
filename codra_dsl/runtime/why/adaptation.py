"""Explain a course, parameter, metric or weight: the chain of causes, in sentences."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.journal.latest_events import LatestEvents
from codra_dsl.runtime.values.cell import Reading, Reason
from codra_dsl.runtime.why.values import Why, instant, seconds, shown

Part = Mapping[str, Any]

_REASONS = {
    "first": "it had the highest weight when the loop began",
    "leads": "its weight was higher for the required time",
    "worse": "its weight was higher, and a metric became worse, which ends the dwell time",
    "nothing_known": "no weight was known",
    "planner": "a planner that replaces the spec's planner chose it",
}


def explain_course(latest_events: LatestEvents, name: str, at_s: float) -> Why | None:
    """Return the explanation of a decided or undecided course or parameter; None if no loop adapts this name."""
    events = latest_events.adaptations.get(f"adaptation/{name}", {})
    last = events.get("chosen", events.get("set"))
    if last is None:
        return _undecided(events, name, at_s)
    content = last.details["action"] if last.what == "chosen" else last.details["value"]
    reading: Reading[Any] = Reading(
        name=name,
        content=content,
        evidence_s=last.instant_s,
        start_s=last.instant_s,
        identified_s=last.instant_s,
        source=last.details["agent"],
    )
    return Why(at_s=at_s, reading=reading, story=tuple(_chain(events)))


def _undecided(events: Mapping[str, Event], name: str, at_s: float) -> Why | None:
    started = events.get("started")
    if started is None or name not in started.details.get("adapts", ()):
        return None
    began = (
        f"loop {started.details['loop']} has been running since {instant(started.instant_s)} and has not decided it yet"
    )
    reading: Reading[Any] = Reading(name=name, reason=Reason.NEVER_OBSERVED)
    return Why(at_s=at_s, reading=reading, story=(began, *_refused(events)))


def adapting(latest_events: LatestEvents, variable: str) -> Iterator[str]:
    """Yield the chain of the last decision or analysis behind a variable; nothing if no loop writes the variable.

    For a weight, also yield the chains of the metrics that it is computed from.
    """
    events = latest_events.adaptations.get(f"context/{variable}", {})
    yield from _chain(events)
    if "analysed" in events:
        yield from _analyses(latest_events, variable)


def _analyses(latest_events: LatestEvents, variable: str) -> Iterator[str]:
    """Yield how a metric or weight was computed, then how its input metrics were computed."""
    pending, explained = [variable], set[str]()
    while pending:
        name = pending.pop(0)
        event = latest_events.adaptations.get(f"context/{name}", {}).get("analysed")
        if event is None:
            continue
        parts = {part["variable"]: part for part in (*event.details["metrics"], *event.details["weights"])}
        part = parts[name]
        rules = [rule for rule in event.details["rules"] if part["name"] in rule["concludes"]]
        yield f"{name} has been {_judged(part)} since {instant(event.instant_s)}:"
        yield from _of_rules(rules, part["name"])
        for reading in event.details["readings"]:
            if reading["variable"] in part["reads"] and reading["variable"] not in explained:
                explained.add(reading["variable"])
                yield f"  {_of_reading(event.details, reading)}"
                pending.append(reading["variable"])


def _chain(events: Mapping[str, Event]) -> Iterator[str]:
    if "set" in events:
        yield from _of_setting(events["set"])
    yield from _refused(events)
    if "chosen" in events:
        chosen = events["chosen"]
        yield from _of_choice(chosen)
        yield from _of_weights(chosen.details)
        yield from _of_evidence(chosen.details)
        after = [event for event in events.values() if event.instant_s >= chosen.instant_s]
        yield from (sentence for event in after for sentence in _of_aftermath(event))


def _refused(events: Mapping[str, Event]) -> Iterator[str]:
    """Yield the error of a parameter's last setting, if that setting failed."""
    failed = events.get("failed")
    is_of_parameter = failed is not None and "variable" in failed.details and "chosen" not in events
    if failed is not None and is_of_parameter and failed.instant_s >= events.get("set", failed).instant_s:
        yield f"at {instant(failed.instant_s)}: {failed.details['message']}"


def _of_choice(event: Event) -> Iterator[str]:
    details = event.details
    action, before, because = details["action"], details.get("before"), details["because"]
    rule = f"by the hard rule: {details.get('rule')}"
    reason = rule if because == "hard_rule" else _REASONS[because]
    place = f"  [{details['place']}]" if "place" in details else ""
    left = "" if before is None else f" instead of {before}"
    yield f"{action} was chosen at {instant(event.instant_s)}{left}: {reason}{place}"
    if before is not None and "dwell_until_s" in details:
        is_within = details["dwell_until_s"] > event.instant_s
        ended = ", which this decision ended early" if is_within else ""
        yield f"{before} had been the course since {_at(details, 'since_s')}, with a dwell time until " + (
            f"{_at(details, 'dwell_until_s')}{ended}"
        )


def _of_setting(event: Event) -> Iterator[str]:
    details = event.details
    place = f"  [{details['place']}]" if "place" in details else ""
    yield f"set at {instant(event.instant_s)} to {shown(details['value'])}: {details['rule']}{place}"
    if details["because"] == "worse":
        yield f"a metric became worse, which ended the dwell time before {_at(details, 'dwell_until_s')}"
    yield from _of_evidence(details)


def _of_weights(details: Part) -> Iterator[str]:
    for weight in details["weights"]:
        filtered = f", smoothed {shown(weight['smoothed'])}" if "smoothed" in weight else ""
        leads = f", leading since {_at(weight, 'leads_since_s')}" if "leads_since_s" in weight else ""
        yield f"weight of {weight['name']}: {_judged(weight)}{filtered}{leads}"
        yield from _of_rules(details["rules"], weight["name"])


def _of_evidence(details: Part) -> Iterator[str]:
    for metric in details["metrics"]:
        yield f"metric {metric['name']}: {_judged(metric)}"
        yield from _of_rules(details["rules"], metric["name"])
    for reading in details["readings"]:
        yield _of_reading(details, reading)


def _of_reading(details: Part, reading: Part) -> str:
    degrees = ", ".join(
        f"{degree['term']} {_between(degree)}"
        for degree in details["degrees"]
        if degree["variable"] == reading["variable"]
    )
    return f"{_read(reading)}{f' ({degrees})' if degrees else ''}"


def _of_rules(rules: Sequence[Part], name: str) -> Iterator[str]:
    for rule in rules:
        if name in rule["concludes"] and rule.get("high", 1.0) > 0.0:
            place = f"  [{rule['place']}]" if "place" in rule else ""
            yield f"  {rule['text']}: activation {_between(rule)}{place}"


def _of_aftermath(event: Event) -> Iterator[str]:
    details = event.details
    match event.what:
        case "ended":
            yield f"the branch {details['branch']} ended ({details['result']}) after {seconds(details['took_s'])}"
        case "overdue":
            tasks = ", ".join(details.get("tasks", ())) or "an action that is being halted"
            yield f"the branch {details['branch']} had not ended after {seconds(details['took_s'])}: {tasks}"
        case "explained":
            ways = " or ".join(map(_kept, details["kept_by"])) or "no single change of an input or weight"
            yield f"{details['before']} would have been kept by {ways}"
        case _:
            pass


def _kept(change: Part) -> str:
    name = change["name"] if change["kind"] == "input" else f"the weight of {change['name']}"
    was = shown(json.loads(change["value"])) if "value" in change else "unknown"
    return f"{name} = {shown(json.loads(change['other']))} instead of {was}"


def _read(reading: Part) -> str:
    if "value" not in reading:
        return f"{reading['variable']} was unknown: {reading.get('because', '')}"
    taken = f", from evidence taken at {_at(reading, 'evidence_s')}" if "evidence_s" in reading else ""
    return f"{reading['variable']} was {shown(json.loads(reading['value']))}{taken}"


def _judged(part: Part) -> str:
    if "value" not in part:
        return "unknown"
    if part.get("low") == part.get("high"):
        return shown(part["value"])
    return f"{shown(part['value'])}, the worse bound of {_between(part)}"


def _between(part: Part) -> str:
    low, high = part.get("low"), part.get("high")
    return shown(low) if low == high else f"{shown(low)} to {shown(high)}"


def _at(part: Part, key: str) -> str:
    return instant(part[key]) if key in part else "the beginning"
