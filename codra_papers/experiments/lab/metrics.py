"""The metrics of the protocol: seconds in the common window, time to first knowledge, lag, and answers to decisions.

The window of a variable in a run begins when every arm has identified the variable at least once, because P1's Table 2
compares arms over the same seconds. An arm that never identifies the variable is left out, because with this arm there
would be no window for the others.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from codra_papers.experiments.campaign.statistics import Share
from codra_papers.experiments.lab.outcomes import Decision, Outcome, WrongSpan
from codra_papers.experiments.lab.scoring import Piece, overlaps


@dataclass(frozen=True, slots=True, kw_only=True)
class Seconds:
    """How long a held value was right (P1's agreement time), wrong (P1's disagreement time), or unknown."""

    right_s: float = 0.0
    wrong_s: float = 0.0
    unknown_s: float = 0.0

    def __add__(self, other: Seconds) -> Seconds:
        """Return the sums of the right, wrong and unknown seconds of both."""
        return Seconds(
            right_s=self.right_s + other.right_s,
            wrong_s=self.wrong_s + other.wrong_s,
            unknown_s=self.unknown_s + other.unknown_s,
        )

    @property
    def paper_share(self) -> Share:
        """Return the seconds with a right value as a share of the seconds with any value: P1's ratio."""
        return Share(self.right_s, self.right_s + self.wrong_s)

    @property
    def strict_share(self) -> Share:
        """Return the seconds with a right value as a share of all seconds, including those with an unknown value."""
        return Share(self.right_s, self.right_s + self.wrong_s + self.unknown_s)


def seconds(held: Sequence[Piece], truth: Sequence[Piece], start_s: float = 0.0) -> Seconds:
    """Return how long held values were right, wrong and unknown, from an instant to the end of the run."""
    durations_s = {"right": 0.0, "wrong": 0.0, "unknown": 0.0}
    window = [Piece(start_s, math.inf, None)]
    held = [Piece(max(piece.start_s, start_s), piece.end_s, piece.value) for piece, _, _ in overlaps(held, window)]
    for piece, fact, duration_s in overlaps(held, truth):
        durations_s["unknown" if piece.value is None else "right" if piece.value == fact.value else "wrong"] += (
            duration_s
        )
    return Seconds(right_s=durations_s["right"], wrong_s=durations_s["wrong"], unknown_s=durations_s["unknown"])


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """The part of a run in which its arms are compared on a variable.

    Attributes:
        start_s: the first instant at which every arm that is not left out has identified the variable; None if no arm
            identified the variable.
        left_out: the arms that never identified the variable.
    """

    start_s: float | None
    left_out: frozenset[str]


def window(outcome: Outcome, variable: str) -> Window:
    """Return a run's window for a variable."""
    first_s = {name: arm.first_s[variable] for name, arm in outcome.arms.items()}
    return Window(
        start_s=max((identified_s for identified_s in first_s.values() if identified_s is not None), default=None),
        left_out=frozenset(name for name, identified_s in first_s.items() if identified_s is None),
    )


def in_window(outcome: Outcome, variable: str, arm: str) -> Seconds | None:
    """Return the seconds of an arm in the window of a variable, or None if the arm is left out of the window."""
    common = window(outcome, variable)
    if common.start_s is None or arm in common.left_out:
        return None
    return seconds(outcome.arms[arm].held[variable], outcome.truth[variable], common.start_s)


def total(seconds_of_runs: Iterable[Seconds | None]) -> Seconds:
    """Return the sum of an arm's seconds over runs. Runs in which the arm was left out (None) add nothing."""
    return sum((seconds_of_run for seconds_of_run in seconds_of_runs if seconds_of_run is not None), Seconds())


@dataclass(frozen=True, slots=True, kw_only=True)
class Causes:
    """How long held values were wrong, by cause.

    Attributes:
        seen_wrongly_s: the time with values that were already wrong at the instant of their evidence.
        changed_since_s: the time with values that were true at the instant of their evidence.
    """

    seen_wrongly_s: float
    changed_since_s: float


def causes(spans: Iterable[WrongSpan]) -> Causes:
    """Return how long held values were wrong, by cause."""
    wrong_spans = list(spans)
    return Causes(
        seen_wrongly_s=math.fsum(span.end_s - span.start_s for span in wrong_spans if not span.was_true),
        changed_since_s=math.fsum(span.end_s - span.start_s for span in wrong_spans if span.was_true),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Lags:
    """The delays between changes of the truth and the instants at which an arm held the new values.

    Attributes:
        seen_s: the delay of each change that was seen; 0 if the arm held the new value already before the change.
        unseen: the number of changes that were not seen before the next change or the end of the run.
    """

    seen_s: tuple[float, ...] = ()
    unseen: int = 0

    def __add__(self, other: Lags) -> Lags:
        """Return the delays of both, and the sum of the unseen changes."""
        return Lags(seen_s=self.seen_s + other.seen_s, unseen=self.unseen + other.unseen)

    def quantile_s(self, share: float) -> float | None:
        """Return the delay that this share of the seen changes does not exceed; None if no change was seen."""
        return float(np.quantile(self.seen_s, share)) if self.seen_s else None


def lags(held: Sequence[Piece], truth: Sequence[Piece]) -> Lags:
    """Return the delays between changes of the truth and the first instants at which the new value was held."""
    seen_s: list[float] = []
    for change in truth[1:]:
        lags_s = (
            max(piece.start_s, change.start_s) - change.start_s
            for piece, _, _ in overlaps(held, [change])
            if piece.value == change.value
        )
        seen_s.extend(lag_s for lag_s in [next(lags_s, None)] if lag_s is not None)
    return Lags(seen_s=tuple(seen_s), unseen=len(truth[1:]) - len(seen_s))


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers:
    """Numbers of decisions, distinguished by the value that an arm held when the decision needed a variable.

    Attributes:
        right: decisions for which the held value was true.
        wrong: decisions for which the held value was not true.
        fell_back: decisions for which the value was unknown, so that the main execution would look by itself.
        fresh: decisions for which the value was known from evidence after the monitored action; previews for which the
            value was known from any evidence.
    """

    right: int
    wrong: int
    fell_back: int
    fresh: int


def answers(decisions: Iterable[Decision], arm: str) -> Answers:
    """Return how often an arm held a right, wrong or unknown value when a decision needed a variable."""
    all_decisions = list(decisions)
    held = [(decision.held[arm], decision.truth) for decision in all_decisions]
    return Answers(
        right=sum(value == fact for value, fact in held if value is not None),
        wrong=sum(value != fact for value, fact in held if value is not None),
        fell_back=sum(value is None for value, _ in held),
        fresh=sum(decision.fresh[arm] for decision in all_decisions),
    )
