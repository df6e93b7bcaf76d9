"""The map of detection error as a picture."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import matplotlib as mpl
import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from codra_papers.lab.detection.rows import MapRow

_MACHINES = ("centrifuge", "pcr_cycler")
_SMALLEST_ERROR_RAD = 0.0005
"""Half of a unit in the last digit of the map. Smaller errors are drawn at this value."""
_COLOURS = ("#33526e", "#2e9e5b", "#d1352b")


def draw(rows: Sequence[MapRow], path: Path) -> None:
    """Draw a map: for each machine, the share of detected tags, and the errors of their corners and of the lid's angle.

    Args:
        rows: the rows of the map.
        path: the file to write; its suffix (`.png`, `.svg`) selects the format.
    """
    figure = Figure(figsize=(13, 7.5), layout="constrained")
    for index, machine in enumerate(_MACHINES):
        machine_rows = [row for row in rows if row.machine == machine]
        tags = [row for row in machine_rows if row.about == "tag"]
        share_axes = _draw_grid(figure.add_subplot(2, 3, 3 * index + 1), tags, [row.found_share for row in tags], 1.0)
        share_axes.set_title(f"{machine}: share of whole tags found")
        error_axes = _draw_grid(figure.add_subplot(2, 3, 3 * index + 2), tags, [row.error_median for row in tags], 1.0)
        error_axes.set_title(f"{machine}: corner error, median in px")
        _draw_lids(
            figure.add_subplot(2, 3, 3 * index + 3), [row for row in machine_rows if row.about == "lid"], machine
        )
    with mpl.rc_context({"svg.hashsalt": "codra", "svg.fonttype": "none"}):
        figure.savefig(path, dpi=80, metadata={"Date": None} if path.suffix == ".svg" else None)


def _draw_grid(axes: Axes, tags: Sequence[MapRow], values: Sequence[float | None], highest_value: float) -> Axes:
    """Draw one value for each distance and viewing angle."""
    distances = sorted({float(row.distance_m) for row in tags})
    angles = sorted({row.angle_deg for row in tags if row.angle_deg is not None})
    cells = np.full((len(angles), len(distances)), np.nan)
    for row, value in zip(tags, values, strict=True):
        if row.angle_deg is not None and value is not None:
            place = angles.index(row.angle_deg), distances.index(float(row.distance_m))
            cells[place] = value
            axes.text(place[1], place[0], f"{value:.2f}", ha="center", va="center", fontsize=8)
    axes.imshow(cells, vmin=0.0, vmax=highest_value, cmap="Blues", alpha=0.6, aspect="auto", origin="lower")
    axes.set_xticks(range(len(distances)), [f"{distance_m:g}" for distance_m in distances])
    axes.set_yticks(range(len(angles)), [str(angle) for angle in angles])
    axes.set_xlabel("distance in m")
    axes.set_ylabel("viewing angle in degrees")
    return axes


def _draw_lids(axes: Axes, lid_rows: Sequence[MapRow], machine: str) -> None:
    """Draw the error of the lid's angle over the number of tags, with two lines for each range of distances."""
    axes.set_ylim(_SMALLEST_ERROR_RAD / 1.5, 2.0)
    for colour, distance_m in zip(_COLOURS, dict.fromkeys(row.distance_m for row in lid_rows), strict=False):
        rows = [row for row in lid_rows if row.distance_m == distance_m]
        markers = [row.markers or 0 for row in rows]
        for line_style, statistic in (("o-", "95 %"), ("o:", "median")):
            errors = [row.error_p95 if statistic == "95 %" else row.error_median for row in rows]
            drawn_errors = [max(error or 0.0, _SMALLEST_ERROR_RAD) for error in errors]
            axes.plot(markers, drawn_errors, line_style, color=colour, label=f"{distance_m} m, {statistic}")
    axes.set_yscale("log")
    axes.set_xticks(range(2, 8))
    axes.set_xlabel("tags of base and lid")
    axes.set_ylabel("error in rad")
    axes.set_title(f"{machine}: lid angle")
    axes.legend(fontsize=7)
