"""Comparisons of arms over several variables: one line per arm, with paired intervals."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass
from typing import Any

from codra_papers.experiments.campaign.cells import interval, plain_table, ratio, rounded
from codra_papers.experiments.campaign.document import Cell, Table
from codra_papers.experiments.campaign.experiment import FIRST_REPORTED_SEED, Settings
from codra_papers.experiments.campaign.statistics import Estimate, ratio_difference, ratio_of_sums
from codra_papers.experiments.lab.metrics import (
    Answers,
    Causes,
    Lags,
    Seconds,
    answers,
    in_window,
    lags,
    total,
    window,
)
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.studies.robustness.findings import (
    LATE_NOTE,
    MEASURES_NOTE,
    Runs,
    ShareFunction,
    estimate_as_data,
    paper_share,
    strict_share,
)

LIDS_AND_LATCHES = ("centrifuge_open", "centrifuge_locked", "pcr_cycler_open", "pcr_cycler_locked")
"""The variables on which decisions are based, and which a camera can see."""

VIEW_VARIABLES = tuple(
    f"{machine}_{part}_in_FOV" for machine in ("centrifuge", "pcr_cycler") for part in ("base", "lid")
)
"""The variables that tell when the camera can see `LIDS_AND_LATCHES`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ArmComparison:
    """How much one arm knew about some variables over runs, and at which cost.

    Attributes:
        seconds: the seconds in the common windows, over all variables and runs. A variable that the arm never
            identified in a run adds no seconds.
        causes: the causes of the wrong seconds: mistakes, and lag.
        balanced_ratio: the mean, over the variables that have one, of the balanced ratio.
        strict_balanced_ratio: the same for the strict balanced ratio.
        constant_ratio: the ratio if, for each variable, the answer were always the more frequent true value.
        left_out: the sum, over all variables, of the number of runs in which the arm never identified the variable.
        paper_difference: the arm's ratio minus the ratio of the other arm; None if the arm is compared with itself.
        strict_difference: the same for the strict ratio.
        triggers: the number of jobs of all algorithms that need the vision slot.
        slot_share: the share of the runs' time in which the arm's observers held the slot.
    """

    arm: str
    seconds: Seconds
    causes: Causes
    balanced_ratio: float | None
    strict_balanced_ratio: float | None
    constant_ratio: float | None
    left_out: int
    paper_difference: Estimate | None
    strict_difference: Estimate | None
    answers: Answers
    lags: Lags
    triggers: int
    slot_share: float

    @property
    def paper_ratio(self) -> float | None:
        """Return the seconds with a right value as a share of the seconds with any value."""
        return ratio_of_sums([self.seconds.paper_share])

    @property
    def strict_ratio(self) -> float | None:
        """Return the seconds with a right value as a share of all seconds."""
        return ratio_of_sums([self.seconds.strict_share])


def reported_seeds(settings: Settings) -> range:
    """Return the seeds of a report. There is at least one seed."""
    return range(FIRST_REPORTED_SEED, FIRST_REPORTED_SEED + max(settings.seeds, 1))


def arm_comparisons(
    outcomes: Sequence[Outcome], variables: Sequence[str], other_arm: str, slot_algorithms: Sequence[str]
) -> Sequence[ArmComparison]:
    """Return a comparison for each arm of some runs.

    Args:
        outcomes: the outcomes of at least one run, all with the same arms.
        variables: the variables over which seconds, changes and decisions are added up.
        other_arm: the arm with which the arms are compared.
        slot_algorithms: the algorithms that need the vision slot.
    """
    return [arm_comparison(outcomes, variables, arm, other_arm, slot_algorithms) for arm in outcomes[0].arms]


def arm_comparison(
    outcomes: Sequence[Outcome], variables: Sequence[str], arm: str, other_arm: str, slot_algorithms: Sequence[str]
) -> ArmComparison:
    """Return the comparison of one arm with another."""
    runs = Runs(outcomes)
    decisions = [decision for outcome in outcomes for decision in outcome.decisions if decision.variable in variables]
    lags_of_variables = [
        lags(outcome.arms[arm].held[name], outcome.truth[name]) for outcome in outcomes for name in variables
    ]
    by_truth_of_variables = [runs.total_by_truth(name, arm) for name in variables]
    return ArmComparison(
        arm=arm,
        seconds=total(pooled_seconds(outcome, variables, arm) for outcome in outcomes),
        causes=sum((runs.causes_in_windows(name, arm) for name in variables), Causes()),
        balanced_ratio=_mean(by_truth.balanced_ratio for by_truth in by_truth_of_variables),
        strict_balanced_ratio=_mean(by_truth.strict_balanced_ratio for by_truth in by_truth_of_variables),
        constant_ratio=ratio_of_sums([by_truth.constant_share for by_truth in by_truth_of_variables]),
        left_out=sum(runs.left_out(name, arm) for name in variables),
        paper_difference=None if arm == other_arm else difference(outcomes, variables, arm, other_arm, paper_share),
        strict_difference=None if arm == other_arm else difference(outcomes, variables, arm, other_arm, strict_share),
        answers=answers(decisions, arm),
        lags=sum(lags_of_variables, Lags()),
        triggers=sum(runs.triggers(arm, slot_algorithms)),
        slot_share=runs.slot_s(arm) / runs.duration_s,
    )


