"""Plots of values against a varied number: one line for each arm, with intervals where they exist."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from codra_papers.experiments.campaign.document import Drawing
from codra_papers.experiments.campaign.figures import figure_style, svg_of
from codra_papers.experiments.campaign.statistics import Estimate

_COLOURS = ("#d1352b", "#1f5fa8", "#2e9e5b", "#8a5fb0")


@dataclass(frozen=True, slots=True, kw_only=True)
class Point:
    """A point of a curve. A point without a value is not drawn."""

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
    """Curves in a coordinate system of their own.

    Attributes:
        x_label: the label of the horizontal axis.
        nominal_x: the value of the varied number in the unchanged laboratory, which a line marks; None for no line.
    """

    title: str
    x_label: str
    curves: Sequence[Curve]
    nominal_x: float | None = None


def curves(plotted_curves: Sequence[Curve], x_label: str, y_label: str, caption: str) -> Drawing:
    """Draw curves in one panel."""
    return panels([Panel(title="", x_label=x_label, curves=plotted_curves)], y_label, caption)


def panels(plotted_panels: Sequence[Panel], y_label: str, caption: str) -> Drawing:
    """Draw panels of the same height, three in a row."""
    columns = min(len(plotted_panels), 3)
    rows = -(-len(plotted_panels) // columns)
    with figure_style():
        figure = Figure(figsize=(3.8 * columns + (2.0 if columns == 1 else 0.0), 2.9 * rows), layout="constrained")
        grid = figure.subplots(rows, columns, sharey=True, squeeze=False)
        for panel, axes in zip(plotted_panels, grid.flat, strict=False):
            _draw(panel, axes)
        for axes in grid.flat[len(plotted_panels) :]:
            axes.set_visible(False)
        for line in grid:
            line[0].set_ylabel(y_label)
        grid.flat[0].legend(fontsize=8, frameon=False)
        return Drawing(caption=caption, svg=svg_of(figure))


def _draw(panel: Panel, axes: Axes) -> None:
    if panel.nominal_x is not None:
        axes.axvline(panel.nominal_x, color="#cccccc", linewidth=1.0)
    for curve, colour in zip(panel.curves, _COLOURS, strict=False):
        drawn_points = [(point, point.y) for point in curve.points if point.y is not None]
        axes.plot(
            [point.x for point, _ in drawn_points], [y for _, y in drawn_points], "o-", color=colour, label=curve.name
        )
        for point, _ in drawn_points:
            if point.low is not None and point.high is not None:
                axes.plot([point.x, point.x], [point.low, point.high], color=colour, linewidth=2.0, alpha=0.5)
    axes.set_title(panel.title, fontsize=10)
    axes.set_xlabel(panel.x_label)


def point_at(x: float, estimate: Estimate | None) -> Point:
    """Return the point of an estimate at a horizontal position."""
    return (
        Point(x=x, y=None) if estimate is None else Point(x=x, y=estimate.value, low=estimate.low, high=estimate.high)
    )


def differences(estimates: Sequence[tuple[str, Estimate]], x_label: str, caption: str) -> Drawing:
    """Draw each estimate in a row of its own, with a vertical line at zero."""
    with figure_style():
        figure = Figure(figsize=(9.0, 1.2 + 0.28 * len(estimates)), layout="constrained")
        axes = figure.subplots()
        axes.axvline(0.0, color="#444444", linewidth=1.0)
        for row, (_, estimate) in enumerate(estimates):
            if estimate.value is not None:
                axes.plot([estimate.value], [row], "o", color=_COLOURS[1])
            if estimate.low is not None and estimate.high is not None:
                axes.plot([estimate.low, estimate.high], [row, row], color=_COLOURS[1], linewidth=2.0)
        axes.set_yticks(range(len(estimates)), [name for name, _ in estimates])
        axes.set_ylim(len(estimates) - 0.5, -0.5)
        axes.set_xlabel(x_label)
        return Drawing(caption=caption, svg=svg_of(figure))
