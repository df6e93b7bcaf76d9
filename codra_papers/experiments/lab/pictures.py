"""The timeline of a run: skills, and for each variable the truth, decisions, and the values that each arm held."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from codra_papers.experiments.lab.fanout import AskedDecision
from codra_papers.experiments.lab.run import LabRun
from codra_papers.experiments.lab.scoring import Piece, overlaps

UNKNOWN_COLOUR = "#dddddd"
RIGHT_COLOUR, WRONG_COLOUR = (
    "#56b4e9",
    "#d55e00",
)  # Okabe and Ito's: readers with any colour vision can distinguish them
TRUE_COLOUR, FALSE_COLOUR = "#222222", "#ffffff"
_SKILL_COLOURS = ("#f0e442", "#fbf7bd")
_ROW_HEIGHT = 1.0
_SKILLS_TOP = -0.45
_NAME_SHARE = 0.013
"""The least distance between two names of skills, as a share of the run."""

_MOST_SKILL_NAMES = 60
"""The names of more skills would not fit."""


def draw_timeline(path: Path, run: LabRun, labels: Mapping[str, str]) -> None:
    """Draw one row per variable: a lane for the truth, and below it a lane for each arm, coloured by agreement.

    Triangles above the truth are the decisions of the main execution on this variable. The uppermost lane has the
    skills of the main execution.

    Args:
        path: the file of the picture; its suffix (`.png`, `.svg`) selects the format.
        run: the run.
        labels: the label of each variable.
    """
    lane_names = ("truth", *(arm.name for arm in run.arms))
    lane_height = 0.72 / len(lane_names)
    figure = Figure(figsize=(16, 2.6 + 0.34 * len(run.truth) * len(lane_names)), layout="constrained")
    axes = figure.add_subplot()
    _draw_skills(axes, run)
    for row, (name, truth) in enumerate(run.truth.items()):
        top = row * _ROW_HEIGHT
        _draw_lane(
            axes,
            top,
            lane_height,
            [(piece, TRUE_COLOUR if piece.value else FALSE_COLOUR) for piece in truth],
            "#222222",
        )
        for lane, arm in enumerate(run.arms, start=1):
            _draw_lane(axes, top + lane * lane_height, lane_height, _coloured_pieces(arm.held[name], truth))
        _draw_decisions(axes, top, [decision for decision in run.asked_decisions if decision.variable == name])
    _name_lanes(axes, [labels[name] for name in run.truth], lane_names, lane_height)
    axes.set_xlim(0, run.duration_s)
    axes.set_xlabel("time in s")
    figure.legend(handles=_legend_handles(), loc="outside lower center", ncols=4, frameon=False)
    with mpl.rc_context({"svg.hashsalt": "codra"}):
        figure.savefig(path, dpi=90, metadata={"Date": None} if path.suffix == ".svg" else None)


def _name_lanes(axes: Axes, labels: Sequence[str], lane_names: Sequence[str], lane_height: float) -> None:
    """Write the names of rows on the left, and the name of each lane on the right."""
    middle = lane_height * len(lane_names) / 2
    axes.set_yticks(
        [_SKILLS_TOP + 0.12, *(row * _ROW_HEIGHT + middle for row in range(len(labels)))], ["skills", *labels]
    )
    axes.set_ylim(len(labels) * _ROW_HEIGHT, _SKILLS_TOP - 0.1)
    lanes = axes.secondary_yaxis("right")
    lanes.set_yticks(
        [
            row * _ROW_HEIGHT + (lane + 0.43) * lane_height
            for row in range(len(labels))
            for lane in range(len(lane_names))
        ],
        [*lane_names] * len(labels),
        fontsize=7,
    )
    lanes.tick_params(length=0)


def _legend_handles() -> Sequence[Patch | Line2D]:
    return (
        Patch(facecolor=TRUE_COLOUR, edgecolor=TRUE_COLOUR, label="truth: true"),
        Patch(facecolor=FALSE_COLOUR, edgecolor=TRUE_COLOUR, label="truth: false"),
        _triangle(TRUE_COLOUR, "decision: answered by context"),
        _triangle("none", "decision: the robot looked by itself"),
        Patch(color=RIGHT_COLOUR, label="held value: right"),
        Patch(color=WRONG_COLOUR, label="held value: wrong"),
        Patch(color=UNKNOWN_COLOUR, label="value unknown"),
        Patch(color=_SKILL_COLOURS[0], label="skill (two shades in turn)"),
    )


def _triangle(fill: str, label: str) -> Line2D:
    return Line2D([], [], linestyle="", marker="v", markeredgecolor=TRUE_COLOUR, markerfacecolor=fill, label=label)


def _draw_skills(axes: Axes, run: LabRun) -> None:
    """Draw the skills, and their names at their starts. A name that would cover the previous one is moved right."""
    place_s = -run.duration_s
    for index, skill in enumerate(run.skills):
        span = [(skill.start_s, skill.end_s - skill.start_s)]
        axes.broken_barh(span, (_SKILLS_TOP, 0.24), facecolors=_SKILL_COLOURS[index % 2], linewidth=0)
        axes.axvline(skill.start_s, color="#888888", linewidth=0.5, linestyle=":", zorder=0)
        if len(run.skills) <= _MOST_SKILL_NAMES:
            place_s = max(skill.start_s, place_s + _NAME_SHARE * run.duration_s)
            axes.annotate(
                skill.name,
                (place_s, _SKILLS_TOP - 0.1),
                (0, 4),
                textcoords="offset points",
                rotation=60,
                fontsize=8,
                annotation_clip=False,
            )


def _draw_decisions(axes: Axes, top: float, decisions: Sequence[AskedDecision]) -> None:
    for has_looked, fill in ((False, TRUE_COLOUR), (True, "none")):
        instants_s = [decision.instant_s for decision in decisions if decision.has_looked is has_looked]
        axes.plot(
            instants_s,
            [top - 0.1] * len(instants_s),
            "v",
            clip_on=False,
            markersize=6,
            markeredgecolor=TRUE_COLOUR,
            markerfacecolor=fill,
        )


def _coloured_pieces(held: Sequence[Piece], truth: Sequence[Piece]) -> list[tuple[Piece, str]]:
    coloured_pieces = []
    for piece, fact, duration_s in overlaps(held, truth):
        start_s = max(piece.start_s, fact.start_s)
        colour = UNKNOWN_COLOUR if piece.value is None else RIGHT_COLOUR if piece.value == fact.value else WRONG_COLOUR
        coloured_pieces.append((Piece(start_s, start_s + duration_s, piece.value), colour))
    return coloured_pieces


def _draw_lane(
    axes: Axes, top: float, height: float, coloured_pieces: Sequence[tuple[Piece, str]], outline: str = "none"
) -> None:
    spans = [(piece.start_s, piece.end_s - piece.start_s) for piece, _ in coloured_pieces]
    axes.broken_barh(
        spans,
        (top, height * 0.86),
        facecolors=[colour for _, colour in coloured_pieces],
        edgecolors=outline,
        linewidth=0 if outline == "none" else 0.6,
    )
