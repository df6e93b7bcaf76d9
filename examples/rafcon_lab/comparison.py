"""What two journals say of the same task: how its decisions were answered, and how long it took."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from codra_dsl.runtime import Event, Kind
from codra_dsl.runtime.journal.reader import JournalReader


class Arm(StrEnum):
    """Whether observers watch."""

    WITH = "with"
    WITHOUT = "without"


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """What a journal says of a run.

    Attributes:
        duration_s: from the first input to the last event.
        skills_s: how long each skill took.
        answered: how many decisions were answered from context, and...
        waited_s: ...how long they waited for it.
        looked: for how many decisions the robot looked itself, and...
        looked_s: ...how long that took.
    """

    duration_s: float
    skills_s: Mapping[str, float]
    answered: int
    waited_s: float
    looked: int
    looked_s: float


def figures(path: Path) -> Figures:
    """Return what a journal says."""
    with JournalReader(path) as reader:
        events = list(reader.events())
    decisions = [event for event in events if event.kind is Kind.DECISION]
    answered = [event for event in decisions if event.what == "answered"]
    looked = [event for event in decisions if event.what in ("fell_back", "shadowed")]
    return Figures(
        duration_s=events[-1].instant_s - events[0].instant_s,
        skills_s=_skills_s(events),
        answered=len(answered),
        waited_s=sum(event.instant_s - event.details["asked_s"] for event in answered),
        looked=len(looked),
        looked_s=sum(event.instant_s - event.details["asked_s"] for event in looked),
    )


def _skills_s(events: Iterable[Event]) -> Mapping[str, float]:
    begun: list[tuple[str, float]] = []
    spent_s: dict[str, float] = {}
    for event in events:
        if event.kind is Kind.INPUT and event.what == "begin":
            begun.append((event.details["skill"], event.instant_s))
        elif event.kind is Kind.INPUT and event.what == "finish":
            name, begin_s = begun[event.details["number"] - 1]
            spent_s[name] = event.instant_s - begin_s
    return spent_s


def table(runs: Iterable[tuple[int, Arm, str, Path]]) -> str:
    """Return a line for each run (its seed, its arm, its outcome, its journal), and one for all runs of an arm."""
    counted = f"{'from context':>12} {'looked':>6}"
    lines = [f"seed observers outcome   {counted} {'looking s':>9} {'waiting s':>9} {'task s':>9}"]
    totals: dict[Arm, list[Figures]] = {}
    for seed, arm, outcome, path in runs:
        found = figures(path)
        totals.setdefault(arm, []).append(found)
        lines.append(_line(str(seed), arm, outcome, [found]))
    lines += [_line("all", arm, "", found) for arm, found in totals.items()]
    if len(totals) == len(Arm):
        with_s, without_s = (sum(found.duration_s for found in totals[arm]) for arm in Arm)
        lines.append(f"with observers the task took {1 - with_s / without_s:.1%} less time")
    return "\n".join(lines)


def _line(name: str, arm: Arm, outcome: str, found: Iterable[Figures]) -> str:
    runs = list(found)
    answered, looked = sum(each.answered for each in runs), sum(each.looked for each in runs)
    looked_s, waited_s = sum(each.looked_s for each in runs), sum(each.waited_s for each in runs)
    task_s = sum(each.duration_s for each in runs)
    counts = f"{answered:>12} {looked:>6}"
    return f"{name:>4} {arm:9} {outcome:9} {counts} {looked_s:>9.1f} {waited_s:>9.1f} {task_s:>9.1f}"
