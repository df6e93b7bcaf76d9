"""A drawing like P1's Figure 8, for our runs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from io import StringIO

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from codra_papers.experiments.studies.lab_runtime.finding import deviation, mean

_WITHOUT_COLOUR, _WITHOUT_PERCEPTION_COLOUR = "#e9b078", "#c9660a"
_OBSERVED_COLOUR, _OBSERVED_PERCEPTION_COLOUR = "#9dbfdd", "#1f5f99"
_BAR_WIDTH = 0.38


@dataclass(frozen=True, slots=True, kw_only=True)
class Bars:
    """The bars of one task.

    Attributes:
        task_s: the durations of all executions, without observers and with them.
        perception_s: the same for the perception in each execution.
        task_share: the share of the task's duration that observers save.
        perception_share: the same for its perception.
    """

    task: str
    task_s: tuple[Sequence[float], Sequence[float]]
    perception_s: tuple[Sequence[float], Sequence[float]]
    task_share: float | None
    perception_share: float | None


def figure_8(bars: Sequence[Bars]) -> str:
    """Return, as SVG, two bars for each task and for its perception: without and with observers.

    Whiskers are the standard deviations of the executions.
    """
    figure = Figure(figsize=(9, 4.6), layout="constrained")
    axes = figure.subplots(1, 2, width_ratios=(1, 1))
    _draw_panel(
        axes[0],
        "whole task",
        [(task_bars.task, task_bars.task_s, task_bars.task_share) for task_bars in bars],
        _WITHOUT_COLOUR,
        _OBSERVED_COLOUR,
    )
    _draw_panel(
        axes[1],
        "perception",
        [(task_bars.task, task_bars.perception_s, task_bars.perception_share) for task_bars in bars],
        _WITHOUT_PERCEPTION_COLOUR,
        _OBSERVED_PERCEPTION_COLOUR,
    )
    axes[0].set_ylabel("duration in s")
    with mpl.rc_context({"svg.hashsalt": "codra", "svg.fonttype": "none"}):
        svg_text = StringIO()
        figure.savefig(svg_text, format="svg", metadata={"Date": None})
    return svg_text.getvalue()


_Rows = Sequence[tuple[str, tuple[Sequence[float], Sequence[float]], float | None]]


def _draw_panel(axes: Axes, title: str, rows: _Rows, without: str, observed: str) -> None:
    """Draw a pair of bars for each task. The text above the pair states their relative difference."""
    tops = [_draw_pair(axes, place, durations_s, (without, observed)) for place, (_, durations_s, _) in enumerate(rows)]
    for place, (top_s, (_, _, share)) in enumerate(zip(tops, rows, strict=True)):
        if share is not None:
            axes.annotate(f"{-100 * share:+.0f} %", (place, top_s), (0, 6), textcoords="offset points", ha="center")
    axes.set_xticks(range(len(rows)), [task for task, _, _ in rows])
    axes.set_ylim(0, 1.28 * max(tops, default=0.0) or 1.0)
    axes.set_title(title, fontsize=11)
    axes.spines[["top", "right"]].set_visible(False)
    axes.legend(
        handles=[Patch(color=without, label="without observers"), Patch(color=observed, label="with observers")],
        frameon=False,
        loc="upper center",
        ncols=2,
        fontsize=8,
    )


def _draw_pair(
    axes: Axes, place: float, durations_s: tuple[Sequence[float], Sequence[float]], colours: tuple[str, str]
) -> float:
    """Draw two bars with whiskers, and return the highest end of the whiskers."""
    tops = [0.0]
    for side, durations, colour in zip((-0.5, 0.5), durations_s, colours, strict=True):
        mean_s, deviation_s = mean(durations) or 0.0, deviation(durations) or 0.0
        x = place + side * (_BAR_WIDTH + 0.02)
        axes.bar(x, mean_s, _BAR_WIDTH, color=colour, yerr=deviation_s, capsize=4, ecolor="#333333")
        axes.annotate(
            f"{mean_s:.0f}",
            (x, 0),
            (0, 4),
            textcoords="offset points",
            ha="center",
            fontsize=8,
            color="white" if colour in (_WITHOUT_PERCEPTION_COLOUR, _OBSERVED_PERCEPTION_COLOUR) else "black",
        )
        tops.append(mean_s + deviation_s)
    return max(tops)
