"""Pictures of sweeps: terms of inputs, metrics and weights over one input, and surfaces over two inputs."""

from __future__ import annotations

import itertools
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from io import BytesIO

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from codra_dsl.runtime.loops import InputModel
from codra_dsl.runtime.loops.sweep import Row, Sweep
from codra_dsl.runtime.values.conditions import Value

_POINT_COUNT = 401
_COLUMN_COUNT = 3
_GREY = "#5a6b75"
_COURSE_COLOURS = ("#4878a8", "#e0a030", "#6aa84f", "#b04a5a", "#8064a2", "#4bacc6", "#9c6b4e", "#7f7f7f")


@dataclass(frozen=True, slots=True, kw_only=True)
class Axis:
    """An input that is an axis of a picture.

    Attributes:
        unit: the unit of the values; empty if they have no unit.
        values: the values in order; members of an enum and truth values are drawn side by side.
        terms: the terms of the input; None if the rules have no terms for it.
    """

    variable: str
    unit: str
    values: Sequence[Value]
    terms: InputModel | None = None

    @property
    def label(self) -> str:
        """Return the text along the axis."""
        return f"{self.variable} in {self.unit}" if self.unit else self.variable

    @property
    def has_members(self) -> bool:
        """Return whether the values are members of an enum or truth values, not numbers."""
        return isinstance(self.values[0], (str, bool))

    def positions(self) -> list[float]:
        """Return the positions of the values on the axis."""
        return [
            float(index) if isinstance(value, (str, bool)) else float(value) for index, value in enumerate(self.values)
        ]

    def mark(self, axes: Axes, axis_letter: str) -> None:
        """Write the label of the axis, and the values if they are not numbers."""
        if self.has_members:
            names = [str(value).lower() if isinstance(value, bool) else str(value) for value in self.values]
            getattr(axes, f"set_{axis_letter}ticks")(self.positions(), names)
        getattr(axes, f"set_{axis_letter}label")(self.label)


