"""Why a course, parameter, metric or weight is what it is: the chain that led to it, in sentences."""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping, Sequence
from typing import Any

from codra_dsl.runtime.cell import Reading, Reason
from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.journal.ledger import Ledger
from codra_dsl.runtime.why.values import Why, instant, seconds, shown

Part = Mapping[str, Any]

_REASONS = {
    "first": "it weighed most when the loop began",
    "leads": "it weighed more for as long as is to be held",
    "worse": "it weighed more, and a metric has become worse, which breaks the dwell",
    "nothing_known": "no weight was known",
    "planner": "a planner that took the place of the spec's chose it",
}


def explain_course(ledger: Ledger, name: str, at_s: float) -> Why | None:
    """Return why a course or parameter is what it is, or is not yet, if a loop is about one of this name."""
    found = ledger.adaptations.get(f"adaptation/{name}", {})
    last = found.get("chosen", found.get("set"))
    if last is None:
        return _undecided(found, name, at_s)
    content = last.details["action"] if last.what == "chosen" else last.details["value"]
    reading: Reading[Any] = Reading(
        name=name,
        content=content,
        evidence_s=last.instant_s,
        start_s=last.instant_s,
        identified_s=last.instant_s,
        source=last.details["agent"],
    )
    return Why(at_s=at_s, reading=reading, story=tuple(_chain(found)))


def _undecided(found: Mapping[str, Event], name: str, at_s: float) -> Why | None:
    started = found.get("started")
    if started is None or name not in started.details.get("adapts", ()):
        return None
    began = f"loop {started.details['loop']} runs since {instant(started.instant_s)} and has not decided on it yet"
    reading: Reading[Any] = Reading(name=name, reason=Reason.NEVER_OBSERVED)
    return Why(at_s=at_s, reading=reading, story=(began, *_refused(found)))


def adapting(ledger: Ledger, variable: str) -> Iterator[str]:
    """Yield the chain of the last decision or analysis of what a variable holds; nothing if no loop has to do with it.

    Of a weight it also tells the chains of the metrics that it follows from.
    """
    found = ledger.adaptations.get(f"context/{variable}", {})
    yield from _chain(found)
    if "analysed" in found:
        yield from _analyses(ledger, variable)


def _analyses(ledger: Ledger, variable: str) -> Iterator[str]:
    """Yield how a metric or weight came about, then how those metrics did that it was read from."""
    pending, told = [variable], set[str]()
    while pending:
        name = pending.pop(0)
        event = ledger.adaptations.get(f"context/{name}", {}).get("analysed")
        if event is None:
            continue
        parts = {part["variable"]: part for part in (*event.details["metrics"], *event.details["weights"])}
        part = parts[name]
        rules = [rule for rule in event.details["rules"] if part["name"] in rule["concludes"]]
        yield f"{name} came to be {_judged(part)} at {instant(event.instant_s)}, and is so since then:"
        yield from _of_rules(rules, part["name"])
        for reading in event.details["readings"]:
            if reading["variable"] in part["reads"] and reading["variable"] not in told:
                told.add(reading["variable"])
                yield f"  {_of_reading(event.details, reading)}"
                pending.append(reading["variable"])


def _chain(found: Mapping[str, Event]) -> Iterator[str]:
    if "set" in found:
        yield from _of_setting(found["set"])
    yield from _refused(found)
    if "chosen" in found:
        chosen = found["chosen"]
        yield from _of_choice(chosen)
        yield from _of_weights(chosen.details)
        yield from _of_evidence(chosen.details)
        after = [event for event in found.values() if event.instant_s >= chosen.instant_s]
        yield from (sentence for event in after for sentence in _of_aftermath(event))


def _refused(found: Mapping[str, Event]) -> Iterator[str]:
    """Yield what a parameter was to be and could not, if that is what came last."""
    failed = found.get("failed")
    is_of_parameter = failed is not None and "variable" in failed.details and "chosen" not in found
    if failed is not None and is_of_parameter and failed.instant_s >= found.get("set", failed).instant_s:
        yield f"at {instant(failed.instant_s)}: {failed.details['message']}"


def _of_choice(event: Event) -> Iterator[str]:
    details = event.details
    action, before, because = details["action"], details.get("before"), details["because"]
    rule = f"the hard rule says so: {details.get('rule')}"
    reason = rule if because == "hard_rule" else _REASONS[because]
    place = f"  [{details['place']}]" if "place" in details else ""
    left = "" if before is None else f", in the place of {before}"
    yield f"{action} was chosen at {instant(event.instant_s)}{left}: {reason}{place}"
    if before is not None and "dwell_until_s" in details:
        is_within = details["dwell_until_s"] > event.instant_s
        broken = ", which this broke" if is_within else ""
        yield f"{before} had been the course since {_at(details, 'since_s')}, its dwell was until " + (
            f"{_at(details, 'dwell_until_s')}{broken}"
        )


def _of_setting(event: Event) -> Iterator[str]:
    details = event.details
    place = f"  [{details['place']}]" if "place" in details else ""
    yield f"set at {instant(event.instant_s)} to {shown(details['value'])}: {details['rule']}{place}"
    if details["because"] == "worse":
        yield f"a metric has become worse, which broke the dwell until {_at(details, 'dwell_until_s')}"
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
        f"{each['term']} {_between(each)}" for each in details["degrees"] if each["variable"] == reading["variable"]
    )
    return f"{_read(reading)}{f' ({degrees})' if degrees else ''}"


def _of_rules(rules: Sequence[Part], name: str) -> Iterator[str]:
    for rule in rules:
        if name in rule["concludes"] and rule.get("high", 1.0) > 0.0:
            place = f"  [{rule['place']}]" if "place" in rule else ""
            yield f"  {rule['text']}: acts with {_between(rule)}{place}"


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


def _judged(each: Part) -> str:
    if "value" not in each:
        return "unknown"
    if each.get("low") == each.get("high"):
        return shown(each["value"])
    return f"{shown(each['value'])}, the worse end of {_between(each)}"


def _between(each: Part) -> str:
    low, high = each.get("low"), each.get("high")
    return shown(low) if low == high else f"{shown(low)} to {shown(high)}"


def _at(part: Part, key: str) -> str:
    return instant(part[key]) if key in part else "the beginning"
