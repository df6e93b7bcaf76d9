"""How arms stand beside each other over several variables: one line an arm, with paired intervals."""

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
"""What decisions rest on that is seen."""

IN_VIEW = tuple(f"{machine}_{part}_in_FOV" for machine in ("centrifuge", "pcr_cycler") for part in ("base", "lid"))
"""What says when these can be seen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Standing:
    """What one arm knew of some variables over runs, and what it cost.

    Attributes:
        seconds: in the common windows, over all variables and runs; of variables that it never identified, none.
        left_out: how many times it never identified a variable in a run.
        paper_difference: of the ratio, less that of the arm it is compared with; None if it is that arm.
        strict_difference: likewise of the strict ratio.
        triggers: jobs of all algorithms that need the vision slot.
        slot_share: of the runs' time in which its observers held the slot.
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
        """Return right of held seconds."""
        return ratio_of_sums([self.seconds.paper])

    @property
    def strict_ratio(self) -> float | None:
        """Return right of all seconds."""
        return ratio_of_sums([self.seconds.strict])


def reported_seeds(settings: Settings) -> range:
    """Return the seeds that a report is made of: one at least."""
    return range(FIRST_REPORTED_SEED, FIRST_REPORTED_SEED + max(settings.seeds, 1))


def standings(
    outcomes: Sequence[Outcome], variables: Sequence[str], against: str, vision: Sequence[str]
) -> Sequence[Standing]:
    """Return how all arms of some runs stand.

    Args:
        outcomes: at least one, all with the same arms.
        variables: over which seconds, changes and decisions are added up.
        against: the arm that the others are compared with.
        vision: the algorithms that need the vision slot.
    """
    return [standing(outcomes, variables, arm, against, vision) for arm in outcomes[0].arms]


def standing(
    outcomes: Sequence[Outcome], variables: Sequence[str], arm: str, against: str, vision: Sequence[str]
) -> Standing:
    """Return how one arm stands."""
    runs = Runs(outcomes)
    asked = [each for outcome in outcomes for each in outcome.decisions if each.variable in variables]
    found = [lags(outcome.arms[arm].held[name], outcome.truth[name]) for outcome in outcomes for name in variables]
    return Standing(
        arm=arm,
        seconds=total(pooled(outcome, variables, arm) for outcome in outcomes),
        left_out=sum(runs.left_out(name, arm) for name in variables),
        paper_difference=None if arm == against else difference(outcomes, variables, arm, against, paper),
        strict_difference=None if arm == against else difference(outcomes, variables, arm, against, strict),
        answers=answers(asked, arm),
        lags=sum(found, Lags()),
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

    A variable that one of the two never identified in a run is left out of that run for both.
    """
    shared = [
        (each, [name for name in variables if not window(each, name).left_out & {arm, against}]) for each in outcomes
    ]
    left, right = ([counted(pooled(each, names, one)) for each, names in shared] for one in (arm, against))
    return ratio_difference(left, right)


def standings_tables(found: Sequence[Standing], caption: str) -> tuple[Table, Table]:
    """Return what arms knew, and what came of it at decisions and what it cost: one line an arm in each."""
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
        "Asked: what was held when a decision needed it; marked where it was wrong. Lag: after changes of the truth; "
        "some were never seen before the next. Triggers: all jobs that need the vision slot."
    )
    wrong = frozenset((row, 2) for row, one in enumerate(found) if one.answers.wrong)
    told = Table(caption=cost, header=used, rows=[_used(one) for one in found], marked=wrong)
    caption = (
        f"{caption} Left out: variables that the arm never identified in a run; they count in none of its numbers, nor "
        "in differences to it."
    )
    return plain_table(caption, knew, [_knew(one) for one in found]), told


def ratios(one: Standing) -> Sequence[Cell]:
    """Return an arm, both of its ratios, and their differences, as cells of a table."""
    return (
        one.arm,
        ratio(one.seconds.paper),
        ratio(one.seconds.strict),
        None if one.paper_difference is None else interval(one.paper_difference),
        None if one.strict_difference is None else interval(one.strict_difference),
    )


def _knew(one: Standing) -> Sequence[Cell]:
    return (
        *ratios(one),
        round(one.seconds.wrong_s, 1),
        round(one.seconds.unknown_s, 1),
        one.left_out,
    )


def _used(one: Standing) -> Sequence[Cell]:
    return (
        one.arm,
        one.answers.right,
        one.answers.wrong,
        one.answers.fell_back,
        rounded(one.lags.quantile_s(0.5), 1),
        one.lags.unseen,
        one.triggers,
        rounded(one.slot_share, 3),
    )


def standings_as_data(found: Sequence[Standing]) -> Mapping[str, Any]:
    """Return how arms stand as plain data, by arm."""
    return {
        one.arm: {
            "window_s": asdict(one.seconds),
            "left_out": one.left_out,
            "paper_ratio": one.paper_ratio,
            "strict_ratio": one.strict_ratio,
            "paper_ratio_difference": None if one.paper_difference is None else plain(one.paper_difference),
            "strict_ratio_difference": None if one.strict_difference is None else plain(one.strict_difference),
            "asked": asdict(one.answers),
            "lag_median_s": one.lags.quantile_s(0.5),
            "changes_never_seen": one.lags.unseen,
            "vision_triggers": one.triggers,
            "slot_share": one.slot_share,
        }
        for one in found
    }


def runs_sentence(outcomes: Sequence[Outcome]) -> str:
    """Return what was run, in a sentence."""
    seeds = sorted({outcome.seed for outcome in outcomes})
    minutes = sum(outcome.duration_s for outcome in outcomes) / 60
    failed = sum(outcome.error is not None for outcome in outcomes)
    ended = f"; {failed} ended with an unrecoverable error" if failed else ""
    return f"{len(outcomes)} runs of seeds {seeds[0]} to {seeds[-1]}, {minutes:.0f} simulated minutes together{ended}."
