"""The results of the managers, with confidence intervals of the differences to our manager over the same seeds."""

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
    """

    name: str
    key: str
    value_of: Callable[[StoreOutcome], float]


MEASURES = (
    Measure(name="Missions completed", key="missions", value_of=lambda run: run.loops),
    Measure(name="Unsafe seconds", key="unsafe_s", value_of=lambda run: run.unsafe_s),
    Measure(name="Aborts", key="aborts", value_of=lambda run: run.aborts),
    Measure(
        name="Switches per minute",
        key="switches_per_min",
        value_of=lambda run: run.switches / run.duration_s * 60.0,
    ),
    Measure(name="Orders done", key="orders_done", value_of=lambda run: run.orders.get("done", 0)),
    Measure(name="Orders failed", key="orders_failed", value_of=lambda run: run.orders.get("failed", 0)),
    Measure(name="Bumps", key="bumps", value_of=lambda run: run.bumps),
)
"""The first four measures answer the question of the experiment; the others are additional."""


@dataclass(frozen=True, slots=True, kw_only=True)
class MeasureComparison:
    """A measure of a manager, compared with our manager.

    Attributes:
        mean: the mean over seeds.
        difference: the mean difference to our manager, over the same seeds; None for our manager.
    """

    measure: Measure
    manager: str
    mean: Estimate
    difference: Estimate | None


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


def compare_managers(runs: Mapping[str, Sequence[StoreOutcome]], ours: str) -> Sequence[MeasureComparison]:
    """Return all measures of all managers.

    Args:
        runs: the runs of each manager, all with the same seeds in the same order.
        ours: the name of our manager, with which the other managers are compared.
    """
    return [_compare_measure(measure, name, runs, ours) for measure in MEASURES for name in runs]


def _compare_measure(
    measure: Measure, name: str, runs: Mapping[str, Sequence[StoreOutcome]], ours: str
) -> MeasureComparison:
    values = [measure.value_of(run) for run in runs[name]]
    our_values = [measure.value_of(run) for run in runs[ours]]
    differences = [value - our_value for value, our_value in zip(values, our_values, strict=True)]
    return MeasureComparison(
        measure=measure,
        manager=name,
        mean=mean_interval(values),
        difference=None if name == ours else mean_interval(differences),
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
