"""The searches. Each cell of a grid is run on the tuning seeds, and scored as the protocol states."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from statistics import fmean

from codra_papers.experiments.campaign.experiment import Settings
from codra_papers.experiments.campaign.seeds import reported_seeds
from codra_papers.experiments.studies.store_managers.loop_parameters import LoopParameters
from codra_papers.experiments.studies.store_managers.managers import OURS_TUNED, THRESHOLD, Manager, ModelEdit
from codra_papers.experiments.studies.store_managers.thresholds import Thresholds
from codra_papers.experiments.studies.store_managers.trial import StoreOutcome, StoreTrial

TUNING_SEEDS = (1, 2, 3)

GRIDS: Mapping[str, Sequence[ModelEdit]] = {
    THRESHOLD: tuple(
        Thresholds(distance_m=distance_m, battery_percent=battery_percent, load=load)
        for distance_m, battery_percent, load in itertools.product((1.0, 1.5), (15.0, 25.0), ("full", "loading"))
    ),
    OURS_TUNED: tuple(
        LoopParameters(crowding_shift=crowding_shift, battery_shift_percent=battery_shift_percent, hold_s=hold_s)
        for crowding_shift, battery_shift_percent, hold_s in itertools.product((0.0, 0.2), (0.0, -5.0), (3.0, 6.0))
    ),
}
"""The cells of each search. Both searches have the same number of cells; the first cell of `ours tuned` is the spec."""

UNSAFE_SECOND_COST = 0.1
"""The cost of an unsafe second, in missions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Design:
    """The runs of an experiment.

    Attributes:
        grids: the cells of the search of each tuned manager; of several cells with the best score, the first is chosen.
        tuning_seeds: the seeds on which the cells are run.
        first_seed: the first reported seed.
        duration_s: the duration of each run; None for the durations of the seeds' shifts.
    """

    grids: Mapping[str, Sequence[ModelEdit]] = field(default_factory=lambda: GRIDS)
    tuning_seeds: Sequence[int] = TUNING_SEEDS
    first_seed: int = reported_seeds("store", 1)[0]
    duration_s: float | None = None

    def trial(self, settings: Settings, name: str, seed: int, manager: Manager) -> StoreTrial:
        """Return the run of a manager with a seed."""
        return StoreTrial(
            name=f"{name} {seed}", spec=settings.spec, seed=seed, manager=manager, duration_s=self.duration_s
        )


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """The result of a cell of a grid, as means over seeds."""

    edit: ModelEdit
    missions_per_h: float
    unsafe_s_per_h: float

    @property
    def score(self) -> float:
        """Return the score by which cells are compared."""
        return self.missions_per_h - UNSAFE_SECOND_COST * self.unsafe_s_per_h


def search_trials(design: Design, settings: Settings) -> Sequence[StoreTrial]:
    """Return the runs of all grids."""
    return [
        design.trial(settings, _cell_name(manager, edit), seed, Manager(name=manager, edits=(edit,)))
        for manager, grid in design.grids.items()
        for edit in grid
        for seed in design.tuning_seeds
    ]


def cells(design: Design, manager: str, outcomes: Mapping[str, StoreOutcome]) -> Sequence[Cell]:
    """Return the results of all cells of a manager, in the order of the grid."""
    return [
        _cell(edit, [outcomes[f"{_cell_name(manager, edit)} {seed}"] for seed in design.tuning_seeds])
        for edit in design.grids[manager]
    ]


def best_cell(search_cells: Sequence[Cell]) -> Cell:
    """Return the cell with the highest score. If several cells have this score, return the first of them."""
    return max(search_cells, key=lambda cell: round(cell.score, 9))


def _cell(edit: ModelEdit, outcomes: Sequence[StoreOutcome]) -> Cell:
    return Cell(
        edit=edit,
        missions_per_h=fmean(outcome.per_hour(outcome.loops) for outcome in outcomes),
        unsafe_s_per_h=fmean(outcome.per_hour(outcome.unsafe_s) for outcome in outcomes),
    )


def _cell_name(manager: str, edit: ModelEdit) -> str:
    return f"{manager}, {edit},"
