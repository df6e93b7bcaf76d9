"""What the trials come to: the table, the reactions, the grid and the pictures."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from itertools import groupby
from typing import Any

from codra_papers.experiments.campaign.cells import interval, percent, plain_table, rounded, with_ends
from codra_papers.experiments.campaign.document import Document, Section, Table, Words
from codra_papers.experiments.campaign.experiment import Settings
from codra_papers.experiments.campaign.statistics import Estimate
from codra_papers.experiments.studies.store_managers.comparing import (
    MEASURES,
    QUANTILES,
    Compared,
    Measure,
    Reactions,
    compared,
    reactions,
)
from codra_papers.experiments.studies.store_managers.drawing import by_seed, over_time
from codra_papers.experiments.studies.store_managers.managers import Chance, Manager, Nobody, Ours, Tuned
from codra_papers.experiments.studies.store_managers.search import Cell, Design, best, cells
from codra_papers.experiments.studies.store_managers.trial import StoreOutcome, StoreTrial

OURS = Ours().name
NEVER = "never"

_NOTE = (
    "Runs of {:.0f} s. What people and orders do is drawn from the seed before a run begins; all is counted from the "
    "state of the world. docs/papers/store-experiment.md has all definitions. Means are over seeds; differences "
    "to ours are over the same seeds, with 95 % intervals by the bootstrap. Marked differences have an interval "
    "without zero."
)


def reported_seeds(design: Design, settings: Settings) -> range:
    """Return the seeds that are reported."""
    return range(design.first_seed, design.first_seed + settings.seeds)


def managers(design: Design, found: Mapping[str, StoreOutcome]) -> tuple[Manager, ...]:
    """Return who is compared, by what came of the search."""
    return (Nobody(), Chance(), Tuned(best(cells(design, found)).thresholds), Ours())


def reported_trials(design: Design, settings: Settings, found: Mapping[str, StoreOutcome]) -> Sequence[StoreTrial]:
    """Return the runs of all managers, by what came of the search."""
    return [
        StoreTrial(
            name=_name(manager.name, seed),
            spec=settings.spec,
            seed=seed,
            manager=manager,
            duration_s=design.duration_s,
        )
        for seed in reported_seeds(design, settings)
        for manager in managers(design, found)
    ]


def _name(manager: str, seed: int) -> str:
    return f"{manager}-{seed}"


def judge(design: Design, settings: Settings, outcomes: Mapping[str, StoreOutcome]) -> Document:
    """Return the report on the outcomes of the search and of `reported_trials`."""
    searched, seeds = cells(design, outcomes), reported_seeds(design, settings)
    runs = {
        manager.name: [outcomes[_name(manager.name, seed)] for seed in seeds]
        for manager in managers(design, outcomes)
        if len(seeds)
    }
    if not runs:
        return _searched_only(design, searched)
    table, answered = compared(runs, OURS), reactions(runs)
    first = {name: came[0] for name, came in runs.items()}
    return Document(
        title="store: what the loops are worth",
        summary=(*_summary(table, answered), f"{len(seeds)} seeds, {seeds[0]} to {seeds[-1]}."),
        sections=(
            Section(
                title="Managers",
                parts=(Words(text=_NOTE.format(design.duration_s)), _means(table), _differences(table)),
            ),
            Section(title="From cause to switch", parts=(_reactions_table(answered),)),
            Section(title="Unsafe seconds", parts=(by_seed(runs),)),
            Section(title="One seed", parts=(over_time(first),)),
            Section(title="The search for thresholds", parts=(_grid(design, searched),)),
        ),
        results={
            "managers": _compared_as_data(table),
            "reactions": [_reactions_as_data(each) for each in answered],
            "grid": [_cell_as_data(each) for each in searched],
            "thresholds": _cell_as_data(best(searched)),
            "by_seed": _by_seed(runs),
        },
    )


def _searched_only(design: Design, searched: Sequence[Cell]) -> Document:
    return Document(
        title="store: the search for thresholds",
        summary=("No seed is reported.",),
        sections=(Section(title="The search for thresholds", parts=(_grid(design, searched),)),),
        results={"grid": [_cell_as_data(each) for each in searched]},
    )


# Words and tables


def _summary(table: Sequence[Compared], answered: Sequence[Reactions]) -> Iterator[str]:
    """Say what was found of the four measures of the question, and of reactions, whatever it is."""
    for measure in MEASURES[:4]:
        told = _of(table, measure)
        means = ", ".join(f"{each.manager} {_number(each.mean.value, 2)}" for each in told)
        sure = [each for each in told if each.difference is not None and _is_sure(each.difference)]
        less = ", ".join(f"{each.manager} {interval(each.difference, 2)}" for each in sure if each.difference)
        yield f"{measure.name} of a run: {means}; different from ours with an interval without zero: {less or 'none'}."
    of_all = [each for each in answered if each.cause is None]
    told_s = ", ".join(
        f"{each.manager} {' and '.join(_seconds(each.quantiles_s[q].value) for q in QUANTILES)} "
        f"({each.answered} of {each.count} answered)"
        for each in of_all
    )
    yield f"From cause to switch, median and 99th percentile: {told_s}."


def _is_sure(found: Estimate) -> bool:
    return found.is_positive or found.is_negative


def _means(table: Sequence[Compared]) -> Table:
    rows = [
        (measure.name, *(with_ends(each.mean, "{:.2f}".format, "-") for each in _of(table, measure)))
        for measure in MEASURES
    ]
    header = ("Of a run", *dict.fromkeys(each.manager for each in table))
    return plain_table("Means over seeds, with their intervals.", header, rows)


def _differences(table: Sequence[Compared]) -> Table:
    told = {
        measure.name: {each.manager: each.difference for each in _of(table, measure) if each.difference is not None}
        for measure in MEASURES
    }
    marked = frozenset(
        (row, column)
        for row, found in enumerate(told.values())
        for column, one in enumerate(found.values(), 1)
        if _is_sure(one)
    )
    return Table(
        caption="Differences to ours, seed by seed: above zero, the manager has more of it than ours.",
        header=("Of a run", *next(iter(told.values()))),
        rows=[(name, *(interval(one, 2) for one in found.values())) for name, found in told.items()],
        marked=marked,
    )


def _of(table: Sequence[Compared], measure: Measure) -> Sequence[Compared]:
    """Return a measure of all managers."""
    return [each for each in table if each.measure is measure]


def _reactions_table(answered: Sequence[Reactions]) -> Table:
    header = ("Cause", "Manager", "Causes", "Answered", "Answered, %", *(f"p{100 * q:.0f} in s" for q in QUANTILES))
    rows = [
        (
            "all" if each.cause is None else each.cause.value,
            each.manager,
            each.count,
            each.answered,
            percent(each.share),
            *(with_ends(each.quantiles_s[q], _shown, "-") for q in QUANTILES),
        )
        for each in answered
    ]
    caption = (
        "From the instant at which a cause begins in the world to the first instant at which the course is one that "
        "it calls for. An unanswered cause is later than any answered one. How many causes there are depends on what "
        "the robot does."
    )
    return plain_table(caption, header, rows)


def _grid(design: Design, searched: Sequence[Cell]) -> Table:
    chosen = best(searched)
    rows = [
        (
            f"{each.thresholds.distance_m:g}",
            f"{each.thresholds.battery_percent:g}",
            each.thresholds.load,
            f"{each.missions:.2f}",
            f"{each.unsafe_s:.2f}",
            f"{each.score:.3f}",
            "chosen" if each is chosen else "",
        )
        for each in searched
    ]
    header = ("Person, m", "Battery, %", "Load", "Missions", "Unsafe s", "Score", "")
    seeds = ", ".join(map(str, design.tuning_seeds))
    caption = f"Each cell of the grid on the seeds {seeds}: missions less a tenth of the unsafe seconds, in the mean."
    return plain_table(caption, header, rows)


def _shown(value: float) -> str:
    return f"{value:.1f}" if math.isfinite(value) else NEVER


def _seconds(value: float | None) -> str:
    if value is None:
        return "nothing"
    return f"{value:.1f} s" if math.isfinite(value) else NEVER


def _number(value: float | None, digits: int) -> str:
    return "-" if value is None else f"{value:.{digits}f}"


# Data


def _compared_as_data(table: Sequence[Compared]) -> Mapping[str, Any]:
    return {
        name: {
            each.measure.key: {"mean": _as_data(each.mean), "difference_to_ours": _as_data(each.difference)}
            for each in found
        }
        for name, found in groupby(sorted(table, key=lambda each: each.manager), lambda each: each.manager)
    }


def _reactions_as_data(each: Reactions) -> Mapping[str, Any]:
    return {
        "manager": each.manager,
        "cause": "all" if each.cause is None else each.cause.value,
        "causes": each.count,
        "answered": each.answered,
        "share": _as_data(each.share),
        **{f"p{100 * quantile:.0f}_s": _as_data(found) for quantile, found in each.quantiles_s.items()},
    }


def _as_data(found: Estimate | None) -> Mapping[str, float | str | None] | None:
    if found is None:
        return None
    ends = {"value": found.value, "low": found.low, "high": found.high}
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
        name: {str(each.seed): {one.key: round(one.of(each), 4) for one in MEASURES} for each in came}
        for name, came in runs.items()
    }
