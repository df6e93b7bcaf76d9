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
    last_event = events.get("chosen", events.get("set"))
    if last_event is None:
        return _explain_undecided(events, name, at_s)
    content = last_event.details["action"] if last_event.what == "chosen" else last_event.details["value"]
    reading: Reading[Any] = Reading(
        name=name,
        content=content,
        evidence_s=last_event.instant_s,
        start_s=last_event.instant_s,
        identified_s=last_event.instant_s,
        source=last_event.details["agent"],
    )
    return Why(at_s=at_s, reading=reading, story=tuple(_chain_lines(events)))


def _explain_undecided(events: Mapping[str, Event], name: str, at_s: float) -> Why | None:
    start = events.get("started")
    if start is None or name not in start.details.get("adapts", ()):
        return None
    start_text = (
        f"loop {start.details['loop']} has been running since {instant(start.instant_s)} and has not decided it yet"
    )
    reading: Reading[Any] = Reading(name=name, reason=Reason.NEVER_OBSERVED)
    return Why(at_s=at_s, reading=reading, story=(start_text, *_failure_lines(events)))


def adaptation_lines(latest_events: LatestEvents, variable: str) -> Iterator[str]:
    """Yield the chain of the last decision or analysis behind a variable; nothing if no loop writes the variable.

    For a weight, also yield the chains of the metrics from which the weight is computed.
    """
    events = latest_events.adaptations.get(f"context/{variable}", {})
    yield from _chain_lines(events)
    if "analysed" in events:
        yield from _analysis_lines(latest_events, variable)


def _analysis_lines(latest_events: LatestEvents, variable: str) -> Iterator[str]:
    """Yield how a metric or weight was computed, then how its input metrics were computed."""
    pending_variables, explained_variables = [variable], set[str]()
    while pending_variables:
        name = pending_variables.pop(0)
        event = latest_events.adaptations.get(f"context/{name}", {}).get("analysed")
        if event is None:
            continue
        parts = {part["variable"]: part for part in (*event.details["metrics"], *event.details["weights"])}
        part = parts[name]
        rules = [rule for rule in event.details["rules"] if part["name"] in rule["concludes"]]
        yield f"{name} has been {_result_text(part)} since {instant(event.instant_s)}:"
        yield from _rule_lines(rules, part["name"])
        for reading in event.details["readings"]:
            if reading["variable"] in part["reads"] and reading["variable"] not in explained_variables:
                explained_variables.add(reading["variable"])
                yield f"  {_reading_text(event.details, reading)}"
                pending_variables.append(reading["variable"])


def _chain_lines(events: Mapping[str, Event]) -> Iterator[str]:
    if "set" in events:
        yield from _setting_lines(events["set"])
    yield from _failure_lines(events)
    if "chosen" in events:
        chosen = events["chosen"]
        yield from _choice_lines(chosen)
        yield from _weight_lines(chosen.details)
        yield from _evidence_lines(chosen.details)
        after = [event for event in events.values() if event.instant_s >= chosen.instant_s]
        yield from (sentence for event in after for sentence in _aftermath_lines(event))


def _failure_lines(events: Mapping[str, Event]) -> Iterator[str]:
    """Yield the error of a parameter's last setting, if that setting failed."""
    failure = events.get("failed")
    is_of_parameter = failure is not None and "variable" in failure.details and "chosen" not in events
    if failure is not None and is_of_parameter and failure.instant_s >= events.get("set", failure).instant_s:
        yield f"at {instant(failure.instant_s)}: {failure.details['message']}"


def _choice_lines(event: Event) -> Iterator[str]:
    details = event.details
    action, before, because = details["action"], details.get("before"), details["because"]
    rule_text = f"by the hard rule: {details.get('rule')}"
    reason = rule_text if because == "hard_rule" else _REASONS[because]
    place_text = f"  [{details['place']}]" if "place" in details else ""
    before_text = "" if before is None else f" instead of {before}"
    yield f"{action} was chosen at {instant(event.instant_s)}{before_text}: {reason}{place_text}"
    if before is not None and "dwell_until_s" in details:
        is_within = details["dwell_until_s"] > event.instant_s
        end_text = ", which this decision ended early" if is_within else ""
        yield f"{before} had been the course since {_instant_text(details, 'since_s')}, with a dwell time until " + (
            f"{_instant_text(details, 'dwell_until_s')}{end_text}"
        )


