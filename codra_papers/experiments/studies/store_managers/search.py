"""The search for thresholds. Each cell of a grid is run on the tuning seeds, and scored as the protocol states."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from statistics import fmean

from codra_papers.experiments.campaign.experiment import Settings
from codra_papers.experiments.studies.store_managers.managers import ThresholdManager
from codra_papers.experiments.studies.store_managers.thresholds import Thresholds
from codra_papers.experiments.studies.store_managers.trial import RUN_DURATION_S, StoreOutcome, StoreTrial

TUNING_SEEDS = (1, 2, 3, 4, 5)
FIRST_SEED = 301
"""The first reported seed. The results for seeds 101 to 120 and 201 to 220 are known: they were reported before the
truck, and later the spec, was changed."""

GRID = tuple(
    Thresholds(distance_m=distance_m, battery_percent=battery_percent, load=load)
    for distance_m, battery_percent, load in itertools.product((1.0, 1.5, 2.0), (15.0, 25.0), ("loading", "full"))
)

UNSAFE_SECOND_COST = 0.1
"""The cost of an unsafe second, in missions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """The runs of an experiment.

    Attributes:
        grid: the cells of the search; of several cells with the best score, the first is chosen.
        tuning_seeds: the seeds on which the cells are run.
        first_seed: the first reported seed.
        duration_s: the duration of each run.
    """

    grid: tuple[Thresholds, ...] = GRID
    tuning_seeds: tuple[int, ...] = TUNING_SEEDS
    first_seed: int = FIRST_SEED
    duration_s: float = RUN_DURATION_S


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """The result of a cell of the grid, as means over seeds."""

    thresholds: Thresholds
    missions: float
    unsafe_s: float

    @property
    def score(self) -> float:
        """Return the score by which cells are compared."""
        return self.missions - UNSAFE_SECOND_COST * self.unsafe_s


def search_trials(design: Design, settings: Settings) -> Sequence[StoreTrial]:
    """Return the runs of the grid."""
    return [
        StoreTrial(
            name=_name(cell, seed),
            spec=settings.spec,
            seed=seed,
            manager=ThresholdManager(cell),
            duration_s=design.duration_s,
        )
        for cell in design.grid
        for seed in design.tuning_seeds
    ]


def cells(design: Design, outcomes: Mapping[str, StoreOutcome]) -> Sequence[Cell]:
    """Return the results of all cells, in the order of the grid."""
    return [
        _cell(thresholds, [outcomes[_name(thresholds, seed)] for seed in design.tuning_seeds])
        for thresholds in design.grid
    ]


def best_cell(search_cells: Sequence[Cell]) -> Cell:
    """Return the cell with the highest score. If several cells have this score, return the first of them."""
    return max(search_cells, key=lambda cell: round(cell.score, 9))


def _cell(thresholds: Thresholds, outcomes: Sequence[StoreOutcome]) -> Cell:
    return Cell(
        thresholds=thresholds,
        missions=fmean(outcome.loops for outcome in outcomes),
        unsafe_s=fmean(outcome.unsafe_s for outcome in outcomes),
    )


def _name(cell: Thresholds, seed: int) -> str:
    return f"grid-{cell.distance_m:g}m-{cell.battery_percent:g}percent-{cell.load}-{seed}"
