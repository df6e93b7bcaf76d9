"""The numbers of an experiment with several arms on the same frames, over its runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from codra_papers.experiments.campaign.statistics import (
    Estimate,
    Share,
    ratio_difference,
    ratio_interval,
    ratio_of_sums,
)
from codra_papers.experiments.lab.metrics import (
    Answers,
    Causes,
    Lags,
    Seconds,
    SecondsByTruth,
    answers,
    by_truth_in_window,
    causes,
    causes_in_window,
    in_window,
    lags,
    seconds,
    total,
    total_by_truth,
    window,
)
from codra_papers.experiments.lab.outcomes import Outcome

LIDS = ("centrifuge_open", "pcr_cycler_open")
"""The variables of P1's Table 2."""

VARIABLES = (
    "centrifuge_in_observable_distance",
    "centrifuge_in_manipulation_distance",
    "centrifuge_base_in_FOV",
    "centrifuge_lid_in_FOV",
    "centrifuge_open",
    "centrifuge_locked",
    "centrifuge_rotor_in_pos_1",
    "centrifuge_rotor_in_pos_2",
    "pcr_cycler_in_observable_distance",
    "pcr_cycler_in_manipulation_distance",
    "pcr_cycler_base_in_FOV",
    "pcr_cycler_lid_in_FOV",
    "pcr_cycler_open",
    "pcr_cycler_locked",
)
"""The variables of P1's Table 1."""

PCR_CYCLER_LID_ALGORITHMS = ("localize_pcr_cycler_lid",)
"""The algorithm whose triggers P1 counts (section 4.1)."""

ShareFunction = Callable[[Seconds], Share]
"""A function that returns one of the two shares of seconds: `paper_share` or `strict_share`."""


def paper_share(arm_seconds: Seconds) -> Share:
    """Return the seconds with a right value as a share of the seconds with any value."""
    return arm_seconds.paper_share


def strict_share(arm_seconds: Seconds) -> Share:
    """Return the seconds with a right value as a share of all seconds."""
    return arm_seconds.strict_share


MEASURES: Mapping[str, Callable[[SecondsByTruth], float | None]] = MappingProxyType(
    {
        "ratio": lambda by_truth: ratio_of_sums([by_truth.all.paper_share]),
        "balanced ratio": lambda by_truth: by_truth.balanced_ratio,
        "strict ratio": lambda by_truth: ratio_of_sums([by_truth.all.strict_share]),
        "strict balanced ratio": lambda by_truth: by_truth.strict_balanced_ratio,
        "constant answer": lambda by_truth: ratio_of_sums([by_truth.constant_share]),
    }
)
"""The two ratios of right values, each with its balanced counterpart, and the ratio of the better constant answer."""

MEASURES_NOTE = (
    "Balanced: the mean of the ratio while the variable is true and the ratio while it is false, which is 0.5 for any "
    "constant answer. Constant: the ratio of an observer that always gives the more frequent true value."
)

LATE_NOTE = "Late: the value was true at the instant of its evidence, and the truth has changed since."


def label(variable: str) -> str:
    """Return a variable's name as spelt in P1."""
    return variable.replace("pcr_cycler", "PCR-cycler")


