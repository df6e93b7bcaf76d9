"""What the managers came to, seed by seed, and how sure a difference to ours is."""

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
        name: as people read it.
        key: as data has it.
        of: takes it from what came of a run.
    """

    name: str
    key: str
    of: Callable[[StoreOutcome], float]


MEASURES = (
    Measure(name="Missions completed", key="missions", of=lambda each: each.loops),
    Measure(name="Unsafe seconds", key="unsafe_s", of=lambda each: each.unsafe_s),
    Measure(name="Aborts", key="aborts", of=lambda each: each.aborts),
    Measure(
        name="Switches per minute",
        key="switches_per_min",
        of=lambda each: each.switches / each.duration_s * 60.0,
    ),
    Measure(name="Orders done", key="orders_done", of=lambda each: each.orders.get("done", 0)),
    Measure(name="Orders failed", key="orders_failed", of=lambda each: each.orders.get("failed", 0)),
    Measure(name="Bumps", key="bumps", of=lambda each: each.bumps),
)
"""The first four are those of the question; the others stand beside."""


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
    """How soon a manager answered.

    Attributes:
        cause: None for all of them.
        count: of causes, of which `answered` were answered.
        share: that was answered.
        quantiles_s: by `QUANTILES`; infinite for never, no value if nothing called.
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
        ours: the manager that the others are compared with.
    """
    return [_compared(measure, name, runs, ours) for measure in MEASURES for name in runs]


def _compared(measure: Measure, name: str, runs: Mapping[str, Sequence[StoreOutcome]], ours: str) -> Compared:
    values = [measure.of(each) for each in runs[name]]
    of_ours = [measure.of(each) for each in runs[ours]]
    less = [value - other for value, other in zip(values, of_ours, strict=True)]
    return Compared(
        measure=measure,
        manager=name,
        mean=mean_interval(values),
        difference=None if name == ours else mean_interval(less),
    )


def reactions(runs: Mapping[str, Sequence[StoreOutcome]]) -> Sequence[Reactions]:
    """Return how soon each manager answered all causes, and each kind of them."""
    return [_reactions(name, cause, runs[name]) for cause in (None, *Cause) for name in runs]


def _reactions(name: str, cause: Cause | None, came: Sequence[StoreOutcome]) -> Reactions:
    by_seed = [[each for each in run.called if cause in (None, each.cause)] for run in came]
    took_s = [[math.inf if each.reaction_s is None else each.reaction_s for each in called] for called in by_seed]
    shares = [Share(sum(map(math.isfinite, found)), len(found)) for found in took_s]
    return Reactions(
        manager=name,
        cause=cause,
        count=sum(map(len, took_s)),
        answered=int(sum(share.part for share in shares)),
        share=ratio_interval(shares),
        quantiles_s={quantile: quantile_interval(took_s, quantile) for quantile in QUANTILES},
    )
