"""What must be so in a story, compared with what was recorded, and what a failure says."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from textwrap import indent
from typing import Any

from codra_dsl.integrations.testing.timeline import Belief, Check, Moment, Outcome, Running
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.load.yaml.source import Source
from codra_dsl.runtime import ContextManager, EventLog, Kind, Why
from codra_dsl.runtime.why.values import instant, shown
from codra_dsl.tooling.report.findings import visible_lines

_NEARLY = 1e-9
_SAID = {
    "answered": "answered from context",
    "fell_back": "made by looking",
    "shadowed": "made by looking in shadow mode",
}


@dataclass(frozen=True, slots=True)
class Failure:
    """Something that is not as a timeline says.

    Attributes:
        place: where it says so.
        why: the explanation, in lines; empty if there is none.
    """

    place: Place
    message: str
    why: str = ""


def failures_of(
    moment: Moment, at_s: float, now_s: float, codra: ContextManager[Any, Any], record: EventLog
) -> Iterator[Failure]:
    """Yield what was not as a moment says.

    Args:
        moment: of the story.
        at_s: when it was, on the clock.
        now_s: how far the clock has come.
        codra: explains.
        record: of the run.
    """
    if moment.checks and at_s > now_s:
        yield Failure(moment.place, f"the run was over at {instant(now_s)}, before this moment")
        return
    for check in moment.checks:
        failure = _failure(check, at_s, codra, record)
        if failure is not None:
            yield failure


def rendered(failures: Sequence[Failure], source: Source) -> str:
    """Return failures as people read them: the place, the line, what was meant, what is, and why."""
    lines = source.text.splitlines()
    return "\n\n".join(_rendered(each, lines) for each in failures)


def _rendered(failure: Failure, lines: Sequence[str]) -> str:
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


def _failure(check: Check, at_s: float, codra: ContextManager[Any, Any], record: EventLog) -> Failure | None:
    match check:
        case Belief():
            why = codra.why(check.variable, at_s=at_s)
            wanted = _wanted(check, why)
            if wanted is None:
                return None
            message = f"at {instant(at_s)} {check.variable} should be {wanted}, and it is {_state(why)}"
            return Failure(check.place, message, str(why))
        case Running():
            return _failure_of_observer(check, at_s, record)
        case Outcome():
            return _failure_of_decision(check, at_s, codra, record)


def _wanted(check: Belief, why: Why) -> str | None:
    """Return in words what should be so, or None if it is."""
    if check.is_unknown:
        wanted = "unknown" if check.reason is None else f"unknown ({check.reason})"
        fits = not why.known and check.reason in (None, why.reading.reason)
    else:
        within = "" if check.within is None else f" within {shown(check.within)}"
        wanted = f"{shown(check.value)}{_spaced(why.unit)}{within}" if check.is_stated else "known"
        wanted += f" from {check.source}" if check.source else ""
        fits = why.known and _is_value(check, why) and check.source in ("", why.reading.source)
    if check.because:
        wanted += f" because of {check.because!r}"
        fits = fits and check.because in str(why)
    return None if fits else wanted


def _is_value(check: Belief, why: Why) -> bool:
    meant, found = check.value, why.reading.content
    if not check.is_stated:
        return True
    if isinstance(meant, float) and isinstance(found, int | float):
        return math.isclose(meant, found, rel_tol=_NEARLY, abs_tol=max(check.within or 0.0, _NEARLY))
    if check.within is not None and isinstance(meant, int) and isinstance(found, int):
        return abs(meant - found) <= check.within
    return meant == found


def _state(why: Why) -> str:
    reading = why.reading
    if not reading.known:
        return f"unknown ({reading.reason})"
    return f"{shown(reading.content)}{_spaced(why.unit)} from {reading.source}"


def _failure_of_observer(check: Running, at_s: float, record: EventLog) -> Failure | None:
    last = record.latest_events(at_s).observers.get(check.observer)
    if (last is not None and last.what == "started") is check.is_running:
        return None
    wanted = "should run" if check.is_running else "should not run"
    state = "it has not run" if last is None else f"it {last.what} at {instant(last.instant_s)}"
    needed = sorted(name for name, event in record.latest_events(at_s).declared.items() if event.what == "declared")
    why = f"declared: {', '.join(needed) or 'nothing'}"
    return Failure(check.place, f"at {instant(at_s)} observer {check.observer} {wanted}, and {state}", why)


def _failure_of_decision(
    check: Outcome, at_s: float, codra: ContextManager[Any, Any], record: EventLog
) -> Failure | None:
    asked = [each for each in record.of(Kind.DECISION) if each.name == check.variable and each.instant_s <= at_s]
    if asked and asked[-1].what == check.how:
        return None
    meant = f"by {instant(at_s)} the decision on {check.variable} should be {_SAID[check.how]}"
    if not asked:
        return Failure(check.place, f"{meant}, and nobody has asked for it")
    then_s = asked[-1].instant_s
    why = str(codra.why(check.variable, at_s=then_s))
    return Failure(check.place, f"{meant}, and at {instant(then_s)} it was {_SAID[asked[-1].what]}", why)


def _spaced(unit: str) -> str:
    return f" {unit}" if unit else ""
