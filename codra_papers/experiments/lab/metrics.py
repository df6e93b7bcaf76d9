"""What the protocol counts: seconds in the common window, time to first knowledge, lag, and answers to decisions.

The window of a variable in a run begins when the last of its arms has identified it first: P1's Table 2 compares arms
over the same seconds. An arm that never identifies the variable would leave no window to the others; it is left out.
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
    """How long a held value was right (P1's agreement time), wrong (its disagreement time), or unknown."""

    right_s: float = 0.0
    wrong_s: float = 0.0
    unknown_s: float = 0.0

    def __add__(self, other: Seconds) -> Seconds:
        """Return the seconds of both."""
        return Seconds(
            right_s=self.right_s + other.right_s,
            wrong_s=self.wrong_s + other.wrong_s,
            unknown_s=self.unknown_s + other.unknown_s,
        )

    @property
    def paper(self) -> Share:
        """Return right of held seconds: P1's ratio."""
        return Share(self.right_s, self.right_s + self.wrong_s)

    @property
    def strict(self) -> Share:
        """Return right of all seconds: not to know is no better than to be wrong."""
        return Share(self.right_s, self.right_s + self.wrong_s + self.unknown_s)


def seconds(held: Sequence[Piece], truth: Sequence[Piece], start_s: float = 0.0) -> Seconds:
    """Return how long what was held was right, wrong and unknown, from an instant to the end of the run."""
    lasted = {"right": 0.0, "wrong": 0.0, "unknown": 0.0}
    window = [Piece(start_s, math.inf, None)]
    held = [Piece(max(piece.start_s, start_s), piece.end_s, piece.value) for piece, _, _ in overlaps(held, window)]
    for piece, fact, duration_s in overlaps(held, truth):
        lasted["unknown" if piece.value is None else "right" if piece.value == fact.value else "wrong"] += duration_s
    return Seconds(right_s=lasted["right"], wrong_s=lasted["wrong"], unknown_s=lasted["unknown"])


@dataclass(frozen=True, slots=True, kw_only=True)
class Window:
    """The part of a run over which its arms are compared on a variable.

    Attributes:
        start_s: when the last arm identified it first; None if none ever did.
        left_out: the arms that never did.
    """

    start_s: float | None
    left_out: frozenset[str]


def window(outcome: Outcome, variable: str) -> Window:
    """Return a run's window for a variable."""
    first_s = {name: arm.first_s[variable] for name, arm in outcome.arms.items()}
    return Window(
        start_s=max((found for found in first_s.values() if found is not None), default=None),
        left_out=frozenset(name for name, found in first_s.items() if found is None),
    )


def in_window(outcome: Outcome, variable: str, arm: str) -> Seconds | None:
    """Return an arm's seconds in the window of a variable; None if it is left out of it."""
    common = window(outcome, variable)
    if common.start_s is None or arm in common.left_out:
        return None
    return seconds(outcome.arms[arm].held[variable], outcome.truth[variable], common.start_s)


def total(found: Iterable[Seconds | None]) -> Seconds:
    """Return what seconds add up to over runs; those of an arm that was left out add nothing."""
    return sum((each for each in found if each is not None), Seconds())


@dataclass(frozen=True, slots=True, kw_only=True)
class Causes:
    """Why a held value was wrong, in seconds."""

    seen_wrongly_s: float
    changed_since_s: float


def causes(spans: Iterable[WrongSpan]) -> Causes:
    """Return how long what was held was wrong, by cause."""
    told = list(spans)
    return Causes(
        seen_wrongly_s=math.fsum(span.end_s - span.start_s for span in told if not span.was_true),
        changed_since_s=math.fsum(span.end_s - span.start_s for span in told if span.was_true),
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Lags:
    """How long after changes of the truth an arm held the new value.

    Attributes:
        seen_s: of each change that was seen; 0 if the arm held the new value before it was true.
        unseen: how many changes were not, until the next one or the end of the run.
    """

    seen_s: tuple[float, ...] = ()
    unseen: int = 0

    def __add__(self, other: Lags) -> Lags:
        """Return the lags of both."""
        return Lags(seen_s=self.seen_s + other.seen_s, unseen=self.unseen + other.unseen)

    def quantile_s(self, share: float) -> float | None:
        """Return the lag that this share of the seen changes do not exceed; None if none was seen."""
        return float(np.quantile(self.seen_s, share)) if self.seen_s else None


def lags(held: Sequence[Piece], truth: Sequence[Piece]) -> Lags:
    """Return how long after each change of the truth what was held followed."""
    seen_s: list[float] = []
    for change in truth[1:]:
        followed = (
            max(piece.start_s, change.start_s) - change.start_s
            for piece, _, _ in overlaps(held, [change])
            if piece.value == change.value
        )
        seen_s.extend(lag_s for lag_s in [next(followed, None)] if lag_s is not None)
    return Lags(seen_s=tuple(seen_s), unseen=len(truth[1:]) - len(seen_s))


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers:
    """What an arm held at the instants when decisions needed it.

    Attributes:
        right: it held what was true.
        wrong: it held what was not.
        fell_back: it held nothing: the main execution would look by itself.
        fresh: for how many there was evidence from after the action that is monitored; of a preview, any evidence.
    """

    right: int
    wrong: int
    fell_back: int
    fresh: int


def answers(decisions: Iterable[Decision], arm: str) -> Answers:
    """Return how often an arm held the truth when it was needed."""
    told = list(decisions)
    held = [(decision.held[arm], decision.truth) for decision in told]
    return Answers(
        right=sum(value == fact for value, fact in held if value is not None),
        wrong=sum(value != fact for value, fact in held if value is not None),
        fell_back=sum(value is None for value, _ in held),
        fresh=sum(decision.fresh[arm] for decision in told),
    )
