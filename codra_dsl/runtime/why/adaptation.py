"""Explain a course, parameter, metric or weight: its chain of causes, in sentences."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any

from codra_dsl.runtime.journal.encoding import parse_json
from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.journal.latest_events import LatestEventsView
from codra_dsl.runtime.values.cell import Reading, Reason
from codra_dsl.runtime.why.values import Why, duration_text, instant_text, value_text

Details = Mapping[str, Any]

_REASON_TEXTS = {
    "first": "it had the highest weight when the loop began",
    "leads": "its weight was higher for the required time",
    "worse": "its weight was higher, and a metric became worse, which ends the dwell time",
    "nothing_known": "no weight was known",
    "planner": "a planner that replaces the spec's planner chose it",
}

_FILTERED = "filtered_"
"""The beginning of the name of a filtered weight, before the name of the weight."""

ReadingOf = Callable[[str], Reading[Any]]
"""Returns the reading of a variable at the instant of the explanation."""


def explain_course(latest_events: LatestEventsView, reading_of: ReadingOf, name: str, at_s: float) -> Why | None:
    """Return the explanation of a decided or undecided course or parameter; None if no loop adapts this name."""
    events = latest_events.adaptation_events.get(f"adaptation/{name}", {})
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
    return Why(at_s=at_s, reading=reading, story=(*_chain_lines(events), *_unknown_input_lines(events, reading_of)))


def _explain_undecided(events: Mapping[str, Event], name: str, at_s: float) -> Why | None:
    start_event = events.get("started")
    if start_event is None or name not in start_event.details.get("adapts", ()):
        return None
    start_text = (
        f"loop {start_event.details['loop']} has been running since {instant_text(start_event.instant_s)} "
        "and has not decided it yet"
    )
    reading: Reading[Any] = Reading(name=name, reason=Reason.NEVER_OBSERVED)
    return Why(at_s=at_s, reading=reading, story=(start_text, *_failure_lines(events)))


def adaptation_lines(latest_events: LatestEventsView, reading_of: ReadingOf, variable: str) -> Iterator[str]:
    """Yield the causes of the last decision or analysis that wrote a variable; nothing if no loop writes the variable.

    For a weight, also yield the causes of the metrics from which the weight is computed; for a filtered weight, the
    causes of the weight that the course smooths. For a parameter, also yield which inputs are unknown at the instant of
    the explanation.
    """
    events = latest_events.adaptation_events.get(f"context/{variable}", {})
    yield from _chain_lines(events)
    yield from _unknown_input_lines(events, reading_of)
    if "computed" in events:
        yield from _rate_lines(events["computed"], reading_of)
    if "analysed" in events:
        yield from _analysis_lines(latest_events, variable)
    weight = variable.removeprefix(_FILTERED)
    has_weight = weight != variable and f"context/{weight}" in latest_events.adaptation_events
    if has_weight and reading_of(variable).source == reading_of(weight).source:  # both are of the analyst
        yield f"{variable} is {weight}, smoothed by the filter of its course"
        yield from _analysis_lines(latest_events, weight)


def _analysis_lines(latest_events: LatestEventsView, variable: str) -> Iterator[str]:
    """Yield how a metric or weight was computed, then how its input metrics were computed."""
    pending_variables, explained_variables = [variable], set[str]()
    while pending_variables:
        name = pending_variables.pop(0)
        event = latest_events.adaptation_events.get(f"context/{name}", {}).get("analysed")
        if event is None:
            continue
        outputs_by_variable = {
            output["variable"]: output for output in (*event.details["metrics"], *event.details["weights"])
        }
        output = outputs_by_variable[name]
        rules = [rule for rule in event.details["rules"] if output["name"] in rule["concludes"]]
        yield f"{name} has been {_output_text(output)} since {instant_text(event.instant_s)}:"
        yield from _rule_lines(rules, output["name"])
        for reading in event.details["readings"]:
            if reading["variable"] in output["reads"] and reading["variable"] not in explained_variables:
                explained_variables.add(reading["variable"])
                yield f"  {_reading_text(event.details, reading)}"
                pending_variables.append(reading["variable"])


def _chain_lines(events: Mapping[str, Event]) -> Iterator[str]:
    if "set" in events:
        yield from _setting_lines(events["set"])
    yield from _failure_lines(events)
    if "chosen" in events:
        choice_event = events["chosen"]
        yield from _choice_lines(choice_event)
        yield from _weight_lines(choice_event.details)
        yield from _metric_and_reading_lines(choice_event.details)
        later_events = [event for event in events.values() if event.instant_s >= choice_event.instant_s]
        yield from (sentence for event in later_events for sentence in _consequence_lines(event))


def _failure_lines(events: Mapping[str, Event]) -> Iterator[str]:
    """Yield the error of the last attempt to set a parameter, if this attempt failed.

    For an input of a loop, yield the report that the input was never known.
    """
    if "never_known" in events and "variable" in (report_event := events["never_known"]).details:
        yield f"at {instant_text(report_event.instant_s)}: {report_event.details['message']}"
    failure_event = events.get("failed")
    is_of_parameter = failure_event is not None and "variable" in failure_event.details and "chosen" not in events
    if (
        failure_event is not None
        and is_of_parameter
        and failure_event.instant_s >= events.get("set", failure_event).instant_s
    ):
        yield f"at {instant_text(failure_event.instant_s)}: {failure_event.details['message']}"


def _choice_lines(event: Event) -> Iterator[str]:
    details = event.details
    action, previous_action, reason_key = details["action"], details.get("before"), details["because"]
    rule_text = f"by the hard rule: {details.get('rule')}"
    reason_text = rule_text if reason_key == "hard_rule" else _REASON_TEXTS[reason_key]
    place_text = f"  [{details['place']}]" if "place" in details else ""
    previous_action_text = "" if previous_action is None else f" instead of {previous_action}"
    yield f"{action} was chosen at {instant_text(event.instant_s)}{previous_action_text}: {reason_text}{place_text}"
    if previous_action is not None and "dwell_until_s" in details:
        is_within_dwell = details["dwell_until_s"] > event.instant_s
        end_text = ", which this decision ended early" if is_within_dwell else ""
        yield (
            f"{previous_action} had been the course since {_instant_text(details, 'since_s')}, with a dwell time until "
            + (f"{_instant_text(details, 'dwell_until_s')}{end_text}")
        )


def _setting_lines(event: Event) -> Iterator[str]:
    details = event.details
    place_text = f"  [{details['place']}]" if "place" in details else ""
    yield f"set at {instant_text(event.instant_s)} to {value_text(details['value'])}: {details['rule']}{place_text}"
    if details["because"] == "unknown":
        yield "the value of this expression became unknown, so 'otherwise' determines the value"
    if details["because"] == "worse":
        yield f"a metric became worse, which ended the dwell time before {_instant_text(details, 'dwell_until_s')}"
    yield from _metric_and_reading_lines(details)


def _rate_lines(event: Event, reading_of: ReadingOf) -> Iterator[str]:
    """Yield the description of a rate, share or held bool, the reason if it is unknown, and the state of its input."""
    details = event.details
    yield f"it is {details['rule']}"
    if "message" in details:
        since_text = f", counted since {_instant_text(details, 'since_s')}" if "since_s" in details else ""
        yield f"unknown since {instant_text(event.instant_s)}: {details['message']}{since_text}"
        if "known_from_s" in details:
            yield f"known from {_instant_text(details, 'known_from_s')} on, if {details['input']} stays as it is"
    else:
        yield f"known since {instant_text(event.instant_s)}"
    yield _input_text(reading_of(details["input"]))


def _input_text(reading: Reading[Any]) -> str:
    """Return the state of an input at the instant of the explanation."""
    if reading.known:
        evidence_text = f"from evidence taken at {instant_text(reading.evidence_s)}"
        return f"{reading.name} is {value_text(reading.content)}, {evidence_text}"
    since_s = reading.identified_s if reading.reason is Reason.STALE else reading.evidence_s
    is_never_known = reading.reason is Reason.NEVER_OBSERVED
    since_text = "has never been known" if is_never_known else f"has been unknown since {instant_text(since_s)}"
    return f"{reading.name} {since_text} ({reading.reason}{f': {reading.detail}' if reading.detail else ''})"


def _unknown_input_lines(events: Mapping[str, Event], reading_of: ReadingOf) -> Iterator[str]:
    """Yield the inputs of a parameter that are unknown now, even if they were known when the parameter was set."""
    if "set" not in events:
        return
    for input_details in events["set"].details["readings"]:
        reading = reading_of(input_details["variable"])
        if not reading.known:
            yield _input_text(reading)


def _weight_lines(details: Details) -> Iterator[str]:
    for weight in details["weights"]:
        smoothed_text = f", smoothed {value_text(weight['smoothed'])}" if "smoothed" in weight else ""
        lead_text = f", leading since {_instant_text(weight, 'leads_since_s')}" if "leads_since_s" in weight else ""
        yield f"weight of {weight['name']}: {_output_text(weight)}{smoothed_text}{lead_text}"
        yield from _rule_lines(details["rules"], weight["name"])


def _metric_and_reading_lines(details: Details) -> Iterator[str]:
    for metric in details["metrics"]:
        yield f"metric {metric['name']}: {_output_text(metric)}"
        yield from _rule_lines(details["rules"], metric["name"])
    for reading in details["readings"]:
        yield _reading_text(details, reading)


def _reading_text(details: Details, reading: Details) -> str:
    degrees_text = ", ".join(
        f"{degree['term']} {_bounds_text(degree)}"
        for degree in details["degrees"]
        if degree["variable"] == reading["variable"]
    )
    return f"{_observation_text(reading)}{f' ({degrees_text})' if degrees_text else ''}"


def _rule_lines(rules: Sequence[Details], name: str) -> Iterator[str]:
    for rule in rules:
        if name in rule["concludes"] and rule.get("high", 1.0) > 0.0:
            place_text = f"  [{rule['place']}]" if "place" in rule else ""
            yield f"  {rule['text']}: activation {_bounds_text(rule)}{place_text}"


def _consequence_lines(event: Event) -> Iterator[str]:
    details = event.details
    match event.what:
        case "ended":
            yield f"the branch {details['branch']} ended ({details['result']}) after {duration_text(details['took_s'])}"
        case "overdue":
            tasks_text = ", ".join(details.get("tasks", ())) or "an action that is being halted"
            yield f"the branch {details['branch']} had not ended after {duration_text(details['took_s'])}: {tasks_text}"
        case "explained":
            changes_text = (
                " or ".join(map(_change_text, details["kept_by"])) or "no single change of an input or weight"
            )
            yield f"{details['before']} would have been kept by {changes_text}"
        case _:
            pass


def _change_text(change: Details) -> str:
    name = change["name"] if change["kind"] == "input" else f"the weight of {change['name']}"
    actual_text = value_text(parse_json(change["value"])) if "value" in change else "unknown"
    return f"{name} = {value_text(parse_json(change['other']))} instead of {actual_text}"


def _observation_text(reading: Details) -> str:
    if "value" not in reading:
        return f"{reading['variable']} was unknown: {reading.get('because', '')}"
    evidence_text = (
        f", from evidence taken at {_instant_text(reading, 'evidence_s')}" if "evidence_s" in reading else ""
    )
    return f"{reading['variable']} was {value_text(parse_json(reading['value']))}{evidence_text}"


def _output_text(output: Details) -> str:
    if "value" not in output:
        return "unknown"
    if output.get("low") == output.get("high"):
        return value_text(output["value"])
    return f"{value_text(output['value'])}, the worse bound of {_bounds_text(output)}"


def _bounds_text(details: Details) -> str:
    low, high = details.get("low"), details.get("high")
    return value_text(low) if low == high else f"{value_text(low)} to {value_text(high)}"


def _instant_text(details: Details, key: str) -> str:
    return instant_text(details[key]) if key in details else "the beginning"
