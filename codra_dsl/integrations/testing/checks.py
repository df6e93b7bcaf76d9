"""The checks of a story against the event log, and the messages of failures.

Checks read only the event log. So they do not change the run, and they work in the same way whether the main execution
is part of the story or a program.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from textwrap import indent
from typing import Any

from codra_dsl.integrations.testing.timeline import (
    Belief,
    Check,
    ExpectationCheck,
    Moment,
    Outcome,
    PreviewCheck,
    RunningCheck,
)
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.load.yaml.source import Source
from codra_dsl.runtime import ContextManager, EventLog, Kind, Why
from codra_dsl.runtime.why import PREVIEW_PREFIX
from codra_dsl.runtime.why.values import instant_text, value_text
from codra_dsl.tooling.report.findings import visible_lines

_TOLERANCE = 1e-9
_OUTCOME_TEXTS = {
    "answered": "answered from context",
    "fell_back": "made by looking",
    "shadowed": "made by looking in shadow mode",
}


@dataclass(frozen=True, slots=True)
class Failure:
    """A failed check.

    Attributes:
        place: the place of the check in the timeline.
        why: the explanation, in lines; empty if there is none.
    """

    place: Place
    message: str
    why: str = ""


def failures_of(
    moment: Moment, at_s: float, now_s: float, codra: ContextManager[Any, Any], record: EventLog
) -> Iterator[Failure]:
    """Yield the failed checks of a moment.

    Args:
        moment: the moment of the story.
        at_s: the instant of the moment on the clock.
        now_s: the present instant of the clock.
        codra: the context manager, for explanations.
        record: the event log of the run.
    """
    if moment.checks and at_s > now_s:
        yield Failure(moment.place, f"the run was over at {instant_text(now_s)}, before this moment")
        return
    for check in moment.checks:
        failure = _failure_of(check, at_s, codra, record)
        if failure is not None:
            yield failure


def failures_text(failures: Sequence[Failure], source: Source) -> str:
    """Return failures as text: the place, the line, the expected and the actual state, and the explanation."""
    lines = source.text.splitlines()
    return "\n\n".join(_failure_text(failure, lines) for failure in failures)


def _failure_text(failure: Failure, lines: Sequence[str]) -> str:
    span = failure.place.span
    text = lines[span.line - 1]
    width = (span.end_column if span.end_line == span.line else len(text) + 1) - span.column
    bar = f"{'':{len(str(span.line))}} |"
    shown_lines = [
        f"{span.file}:{span.line}:{span.column}: {failure.message}",
        bar,
        f"{span.line} | {text}",
        f"{bar} {' ' * (span.column - 1)}{'^' * max(1, width)}",
    ]
    if failure.why:
        shown_lines.append(indent(failure.why, "  "))
    return visible_lines("\n".join(shown_lines))


def _failure_of(check: Check, at_s: float, codra: ContextManager[Any, Any], record: EventLog) -> Failure | None:
    match check:
        case Belief():
            why = codra.why(check.variable, at_s=at_s)
            expected_text = _unmet_text(check, why)
            if expected_text is None:
                return None
            message = (
                f"at {instant_text(at_s)} {check.variable} should be {expected_text}, but it is {_state_text(why)}"
            )
            return Failure(check.place, message, str(why))
        case RunningCheck():
            return _failure_of_observer(check, at_s, record)
        case PreviewCheck():
            return _failure_of_preview(check, at_s, codra)
        case Outcome():
            return _failure_of_decision(check, at_s, codra, record)
        case ExpectationCheck():
            return _failure_of_expectation(check, at_s, codra, record)


def _unmet_text(check: Belief, why: Why) -> str | None:
    """Return the expected state in words, or None if the check passes."""
    if check.is_unknown:
        expected_text = "unknown" if check.reason is None else f"unknown ({check.reason})"
        is_met = not why.known and check.reason in (None, why.reading.reason)
    else:
        within_text = "" if check.within is None else f" within {value_text(check.within)}"
        expected_text = f"{value_text(check.value)}{_unit_text(why.unit)}{within_text}" if check.is_stated else "known"
        expected_text += f" from {check.source}" if check.source else ""
        is_met = why.known and _has_expected_value(check, why) and check.source in ("", why.reading.source)
    if check.because:
        expected_text += f" because of {check.because!r}"
        is_met = is_met and check.because in str(why)
    return None if is_met else expected_text


def _has_expected_value(check: Belief, why: Why) -> bool:
    expected_value, actual_value = check.value, why.reading.content
    if not check.is_stated:
        return True
    if isinstance(expected_value, float) and isinstance(actual_value, int | float):
        return math.isclose(
            expected_value, actual_value, rel_tol=_TOLERANCE, abs_tol=max(check.within or 0.0, _TOLERANCE)
        )
    if check.within is not None and isinstance(expected_value, int) and isinstance(actual_value, int):
        return abs(expected_value - actual_value) <= check.within
    return expected_value == actual_value


def _state_text(why: Why) -> str:
    reading = why.reading
    if not reading.known:
        return f"unknown ({reading.reason})"
    return f"{value_text(reading.content)}{_unit_text(why.unit)} from {reading.source}"


def _failure_of_observer(check: RunningCheck, at_s: float, record: EventLog) -> Failure | None:
    last_event = record.latest_events(at_s).observer_events.get(check.observer)
    if (last_event is not None and last_event.what == "started") is check.is_running:
        return None
    expected_text = "should run" if check.is_running else "should not run"
    state = "it has not run" if last_event is None else f"it {last_event.what} at {instant_text(last_event.instant_s)}"
    declared_names = sorted(
        name for name, event in record.latest_events(at_s).declaration_events.items() if event.what == "declared"
    )
    why = f"declared: {', '.join(declared_names) or 'none'}"
    return Failure(check.place, f"at {instant_text(at_s)} observer {check.observer} {expected_text}, but {state}", why)


def _failure_of_preview(check: PreviewCheck, at_s: float, codra: ContextManager[Any, Any]) -> Failure | None:
    why = codra.why(f"{PREVIEW_PREFIX}{check.skill}", at_s=at_s)
    outcome = why.reading.content if why.known else "unknown"
    if outcome == check.expected_outcome and check.because in str(why):
        return None
    because_text = f" because of {check.because!r}" if check.because else ""
    message = (
        f"at {instant_text(at_s)} the preview of {check.skill} should be {check.expected_outcome!r}{because_text}, "
        f"but it is {outcome!r}"
    )
    return Failure(check.place, message, str(why))


def _failure_of_decision(
    check: Outcome, at_s: float, codra: ContextManager[Any, Any], record: EventLog
) -> Failure | None:
    decisions = [
        event for event in record.of(Kind.DECISION) if event.name == check.variable and event.instant_s <= at_s
    ]
    if decisions and decisions[-1].what == check.expected_outcome:
        return None
    expected_text = (
        f"by {instant_text(at_s)} the decision on {check.variable} should be {_OUTCOME_TEXTS[check.expected_outcome]}"
    )
    if not decisions:
        return Failure(check.place, f"{expected_text}, but there was no decision on it")
    decision = decisions[-1]
    message = f"{expected_text}, but at {instant_text(decision.instant_s)} it was {_OUTCOME_TEXTS[decision.what]}"
    return Failure(check.place, message, str(codra.why(check.variable, before=decision)))


def _failure_of_expectation(
    check: ExpectationCheck, at_s: float, codra: ContextManager[Any, Any], record: EventLog
) -> Failure | None:
    """Return a failure unless the last outcome of every expectation of the skill about the variable is as stated."""
    last_outcomes = {
        event.details["expected"]: event
        for event in record.of(Kind.EXPECTATION, check.variable)
        if event.details["skill"] == check.skill and event.instant_s <= at_s
    }
    expected_text = f"by {instant_text(at_s)} the expectation of {check.skill} about {check.variable} should be"
    if not last_outcomes:
        message = f"{expected_text} {check.expected_outcome}, but it has no outcome yet"
        return Failure(check.place, message, str(codra.why(check.variable, at_s=at_s)))
    for text, event in last_outcomes.items():
        if event.what != check.expected_outcome:
            message = f"{expected_text} {check.expected_outcome}, but at {instant_text(event.instant_s)} it was"
            why = str(codra.why(check.variable, at_s=event.instant_s))
            return Failure(check.place, f"{message} {event.what}: {text}", why)
    return None


def _unit_text(unit: str) -> str:
    return f" {unit}" if unit else ""
