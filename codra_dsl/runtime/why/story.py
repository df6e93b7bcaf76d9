"""The history of a variable's reading, in sentences."""

from __future__ import annotations

import math
from collections.abc import Iterator

from codra_dsl.logic import Value
from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.journal.latest_events import LatestEventsView
from codra_dsl.runtime.journal.spec_summary import AlgorithmSummary, SpecSummary
from codra_dsl.runtime.perception.hosts import obstacle_text
from codra_dsl.runtime.values.cell import Reading, Reason
from codra_dsl.runtime.values.declarations import DERIVED, MAIN, POSES
from codra_dsl.runtime.why.values import duration_text, instant_text, value_text


def story(name: str, reading: Reading[Value], latest_events: LatestEventsView, summary: SpecSummary) -> Iterator[str]:
    """Yield how a variable got its reading, what happened later, and the states of its observer and declarations."""
    if reading.known:
        yield from _value_lines(reading, latest_events, summary)
    else:
        yield from _unknown_lines(reading, latest_events, summary)
    yield from _later_event_lines(name, latest_events)
    observer = summary.find_observer(name)
    if observer is not None:
        yield _observer_text(observer.name, latest_events.observer_events.get(observer.name))
    declaration = latest_events.declaration_events.get(name)
    if declaration is not None and declaration.what == "declared":
        yield f"declared since {instant_text(declaration.instant_s)} for {declaration.details['holder']}"
    expectation = latest_events.expectation_events.get(name)
    if expectation is not None:
        yield _expectation_text(expectation, summary)


def override_text(reading: Reading[Value]) -> str:
    """Return a sentence about an override, from its reading."""
    since_text, until_text = instant_text(reading.identified_s), instant_text(reading.expires_s)
    return f"overridden by the operator since {since_text} until {until_text}: {reading.detail}"


def _value_lines(reading: Reading[Value], latest_events: LatestEventsView, summary: SpecSummary) -> Iterator[str]:
    if reading.source in summary.algorithms:
        yield (
            f"identified at {instant_text(reading.identified_s)} "
            f"from evidence taken at {instant_text(reading.evidence_s)}"
        )
    elif reading.source == DERIVED:
        yield (
            f"derived at {instant_text(reading.identified_s)} "
            f"from evidence taken at {instant_text(reading.evidence_s)} or later"
        )
    elif reading.source == POSES:
        learned_text = (
            "" if reading.evidence_s == reading.identified_s else f", learned at {instant_text(reading.identified_s)}"
        )
        is_counted = reading.name.startswith(("count(", "exists("))
        origin = "counted in the knowledge graph" if is_counted else "determined by poses"
        yield f"{origin} since {instant_text(reading.evidence_s)}{learned_text}"
    elif (look_event := _look_of_decision(reading, latest_events)) is not None:
        details = look_event.details
        state_text = details.get("reason") or "its evidence did not count"
        detail_text = f": {details['detail']}" if details.get("detail") else ""
        yield f"found by a look of {MAIN} at {instant_text(reading.identified_s)}"
        asked_text = instant_text(details["asked_s"])
        yield f"context could not answer the decision of {asked_text}: {state_text}{detail_text}"
    else:
        writer_text = reading.source if reading.source == MAIN else f"agent {reading.source}"
        old_evidence_text = f", from evidence taken at {instant_text(reading.evidence_s)}"
        evidence_text = "" if reading.evidence_s == reading.identified_s else old_evidence_text
        yield f"written by {writer_text} at {instant_text(reading.identified_s)}{evidence_text}"
    if reading.expires_s < math.inf:
        yield f"valid until {instant_text(reading.expires_s)}"


def _look_of_decision(reading: Reading[Value], latest_events: LatestEventsView) -> Event | None:
    """Return the decision whose look found the value of a reading; None if no look did."""
    event = latest_events.decision_events.get(reading.name)
    is_look = event is not None and event.what == "fell_back" and event.details.get("kept") is True
    is_of_reading = event is not None and (reading.source, reading.identified_s) == (MAIN, event.instant_s)
    return event if is_look and is_of_reading else None