def _setting_lines(event: Event) -> Iterator[str]:
    details = event.details
    place_text = f"  [{details['place']}]" if "place" in details else ""
    yield f"set at {instant(event.instant_s)} to {shown(details['value'])}: {details['rule']}{place_text}"
    if details["because"] == "worse":
        yield f"a metric became worse, which ended the dwell time before {_instant_text(details, 'dwell_until_s')}"
    yield from _evidence_lines(details)


def _weight_lines(details: Part) -> Iterator[str]:
    for weight in details["weights"]:
        smoothed_text = f", smoothed {shown(weight['smoothed'])}" if "smoothed" in weight else ""
        lead_text = f", leading since {_instant_text(weight, 'leads_since_s')}" if "leads_since_s" in weight else ""
        yield f"weight of {weight['name']}: {_result_text(weight)}{smoothed_text}{lead_text}"
        yield from _rule_lines(details["rules"], weight["name"])


def _evidence_lines(details: Part) -> Iterator[str]:
    for metric in details["metrics"]:
        yield f"metric {metric['name']}: {_result_text(metric)}"
        yield from _rule_lines(details["rules"], metric["name"])
    for reading in details["readings"]:
        yield _reading_text(details, reading)


def _reading_text(details: Part, reading: Part) -> str:
    degrees = ", ".join(
        f"{degree['term']} {_bounds_text(degree)}"
        for degree in details["degrees"]
        if degree["variable"] == reading["variable"]
    )
    return f"{_observation_text(reading)}{f' ({degrees})' if degrees else ''}"


def _rule_lines(rules: Sequence[Part], name: str) -> Iterator[str]:
    for rule in rules:
        if name in rule["concludes"] and rule.get("high", 1.0) > 0.0:
            place_text = f"  [{rule['place']}]" if "place" in rule else ""
            yield f"  {rule['text']}: activation {_bounds_text(rule)}{place_text}"


def _aftermath_lines(event: Event) -> Iterator[str]:
    details = event.details
    match event.what:
        case "ended":
            yield f"the branch {details['branch']} ended ({details['result']}) after {seconds(details['took_s'])}"
        case "overdue":
            tasks_text = ", ".join(details.get("tasks", ())) or "an action that is being halted"
            yield f"the branch {details['branch']} had not ended after {seconds(details['took_s'])}: {tasks_text}"
        case "explained":
            changes_text = (
                " or ".join(map(_change_text, details["kept_by"])) or "no single change of an input or weight"
            )
            yield f"{details['before']} would have been kept by {changes_text}"
        case _:
            pass


def _change_text(change: Part) -> str:
    name = change["name"] if change["kind"] == "input" else f"the weight of {change['name']}"
    old_text = shown(json.loads(change["value"])) if "value" in change else "unknown"
    return f"{name} = {shown(json.loads(change['other']))} instead of {old_text}"


def _observation_text(reading: Part) -> str:
    if "value" not in reading:
        return f"{reading['variable']} was unknown: {reading.get('because', '')}"
    evidence_text = (
        f", from evidence taken at {_instant_text(reading, 'evidence_s')}" if "evidence_s" in reading else ""
    )
    return f"{reading['variable']} was {shown(json.loads(reading['value']))}{evidence_text}"


def _result_text(part: Part) -> str:
    if "value" not in part:
        return "unknown"
    if part.get("low") == part.get("high"):
        return shown(part["value"])
    return f"{shown(part['value'])}, the worse bound of {_bounds_text(part)}"


def _bounds_text(part: Part) -> str:
    low, high = part.get("low"), part.get("high")
    return shown(low) if low == high else f"{shown(low)} to {shown(high)}"


def _instant_text(part: Part, key: str) -> str:
    return instant(part[key]) if key in part else "the beginning"
