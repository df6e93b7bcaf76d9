"""The pictures of `lab-robustness`: P1's Figures 6 and 7 for all arms, and the confidence intervals of differences."""

from __future__ import annotations

from collections.abc import Sequence
from contextlib import AbstractContextManager
from io import StringIO
from itertools import pairwise

import matplotlib as mpl
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from codra_papers.experiments.campaign.document import Drawing
from codra_papers.experiments.campaign.statistics import Estimate
from codra_papers.experiments.lab.outcomes import Decision, Outcome
from codra_papers.experiments.lab.pictures import UNKNOWN_COLOUR
from codra_papers.experiments.lab.scoring import Piece
from codra_papers.experiments.studies.robustness.findings import (
    LIDS,
    Comparison,
    ShareFunction,
    label,
    paper_share,
    strict_share,
)

_WIDTH_IN = 11.0
_TRUTH_COLOUR, _HELD_COLOUR, _WRONG_COLOUR = "#444444", "#1f5fa8", "#f59a80"
_RING_COLOUR, _WRONG_RING_COLOUR = "#1f5fa8", "#d100b8"


def timeline(outcome: Outcome, variable: str, caption: str) -> Drawing:
    """Draw the true value of a variable over a run, and the value that each arm held (Figure 6).

    The background of an arm is red while the value of the arm is wrong.
    """
    with _style():
        figure, _ = _timelines(outcome, variable)
        _legend(figure, [Line2D([], [], color=_HELD_COLOUR, label="held")])
        return Drawing(caption=caption, svg=_svg(figure))


def decisions(outcome: Outcome, variable: str, caption: str) -> Drawing:
    """Draw the timeline of a variable, with rings at the decisions on this variable (Figure 7).

    Each ring is drawn at the value that the arm held, and is a magenta disc if the value was wrong. If the value was
    unknown, the ring is half-way between false and true.
    """
    with _style():
        figure, rows = _timelines(outcome, variable)
        variable_decisions = [decision for decision in outcome.decisions if decision.variable == variable]
        for arm, axes in rows:
            _rings(axes, arm, variable_decisions)
        _legend(
            figure,
            [
                _ring("decision: value right or unknown", _RING_COLOUR, "none"),
                _ring("decision: value wrong", _WRONG_RING_COLOUR, _WRONG_RING_COLOUR),
            ],
        )
        return Drawing(caption=caption, svg=_svg(figure))


def _style() -> AbstractContextManager[None]:
    """Use one style in all pictures, and fixed SVG identifiers, so that equal pictures have equal texts."""
    return mpl.rc_context(
        {"svg.hashsalt": "codra", "font.size": 9.5, "axes.spines.top": False, "axes.spines.right": False}
    )


def _timelines(outcome: Outcome, variable: str) -> tuple[Figure, Sequence[tuple[str, Axes]]]:
    """Draw one row for the truth and one for each arm; return the rows of the arms."""
    figure = Figure(figsize=(_WIDTH_IN, 1.1 + 0.75 * (1 + len(outcome.arms))), layout="constrained")
    truth_axes, *arm_axes = figure.subplots(1 + len(outcome.arms), sharex=True, sharey=True)
    truth = outcome.truth[variable]
    _row(truth_axes, "truth", truth, _TRUTH_COLOUR)
    for (name, arm), axes in zip(outcome.arms.items(), arm_axes, strict=True):
        for span in arm.wrong[variable]:
            axes.axvspan(span.start_s, span.end_s, color=_WRONG_COLOUR, linewidth=0)
        _row(axes, name, arm.held[variable], _HELD_COLOUR)
    truth_axes.set_xlim(0.0, truth[-1].end_s)
    truth_axes.set_ylim(-0.35, 1.35)
    arm_axes[-1].set_xlabel(f"time in s, seed {outcome.seed}")
    truth_axes.set_title(label(variable), loc="left", fontsize=10.5)
    return figure, list(zip(outcome.arms, arm_axes, strict=True))


