"""The results of the managers, seed by seed, with confidence intervals of the differences to ours."""

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
    """A number of each run.

    Attributes:
        name: as shown in tables.
        key: as used in data.
        of: computes it from the outcome of a run.
    """

    name: str
    key: str
    of: Callable[[StoreOutcome], float]


MEASURES = (
    Measure(name="Missions completed", key="missions", of=lambda run: run.loops),
    Measure(name="Unsafe seconds", key="unsafe_s", of=lambda run: run.unsafe_s),
    Measure(name="Aborts", key="aborts", of=lambda run: run.aborts),
    Measure(
        name="Switches per minute",
        key="switches_per_min",
        of=lambda run: run.switches / run.duration_s * 60.0,
    ),
    Measure(name="Orders done", key="orders_done", of=lambda run: run.orders.get("done", 0)),
    Measure(name="Orders failed", key="orders_failed", of=lambda run: run.orders.get("failed", 0)),
    Measure(name="Bumps", key="bumps", of=lambda run: run.bumps),
)
"""The first four answer the question of the experiment; the others are additional."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """A measure of a manager.

    Attributes:
        mean: over seeds.
        difference: to ours, over the same seeds; None for ours.
    """

    measure: Measure
    manager: str
    mean: Estimate
    difference: Estimate | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Reactions:
    """How soon a manager reacted.

    Attributes:
        cause: None for all causes.
        count: the number of causes; `answered` of them were answered.
        share: of answered causes.
        quantiles_s: by `QUANTILES`; infinite for never, without a value if no cause occurred.
    """

    manager: str
    cause: Cause | None
    count: int
    answered: int
    share: Estimate
    quantiles_s: Mapping[float, Estimate]


def compared(runs: Mapping[str, Sequence[StoreOutcome]], ours: str) -> Sequence[Compared]:
    """Return all measures of all managers.

    Args:
        runs: by manager, all with the same seeds in the same order.
        ours: the manager with which the others are compared.
    """
    return [_compared(measure, name, runs, ours) for measure in MEASURES for name in runs]


def _compared(measure: Measure, name: str, runs: Mapping[str, Sequence[StoreOutcome]], ours: str) -> Compared:
    values = [measure.of(run) for run in runs[name]]
    of_ours = [measure.of(run) for run in runs[ours]]
    less = [value - other for value, other in zip(values, of_ours, strict=True)]
    return Compared(
        measure=measure,
        manager=name,
        mean=mean_interval(values),
        difference=None if name == ours else mean_interval(less),
    )


def reactions(runs: Mapping[str, Sequence[StoreOutcome]]) -> Sequence[Reactions]:
    """Return how soon each manager answered all causes, and each kind of cause."""
    return [_reactions(name, cause, runs[name]) for cause in (None, *Cause) for name in runs]


def _reactions(name: str, cause: Cause | None, runs: Sequence[StoreOutcome]) -> Reactions:
    by_seed = [[call for call in run.called if cause in (None, call.cause)] for run in runs]
    took_s = [[math.inf if call.reaction_s is None else call.reaction_s for call in called] for called in by_seed]
    shares = [Share(sum(map(math.isfinite, durations_s)), len(durations_s)) for durations_s in took_s]
    return Reactions(
        manager=name,
        cause=cause,
        count=sum(map(len, took_s)),
        answered=int(sum(share.part for share in shares)),
        share=ratio_interval(shares),
        quantiles_s={quantile: quantile_interval(took_s, quantile) for quantile in QUANTILES},
    )
