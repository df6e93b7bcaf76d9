"""Comparisons of arms over several variables: one line per arm, with paired intervals."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from codra_papers.experiments.campaign.cells import interval, plain_table, ratio, rounded
from codra_papers.experiments.campaign.document import Cell, Table
from codra_papers.experiments.campaign.experiment import FIRST_REPORTED_SEED, Settings
from codra_papers.experiments.campaign.statistics import Estimate, ratio_difference, ratio_of_sums
from codra_papers.experiments.lab.metrics import Answers, Lags, Seconds, answers, in_window, lags, total, window
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.studies.robustness.findings import Counted, Runs, paper, plain, strict

LIDS_AND_LATCHES = ("centrifuge_open", "centrifuge_locked", "pcr_cycler_open", "pcr_cycler_locked")
"""The visible variables on which decisions are based."""

IN_VIEW = tuple(f"{machine}_{part}_in_FOV" for machine in ("centrifuge", "pcr_cycler") for part in ("base", "lid"))
"""The variables that show when the others are visible."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmComparison:
    """How much one arm knew of some variables over runs, and at which cost.

    Attributes:
        seconds: in the common windows, over all variables and runs; variables that it never identified add none.
        left_out: how many times it never identified a variable in a run.
        paper_difference: of the ratio, minus that of the arm it is compared with; None if it is that arm.
        strict_difference: of the strict ratio, likewise.
        triggers: the number of jobs of all algorithms that need the vision slot.
        slot_share: the share of the runs' time in which its observers held the slot.
    """

    arm: str
    seconds: Seconds
    left_out: int
    paper_difference: Estimate | None
    strict_difference: Estimate | None
    answers: Answers
    lags: Lags
    triggers: int
    slot_share: float

    @property
    def paper_ratio(self) -> float | None:
        """Return right seconds of held seconds."""
        return ratio_of_sums([self.seconds.paper])

    @property
    def strict_ratio(self) -> float | None:
        """Return right seconds of all seconds."""
        return ratio_of_sums([self.seconds.strict])


def reported_seeds(settings: Settings) -> range:
    """Return the seeds of a report: at least one."""
    return range(FIRST_REPORTED_SEED, FIRST_REPORTED_SEED + max(settings.seeds, 1))


def arm_comparisons(
    outcomes: Sequence[Outcome], variables: Sequence[str], against: str, vision: Sequence[str]
) -> Sequence[ArmComparison]:
    """Return the comparisons of all arms of some runs.

    Args:
        outcomes: at least one, all with the same arms.
        variables: the variables over which seconds, changes and decisions are added up.
        against: the arm with which the others are compared.
        vision: the algorithms that need the vision slot.
    """
    return [arm_comparison(outcomes, variables, arm, against, vision) for arm in outcomes[0].arms]


def arm_comparison(
    outcomes: Sequence[Outcome], variables: Sequence[str], arm: str, against: str, vision: Sequence[str]
) -> ArmComparison:
    """Return the comparison of one arm with another."""
    runs = Runs(outcomes)
    decisions = [decision for outcome in outcomes for decision in outcome.decisions if decision.variable in variables]
    lags_of_variables = [
        lags(outcome.arms[arm].held[name], outcome.truth[name]) for outcome in outcomes for name in variables
    ]
    return ArmComparison(
        arm=arm,
        seconds=total(pooled(outcome, variables, arm) for outcome in outcomes),
        left_out=sum(runs.left_out(name, arm) for name in variables),
        paper_difference=None if arm == against else difference(outcomes, variables, arm, against, paper),
        strict_difference=None if arm == against else difference(outcomes, variables, arm, against, strict),
        answers=answers(decisions, arm),
        lags=sum(lags_of_variables, Lags()),
        triggers=sum(runs.triggers(arm, vision)),
        slot_share=runs.slot_s(arm) / runs.duration_s,
    )


def pooled(outcome: Outcome, variables: Sequence[str], arm: str) -> Seconds:
    """Return an arm's seconds in the common windows of several variables, added up."""
    return total(in_window(outcome, name, arm) for name in variables)


