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


@dataclass(frozen=True, slots=True, kw_only=True)
class SecondsByTruth:
    """The seconds of a held value, divided by the true value of the variable, which is true or false.

    A ratio of right values can be high because one of the two true values is rare. Compare the ratio with the ratio of
    a constant answer, and with the balanced ratio, in which both true values have the same weight.

    Attributes:
        while_true: the seconds while the variable was true.
        while_false: the seconds while the variable was false.
    """

    while_true: Seconds = Seconds()
    while_false: Seconds = Seconds()

    def __add__(self, other: SecondsByTruth) -> SecondsByTruth:
        """Return the sums of the seconds of both."""
        return SecondsByTruth(
            while_true=self.while_true + other.while_true, while_false=self.while_false + other.while_false
        )

    @property
    def all(self) -> Seconds:
        """Return the seconds without regard to the true value."""
        return self.while_true + self.while_false

    @property
    def balanced_ratio(self) -> float | None:
        """Return the mean of the paper ratios while the variable was true and while it was false.

        This is the balanced accuracy of known values; 0.5 for a constant answer. None if one of the ratios is missing,
        because the variable was always true or always false, or because no value was held meanwhile.
        """
        return _mean_of_ratios(self.while_true.paper_share, self.while_false.paper_share)

    @property
    def strict_balanced_ratio(self) -> float | None:
        """Return the same for the strict ratios, in which an unknown value counts as not right."""
        return _mean_of_ratios(self.while_true.strict_share, self.while_false.strict_share)

    @property
    def constant_share(self) -> Share:
        """Return the share of the better one of the two constant answers: the share of the more frequent true value."""
        true_s, false_s = self.while_true.strict_share.total, self.while_false.strict_share.total
        return Share(max(true_s, false_s), true_s + false_s)


def _mean_of_ratios(*shares: Share) -> float | None:
    ratios = [share.part / share.total for share in shares if share.total]
    return math.fsum(ratios) / len(ratios) if len(ratios) == len(shares) else None


def seconds(held: Sequence[Piece], truth: Sequence[Piece], start_s: float = 0.0) -> Seconds:
    """Return how long held values were right, wrong and unknown, from an instant to the end of the run."""
    return seconds_by_truth(held, truth, start_s).all


def seconds_by_truth(held: Sequence[Piece], truth: Sequence[Piece], start_s: float = 0.0) -> SecondsByTruth:
    """Return the same as `seconds`, divided by the true value."""
    durations_s = {(is_true, verdict): 0.0 for is_true in (True, False) for verdict in ("right", "wrong", "unknown")}
    window = [Piece(start_s, math.inf, None)]
    held = [Piece(max(piece.start_s, start_s), piece.end_s, piece.value) for piece, _, _ in overlaps(held, window)]
    for piece, fact, duration_s in overlaps(held, truth):
        verdict = "unknown" if piece.value is None else "right" if piece.value == fact.value else "wrong"
        durations_s[bool(fact.value), verdict] += duration_s
    while_true, while_false = (
        Seconds(
            right_s=durations_s[is_true, "right"],
            wrong_s=durations_s[is_true, "wrong"],
            unknown_s=durations_s[is_true, "unknown"],
        )
        for is_true in (True, False)
    )
    return SecondsByTruth(while_true=while_true, while_false=while_false)


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
    by_truth = by_truth_in_window(outcome, variable, arm)
    return None if by_truth is None else by_truth.all


def by_truth_in_window(outcome: Outcome, variable: str, arm: str) -> SecondsByTruth | None:
    """Return the same as `in_window`, divided by the true value."""
    start_s = _start_s(outcome, variable, arm)
    if start_s is None:
        return None
    return seconds_by_truth(outcome.arms[arm].held[variable], outcome.truth[variable], start_s)


def causes_in_window(outcome: Outcome, variable: str, arm: str) -> Causes:
    """Return how long an arm's values were wrong, by cause, in the window of a variable.

    The two times add up to the wrong seconds of `in_window`. They are 0 if the arm is left out of the window.
    """
    start_s = _start_s(outcome, variable, arm)
    if start_s is None:
        return Causes()
    return causes(
        WrongSpan(max(span.start_s, start_s), span.end_s, span.was_true)
        for span in outcome.arms[arm].wrong[variable]
        if span.end_s > start_s
    )


def _start_s(outcome: Outcome, variable: str, arm: str) -> float | None:
    """Return the start of the window of a variable; None if there is no window, or if the arm is left out of it."""
    common = window(outcome, variable)
    return None if arm in common.left_out else common.start_s


def total(seconds_of_runs: Iterable[Seconds | None]) -> Seconds:
    """Return the sum of an arm's seconds over runs. Runs in which the arm was left out (None) add nothing."""
    return sum((seconds_of_run for seconds_of_run in seconds_of_runs if seconds_of_run is not None), Seconds())


def total_by_truth(outcomes: Iterable[Outcome], variable: str, arm: str) -> SecondsByTruth:
    """Return the sum of an arm's seconds in the windows of a variable, divided by the true value."""
    by_run = (by_truth_in_window(outcome, variable, arm) for outcome in outcomes)
    return sum((by_truth for by_truth in by_run if by_truth is not None), SecondsByTruth())


@dataclass(frozen=True, slots=True, kw_only=True)
class Causes:
    """How long held values were wrong, by cause.

    Attributes:
        seen_wrongly_s: the time with values that were already wrong at the instant of their evidence: mistakes.
        changed_since_s: the time with values that were true at the instant of their evidence: lag.
    """

    seen_wrongly_s: float = 0.0
    changed_since_s: float = 0.0

    def __add__(self, other: Causes) -> Causes:
        """Return the sums of the times of both."""
        return Causes(
            seen_wrongly_s=self.seen_wrongly_s + other.seen_wrongly_s,
            changed_since_s=self.changed_since_s + other.changed_since_s,
        )


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
        late: those of the wrong decisions whose value was true at the instant of its evidence: lag, and no mistake.
        fell_back: decisions for which the value was unknown, so that the main execution would look by itself.
        fresh: decisions for which the value was known from evidence after the monitored action; previews for which the
            value was known from any evidence.
    """

    right: int
    wrong: int
    late: int
    fell_back: int
    fresh: int


def answers(decisions: Iterable[Decision], arm: str) -> Answers:
    """Return how often an arm held a right, wrong or unknown value when a decision needed a variable."""
    all_decisions = list(decisions)
    held = [(decision.held[arm], decision.truth) for decision in all_decisions]
    return Answers(
        right=sum(value == fact for value, fact in held if value is not None),
        wrong=sum(value != fact for value, fact in held if value is not None),
        late=sum(decision.wrong[arm].was_true for decision in all_decisions if arm in decision.wrong),
        fell_back=sum(value is None for value, _ in held),
        fresh=sum(decision.fresh[arm] for decision in all_decisions),
    )
