"""The true state of a run, which managers cannot see, and the courses for which this state calls."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from itertools import pairwise

from codra_papers.store.geometry import Pose2D
from codra_papers.store.simulator.driving import STEP_S
from codra_papers.store.simulator.state import Load, StoreState
from codra_papers.store.simulator.truth import is_unsafe, nearest_person_m

LOW_BATTERY_PERCENT = 20.0
NEAR_PERSON_M = 1.5
MAX_GAP_S = 1.0
"""Spans of one cause that are less than this apart are merged."""

MIN_UNANSWERED_S = 3.0
"""An unanswered cause that lasts less than this is ignored."""

STEPS_PER_DISTANCE = 10
"""For pictures, the distance to people is stored once in this many steps."""

MAX_DISTANCE_M = 10.0


class Cause(StrEnum):
    """The causes for a change of the course. If two causes exist at the same time, the first in this list is used."""

    BATTERY = "battery"
    FULL = "full"
    PERSON = "person"


ANSWERS: Mapping[Cause, frozenset[str]] = {
    Cause.BATTERY: frozenset({"dock"}),
    Cause.FULL: frozenset({"deliver"}),
    Cause.PERSON: frozenset({"deliver", "start", "dock"}),
}
"""The courses for which a cause calls."""


@dataclass(frozen=True, slots=True)
class Span:
    """A span of time."""

    start_s: float
    end_s: float


@dataclass(frozen=True, slots=True)
class CauseCall:
    """A cause that called for another course.

    Attributes:
        answered_s: when the course became one for which the cause calls; None if the cause ended before that.
    """

    cause: Cause
    begun_s: float
    ended_s: float
    answered_s: float | None

    @property
    def reaction_s(self) -> float | None:
        """Return the time from the cause to the answer, or None if the cause was never answered."""
        return None if self.answered_s is None else self.answered_s - self.begun_s


def cause_of(state: StoreState, *, is_fetching: bool) -> Cause | None:
    """Return the cause for another course in a state, or None if there is no cause.

    Args:
        state: the true state of the shop.
        is_fetching: whether the robot fetches a container.
    """
    robot, carried_container = state.robot, state.carried_container()
    if robot.battery_percent < LOW_BATTERY_PERCENT and not robot.is_charging:
        return Cause.BATTERY
    if carried_container is not None and carried_container.load is Load.FULL:
        return Cause.FULL
    if is_fetching and any(robot.at.distance_m(Pose2D(*at_m)) < NEAR_PERSON_M for _, at_m in state.people_m):
        return Cause.PERSON
    return None


class Watch:
    """Records the states of a shop.

    Attributes:
        causes: pairs of an instant and the cause for another course from this instant on; None for no cause.
        unsafe: when the robot moved fast near a person.
        gaps_m: the distance to the nearest person, second by second.
        battery_empty_s: when the battery became empty; None if it did not.
    """

    def __init__(self, is_fetching: Callable[[], bool]) -> None:
        """Create an empty record. `is_fetching` returns whether the robot fetches a container."""
        self.causes: list[tuple[float, Cause | None]] = []
        self.unsafe: list[Span] = []
        self.gaps_m: list[tuple[float, float]] = []
        self.battery_empty_s: float | None = None
        self._is_fetching = is_fetching

    def see(self, state: StoreState) -> None:
        """Record one more step."""
        if self.battery_empty_s is None and state.robot.battery_percent <= 0.0:
            self.battery_empty_s = state.instant_s
        cause = cause_of(state, is_fetching=self._is_fetching())
        if not self.causes or self.causes[-1][1] is not cause:
            self.causes.append((state.instant_s, cause))
        if is_unsafe(state):
            self._add_unsafe_step(state.instant_s)
        if state.step % STEPS_PER_DISTANCE == 0:
            self.gaps_m.append((state.instant_s, round(min(nearest_person_m(state), MAX_DISTANCE_M), 2)))

    def _add_unsafe_step(self, now_s: float) -> None:
        """Record the step that ends now as unsafe."""
        start_s = round(now_s - STEP_S, 6)
        if self.unsafe and start_s - self.unsafe[-1].end_s < STEP_S / 2:
            start_s = self.unsafe.pop().start_s
        self.unsafe.append(Span(start_s, now_s))


def calls(
    causes: Sequence[tuple[float, Cause | None]], courses: Sequence[tuple[float, str]], end_s: float
) -> tuple[CauseCall, ...]:
    """Return the causes that called for another course, and when each was answered.

    Args:
        causes: pairs of an instant and the cause from this instant on, in order.
        courses: pairs of an instant and the course from this instant on, in order.
        end_s: the end of the run.
    """
    candidates = [_call_of_cause(cause, span, courses) for cause, span in _cause_spans(causes, end_s)]
    return tuple(call for call in candidates if call is not None)


def _cause_spans(causes: Sequence[tuple[float, Cause | None]], end_s: float) -> Iterator[tuple[Cause, Span]]:
    """Yield the spans of causes; spans of one cause with a short gap between them are merged."""
    last_spans: dict[Cause, Span] = {}
    for (start_s, cause), (next_s, _) in pairwise((*causes, (end_s, None))):
        if cause is None:
            continue
        before = last_spans.get(cause)
        if before is not None and start_s - before.end_s < MAX_GAP_S:
            last_spans[cause] = Span(before.start_s, next_s)
            continue
        if before is not None:
            yield cause, before
        last_spans[cause] = Span(start_s, next_s)
    yield from last_spans.items()


def _call_of_cause(cause: Cause, span: Span, courses: Sequence[tuple[float, str]]) -> CauseCall | None:
    answers = ANSWERS[cause]
    earlier_actions = [action for at_s, action in courses if at_s <= span.start_s]
    if earlier_actions and earlier_actions[-1] in answers:
        return None
    answer_instants_s = (at_s for at_s, action in courses if span.start_s < at_s <= span.end_s and action in answers)
    answered_s = next(answer_instants_s, None)
    if answered_s is None and span.end_s - span.start_s < MIN_UNANSWERED_S:
        return None
    return CauseCall(cause, span.start_s, span.end_s, answered_s)