def _row(axes: Axes, name: str, held: Sequence[Piece], colour: str) -> None:
    for piece in held:
        if piece.value is None:
            axes.axvspan(piece.start_s, piece.end_s, color=UNKNOWN_COLOUR, linewidth=0)
    known_spans = [(piece.start_s, piece.end_s, float(bool(piece.value))) for piece in held if piece.value is not None]
    for start_s, end_s, level in known_spans:
        axes.plot([start_s, end_s], [level, level], color=colour, linewidth=2.0, solid_capstyle="butt")
    for (_, end_s, level), (start_s, _, next_level) in pairwise(known_spans):
        if end_s == start_s:
            axes.plot([start_s, start_s], [level, next_level], color=colour, linewidth=1.0)
    axes.set_yticks([0.0, 1.0], ["false", "true"])
    axes.set_ylabel(name.replace(", ", ",\n").replace(" and ", "\nand "), rotation=0, ha="right", va="center")
    axes.yaxis.set_label_coords(-0.055, 0.5)


def _rings(axes: Axes, arm: str, variable_decisions: Sequence[Decision]) -> None:
    for decision in variable_decisions:
        held = decision.held[arm]
        is_wrong = held is not None and held != decision.truth
        axes.plot(
            [decision.instant_s],
            [0.5 if held is None else float(bool(held))],
            marker="o",
            markersize=8,
            markerfacecolor=_WRONG_RING_COLOUR if is_wrong else "none",  # filled: not only the colour differs
            markeredgewidth=1.8,
            markeredgecolor=_WRONG_RING_COLOUR if is_wrong else _RING_COLOUR,
            clip_on=False,
            zorder=5,
        )


def _ring(name: str, colour: str, fill: str) -> Line2D:
    return Line2D(
        [], [], linestyle="none", marker="o", markersize=8, markerfacecolor=fill, markeredgecolor=colour, label=name
    )


def _legend(figure: Figure, first_handles: Sequence[Line2D]) -> None:
    handles = [*first_handles, Patch(color=_WRONG_COLOUR, label="wrong"), Patch(color=UNKNOWN_COLOUR, label="unknown")]
    figure.legend(handles=handles, loc="outside lower center", ncols=len(handles), frameon=False)


def forest(comparisons: Sequence[Comparison], caption: str) -> Drawing:
    """Draw the differences between arms for the variables of the two lids, each with its confidence interval."""
    lid_comparisons = [comparison for variable in LIDS for comparison in comparisons if comparison.variable == variable]
    names = [
        f"{label(comparison.variable)}: {comparison.arm} minus {comparison.other_arm}" for comparison in lid_comparisons
    ]
    with _style():
        figure = Figure(figsize=(_WIDTH_IN, 1.2 + 0.3 * len(lid_comparisons)), layout="constrained")
        panels = figure.subplots(1, 2, sharey=True)
        for axes, share_of, title in zip(panels, (paper_share, strict_share), ("ratio", "strict ratio"), strict=True):
            _differences(axes, [_estimate(comparison, share_of) for comparison in lid_comparisons])
            axes.set_xlabel(f"difference in {title}")
        panels[0].set_yticks(range(len(lid_comparisons)), names)
        panels[0].set_ylim(len(lid_comparisons) - 0.5, -0.5)
        return Drawing(caption=caption, svg=_svg(figure))


def _estimate(comparison: Comparison, share_of: ShareFunction) -> Estimate:
    return comparison.paper_difference if share_of is paper_share else comparison.strict_difference


def _differences(axes: Axes, estimates: Sequence[Estimate]) -> None:
    axes.axvline(0.0, color=_TRUTH_COLOUR, linewidth=1.0)
    for row, estimate in enumerate(estimates):
        if estimate.value is not None:
            axes.plot([estimate.value], [row], marker="o", color=_HELD_COLOUR, markersize=6)
        if estimate.low is not None and estimate.high is not None:
            axes.plot([estimate.low, estimate.high], [row, row], color=_HELD_COLOUR, linewidth=2.0)
    axes.grid(axis="x", color=UNKNOWN_COLOUR, linewidth=0.8)
    axes.set_axisbelow(True)


def _svg(figure: Figure) -> str:
    text = StringIO()
    figure.savefig(text, format="svg", metadata={"Date": None})
    return text.getvalue()
