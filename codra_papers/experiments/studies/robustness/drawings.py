"""The pictures of `lab-robustness`: P1's Figures 6 and 7 for all arms, and the confidence intervals of differences."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise, product
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Patch

from codra_dsl.runtime.values.conditions import Value
from codra_papers.experiments.campaign.document import Drawing
from codra_papers.experiments.campaign.figures import figure_style, svg_of
from codra_papers.experiments.campaign.statistics import Estimate
from codra_papers.experiments.lab.outcomes import Decision, Outcome
from codra_papers.experiments.lab.pictures import UNKNOWN_COLOUR
from codra_papers.experiments.lab.scoring import Piece
from codra_papers.experiments.lab.trials import value_at
from codra_papers.experiments.studies.robustness.findings import (
    LIDS,
    Comparison,
    ShareFunction,
    label,
    paper_share,
    strict_share,
)

_WIDTH_IN = 11.0
_LANE_HEIGHT_IN, _LANE_STEP_IN, _STRIP_GAP_IN, _TOP_IN, _BOTTOM_IN = 0.62, 0.75, 0.3, 0.3, 0.55
_LEFT_SHARE, _WIDTH_SHARE = 0.15, 0.84
"""Sizes of timelines. A solver of layouts would place their many axes with rounding errors that differ each time."""

_TRUTH_COLOUR, _HELD_COLOUR, _WRONG_COLOUR = "#444444", "#1f5fa8", "#f59a80"
_RING_COLOUR, _WRONG_RING_COLOUR = "#1f5fa8", "#d100b8"
_MARKS: Mapping[str, Mapping[str, Any]] = {
    "right": {"marker": "o", "markersize": 8, "markeredgewidth": 1.8, "color": _RING_COLOUR, "markerfacecolor": "none"},
    "unknown": {"marker": "D", "markersize": 6, "color": _RING_COLOUR, "markerfacecolor": "white"},
    "wrong": {"marker": "X", "markersize": 11, "color": _WRONG_RING_COLOUR, "markeredgecolor": "black"},
}
"""The marks of decisions. They differ in shape, and not only in colour."""

_MARKS_NOTE = (
    "Each decision is marked at the value that the arm held. A ring: the value was right. A cross: it was wrong. A "
    "diamond half-way between false and true: the arm did not know the value."
)


@dataclass(frozen=True, slots=True)
class Ring:
    """The mark of a decision on a variable: the value that an arm held, and the true value at the same instant."""

    instant_s: float
    held: Value | None
    truth: Value | None

    @property
    def verdict(self) -> str:
        """Return `right`, `wrong` or `unknown`."""
        return "unknown" if self.held is None else "right" if self.held == self.truth else "wrong"


def rings(outcome: Outcome, variable: str, arm: str) -> Sequence[Ring]:
    """Return a ring for each decision on a variable.

    The ring is at the request, or at the end of the wait if the main execution waited for observers.
    """
    return [_ring(outcome, decision, arm) for decision in outcome.decisions if decision.variable == variable]


def _ring(outcome: Outcome, decision: Decision, arm: str) -> Ring:
    instant_s = decision.answered_s - decision.looked_s if decision.waited_s else decision.instant_s
    truth = value_at(outcome.truth[decision.variable], instant_s)
    return Ring(instant_s, decision.held_after_wait[arm], truth)


def timeline(outcome: Outcome, variable: str, caption: str, events: Mapping[str, float] | None = None) -> Drawing:
    """Draw the true value of a variable over a run, and the value that each arm held (Figure 6).

    The background of an arm is coloured while the value of the arm is wrong.

    Args:
        outcome: the run.
        variable: the variable.
        caption: the description of the drawing, without that of the events.
        events: instants to mark in s, each with a name.
    """
    with figure_style():
        figure, _ = _timelines(outcome, variable, tuple(outcome.arms))
        _mark_events(figure, events or {})
        _legend(figure, [Line2D([], [], color=_HELD_COLOUR, label="held")])
        return Drawing(caption=f"{caption}{_events_text(events or {})}", svg=svg_of(figure))


def decisions(
    outcome: Outcome, variable: str, caption: str, arms: Sequence[str] | None = None, strips: int = 1
) -> Drawing:
    """Draw the timeline of a variable, with rings at the decisions on this variable (Figure 7).

    Each ring is drawn at the value that the arm held. If the value was unknown, a diamond is half-way between false and
    true; if it was wrong, a magenta cross is drawn instead of the ring.

    Args:
        outcome: the run.
        variable: the variable.
        caption: the description of the drawing, without that of the marks.
        arms: the arms to draw; None for all.
        strips: the number of parts, one below the other, into which the time of the run is divided.
    """
    with figure_style():
        figure, rows = _timelines(outcome, variable, tuple(arms or outcome.arms), strips)
        for arm, axes in rows:
            _draw_rings(axes, rings(outcome, variable, arm))
        _legend(figure, [_mark(verdict) for verdict in _MARKS])
        return Drawing(caption=f"{caption} {_MARKS_NOTE}", svg=svg_of(figure))


def _timelines(
    outcome: Outcome, variable: str, arms: Sequence[str], strips: int = 1
) -> tuple[Figure, Sequence[tuple[str, Axes]]]:
    """Draw, in each strip, one lane for the truth and one for each arm; return the lanes of the arms."""
    lanes = [("truth", outcome.truth[variable]), *((name, outcome.arms[name].held[variable]) for name in arms)]
    strip_in, strip_s = len(lanes) * _LANE_STEP_IN + _STRIP_GAP_IN, outcome.duration_s / strips
    height_in = _TOP_IN + strips * strip_in + _BOTTOM_IN
    figure = Figure(figsize=(_WIDTH_IN, height_in))
    arm_lanes: list[tuple[str, Axes]] = []
    for strip, (lane, (name, held)) in product(range(strips), enumerate(lanes)):
        bottom_in = height_in - _TOP_IN - strip * strip_in - (lane + 1) * _LANE_STEP_IN
        axes = figure.add_axes((_LEFT_SHARE, bottom_in / height_in, _WIDTH_SHARE, _LANE_HEIGHT_IN / height_in))
        if lane:
            arm_lanes.append((name, axes))
            for span in outcome.arms[name].wrong[variable]:
                axes.axvspan(span.start_s, span.end_s, color=_WRONG_COLOUR, linewidth=0)
        _row(axes, name, held, _HELD_COLOUR if lane else _TRUTH_COLOUR)
        axes.set_xlim(strip * strip_s, (strip + 1) * strip_s)
        axes.set_ylim(-0.35, 1.35)
        axes.tick_params(labelbottom=lane == len(lanes) - 1)
    figure.axes[0].set_title(label(variable), loc="left", fontsize=10.5)
    figure.axes[-1].set_xlabel(f"time in s, seed {outcome.seed}")
    return figure, arm_lanes


def _mark_events(figure: Figure, events: Mapping[str, float]) -> None:
    for number, instant_s in enumerate(events.values(), 1):
        for axes in figure.axes:
            axes.axvline(instant_s, color=_TRUTH_COLOUR, linestyle=":", linewidth=1.0)
        figure.axes[0].text(instant_s, 1.4, str(number), ha="center", va="bottom")


def _events_text(events: Mapping[str, float]) -> str:
    names = "; ".join(f"{number}: {name}" for number, name in enumerate(events, 1))
    return f" Dotted lines: {names}." if names else ""


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


def _draw_rings(axes: Axes, rings: Sequence[Ring]) -> None:
    start_s, end_s = axes.get_xlim()
    for ring in rings:
        if start_s <= ring.instant_s < end_s:
            level = 0.5 if ring.held is None else float(bool(ring.held))
            order = 6 if ring.verdict == "wrong" else 5
            axes.plot([ring.instant_s], [level], clip_on=False, zorder=order, **_MARKS[ring.verdict])


def _mark(verdict: str) -> Line2D:
    return Line2D([], [], linestyle="none", label=f"decision: {verdict}", **_MARKS[verdict])


def _legend(figure: Figure, first_handles: Sequence[Line2D]) -> None:
    handles = [
        *first_handles,
        Patch(color=_WRONG_COLOUR, label="value wrong"),
        Patch(color=UNKNOWN_COLOUR, label="value unknown"),
    ]
    figure.legend(handles=handles, loc="lower center", ncols=len(handles), frameon=False)


def forest(comparisons: Sequence[Comparison], caption: str) -> Drawing:
    """Draw the differences between arms for the variables of the two lids, each with its confidence interval."""
    lid_comparisons = [comparison for variable in LIDS for comparison in comparisons if comparison.variable == variable]
    names = [
        f"{label(comparison.variable)}: {comparison.arm} minus {comparison.other_arm}" for comparison in lid_comparisons
    ]
    with figure_style():
        figure = Figure(figsize=(_WIDTH_IN, 1.2 + 0.3 * len(lid_comparisons)), layout="constrained")
        panels = figure.subplots(1, 2, sharey=True)
        for axes, share_of, title in zip(panels, (paper_share, strict_share), ("ratio", "strict ratio"), strict=True):
            _differences(axes, [_estimate(comparison, share_of) for comparison in lid_comparisons])
            axes.set_xlabel(f"difference in {title}")
        panels[0].set_yticks(range(len(lid_comparisons)), names)
        panels[0].set_ylim(len(lid_comparisons) - 0.5, -0.5)
        return Drawing(caption=caption, svg=svg_of(figure))


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