def _unknown_lines(reading: Reading[Value], latest_events: LatestEventsView, summary: SpecSummary) -> Iterator[str]:
    name, since_text = reading.name, instant_text(reading.identified_s) if reading.identified_s > -math.inf else ""
    last_value_event = latest_events.last_value_events.get(name)
    match reading.reason:
        case _ if reading.source == DERIVED:  # the reason can change while the variable stays unknown
            yield f"unknown from {instant_text(reading.evidence_s)} on: {reading.detail}"
        case _ if reading.source == POSES:
            yield f"unknown from {since_text} on: {reading.detail}"
        case Reason.NEVER_OBSERVED:
            sources = " or ".join(summary.variables[name].sources)
            is_observed = summary.find_observer(name) is not None
            yield "not identified yet" if is_observed else f"not written yet; {sources} writes it"
        case Reason.STALE:
            valid_for_s = summary.variables[name].valid_for_s
            yield (
                f"its evidence, taken at {instant_text(reading.evidence_s)}, was valid for {duration_text(valid_for_s)}"
            )
        case Reason.INVALIDATED:
            place = summary.places.get(f"skill/{reading.detail}")
            place_text = "" if place is None else f"  [{place}]"
            yield (
                f"skill {reading.detail}, which changes it, acted at {since_text}: "
                f"only newer evidence counts{place_text}"
            )
        case Reason.FORGOTTEN:
            yield f"forgotten at {since_text}, because this condition did not hold: {reading.detail}"
        case Reason.WITHDRAWN:
            yield f"its observer {reading.detail} stopped at {since_text}"
        case _:
            detail_text = f": {reading.detail}" if reading.detail else ""
            yield f"{reading.reason} at {since_text}{detail_text} ({reading.source})"
    if last_value_event is not None:
        value, source = value_text(last_value_event.details.get("value")), last_value_event.details["source"]
        yield f"it was {value} before, from {source} at {instant_text(last_value_event.instant_s)}"


def _later_event_lines(name: str, latest_events: LatestEventsView) -> Iterator[str]:
    """Yield the later events that did not replace the present reading."""
    superseded_events = latest_events.later_events.get(name)
    for what, last_event in () if superseded_events is None else superseded_events.last_events.items():
        count = superseded_events.event_counts[what] if superseded_events is not None else 0
        at_text = (
            f"the last at {instant_text(last_event.instant_s)}"
            if count > 1
            else f"at {instant_text(last_event.instant_s)}"
        )
        match what:
            case "rejected":
                message = last_event.details.get("message", "")
                yield f"{_count_text(count, 'look')} rejected since then, {at_text}: {message} ({last_event.name})"
            case "too_old":
                yield (
                    f"{_count_text(count, 'value')} did not count, {at_text}: "
                    "a skill acted while the evidence was taken"
                )
            case "refused":
                yield f"{_count_text(count, 'write')} by {last_event.details['source']} refused, {at_text}"
            case _:
                source = last_event.details["source"]
                yield f"{_count_text(count, 'value')} with older evidence arrived since then, {at_text} from {source}"


def _expectation_text(event: Event, summary: SpecSummary) -> str:
    skill, what = event.details["skill"], event.what.replace("_", " ")
    place = summary.places.get(f"skill/{skill}")
    place_text = "" if place is None else f"  [{place}]"
    return f"skill {skill} expected: {event.details['expected']}; {what} at {instant_text(event.instant_s)}{place_text}"


def _count_text(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


def _observer_text(name: str, last_event: Event | None) -> str:
    if last_event is None:
        return f"observer {name} has not run"
    match last_event.what:
        case "started":
            return f"observer {name} has been running since {instant_text(last_event.instant_s)}"
        case "stopped":
            return f"observer {name} stopped at {instant_text(last_event.instant_s)}"
        case _:
            return (
                f"observer {name} failed at {instant_text(last_event.instant_s)}: "
                f"{last_event.details.get('message', '')}"
            )


def job_text(algorithm: AlgorithmSummary, latest_events: LatestEventsView) -> str:
    """Return a sentence about an algorithm's running or last job; empty if the algorithm never had a job."""
    start_event, end_event = latest_events.job_starts.get(algorithm.name), latest_events.job_ends.get(algorithm.name)
    if start_event is not None and (end_event is None or end_event.details["index"] < start_event.details["index"]):
        return f"job {start_event.details['index']} has been looking since {instant_text(start_event.instant_s)}"
    if end_event is None:
        return ""
    index, at_text = end_event.details["index"], instant_text(end_event.instant_s)
    match end_event.what:
        case "returned":
            return f"job {index} returned at {at_text}"
        case "failed":
            return f"job {index} failed at {at_text}: {end_event.details.get('message', '')}"
        case "voided":
            return (
                f"job {index} was voided at {at_text}: "
                f"{end_event.details.get('condition', '')} did not hold while it looked"
            )
        case _:
            return f"job {index} was cancelled at {at_text}"


def host_text(host: str, latest_events: LatestEventsView) -> str:
    """Return why a host cannot look; empty if it can, or if `host` is empty."""
    if not host:
        return ""
    event = latest_events.host_events.get(host)
    if event is None:
        return obstacle_text(host)
    return "" if event.what == "connected" else obstacle_text(host, event.details["message"])