@dataclass(frozen=True, slots=True)
class Runs:
    """Outcomes of several runs with the same arms."""

    outcomes: Sequence[Outcome]

    @property
    def arms(self) -> tuple[str, ...]:
        """Return the names of the arms, in the order of the trials."""
        return tuple(self.outcomes[0].arms) if self.outcomes else ()

    def by_truth(self, variable: str, arm: str) -> Sequence[SecondsByTruth | None]:
        """Return, for each run, an arm's seconds in the common window; None if the arm is left out of the window."""
        return [by_truth_in_window(outcome, variable, arm) for outcome in self.outcomes]

    def total_by_truth(self, variable: str, arm: str) -> SecondsByTruth:
        """Return the sum of an arm's seconds in the common windows, divided by the true value."""
        return total_by_truth(self.outcomes, variable, arm)

    def seconds(self, variable: str, arm: str) -> Sequence[Seconds | None]:
        """Return the same as `by_truth`, without regard to the true value."""
        return [in_window(outcome, variable, arm) for outcome in self.outcomes]

    def total(self, variable: str, arm: str) -> Seconds:
        """Return the sum of an arm's seconds in the common windows."""
        return total(self.seconds(variable, arm))

    def causes_in_windows(self, variable: str, arm: str) -> Causes:
        """Return, for each cause, how long the values of an arm were wrong in the common windows."""
        return sum((causes_in_window(outcome, variable, arm) for outcome in self.outcomes), Causes())

    def whole_run_seconds(self, variable: str, arm: str) -> Seconds:
        """Return an arm's seconds over complete runs, without regard to windows."""
        return total(seconds(outcome.arms[arm].held[variable], outcome.truth[variable]) for outcome in self.outcomes)

    def left_out(self, variable: str, arm: str) -> int:
        """Return in how many runs an arm never identified a variable."""
        return sum(arm in window(outcome, variable).left_out for outcome in self.outcomes)

    def first_s(self, variable: str, arm: str) -> Sequence[float]:
        """Return when an arm first identified a variable. Runs in which the arm never identified it are left out."""
        first_s_by_run = (outcome.arms[arm].first_s[variable] for outcome in self.outcomes)
        return [first_s for first_s in first_s_by_run if first_s is not None]

    def lags(self, variable: str, arm: str) -> Lags:
        """Return an arm's lags after all changes of a variable."""
        lags_by_run = (lags(outcome.arms[arm].held[variable], outcome.truth[variable]) for outcome in self.outcomes)
        return sum(lags_by_run, Lags())

    def causes(self, variables: Sequence[str], arm: str) -> Causes:
        """Return, for each cause, how long the values of an arm were wrong."""
        return causes(span for outcome in self.outcomes for name in variables for span in outcome.arms[arm].wrong[name])

    def answers(self, variables: Sequence[str], arm: str, *, previews: bool) -> Answers:
        """Return how often an arm held right, wrong and unknown values at previews, or at decisions after an action."""
        decisions = (decision for outcome in self.outcomes for decision in outcome.decisions)
        return answers(
            [decision for decision in decisions if decision.variable in variables and decision.is_preview == previews],
            arm,
        )

    def triggers(self, arm: str, algorithms: Sequence[str]) -> Sequence[int]:
        """Return, for each run, how many jobs of some algorithms an arm started."""
        return [sum(outcome.arms[arm].triggers.get(name, 0) for name in algorithms) for outcome in self.outcomes]

    def observable_share(self, arm: str, algorithm: str) -> Share:
        """Return the share of an algorithm's jobs that were started while the preconditions of the spec were true."""
        arms = [outcome.arms[arm] for outcome in self.outcomes]
        is_counted = any(algorithm in arm_outcome.observable_triggers for arm_outcome in arms)
        return Share(
            float(sum(arm_outcome.observable_triggers.get(algorithm, 0) for arm_outcome in arms)),
            float(sum(self.triggers(arm, (algorithm,)))) if is_counted else 0.0,
        )

    def slot_s(self, arm: str) -> float:
        """Return how long an arm's observers held slots."""
        return math.fsum(outcome.arms[arm].slot_s for outcome in self.outcomes)

    @property
    def duration_s(self) -> float:
        """Return the duration of all runs together."""
        return math.fsum(outcome.duration_s for outcome in self.outcomes)


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """How much better one arm knew a variable than another arm.

    Attributes:
        runs: the number of runs in which neither arm was left out of the window.
        paper_difference: the ratio of sums of `arm` over these runs, minus that of `other_arm`.
        strict_difference: the same for the strict ratio.
    """

    variable: str
    arm: str
    other_arm: str
    runs: int
    paper_difference: Estimate
    strict_difference: Estimate


def compare(runs: Runs, variable: str, arm: str, other_arm: str) -> Comparison:
    """Return the difference between two arms for a variable."""
    all_pairs = zip(runs.seconds(variable, arm), runs.seconds(variable, other_arm), strict=True)
    pairs = [(left, right) for left, right in all_pairs if left is not None and right is not None]
    return Comparison(
        variable=variable,
        arm=arm,
        other_arm=other_arm,
        runs=len(pairs),
        paper_difference=_difference(pairs, paper_share),
        strict_difference=_difference(pairs, strict_share),
    )


def _difference(pairs: Sequence[tuple[Seconds, Seconds]], share_of: ShareFunction) -> Estimate:
    return ratio_difference([share_of(left) for left, _ in pairs], [share_of(right) for _, right in pairs])


def fewer_triggers(runs: Runs, arm: str, other_arm: str, algorithms: Sequence[str]) -> Estimate:
    """Return the share of another arm's triggers that an arm saves (P1, section 4.1: 79.4 %), with its interval."""
    counts = zip(runs.triggers(arm, algorithms), runs.triggers(other_arm, algorithms), strict=True)
    return ratio_interval(
        [Share(float(other_count - own_count), float(other_count)) for own_count, other_count in counts]
    )


def estimate_as_data(estimate: Estimate) -> Mapping[str, float | None]:
    """Return an estimate as plain data."""
    return {"value": estimate.value, "low": estimate.low, "high": estimate.high}


def measures_as_data(by_truth: SecondsByTruth) -> Mapping[str, float | None]:
    """Return `MEASURES` of some seconds as plain data."""
    keys = {"ratio": "paper_ratio", "constant answer": "constant_answer_ratio"}
    return {keys.get(name, name.replace(" ", "_")): measure(by_truth) for name, measure in MEASURES.items()}