def difference(
    outcomes: Sequence[Outcome], variables: Sequence[str], arm: str, against: str, counted: Counted
) -> Estimate:
    """Return how much better one arm knew some variables than another, with its interval over paired runs.

    If one of the two never identified a variable in a run, that variable is left out of that run for both.
    """
    shared = [
        (outcome, [name for name in variables if not window(outcome, name).left_out & {arm, against}])
        for outcome in outcomes
    ]
    left, right = ([counted(pooled(outcome, names, side)) for outcome, names in shared] for side in (arm, against))
    return ratio_difference(left, right)


def arm_comparison_tables(comparisons: Sequence[ArmComparison], caption: str) -> tuple[Table, Table]:
    """Return two tables with one line per arm: its knowledge, and its decisions and costs."""
    knew = (
        "arm",
        "ratio",
        "strict ratio",
        "ratio, difference",
        "strict, difference",
        "wrong s",
        "unknown s",
        "left out",
    )
    used = ("arm", "asked: right", "wrong", "fell back", "lag median s", "never seen", "triggers", "slot share")
    cost = (
        "Asked: the values at decisions; wrong values are marked. Lag: after changes of the truth; "
        "some were never seen before the next. Triggers: all jobs that need the vision slot."
    )
    wrong = frozenset((row, 2) for row, comparison in enumerate(comparisons) if comparison.answers.wrong)
    used_table = Table(caption=cost, header=used, rows=[_used(comparison) for comparison in comparisons], marked=wrong)
    caption = (
        f"{caption} Left out: variables that the arm never identified in a run; they do not count in its numbers or in "
        "differences to it."
    )
    return plain_table(caption, knew, [_knew(comparison) for comparison in comparisons]), used_table


def ratios(comparison: ArmComparison) -> Sequence[Cell]:
    """Return an arm, both of its ratios, and their differences, as cells of a table."""
    return (
        comparison.arm,
        ratio(comparison.seconds.paper),
        ratio(comparison.seconds.strict),
        None if comparison.paper_difference is None else interval(comparison.paper_difference),
        None if comparison.strict_difference is None else interval(comparison.strict_difference),
    )


def _knew(comparison: ArmComparison) -> Sequence[Cell]:
    return (
        *ratios(comparison),
        round(comparison.seconds.wrong_s, 1),
        round(comparison.seconds.unknown_s, 1),
        comparison.left_out,
    )


def _used(comparison: ArmComparison) -> Sequence[Cell]:
    return (
        comparison.arm,
        comparison.answers.right,
        comparison.answers.wrong,
        comparison.answers.fell_back,
        rounded(comparison.lags.quantile_s(0.5), 1),
        comparison.lags.unseen,
        comparison.triggers,
        rounded(comparison.slot_share, 3),
    )


def arm_comparisons_as_data(comparisons: Sequence[ArmComparison]) -> Mapping[str, Any]:
    """Return comparisons as plain data, by arm."""
    return {
        comparison.arm: {
            "window_s": asdict(comparison.seconds),
            "left_out": comparison.left_out,
            "paper_ratio": comparison.paper_ratio,
            "strict_ratio": comparison.strict_ratio,
            "paper_ratio_difference": None
            if comparison.paper_difference is None
            else plain(comparison.paper_difference),
            "strict_ratio_difference": None
            if comparison.strict_difference is None
            else plain(comparison.strict_difference),
            "asked": asdict(comparison.answers),
            "lag_median_s": comparison.lags.quantile_s(0.5),
            "changes_never_seen": comparison.lags.unseen,
            "vision_triggers": comparison.triggers,
            "slot_share": comparison.slot_share,
        }
        for comparison in comparisons
    }


def runs_sentence(outcomes: Sequence[Outcome]) -> str:
    """Return a sentence that describes the runs."""
    seeds = sorted({outcome.seed for outcome in outcomes})
    minutes = sum(outcome.duration_s for outcome in outcomes) / 60
    failed = sum(outcome.error is not None for outcome in outcomes)
    ended = f"; {failed} ended with an unrecoverable error" if failed else ""
    return f"{len(outcomes)} runs of seeds {seeds[0]} to {seeds[-1]}, {minutes:.0f} simulated minutes together{ended}."
