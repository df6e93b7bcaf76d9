"""What is true in a run, and what a course was to be for it: from the world's own state, which no manager sees."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

from codra_papers.store.geometry import Pose2D
from codra_papers.store.simulator.driving import STEP_S
from codra_papers.store.simulator.state import Load, StoreState
from codra_papers.store.simulator.truth import is_unsafe, nearest_person_m

LOW_PERCENT = 20.0
NEAR_M = 1.5
JOINED_S = 1.0
"""Spans of one cause that are less than this apart are one."""

COUNTS_S = 3.0
"""A cause that ends unanswered before this does not count."""

SHOWN_EVERY = 10
"""Of so many steps one has its distance to people kept, to be drawn."""

FAR_M = 10.0


class Cause(StrEnum):
    """What calls for another course. Of two at once the upper one counts."""

    BATTERY = "battery"
    FULL = "full"
    PERSON = "person"


ANSWERS: Mapping[Cause, frozenset[str]] = {
    Cause.BATTERY: frozenset({"dock"}),
    Cause.FULL: frozenset({"deliver"}),
    Cause.PERSON: frozenset({"deliver", "start", "dock"}),
}
"""The courses that a cause calls for."""


@dataclass(frozen=True, slots=True)
class Span:
    """A span of time."""

    start_s: float
    end_s: float


@dataclass(frozen=True, slots=True)
class Called:
    """That a cause called for another course.

    Attributes:
        answered_s: when the course was one that it calls for; None if it ended before.
    """

    cause: Cause
    begun_s: float
    ended_s: float
    answered_s: float | None

    @property
    def reaction_s(self) -> float | None:
        """Return how long it took; None for never."""
        return None if self.answered_s is None else self.answered_s - self.begun_s


def cause_of(state: StoreState, *, is_fetching: bool) -> Cause | None:
    """Return what calls for another course in a state.

    Args:
        state: the truth.
        is_fetching: whether the robot fetches a container.
    """
    robot, carried = state.robot, state.carried()
    if robot.battery_percent < LOW_PERCENT and not robot.is_charging:
        return Cause.BATTERY
    if carried is not None and carried.load is Load.FULL:
        return Cause.FULL
    if is_fetching and any(robot.at.distance_m(Pose2D(*at_m)) < NEAR_M for _, at_m in state.people_m):
        return Cause.PERSON
    return None


class Watch:
    """Follows the states of a shop.

    Attributes:
        causes: what called for another course, from each change to the next.
        unsafe: when the robot moved fast near somebody.
        gaps_m: how near people were, second by second.
    """

    def __init__(self, is_fetching: Callable[[], bool]) -> None:
        """Begin; `is_fetching` tells whether the robot fetches a container."""
        self.causes: list[tuple[float, Cause | None]] = []
        self.unsafe: list[Span] = []
        self.gaps_m: list[tuple[float, float]] = []
        self._is_fetching = is_fetching

    def see(self, state: StoreState) -> None:
        """Take one more step into account."""
        cause = cause_of(state, is_fetching=self._is_fetching())
        if not self.causes or self.causes[-1][1] is not cause:
            self.causes.append((state.instant_s, cause))
        if is_unsafe(state):
            self._add(state.instant_s)
        if state.step % SHOWN_EVERY == 0:
            self.gaps_m.append((state.instant_s, round(min(nearest_person_m(state), FAR_M), 2)))

    def _add(self, now_s: float) -> None:
        """Take the step that ends now as unsafe."""
        start_s = round(now_s - STEP_S, 6)
        if self.unsafe and start_s - self.unsafe[-1].end_s < STEP_S / 2:
            start_s = self.unsafe.pop().start_s
        self.unsafe.append(Span(start_s, now_s))


def calls(
    causes: Sequence[tuple[float, Cause | None]], courses: Sequence[tuple[float, str]], end_s: float
) -> tuple[Called, ...]:
    """Return which causes called for another course, and when each was answered.

    Args:
        causes: what called, from each change to the next, in order.
        courses: the course, from each change to the next, in order.
        end_s: of the run.
    """
    found = [_called(cause, span, courses) for cause, span in _joined(causes, end_s)]
    return tuple(each for each in found if each is not None)


def _joined(causes: Sequence[tuple[float, Cause | None]], end_s: float) -> Iterator[tuple[Cause, Span]]:
    """Yield the spans of causes, those of one cause with a short gap between them as one."""
    last: dict[Cause, Span] = {}
    for (start_s, cause), (next_s, _) in pairwise((*causes, (end_s, None))):
        if cause is None:
            continue
        before = last.get(cause)
        if before is not None and start_s - before.end_s < JOINED_S:
            last[cause] = Span(before.start_s, next_s)
            continue
        if before is not None:
            yield cause, before
        last[cause] = Span(start_s, next_s)
    yield from last.items()


def _called(cause: Cause, span: Span, courses: Sequence[tuple[float, str]]) -> Called | None:
    answers = ANSWERS[cause]
    present = [action for at_s, action in courses if at_s <= span.start_s]
    if present and present[-1] in answers:
        return None
    later = (at_s for at_s, action in courses if span.start_s < at_s <= span.end_s and action in answers)
    answered_s = next(later, None)
    if answered_s is None and span.end_s - span.start_s < COUNTS_S:
        return None
    return Called(cause, span.start_s, span.end_s, answered_s)
