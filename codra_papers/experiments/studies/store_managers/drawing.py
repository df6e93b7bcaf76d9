"""The pictures of the report: the runs of one seed over time, and some measures of each seed."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from itertools import pairwise
from statistics import fmean

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from codra_papers.experiments.campaign.document import Drawing
from codra_papers.experiments.campaign.figures import figure_style, svg_of
from codra_papers.experiments.studies.store_managers.comparing import Measure
from codra_papers.experiments.studies.store_managers.trial import BATTERY, StoreOutcome

COLOURS: Mapping[str, str] = {"pick": "#0072b2", "deliver": "#009e73", "start": "#e69f00", "dock": "#cc79a7"}
"""Okabe and Ito's: readers with any colour vision can distinguish them."""

_UNSAFE_COLOUR, _METRIC_COLOUR, _SEED_COLOUR, _MEAN_COLOUR = "#f6b9b3", "#5a6b75", "#b9c2c9", "#d1352b"

_LANES: Mapping[str, str] = {
    "weight_of_dock": "weight of dock",
    "weight_of_start": "weight of start",
    "weight_of_deliver": "weight of deliver",
    "weight_of_pick": "weight of pick",
    "safety": "safety",
    BATTERY: "battery",
}
"""The curves and their names, from the bottom. Each curve has a lane of its own, so no curve hides another."""

_LANE_HEIGHT = 1.3
"""The distance between the bottoms of two lanes; a curve is 1 high."""

_COURSE_LANE, _CAUSE_LANE = -1, len(_LANES)
"""The lanes below and above those of the curves."""


def draw_over_time(runs: Mapping[str, StoreOutcome]) -> Drawing:
    """Draw battery, safety, weights, course and unsafe seconds of one seed, with a block of lanes for each manager.

    Args:
        runs: the run of each manager, all with one seed.
    """
    with figure_style():
        figure = Figure(figsize=(11.0, 0.8 + 1.9 * len(runs)), layout="constrained")
        blocks = figure.subplots(len(runs), sharex=True, sharey=True, squeeze=False)[:, 0]
        for (name, run), axes in zip(runs.items(), blocks, strict=True):
            _block(axes, name, run)
        seed = next(iter(runs.values())).seed
        blocks[-1].set_xlabel(f"time in minutes, seed {seed}")
        handles = [
            *(Patch(color=colour, label=name) for name, colour in COLOURS.items()),
            Patch(color=_UNSAFE_COLOUR, label="unsafe"),
            Line2D([], [], color="black", marker="v", linestyle="", label="cause that was answered"),
            Line2D([], [], color="black", marker="v", linestyle="", markerfacecolor="none", label="never answered"),
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
        caption = (
            f"Seed {seed}. Each lane reaches from 0 to 1, for the battery from 0 to 100 percent; a gap means that the "
            "value is unknown. The managers 'none' and 'speed only' do not use the weights. Unsafe: the robot moved "
            "fast near a person. The triangles mark the causes for another course."
        )
        return Drawing(caption=caption, svg=svg_of(figure))


def _block(axes: Axes, name: str, run: StoreOutcome) -> None:
    for span in run.unsafe:
        axes.axvspan(span.start_s / 60.0, span.end_s / 60.0, color=_UNSAFE_COLOUR, linewidth=0)
    for lane, variable in enumerate(_LANES):
        _curve(axes, lane, variable, run)
    course_lane = (_COURSE_LANE * _LANE_HEIGHT, 1.0)
    for (start_s, action), (end_s, _) in pairwise((*run.courses, (run.duration_s, ""))):
        span_min = [(start_s / 60.0, (end_s - start_s) / 60.0)]
        axes.broken_barh(span_min, course_lane, facecolors=COLOURS[action], linewidth=0)
    for call in run.called:
        fill = "none" if call.answered_s is None else "black"
        place = (call.begun_s / 60.0, _CAUSE_LANE * _LANE_HEIGHT + 0.5)
        axes.plot(*place, "v", markersize=4, markeredgecolor="black", markerfacecolor=fill)
    names = ["course", *_LANES.values(), "causes"]
    axes.set_yticks([(lane - 1) * _LANE_HEIGHT + 0.5 for lane in range(len(names))], names, fontsize=7)
    axes.tick_params(axis="y", length=0)
    axes.set_ylim(_COURSE_LANE * _LANE_HEIGHT - 0.2, (_CAUSE_LANE + 1) * _LANE_HEIGHT)
    axes.set_xlim(0.0, run.duration_s / 60.0)
    axes.set_title(f"{name}: {run.loops} missions, {run.unsafe_s:.1f} s unsafe", loc="left", fontsize=10)


def _curve(axes: Axes, lane: int, variable: str, run: StoreOutcome) -> None:
    bottom, scale = lane * _LANE_HEIGHT, 0.01 if variable == BATTERY else 1.0
    colour = COLOURS.get(variable.removeprefix("weight_of_"), _METRIC_COLOUR)
    points = [(at_s, math.nan if value is None else bottom + scale * value) for at_s, value in run.curves[variable]]
    instants_min = [at_s / 60.0 for at_s in (*(at_s for at_s, _ in points), run.duration_s)]
    heights = [height for _, height in (*points, *points[-1:])]
    axes.axhline(bottom, color=_SEED_COLOUR, linewidth=0.4)
    if points:
        axes.fill_between(instants_min, heights, bottom, step="post", color=colour, alpha=0.35, linewidth=0)
        axes.step(instants_min, heights, where="post", color=colour, linewidth=0.8)


def draw_by_seed(runs: Mapping[str, Sequence[StoreOutcome]], measures: Sequence[Measure]) -> Drawing:
    """Draw some measures of each seed for all managers, and their means, with a row for each measure."""
    with figure_style():
        figure = Figure(figsize=(8.0, 2.8 * len(measures)), layout="constrained")
        rows = figure.subplots(len(measures), sharex=True, squeeze=False)[:, 0]
        places = range(len(runs))
        for measure, axes in zip(measures, rows, strict=True):
            values = [list(map(measure.value_of, manager_runs)) for manager_runs in runs.values()]
            for line in zip(*values, strict=True):
                axes.plot(places, line, "o-", color=_SEED_COLOUR, markersize=3, linewidth=0.8)
            axes.plot(places, list(map(fmean, values)), "D", color=_MEAN_COLOUR, markersize=7)
            axes.set_xticks(places, list(runs))
            axes.set_ylim(bottom=0.0)
            axes.set_title(f"{measure.name} in an hour", loc="left", fontsize=10)
        caption = "Each line is one seed with all managers; the diamonds are means over seeds."
        return Drawing(caption=caption, svg=svg_of(figure))
