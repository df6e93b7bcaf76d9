"""The report on the trials: the table, the reactions, the grid and the pictures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

from codra_papers.experiments.campaign.cells import estimate_text, interval, percent, plain_table, rounded
from codra_papers.experiments.campaign.document import Document, Section, Table, Words
from codra_papers.experiments.campaign.experiment import Settings
from codra_papers.experiments.campaign.statistics import Estimate
from codra_papers.experiments.studies.store_managers.comparing import (
    MEASURES,
    QUANTILES,
    Measure,
    MeasureComparison,
    Reactions,
    compare_managers,
    reactions,
)
from codra_papers.experiments.studies.store_managers.drawing import draw_by_seed, draw_over_time
from codra_papers.experiments.studies.store_managers.managers import (
    LoopsManager,
    Manager,
    NominalManager,
    RandomManager,
    ThresholdManager,
)
from codra_papers.experiments.studies.store_managers.search import Cell, Design, best_cell, cells
from codra_papers.experiments.studies.store_managers.trial import StoreOutcome, StoreTrial

OURS = LoopsManager().name
NEVER = "never"

_NOTE = (
    "Runs of {:.0f} s. The actions of people and the orders are drawn from the seed before a run begins. All numbers "
    "are computed from the state of the world. docs/papers/store-experiment.md has all definitions. Means are over "
    "seeds. Each difference compares a manager with the manager 'ours' over the same seeds; its 95 % interval is "
    "computed by the bootstrap. The intervals of marked differences do not contain zero."
)


def reported_seeds(design: Design, settings: Settings) -> range:
    """Return the seeds of the report."""
    return range(design.first_seed, design.first_seed + settings.seeds)


def managers(design: Design, outcomes: Mapping[str, StoreOutcome]) -> tuple[Manager, ...]:
    """Return the compared managers. The manager with thresholds uses the result of the search."""
    return (
        NominalManager(),
        RandomManager(),
        ThresholdManager(best_cell(cells(design, outcomes)).thresholds),
        LoopsManager(),
    )


def reported_trials(design: Design, settings: Settings, outcomes: Mapping[str, StoreOutcome]) -> Sequence[StoreTrial]:
    """Return the runs of all managers. The manager with thresholds uses the result of the search."""
    return [
        StoreTrial(
            name=_name(manager.name, seed),
            spec=settings.spec,
            seed=seed,
            manager=manager,
            duration_s=design.duration_s,
        )
        for seed in reported_seeds(design, settings)
        for manager in managers(design, outcomes)
    ]


def _name(manager: str, seed: int) -> str:
    return f"{manager}-{seed}"


def judge(design: Design, settings: Settings, outcomes: Mapping[str, StoreOutcome]) -> Document:
    """Return the report on the outcomes of the search and of `reported_trials`."""
    search_cells, seeds = cells(design, outcomes), reported_seeds(design, settings)
    runs = {
        manager.name: [outcomes[_name(manager.name, seed)] for seed in seeds]
        for manager in managers(design, outcomes)
        if len(seeds)
    }
    if not runs:
        return _search_document(design, search_cells)
    table, reaction_rows = compare_managers(runs, OURS), reactions(runs)
    first_runs = {name: manager_runs[0] for name, manager_runs in runs.items()}
    return Document(
        title="store: the value of the loops",
        summary=(*_summary(table, reaction_rows), f"{len(seeds)} seeds, {seeds[0]} to {seeds[-1]}."),
        sections=(
            Section(
                title="Managers",
                parts=(Words(text=_NOTE.format(design.duration_s)), _means(table), _differences(table)),
            ),
            Section(title="From cause to switch", parts=(_reactions_table(reaction_rows),)),
            Section(title="Unsafe seconds", parts=(draw_by_seed(runs),)),
            Section(title="One seed", parts=(draw_over_time(first_runs),)),
            Section(title="The search for thresholds", parts=(_grid(design, search_cells),)),
        ),
        results={
            "managers": _comparisons_as_data(table),
            "reactions": [_reactions_as_data(manager_reactions) for manager_reactions in reaction_rows],
            "grid": [_cell_as_data(cell) for cell in search_cells],
            "thresholds": _cell_as_data(best_cell(search_cells)),
            "by_seed": _by_seed(runs),
        },
    )


def _search_document(design: Design, search_cells: Sequence[Cell]) -> Document:
    return Document(
        title="store: the search for thresholds",
        summary=("No seed is reported.",),
        sections=(Section(title="The search for thresholds", parts=(_grid(design, search_cells),)),),
        results={"grid": [_cell_as_data(cell) for cell in search_cells]},
    )


# Words and tables


def _summary(table: Sequence[MeasureComparison], reaction_rows: Sequence[Reactions]) -> Iterator[str]:
    """Yield a sentence for each of the four measures that answer the question of the experiment, and one on reactions.

    The same sentences are written whatever the results are.
    """
    for measure in MEASURES[:4]:
        manager_rows = _measure_rows(table, measure)
        means = ", ".join(f"{row.manager} {_number_text(row.mean.value, 2)}" for row in manager_rows)
        sure_rows = [row for row in manager_rows if row.difference is not None and _is_sure(row.difference)]
        differences_text = ", ".join(
            f"{row.manager} {interval(row.difference, 2)}" for row in sure_rows if row.difference
        )
        sure_text = f"differences to ours with an interval that does not contain zero: {differences_text or 'none'}"
        yield f"{measure.name} of a run: {means}; {sure_text}."
    all_cause_rows = [row for row in reaction_rows if row.cause is None]
    reactions_text = ", ".join(
        f"{row.manager} {' and '.join(_seconds_text(row.quantiles_s[q].value) for q in QUANTILES)} "
        f"({row.answered} of {row.count} answered)"
        for row in all_cause_rows
    )
    yield f"From cause to switch, median and 99th percentile: {reactions_text}."


def _is_sure(difference: Estimate) -> bool:
    return difference.is_positive or difference.is_negative


def _means(table: Sequence[MeasureComparison]) -> Table:
    rows = [
        (measure.name, *(estimate_text(row.mean, "{:.2f}".format, "-") for row in _measure_rows(table, measure)))
        for measure in MEASURES
    ]
    header = ("Of a run", *dict.fromkeys(row.manager for row in table))
    return plain_table("Means over seeds, with their intervals.", header, rows)


def _differences(table: Sequence[MeasureComparison]) -> Table:
    differences = {
        measure.name: {
            row.manager: row.difference for row in _measure_rows(table, measure) if row.difference is not None
        }
        for measure in MEASURES
    }
    marked = frozenset(
        (row, column)
        for row, manager_differences in enumerate(differences.values())
        for column, difference in enumerate(manager_differences.values(), 1)
        if _is_sure(difference)
    )
    return Table(
        caption="The manager's value minus the value of 'ours', as the mean over seeds. If a difference is above zero, "
        "the manager's value is larger.",
        header=("Of a run", *next(iter(differences.values()))),
        rows=[
            (name, *(interval(difference, 2) for difference in manager_differences.values()))
            for name, manager_differences in differences.items()
        ],
        marked=marked,
    )


def _measure_rows(table: Sequence[MeasureComparison], measure: Measure) -> Sequence[MeasureComparison]:
    """Return the rows of a measure for all managers."""
    return [row for row in table if row.measure is measure]


def _reactions_table(reaction_rows: Sequence[Reactions]) -> Table:
    header = ("Cause", "Manager", "Causes", "Answered", "Answered, %", *(f"p{100 * q:.0f} in s" for q in QUANTILES))
    rows = [
        (
            "all" if row.cause is None else row.cause.value,
            row.manager,
            row.count,
            row.answered,
            percent(row.share),
            *(estimate_text(row.quantiles_s[q], _quantile_text, "-") for q in QUANTILES),
        )
        for row in reaction_rows
    ]
    caption = (
        "The time from the beginning of a cause in the world until the course is one of those that answer this cause. "
        "The time of an unanswered cause is treated as longer than any other time. The number of causes depends on the "
        "actions of the robot."
    )
    return plain_table(caption, header, rows)


def _grid(design: Design, search_cells: Sequence[Cell]) -> Table:
    chosen_cell = best_cell(search_cells)
    rows = [
        (
            f"{cell.thresholds.distance_m:g}",
            f"{cell.thresholds.battery_percent:g}",
            cell.thresholds.load,
            f"{cell.missions:.2f}",
            f"{cell.unsafe_s:.2f}",
            f"{cell.score:.3f}",
            "chosen" if cell is chosen_cell else "",
        )
        for cell in search_cells
    ]
    header = ("Person, m", "Battery, %", "Load", "Missions", "Unsafe s", "Score", "")
    seeds = ", ".join(map(str, design.tuning_seeds))
    caption = (
        f"The means of each cell of the grid over the seeds {seeds}. "
        "The score is the number of missions minus a tenth of the unsafe seconds."
    )
    return plain_table(caption, header, rows)


def _quantile_text(value: float) -> str:
    return f"{value:.1f}" if math.isfinite(value) else NEVER


def _seconds_text(value: float | None) -> str:
    if value is None:
        return "nothing"
    return f"{value:.1f} s" if math.isfinite(value) else NEVER


def _number_text(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


# Data


def _comparisons_as_data(table: Sequence[MeasureComparison]) -> Mapping[str, Any]:
    return {
        name: {
            row.measure.key: {"mean": _as_data(row.mean), "difference_to_ours": _as_data(row.difference)}
            for row in rows
        }
        for name, rows in groupby(sorted(table, key=lambda row: row.manager), lambda row: row.manager)
    }


def _reactions_as_data(row: Reactions) -> Mapping[str, Any]:
    return {
        "manager": row.manager,
        "cause": "all" if row.cause is None else row.cause.value,
        "causes": row.count,
        "answered": row.answered,
        "share": _as_data(row.share),
        **{f"p{100 * quantile:.0f}_s": _as_data(quantile_s) for quantile, quantile_s in row.quantiles_s.items()},
    }


def _as_data(estimate: Estimate | None) -> Mapping[str, float | str | None] | None:
    if estimate is None:
        return None
    ends = {"value": estimate.value, "low": estimate.low, "high": estimate.high}
    return {key: NEVER if end == math.inf else rounded(end, 4) for key, end in ends.items()}


def _cell_as_data(cell: Cell) -> Mapping[str, Any]:
    return {
        "distance_m": cell.thresholds.distance_m,
        "battery_percent": cell.thresholds.battery_percent,
        "load": cell.thresholds.load,
        "missions": round(cell.missions, 4),
        "unsafe_s": round(cell.unsafe_s, 4),
        "score": round(cell.score, 4),
    }


def _by_seed(runs: Mapping[str, Sequence[StoreOutcome]]) -> Mapping[str, Any]:
    return {
        name: {
            str(run.seed): {measure.key: round(measure.value_of(run), 4) for measure in MEASURES}
            for run in manager_runs
        }
        for name, manager_runs in runs.items()
    }