def _mean(values: Iterable[float | None]) -> float | None:
    """Return the mean of the values that are not None; None without such a value."""
    known_values = [value for value in values if value is not None]
    return math.fsum(known_values) / len(known_values) if known_values else None


def pooled_seconds(outcome: Outcome, variables: Sequence[str], arm: str) -> Seconds:
    """Return the sum of an arm's seconds in the common windows of several variables."""
    return total(in_window(outcome, name, arm) for name in variables)


def difference(
    outcomes: Sequence[Outcome], variables: Sequence[str], arm: str, other_arm: str, share_of: ShareFunction
) -> Estimate:
    """Return how much better one arm knew some variables than another arm, with the interval over paired runs.

    If one of the two arms never identified a variable in a run, the variable is left out of this run for both arms.
    """
    variables_by_run = [
        (outcome, [name for name in variables if not window(outcome, name).left_out & {arm, other_arm}])
        for outcome in outcomes
    ]
    shares, other_shares = (
        [share_of(pooled_seconds(outcome, names, name)) for outcome, names in variables_by_run]
        for name in (arm, other_arm)
    )
    return ratio_difference(shares, other_shares)


def arm_comparison_tables(comparisons: Sequence[ArmComparison], caption: str) -> tuple[Table, Table]:
    """Return two tables with one line per arm: one of the arms' knowledge, and one of their decisions and costs."""
    knowledge_header = ("arm", *RATIO_HEADER, "wrong s", "of these, late s", "unknown s", "left out")
    decision_header = (
        "arm",
        "asked: right",
        "wrong",
        "of these, late",
        "fell back",
        "lag median s",
        "never seen",
        "triggers",
        "slot share",
    )
    decision_caption = (
        "Asked: the values that the arm held at decisions; wrong values are marked. Lag: the delay after changes of "
        "the truth. Never seen: changes that were not seen before the next change. Triggers: all jobs that need the "
        "vision slot."
    )
    wrong_cells = frozenset((row, 2) for row, comparison in enumerate(comparisons) if comparison.answers.wrong)
    decision_table = Table(
        caption=decision_caption,
        header=decision_header,
        rows=[_decision_cells(comparison) for comparison in comparisons],
        marked=wrong_cells,
    )
    caption = (
        f"{caption} {MEASURES_NOTE} The balanced ratios are means over the variables. {LATE_NOTE} Left out: variables "
        "that the arm never identified in a run; neither the numbers of the arm nor differences to this arm include "
        "them."
    )
    return plain_table(
        caption, knowledge_header, [_knowledge_cells(comparison) for comparison in comparisons]
    ), decision_table


RATIO_HEADER = ("ratio", "balanced", "strict ratio", "strict, balanced", "constant", "difference", "strict, difference")
"""The titles of the cells of `ratio_cells` after the first cell, which has the name of the arm."""


def ratio_cells(comparison: ArmComparison) -> Sequence[Cell]:
    """Return the cells of a table for an arm: the arm's name, the ratios, and differences to the other arm."""
    return (
        comparison.arm,
        ratio(comparison.seconds.paper_share),
        rounded(comparison.balanced_ratio, 3),
        ratio(comparison.seconds.strict_share),
        rounded(comparison.strict_balanced_ratio, 3),
        rounded(comparison.constant_ratio, 3),
        None if comparison.paper_difference is None else interval(comparison.paper_difference),
        None if comparison.strict_difference is None else interval(comparison.strict_difference),
    )


def _knowledge_cells(comparison: ArmComparison) -> Sequence[Cell]:
    return (
        *ratio_cells(comparison),
        round(comparison.seconds.wrong_s, 1),
        round(comparison.causes.changed_since_s, 1),
        round(comparison.seconds.unknown_s, 1),
        comparison.left_out,
    )


def _decision_cells(comparison: ArmComparison) -> Sequence[Cell]:
    return (
        comparison.arm,
        comparison.answers.right,
        comparison.answers.wrong,
        comparison.answers.late,
        comparison.answers.fell_back,
        rounded(comparison.lags.quantile_s(0.5), 1),
        comparison.lags.unseen,
        comparison.triggers,
        rounded(comparison.slot_share, 3),
    )


def arm_comparisons_as_data(comparisons: Sequence[ArmComparison]) -> Mapping[str, Any]:
    """Return comparisons as plain data. The keys are the names of the arms."""
    return {
        comparison.arm: {
            "window_s": asdict(comparison.seconds),
            "left_out": comparison.left_out,
            "paper_ratio": comparison.paper_ratio,
            "strict_ratio": comparison.strict_ratio,
            "balanced_ratio": comparison.balanced_ratio,
            "strict_balanced_ratio": comparison.strict_balanced_ratio,
            "constant_answer_ratio": comparison.constant_ratio,
            "wrong_by_cause": asdict(comparison.causes),
            "paper_ratio_difference": None
            if comparison.paper_difference is None
            else estimate_as_data(comparison.paper_difference),
            "strict_ratio_difference": None
            if comparison.strict_difference is None
            else estimate_as_data(comparison.strict_difference),
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
    failed_count = sum(outcome.error is not None for outcome in outcomes)
    errors_text = f"; {failed_count} ended with an unrecoverable error" if failed_count else ""
    seeds_text = f"{len(outcomes)} runs of seeds {seeds[0]} to {seeds[-1]}"
    return f"{seeds_text}, {minutes:.0f} simulated minutes together{errors_text}."
