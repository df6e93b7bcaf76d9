"""The timeline of a run: the values that each arm held, below the truth."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import Patch

from codra_papers.experiments.lab.scoring import Piece, overlaps

RIGHT_COLOUR, WRONG_COLOUR, UNKNOWN_COLOUR = "#2e9e5b", "#d1352b", "#dddddd"
TRUE_COLOUR, FALSE_COLOUR = "#33526e", "#c9d6e2"
_ROW_HEIGHT = 1.0
_STRIP_HEIGHT = 0.24


def draw_timeline(
    path: Path,
    truth: Mapping[str, Sequence[Piece]],
    arms: Mapping[str, Mapping[str, Sequence[Piece]]],
    labels: Mapping[str, str],
) -> None:
    """Draw one row per variable: a strip for the truth, and below it a strip for each arm, coloured by agreement.

    Args:
        path: the file of the picture; its suffix (`.png`, `.svg`) selects the format.
        truth: the true values of each variable.
        arms: for each arm, a mapping from each variable to the values that the arm held.
        labels: the label of each variable.
    """
    names = list(truth)
    figure = Figure(figsize=(16, 1.6 + 0.28 * len(names) * (1 + len(arms))), layout="constrained")
    axes = figure.add_subplot()
    for row, name in enumerate(names):
        top = row * _ROW_HEIGHT
        _draw_strip(axes, top, [(piece, TRUE_COLOUR if piece.value else FALSE_COLOUR) for piece in truth[name]])
        for index, held in enumerate(arms.values(), start=1):
            _draw_strip(axes, top + index * _STRIP_HEIGHT, _coloured_pieces(held[name], truth[name]))
    axes.set_yticks(
        [row * _ROW_HEIGHT + _STRIP_HEIGHT * (1 + len(arms)) / 2 for row in range(len(names))],
        [labels[n] for n in names],
    )
    axes.set_ylim(len(names) * _ROW_HEIGHT, -0.1)
    axes.set_xlim(0, max(piece.end_s for timeline in truth.values() for piece in timeline))
    axes.set_xlabel("time in s")
    axes.set_title(f"in each row from the top: truth, {', '.join(arms)}", fontsize=10, loc="left")
    colours = {
        "true": TRUE_COLOUR,
        "false": FALSE_COLOUR,
        "held, right": RIGHT_COLOUR,
        "held, wrong": WRONG_COLOUR,
        "unknown": UNKNOWN_COLOUR,
    }
    handles = [Patch(color=colour, label=label) for label, colour in colours.items()]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)
    with mpl.rc_context({"svg.hashsalt": "codra"}):
        figure.savefig(path, dpi=90, metadata={"Date": None} if path.suffix == ".svg" else None)


def _coloured_pieces(held: Sequence[Piece], truth: Sequence[Piece]) -> list[tuple[Piece, str]]:
    coloured_pieces = []
    for piece, fact, duration_s in overlaps(held, truth):
        start_s = max(piece.start_s, fact.start_s)
        colour = UNKNOWN_COLOUR if piece.value is None else RIGHT_COLOUR if piece.value == fact.value else WRONG_COLOUR
        coloured_pieces.append((Piece(start_s, start_s + duration_s, piece.value), colour))
    return coloured_pieces


def _draw_strip(axes: Axes, top: float, coloured_pieces: Sequence[tuple[Piece, str]]) -> None:
    spans = [(piece.start_s, piece.end_s - piece.start_s) for piece, _ in coloured_pieces]
    axes.broken_barh(
        spans, (top, _STRIP_HEIGHT * 0.86), facecolors=[colour for _, colour in coloured_pieces], linewidth=0
    )