def memberships_svg(axes: Sequence[Axis]) -> bytes:
    """Return a picture of the terms of each input that has terms, over the values of its axis."""
    drawn_axes = [axis for axis in axes if axis.terms is not None and not axis.terms.members]
    row_count = -(-len(drawn_axes) // _COLUMN_COUNT)
    figure = Figure(figsize=(4.2 * min(_COLUMN_COUNT, len(drawn_axes)), 2.6 * row_count), layout="constrained")
    for index, axis in enumerate(drawn_axes):
        panel = figure.add_subplot(row_count, min(_COLUMN_COUNT, len(drawn_axes)), index + 1)
        _draw_terms(panel, axis)
        axis.mark(panel, "x")
    return _svg(figure)


def sweep_svg(sweep_result: Sweep, axis: Axis) -> bytes:
    """Return a picture of a sweep: the terms of the input, metrics, weights, and the switches of the course."""
    has_terms = axis.terms is not None and not axis.terms.members
    names = [*(["terms"] if has_terms else []), "metrics", *(["weights"] if sweep_result.rows[0].weights else [])]
    figure = Figure(figsize=(8.0, 0.6 + 2.2 * len(names)), layout="constrained")
    panels = dict(zip(names, np.atleast_1d(figure.subplots(len(names), 1, sharex=True)).tolist(), strict=True))
    if has_terms:
        _draw_terms(panels["terms"], axis)
    for name in names[has_terms:]:
        _draw_curves(
            panels[name], axis, [row.metrics if name == "metrics" else row.weights for row in sweep_result.rows]
        )
    for name, panel in panels.items():
        panel.set_ylabel(name)
        for switch in sweep_result.switches:
            panel.axvline(_middle_position(axis, switch.low, switch.high), color=_GREY, linewidth=0.9, linestyle=":")
    _name_courses(panels[names[0]], axis, sweep_result)
    axis.mark(panels[names[-1]], "x")
    return _svg(figure)


def surfaces_svg(rows: Sequence[Sequence[Row]], x_axis: Axis, y_axis: Axis) -> bytes:
    """Return a picture of each metric, each weight and the course over two inputs; unknown values are blank."""
    first_row = rows[0][0]
    named_grids = [(name, [[row.metrics[name] for row in line] for line in rows]) for name in first_row.metrics]
    named_grids += [
        (f"weight of {name}", [[row.weights[name] for row in line] for line in rows]) for name in first_row.weights
    ]
    panel_count = len(named_grids) + bool(first_row.action)
    row_count = -(-panel_count // _COLUMN_COUNT)
    figure = Figure(figsize=(4.4 * _COLUMN_COUNT, 3.2 * row_count), layout="constrained")
    for index, (name, values) in enumerate(named_grids):
        axes = figure.add_subplot(row_count, _COLUMN_COUNT, index + 1)
        value_grid = np.array([[np.nan if value is None else value for value in line] for line in values])
        picture = axes.pcolormesh(
            x_axis.positions(), y_axis.positions(), value_grid, vmin=0.0, vmax=1.0, shading="nearest", rasterized=True
        )
        figure.colorbar(picture, ax=axes)
        _label_panel(axes, name, x_axis, y_axis)
    if first_row.action:
        _draw_courses(figure.add_subplot(row_count, _COLUMN_COUNT, panel_count), rows, x_axis, y_axis)
    return _svg(figure)


def _draw_terms(axes: Axes, axis: Axis) -> None:
    assert axis.terms is not None
    positions = axis.positions()
    xs = np.linspace(min(positions), max(positions), _POINT_COUNT).tolist()
    for name, degree in axis.terms.terms.items():
        axes.plot(xs, [degree(x) for x in xs], label=name)
    axes.set_ylim(-0.03, 1.05)
    _add_legend(axes)


def _draw_curves(axes: Axes, axis: Axis, rows: Sequence[Mapping[str, float | None]]) -> None:
    marker, line = ("o", "--") if axis.has_members else ("", "-")
    for index, name in enumerate(rows[0]):
        values = [float("nan") if (value := row[name]) is None else value for row in rows]
        width = max(1.2, 4.0 - 0.9 * index)  # so that coinciding lines stay visible
        axes.plot(axis.positions(), values, label=name, marker=marker, linestyle=line, linewidth=width)
    axes.set_ylim(-0.03, 1.05)
    _add_legend(axes)


def _add_legend(axes: Axes) -> None:
    axes.legend(fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))


def _middle_position(axis: Axis, low: Value, high: Value) -> float:
    if isinstance(low, (str, bool)) or isinstance(high, (str, bool)):
        values = list(axis.values)
        return (values.index(low) + values.index(high)) / 2.0
    return (low + high) / 2.0


def _name_courses(axes: Axes, axis: Axis, sweep_result: Sweep) -> None:
    """Write the name of each course above the part of the axis where it is chosen."""
    switch_positions = [_middle_position(axis, switch.low, switch.high) for switch in sweep_result.switches]
    boundary_positions = [axis.positions()[0], *switch_positions, axis.positions()[-1]]
    actions = [sweep_result.rows[0].action, *(switch.after for switch in sweep_result.switches)]
    for action, (start, end) in zip(actions, itertools.pairwise(boundary_positions), strict=True):
        axes.annotate(action, ((start + end) / 2.0, 1.07), ha="center", fontsize=8, color=_GREY, annotation_clip=False)


def _draw_courses(axes: Axes, rows: Sequence[Sequence[Row]], x_axis: Axis, y_axis: Axis) -> None:
    actions = list(rows[0][0].weights)
    action_indexes = np.array([[actions.index(row.action) for row in line] for line in rows])
    colours = [_COURSE_COLOURS[index % len(_COURSE_COLOURS)] for index in range(len(actions))]
    axes.pcolormesh(
        x_axis.positions(),
        y_axis.positions(),
        action_indexes,
        cmap=ListedColormap(colours),
        vmin=-0.5,
        vmax=len(actions) - 0.5,
        shading="nearest",
        rasterized=True,
    )
    chosen_actions = [action for index, action in enumerate(actions) if (action_indexes == index).any()]
    patches = [Patch(color=colours[actions.index(action)], label=action) for action in chosen_actions]
    axes.legend(handles=patches, fontsize=8, frameon=False, loc="center left", bbox_to_anchor=(1.0, 0.5))
    _label_panel(axes, "course", x_axis, y_axis)


def _label_panel(axes: Axes, title: str, x_axis: Axis, y_axis: Axis) -> None:
    axes.set_title(title, fontsize=10, loc="left")
    x_axis.mark(axes, "x")
    y_axis.mark(axes, "y")


def _svg(figure: Figure) -> bytes:
    stream = BytesIO()
    with mpl.rc_context({"svg.hashsalt": "codra", "svg.fonttype": "none"}):
        figure.savefig(stream, format="svg", metadata={"Date": None})
    return stream.getvalue()
