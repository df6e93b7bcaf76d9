"""The history of a variable's reading, in sentences."""

from __future__ import annotations

import math
from collections.abc import Iterator

from codra_dsl.logic import Value
from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.journal.latest_events import LatestEvents
from codra_dsl.runtime.journal.spec_summary import AlgorithmSummary, SpecSummary
from codra_dsl.runtime.values.cell import Reading, Reason
from codra_dsl.runtime.values.declarations import POSES
from codra_dsl.runtime.why.values import instant, seconds, shown

MAIN = "main_execution"


def story(name: str, reading: Reading[Value], latest_events: LatestEvents, summary: SpecSummary) -> Iterator[str]:
    """Yield how a variable got its reading, the later events, and the states of its observer and declarations."""
    if reading.known:
        yield from _of_value(reading, summary)
    else:
        yield from _of_unknown(reading, latest_events, summary)
    yield from _of_later(name, latest_events)
    observer = summary.observer_of(name)
    if observer is not None:
        yield _of_observer(observer.name, latest_events.observers.get(observer.name))
    declared = latest_events.declared.get(name)
    if declared is not None and declared.what == "declared":
        yield f"declared since {instant(declared.instant_s)} for {declared.details['holder']}"
    expected = latest_events.expected.get(name)
    if expected is not None:
        yield _of_expectation(expected, summary)


def _of_value(reading: Reading[Value], summary: SpecSummary) -> Iterator[str]:
    if reading.source in summary.algorithms:
        yield f"identified at {instant(reading.identified_s)} from evidence taken at {instant(reading.evidence_s)}"
    elif reading.source == POSES:
        learned = "" if reading.evidence_s == reading.identified_s else f", learned at {instant(reading.identified_s)}"
        yield f"determined by poses since {instant(reading.evidence_s)}{learned}"
    else:
        who = reading.source if reading.source == MAIN else f"agent {reading.source}"
        taken = f", from evidence taken at {instant(reading.evidence_s)}"
        evidence = "" if reading.evidence_s == reading.identified_s else taken
        yield f"written by {who} at {instant(reading.identified_s)}{evidence}"
    if reading.expires_s < math.inf:
        yield f"valid until {instant(reading.expires_s)}"


def _of_unknown(reading: Reading[Value], latest_events: LatestEvents, summary: SpecSummary) -> Iterator[str]:
    name, since = reading.name, instant(reading.identified_s) if reading.identified_s > -math.inf else ""
    before = latest_events.known.get(name)
    match reading.reason:
        case _ if reading.source == POSES:
            yield f"unknown since {since}: {reading.detail}"
        case Reason.NEVER_OBSERVED:
            sources = " or ".join(summary.variables[name].sources)
            is_observed = summary.observer_of(name) is not None
            yield "not identified yet" if is_observed else f"not written yet; {sources} writes it"
        case Reason.STALE:
            valid_for_s = summary.variables[name].valid_for_s
            yield f"its evidence, taken at {instant(reading.evidence_s)}, was valid for {seconds(valid_for_s)}"
        case Reason.INVALIDATED:
            place = summary.places.get(f"skill/{reading.detail}")
            at = "" if place is None else f"  [{place}]"
            yield f"skill {reading.detail}, which changes it, acted at {since}: only newer evidence counts{at}"
        case Reason.FORGOTTEN:
            yield f"forgotten at {since}, because this condition did not hold: {reading.detail}"
        case Reason.WITHDRAWN:
            yield f"its observer {reading.detail} stopped at {since}"
        case _:
            yield f"{reading.reason} at {since}: {reading.detail} ({reading.source})"
    if before is not None:
        value, source = shown(before.details.get("value")), before.details["source"]
        yield f"it was {value} before, from {source} at {instant(before.instant_s)}"


def _of_later(name: str, latest_events: LatestEvents) -> Iterator[str]:
    """Yield the events after the present reading that did not replace it."""
    later = latest_events.later.get(name)
    for what, last in () if later is None else later.last.items():
        count = later.counts[what] if later is not None else 0
        at = f"the last at {instant(last.instant_s)}" if count > 1 else f"at {instant(last.instant_s)}"
        match what:
            case "rejected":
                message = last.details.get("message", "")
                yield f"{_counted(count, 'look')} rejected since then, {at}: {message} ({last.name})"
            case "too_old":
                yield f"{_counted(count, 'value')} did not count, {at}: the evidence was being taken when a skill acted"
            case "refused":
                yield f"{_counted(count, 'write')} by {last.details['source']} refused, {at}"
            case _:
                source = last.details["source"]
                yield f"{_counted(count, 'value')} with older evidence arrived since then, {at} from {source}"


def _of_expectation(event: Event, summary: SpecSummary) -> str:
    skill, what = event.details["skill"], event.what.replace("_", " ")
    place = summary.places.get(f"skill/{skill}")
    at = "" if place is None else f"  [{place}]"
    return f"skill {skill} expected: {event.details['expected']}; {what} at {instant(event.instant_s)}{at}"


def _counted(count: int, noun: str) -> str:
    return f"{count} {noun}{'' if count == 1 else 's'}"


def _of_observer(name: str, last: Event | None) -> str:
    if last is None:
        return f"observer {name} has not run"
    match last.what:
        case "started":
            return f"observer {name} has been running since {instant(last.instant_s)}"
        case "stopped":
            return f"observer {name} stopped at {instant(last.instant_s)}"
        case _:
            return f"observer {name} failed at {instant(last.instant_s)}: {last.details.get('message', '')}"


def doing(algorithm: AlgorithmSummary, latest_events: LatestEvents) -> str:
    """Return a sentence about an algorithm's running or last job; empty if it never had a job."""
    started, ended = latest_events.started.get(algorithm.name), latest_events.ended.get(algorithm.name)
    if started is not None and (ended is None or ended.details["index"] < started.details["index"]):
        return f"job {started.details['index']} has been looking since {instant(started.instant_s)}"
    if ended is None:
        return ""
    index, at = ended.details["index"], instant(ended.instant_s)
    match ended.what:
        case "returned":
            return f"job {index} returned at {at}"
        case "failed":
            return f"job {index} failed at {at}: {ended.details.get('message', '')}"
        case "voided":
            return f"job {index} was voided at {at}: {ended.details.get('condition', '')} did not hold while it looked"
        case _:
            return f"job {index} was cancelled at {at}"
