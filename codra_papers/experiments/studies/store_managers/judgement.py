"""The report on the trials: the answer, the tables, the reactions, the pictures and the searches."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

from codra_papers.experiments.campaign.cells import estimate_text, interval, percent, plain_table, rounded
from codra_papers.experiments.campaign.document import Document, Section, Table, Words
from codra_papers.experiments.campaign.experiment import Settings
from codra_papers.experiments.campaign.statistics import Estimate
from codra_papers.experiments.studies.store_managers.answering import answers
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
from codra_papers.experiments.studies.store_managers.managers import OURS, SPEED_ONLY, managers
from codra_papers.experiments.studies.store_managers.search import UNSAFE_SECOND_COST, Cell, Design, best_cell, cells
from codra_papers.experiments.studies.store_managers.trial import StoreOutcome, StoreTrial

REFERENCES = (SPEED_ONLY.name, OURS.name)
"""The managers with which all other managers are compared."""

NEVER = "never"
QUESTION = "What do the loops bring that a rule does not?"
_MAIN_MEASURES = ("missions_per_h", "orders_done_per_h", "unsafe_s_per_h", "battery_empty_min_per_h")

_NOTE = (
    "All counts are rates per hour, because shifts have different durations. The actions of people and the orders are "
    "drawn from the seed before a run begins. Without a choice of the course, 'none' drives at 1.2 m/s and 'speed "
    "only' follows the speed rule of the spec; 'course only' has the loops without this rule; 'threshold' has a tuned "
    "list of comparisons in place of the loops; 'ours' has the loops, and 'ours tuned' has loops with tuned numbers. "
    "docs/papers/store-experiment.md has all definitions. Means are over "
    "seeds. Differences are over the same seeds, with 95 % intervals by the bootstrap; the intervals of marked "
    "differences do not contain zero."
)
_ANSWER_NOTE = (
    "The rules are the speed rule of the spec alone ('speed only'), and the tuned list of comparisons ('threshold'). "
    "These sentences are computed: an advantage or a disadvantage is one whose paired 95 % interval does not contain "
    "zero. So, of the differences that do not exist, about one in twenty is named. The number of changes of the course "
    "is neither good nor bad."
)


def reported_seeds(design: Design, settings: Settings) -> range:
    """Return the seeds of the report."""
    return range(design.first_seed, design.first_seed + settings.seeds)


def reported_trials(design: Design, settings: Settings, outcomes: Mapping[str, StoreOutcome]) -> Sequence[StoreTrial]:
    """Return the runs of all managers. The tuned managers use the results of their searches."""
    chosen_edits = {name: best_cell(cells(design, name, outcomes)).edit for name in design.grids}
    return [
        design.trial(settings, manager.name, seed, manager)
        for seed in reported_seeds(design, settings)
        for manager in managers(chosen_edits)
    ]


def judge(design: Design, settings: Settings, outcomes: Mapping[str, StoreOutcome]) -> Document:
    """Return the report on the outcomes of the searches and of `reported_trials`."""
    searches = {name: cells(design, name, outcomes) for name in design.grids}
    search_section = Section(title="The searches", parts=[_grid(design, *search) for search in searches.items()])
    search_data = {name: [_cell_as_data(cell) for cell in search_cells] for name, search_cells in searches.items()}
    runs: dict[str, list[StoreOutcome]] = {}
    for trial in reported_trials(design, settings, outcomes):
        runs.setdefault(trial.manager.name, []).append(outcomes[trial.name])
    if not runs:
        return Document(
            title="store: the searches",
            summary=("No seed is reported.",),
            sections=(search_section,),
            results={"searches": search_data},
        )
    table, reaction_rows, seeds = compare_managers(runs), reactions(runs), reported_seeds(design, settings)
    first_runs = {name: manager_runs[0] for name, manager_runs in runs.items()}
    drain_sentence = _drain_sentence([run for manager_runs in runs.values() for run in manager_runs])
    sentences = tuple(answers(table))
    return Document(
        title="store: the value of the loops",
        summary=(*sentences, *_summary(table, reaction_rows), drain_sentence, _seeds_sentence(seeds)),
        sections=(
            Section(title=QUESTION, parts=[Words(text=text) for text in (*sentences, _ANSWER_NOTE)]),
            Section(
                title="Managers",
                parts=(
                    Words(text=_NOTE),
                    Words(text=drain_sentence),
                    _means(table),
                    *(_differences(table, reference) for reference in REFERENCES),
                ),
            ),
            Section(title="From cause to switch", parts=(_reactions_table(reaction_rows),)),
            Section(title="Seed by seed", parts=(draw_by_seed(runs, _main_measures()),)),
            Section(title="One seed", parts=(draw_over_time(first_runs),)),
            search_section,
        ),
        results={
            "answers": sentences,
            "managers": _comparisons_as_data(table),
            "reactions": [_reactions_as_data(manager_reactions) for manager_reactions in reaction_rows],
            "searches": search_data,
            "chosen": {name: _cell_as_data(best_cell(search_cells)) for name, search_cells in searches.items()},
            "by_seed": _by_seed(runs),
        },
    )


# Words and tables


def _summary(table: Sequence[MeasureComparison], reaction_rows: Sequence[Reactions]) -> Iterator[str]:
    """Yield the means of the main measures, and the reactions. The sentences are the same whatever the results are."""
    for measure in _main_measures():
        means = ", ".join(f"{row.manager} {_number_text(row.mean.value, 2)}" for row in _measure_rows(table, measure))
        yield f"{measure.name} in an hour: {means}."
    all_cause_rows = [row for row in reaction_rows if row.cause is None]
    answered_text = ", ".join(f"{row.manager} {row.answered} of {row.count}" for row in all_cause_rows)
    median_text = ", ".join(f"{row.manager} {_seconds_text(row.quantiles_s[0.5].value)}" for row in all_cause_rows)
    yield f"Answered causes for a change of the course: {answered_text}."
    yield f"Median time from such a cause to the change: {median_text}."


def _main_measures() -> Sequence[Measure]:
    return [measure for measure in MEASURES if measure.key in _MAIN_MEASURES]


def _drain_sentence(runs: Sequence[StoreOutcome]) -> str:
    known_s = sorted(run.drain_known_s for run in runs if run.drain_known_s is not None)
    latest_text = f", at the latest {known_s[-1]:.1f} s after the beginning" if known_s else ""
    count_text = f"{len(known_s)} of {len(runs)} reported runs"
    return f"The drain of the battery (battery_drain) was known in {count_text}{latest_text}."


def _seeds_sentence(seeds: Sequence[int]) -> str:
    return f"{len(seeds)} seeds, {seeds[0]} to {seeds[-1]}."


def _is_sure(difference: Estimate) -> bool:
    return difference.is_positive or difference.is_negative


def _means(table: Sequence[MeasureComparison]) -> Table:
    rows = [
        (measure.name, *(estimate_text(row.mean, "{:.2f}".format, "-") for row in _measure_rows(table, measure)))
        for measure in MEASURES
    ]
    header = ("In an hour", *dict.fromkeys(row.manager for row in table))
    return plain_table("Means over seeds, with their intervals.", header, rows)


def _differences(table: Sequence[MeasureComparison], reference: str) -> Table:
    names = [name for name in dict.fromkeys(row.manager for row in table) if name != reference]
    differences = [
        [row.differences[reference] for row in _measure_rows(table, measure) if row.manager in names]
        for measure in MEASURES
    ]
    marked = frozenset(
        (row, column)
        for row, measure_differences in enumerate(differences)
        for column, difference in enumerate(measure_differences, 1)
        if _is_sure(difference)
    )
    return Table(
        caption=f"The manager's value minus the value of '{reference}', as the mean over seeds. Larger values are "
        "better in the first two rows, smaller values in the others; changes of the course are neither.",
        header=("In an hour", *names),
        rows=[
            (measure.name, *(interval(difference, 2) for difference in measure_differences))
            for measure, measure_differences in zip(MEASURES, differences, strict=True)
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


def _grid(design: Design, manager: str, search_cells: Sequence[Cell]) -> Table:
    chosen_cell = best_cell(search_cells)
    rows = [
        (
            str(cell.edit),
            f"{cell.missions_per_h:.2f}",
            f"{cell.unsafe_s_per_h:.2f}",
            f"{cell.score:.3f}",
            "chosen" if cell is chosen_cell else "",
        )
        for cell in search_cells
    ]
    seeds = ", ".join(map(str, design.tuning_seeds))
    caption = (
        f"The cells of '{manager}': means in an hour over the seeds {seeds}. "
        f"The score is the number of missions minus {UNSAFE_SECOND_COST:g} times the unsafe seconds. "
        "docs/papers/store-experiment.md explains the numbers of a cell."
    )
    return plain_table(caption, ("Cell", "Missions", "Unsafe s", "Score", ""), rows)


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
            row.measure.key: {
                "mean": _as_data(row.mean),
                "differences": {other: _as_data(difference) for other, difference in row.differences.items()},
            }
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


def _as_data(estimate: Estimate) -> Mapping[str, float | str | None]:
    ends = {"value": estimate.value, "low": estimate.low, "high": estimate.high}
    return {key: NEVER if end == math.inf else rounded(end, 4) for key, end in ends.items()}


def _cell_as_data(cell: Cell) -> Mapping[str, Any]:
    return {
        "cell": str(cell.edit),
        "missions_per_h": round(cell.missions_per_h, 4),
        "unsafe_s_per_h": round(cell.unsafe_s_per_h, 4),
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
