"""The pictures of the report: the runs of one seed over time, and the unsafe seconds of each seed."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import AbstractContextManager
from io import StringIO
from itertools import pairwise
from statistics import fmean

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from codra_papers.experiments.campaign.document import Drawing
from codra_papers.experiments.studies.store_managers.trial import Curve, StoreOutcome

COLOURS: Mapping[str, str] = {"pick": "#0072b2", "deliver": "#009e73", "start": "#e69f00", "dock": "#cc79a7"}
"""Okabe and Ito's: readers with any colour vision can distinguish them."""

_WIDTHS: Mapping[str, float] = {"pick": 5.0, "deliver": 3.6, "start": 2.4, "dock": 1.2}
"""The widths of weights: where curves coincide, the wider ones show on both sides of the narrower ones."""

_UNSAFE_COLOUR, _SAFETY_COLOUR, _SEED_COLOUR, _MEAN_COLOUR = "#f6b9b3", "#222222", "#b9c2c9", "#d1352b"
_BAND = (-0.22, 0.15)
_WEIGHT_PREFIX = "weight_of_"


def draw_over_time(runs: Mapping[str, StoreOutcome]) -> Drawing:
    """Draw safety, weights, course and unsafe seconds of one seed, with a row for each manager.

    Args:
        runs: the run of each manager, all with one seed.
    """
    with _style():
        figure = Figure(figsize=(11.0, 1.0 + 1.9 * len(runs)), layout="constrained")
        rows = figure.subplots(len(runs), sharex=True, sharey=True, squeeze=False)[:, 0]
        for (name, run), axes in zip(runs.items(), rows, strict=True):
            _row(axes, name, run)
        seed = next(iter(runs.values())).seed
        rows[-1].set_xlabel(f"time in s, seed {seed}")
        handles = [
            Line2D([], [], color=_SAFETY_COLOUR, label="safety"),
            *(Line2D([], [], color=colour, label=f"weight, course: {name}") for name, colour in COLOURS.items()),
            Patch(color=_UNSAFE_COLOUR, label="unsafe"),
            Line2D(
                [], [], color=_SAFETY_COLOUR, marker="v", linestyle="", label="a cause begins (hollow: never answered)"
            ),
        ]
        figure.legend(handles=handles, loc="outside lower center", ncols=4, frameon=False)
        caption = (
            f"Seed {seed}. The lines are safety and weights from the manager's own analysis; the band below them is "
            "the course. Red: the robot moved fast near a person. For the managers none and random, the weights are "
            "those of the spec's loops, which these managers do not follow."
        )
        return Drawing(caption=caption, svg=_svg(figure))


def _row(axes: Axes, name: str, run: StoreOutcome) -> None:
    for span in run.unsafe:
        axes.axvspan(span.start_s, span.end_s, color=_UNSAFE_COLOUR, linewidth=0)
    for variable, curve in sorted(run.curves.items(), key=lambda item: not item[0].startswith(_WEIGHT_PREFIX)):
        action = variable.removeprefix(_WEIGHT_PREFIX)
        _step(axes, curve, run.duration_s, COLOURS.get(action, _SAFETY_COLOUR), _WIDTHS.get(action, 1.0))
    for (start_s, action), (end_s, _) in pairwise((*run.courses, (run.duration_s, ""))):
        axes.broken_barh([(start_s, end_s - start_s)], _BAND, facecolors=COLOURS[action], linewidth=0)
    for call in run.called:
        fill = "none" if call.answered_s is None else _SAFETY_COLOUR
        axes.plot([call.begun_s], [1.12], "v", markersize=5, markeredgecolor=_SAFETY_COLOUR, markerfacecolor=fill)
    axes.set_ylim(-0.25, 1.2)
    axes.set_xlim(0.0, run.duration_s)
    axes.set_yticks([0.0, 0.5, 1.0])
    axes.set_title(f"{name}: {run.loops} missions, {run.unsafe_s:.1f} s unsafe", loc="left", fontsize=10)


def _step(axes: Axes, curve: Curve, end_s: float, colour: str, width: float) -> None:
    if curve:
        instants = [*(at_s for at_s, _ in curve), end_s]
        values = [float("nan") if value is None else value for _, value in curve]
        axes.step(instants, [*values, values[-1]], where="post", color=colour, linewidth=width)


def draw_by_seed(runs: Mapping[str, Sequence[StoreOutcome]]) -> Drawing:
    """Draw the unsafe seconds of each seed for all managers, and the mean for each manager."""
    with _style():
        figure = Figure(figsize=(7.0, 3.6), layout="constrained")
        axes = figure.subplots()
        places = range(len(runs))
        for line in zip(*([run.unsafe_s for run in outcomes] for outcomes in runs.values()), strict=True):
            axes.plot(places, line, "o-", color=_SEED_COLOUR, markersize=3, linewidth=0.8)
        means = [fmean(run.unsafe_s for run in outcomes) for outcomes in runs.values()]
        axes.plot(places, means, "D", color=_MEAN_COLOUR, markersize=7, label="mean")
        axes.set_xticks(places, list(runs))
        axes.set_ylim(bottom=0.0)
        axes.set_ylabel("unsafe seconds of a run")
        axes.legend(frameon=False)
        return Drawing(caption="Unsafe seconds: each line is one seed with all managers.", svg=_svg(figure))


def _style() -> AbstractContextManager[None]:
    return mpl.rc_context(
        {"svg.hashsalt": "codra", "font.size": 9.5, "axes.spines.top": False, "axes.spines.right": False}
    )


def _svg(figure: Figure) -> str:
    text = StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()
