"""How the main execution spent its time while it opened and closed a machine."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

from codra_papers.experiments.lab.outcomes import Decision, Outcome
from codra_papers.lab.mission import PCR_CYCLER


class Task(StrEnum):
    """The tasks that P1 measured (section 4.2)."""

    OPENING = "opening"
    CLOSING = "closing"


SKILLS = {
    Task.OPENING: (f"unlock_{PCR_CYCLER}", f"open_{PCR_CYCLER}"),
    Task.CLOSING: (f"close_{PCR_CYCLER}", f"lock_{PCR_CYCLER}"),
}
"""Opening includes unlocking, and closing includes locking (P1, Figure 8)."""

_SUFFIXES_WITHOUT_CAMERA = ("_is_localized", "_in_manipulation_distance")


@dataclass(frozen=True, slots=True, kw_only=True)
class Execution:
    """One opening or closing.

    Attributes:
        previews: the perception tasks before an action.
        monitors: the perception tasks after an action.
        other_decisions: the decisions that need no camera: those on localization and on the distance to a machine.
    """

    task: Task
    start_s: float
    end_s: float
    previews: Sequence[Decision]
    monitors: Sequence[Decision]
    other_decisions: Sequence[Decision]

    @property
    def checks(self) -> Sequence[Decision]:
        """Return all perception tasks of the execution."""
        return (*self.previews, *self.monitors)

    @property
    def duration_s(self) -> float:
        """Return the total duration: perception, other decisions and the rest, which is acting."""
        return self.end_s - self.start_s

    @property
    def perception_s(self) -> float:
        """Return how long the perception tasks of the execution took."""
        return spent_s(self.checks)

    @property
    def acting_s(self) -> float:
        """Return how long planning and moving took."""
        return self.duration_s - self.perception_s - spent_s(self.other_decisions)


def needs_the_camera(decision: Decision) -> bool:
    """Return whether a decision is a perception task, for which a robot without observers moves its camera."""
    return not decision.variable.endswith(_SUFFIXES_WITHOUT_CAMERA)


def spent_s(decisions: Iterable[Decision]) -> float:
    """Return the sum over decisions of the time from the request to the answer: asking, waiting and looking."""
    return sum(decision.answered_s - decision.instant_s for decision in decisions)


def executions(outcome: Outcome) -> Sequence[Execution]:
    """Return the openings and closings that a run completed, in order of time."""
    skills = outcome.skills if outcome.error is None else outcome.skills[:-1]
    return [
        _execution(task, first, second, outcome.decisions)
        for first, second in pairwise(skills)
        for task, names in SKILLS.items()
        if (first[0], second[0]) == names
    ]


def _execution(
    task: Task, first: tuple[str, float, float], second: tuple[str, float, float], decisions: Sequence[Decision]
) -> Execution:
    execution_decisions = [
        decision
        for decision in decisions
        for name, start_s, end_s in (first, second)
        if decision.skill == name and start_s <= decision.instant_s <= end_s
    ]
    checks = [decision for decision in execution_decisions if needs_the_camera(decision)]
    return Execution(
        task=task,
        start_s=first[1],
        end_s=second[2],
        previews=[decision for decision in checks if decision.is_preview],
        monitors=[decision for decision in checks if not decision.is_preview],
        other_decisions=[decision for decision in execution_decisions if not needs_the_camera(decision)],
    )
