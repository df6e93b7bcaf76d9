"""Pictures of how something depends on a number: a line for each arm, with intervals where there are some."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from dataclasses import dataclass
from io import StringIO

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from codra_papers.experiments.campaign.document import Drawing
from codra_papers.experiments.campaign.statistics import Estimate

_COLOURS = ("#d1352b", "#1f5fa8", "#2e9e5b", "#8a5fb0")


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """One place of a curve; nothing is drawn where there is no value."""

    x: float
    y: float | None
    low: float | None = None
    high: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Curve:
    """A line through points, in order."""

    name: str
    points: Sequence[Point]


@dataclass(frozen=True, slots=True, kw_only=True)
class Panel:
    """Curves with axes of their own.

    Attributes:
        across: what the numbers to the right are.
        nominal: the number that stands for the laboratory as it is; None if there is none.
    """

    title: str
    across: str
    curves: Sequence[Curve]
    nominal: float | None = None


def _style() -> AbstractContextManager[None]:
    return mpl.rc_context(
        {"svg.hashsalt": "codra", "font.size": 9.5, "axes.spines.top": False, "axes.spines.right": False}
    )


def curves(told: Sequence[Curve], across: str, up: str, caption: str) -> Drawing:
    """Draw some curves over the same numbers."""
    return panels([Panel(title="", across=across, curves=told)], up, caption)


def panels(told: Sequence[Panel], up: str, caption: str) -> Drawing:
    """Draw panels, three in a row, all as high."""
    columns = min(len(told), 3)
    rows = -(-len(told) // columns)
    with _style():
        figure = Figure(figsize=(3.8 * columns + (2.0 if columns == 1 else 0.0), 2.9 * rows), layout="constrained")
        grid = figure.subplots(rows, columns, sharey=True, squeeze=False)
        for panel, axes in zip(told, grid.flat, strict=False):
            _draw(panel, axes)
        for axes in grid.flat[len(told) :]:
            axes.set_visible(False)
        for line in grid:
            line[0].set_ylabel(up)
        grid.flat[0].legend(fontsize=8, frameon=False)
        text = StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None})
        return Drawing(caption=caption, svg=text.getvalue())


def _draw(panel: Panel, axes: Axes) -> None:
    if panel.nominal is not None:
        axes.axvline(panel.nominal, color="#cccccc", linewidth=1.0)
    for curve, colour in zip(panel.curves, _COLOURS, strict=False):
        shown = [(point, point.y) for point in curve.points if point.y is not None]
        axes.plot([point.x for point, _ in shown], [y for _, y in shown], "o-", color=colour, label=curve.name)
        for point, _ in shown:
            if point.low is not None and point.high is not None:
                axes.plot([point.x, point.x], [point.low, point.high], color=colour, linewidth=2.0, alpha=0.5)
    axes.set_title(panel.title, fontsize=10)
    axes.set_xlabel(panel.across)


def at(x: float, found: Estimate | None) -> Point:
    """Return the point of an estimate."""
    return Point(x=x, y=None) if found is None else Point(x=x, y=found.value, low=found.low, high=found.high)


def differences(told: Sequence[tuple[str, Estimate]], across: str, caption: str) -> Drawing:
    """Draw estimates below each other, with zero as a line."""
    with _style():
        figure = Figure(figsize=(9.0, 1.2 + 0.28 * len(told)), layout="constrained")
        axes = figure.subplots()
        axes.axvline(0.0, color="#444444", linewidth=1.0)
        for row, (_, found) in enumerate(told):
            if found.value is not None:
                axes.plot([found.value], [row], "o", color=_COLOURS[1])
            if found.low is not None and found.high is not None:
                axes.plot([found.low, found.high], [row, row], color=_COLOURS[1], linewidth=2.0)
        axes.set_yticks(range(len(told)), [name for name, _ in told])
        axes.set_ylim(len(told) - 0.5, -0.5)
        axes.set_xlabel(across)
        text = StringIO()
        figure.savefig(text, format="svg", metadata={"Date": None})
        return Drawing(caption=caption, svg=text.getvalue())
