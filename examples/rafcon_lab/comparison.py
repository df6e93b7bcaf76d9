"""Comparison of the journals of one task: how the decisions were answered, and how long the task took."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path

from codra_dsl.runtime import Event, Kind
from codra_dsl.runtime.journal.reader import JournalReader


class Arm(StrEnum):
    """The arms of the comparison: with or without observers."""

    WITH = "with"
    WITHOUT = "without"


@dataclass(frozen=True, slots=True, kw_only=True)
class Figures:
    """Figures of a run, from its journal.

    Attributes:
        duration_s: the time from the first input to the last event.
        skills_s: the duration of each skill.
        answered_count: the number of decisions that were answered from context.
        waiting_s: how long these decisions waited for context.
        looked_count: the number of decisions for which the robot itself looked.
        looking_s: how long the robot looked for these decisions.
    """

    duration_s: float
    skills_s: Mapping[str, float]
    answered_count: int
    waiting_s: float
    looked_count: int
    looking_s: float


def read_figures(path: Path) -> Figures:
    """Return the figures of a journal."""
    with JournalReader(path) as reader:
        events = list(reader.events())
    decisions = [event for event in events if event.kind is Kind.DECISION]
    answered_decisions = [event for event in decisions if event.what == "answered"]
    looked_decisions = [event for event in decisions if event.what in ("fell_back", "shadowed")]
    return Figures(
        duration_s=events[-1].instant_s - events[0].instant_s,
        skills_s=_skills_s(events),
        answered_count=len(answered_decisions),
        waiting_s=sum(event.instant_s - event.details["asked_s"] for event in answered_decisions),
        looked_count=len(looked_decisions),
        looking_s=sum(event.instant_s - event.details["asked_s"] for event in looked_decisions),
    )


def _skills_s(events: Iterable[Event]) -> Mapping[str, float]:
    started_skills: list[tuple[str, float]] = []
    durations_s: dict[str, float] = {}
    for event in events:
        if event.kind is Kind.INPUT and event.what == "begin":
            started_skills.append((event.details["skill"], event.instant_s))
        elif event.kind is Kind.INPUT and event.what == "finish":
            name, begin_s = started_skills[event.details["number"] - 1]
            durations_s[name] = event.instant_s - begin_s
    return durations_s


def comparison_table(runs: Iterable[tuple[int, Arm, str, Path]]) -> str:
    """Return a table with a line for each run (seed, arm, outcome, journal), and a line for all runs of each arm."""
    count_headers = f"{'from context':>12} {'looked':>6}"
    lines = [f"seed observers outcome   {count_headers} {'looking s':>9} {'waiting s':>9} {'task s':>9}"]
    totals: dict[Arm, list[Figures]] = {}
    for seed, arm, outcome, path in runs:
        run_figures = read_figures(path)
        totals.setdefault(arm, []).append(run_figures)
        lines.append(_line(str(seed), arm, outcome, [run_figures]))
    lines += [_line("all", arm, "", arm_figures) for arm, arm_figures in totals.items()]
    if len(totals) == len(Arm):
        with_s, without_s = (sum(run_figures.duration_s for run_figures in totals[arm]) for arm in Arm)
        lines.append(f"with observers the task took {1 - with_s / without_s:.1%} less time")
    return "\n".join(lines)


def _line(name: str, arm: Arm, outcome: str, figures_of_runs: Iterable[Figures]) -> str:
    run_figures = list(figures_of_runs)
    answered_count, looked_count = (
        sum(figures_of_run.answered_count for figures_of_run in run_figures),
        sum(figures_of_run.looked_count for figures_of_run in run_figures),
    )
    looking_s, waiting_s = (
        sum(figures_of_run.looking_s for figures_of_run in run_figures),
        sum(figures_of_run.waiting_s for figures_of_run in run_figures),
    )
    task_s = sum(figures_of_run.duration_s for figures_of_run in run_figures)
    counts = f"{answered_count:>12} {looked_count:>6}"
    return f"{name:>4} {arm:9} {outcome:9} {counts} {looking_s:>9.1f} {waiting_s:>9.1f} {task_s:>9.1f}"
