"""The results of the managers, with confidence intervals of the differences between managers over the same seeds."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass

from codra_papers.experiments.campaign.statistics import (
    Estimate,
    Share,
    mean_interval,
    quantile_interval,
    ratio_interval,
)
from codra_papers.experiments.studies.store_managers.trial import StoreOutcome
from codra_papers.experiments.studies.store_managers.watching import Cause

QUANTILES = (0.5, 0.99)


@dataclass(frozen=True, slots=True, kw_only=True)
class Measure:
    """A number that is computed for each run.

    Attributes:
        name: the name in tables.
        key: the key in data.
        value_of: a function that returns the number for the outcome of a run.
        is_more_better: whether a larger number is better; None if neither larger nor smaller numbers are better.
    """

    name: str
    key: str
    value_of: Callable[[StoreOutcome], float]
    is_more_better: bool | None


def _per_hour(
    name: str, key: str, count_of: Callable[[StoreOutcome], float], *, is_more_better: bool | None
) -> Measure:
    return Measure(
        name=name, key=f"{key}_per_h", value_of=lambda run: run.per_hour(count_of(run)), is_more_better=is_more_better
    )


MEASURES = (
    _per_hour("Missions completed", "missions", lambda run: run.loops, is_more_better=True),
    _per_hour("Orders done", "orders_done", lambda run: run.orders.get("done", 0), is_more_better=True),
    _per_hour("Orders failed", "orders_failed", lambda run: run.orders.get("failed", 0), is_more_better=False),
    _per_hour("Unsafe seconds", "unsafe_s", lambda run: run.unsafe_s, is_more_better=False),
    _per_hour("Minutes with an empty battery", "battery_empty_min", lambda run: run.empty_min, is_more_better=False),
    _per_hour("Aborted pick-ups", "aborts", lambda run: run.aborts, is_more_better=False),
    _per_hour("Bumps", "bumps", lambda run: run.bumps, is_more_better=False),
    _per_hour("Changes of the course", "switches", lambda run: run.switches, is_more_better=None),
)
"""All measures are rates per hour, because shifts have different durations."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasureComparison:
    """A measure of a manager, compared with other managers.

    Attributes:
        mean: the mean over seeds.
        differences: for each other manager, the mean of this manager's value minus the other's over the same seeds.
    """

    measure: Measure
    manager: str
    mean: Estimate
    differences: Mapping[str, Estimate]


@dataclass(frozen=True, slots=True, kw_only=True)
class Reactions:
    """How soon a manager reacted.

    Attributes:
        cause: the kind of cause; None for all kinds.
        count: the number of causes.
        answered: how many of the causes were answered.
        share: the share of answered causes.
        quantiles_s: for each of `QUANTILES`, the time from a cause to its answer. The time is infinite if the cause was
            never answered. If no cause occurred, the estimate has no value.
    """

    manager: str
    cause: Cause | None
    count: int
    answered: int
    share: Estimate
    quantiles_s: Mapping[float, Estimate]


def compare_managers(runs: Mapping[str, Sequence[StoreOutcome]]) -> Sequence[MeasureComparison]:
    """Return all measures of all managers.

    Args:
        runs: the runs of each manager, all with the same seeds in the same order.
    """
    return [_compare_measure(measure, name, runs) for measure in MEASURES for name in runs]


def _compare_measure(measure: Measure, name: str, runs: Mapping[str, Sequence[StoreOutcome]]) -> MeasureComparison:
    values = {manager: [measure.value_of(run) for run in manager_runs] for manager, manager_runs in runs.items()}
    own_values = values[name]
    return MeasureComparison(
        measure=measure,
        manager=name,
        mean=mean_interval(own_values),
        differences={
            other: mean_interval(
                [value - other_value for value, other_value in zip(own_values, other_values, strict=True)]
            )
            for other, other_values in values.items()
            if other != name
        },
    )


def reactions(runs: Mapping[str, Sequence[StoreOutcome]]) -> Sequence[Reactions]:
    """Return how soon each manager answered all causes, and each kind of cause."""
    return [_reactions(name, cause, runs[name]) for cause in (None, *Cause) for name in runs]


def _reactions(name: str, cause: Cause | None, runs: Sequence[StoreOutcome]) -> Reactions:
    calls_by_seed = [[call for call in run.called if cause in (None, call.cause)] for run in runs]
    reactions_s = [
        [math.inf if call.reaction_s is None else call.reaction_s for call in seed_calls]
        for seed_calls in calls_by_seed
    ]
    shares = [Share(sum(map(math.isfinite, durations_s)), len(durations_s)) for durations_s in reactions_s]
    return Reactions(
        manager=name,
        cause=cause,
        count=sum(map(len, reactions_s)),
        answered=int(sum(share.part for share in shares)),
        share=ratio_interval(shares),
        quantiles_s={quantile: quantile_interval(reactions_s, quantile) for quantile in QUANTILES},
    )
