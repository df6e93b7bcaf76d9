"""The picture of the factorial design: ratios and saved triggers in each cell, beside those of P1."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

from matplotlib.axes import Axes
from matplotlib.figure import Figure

from codra_papers.experiments.campaign.document import Drawing
from codra_papers.experiments.campaign.figures import figure_style, svg_of
from codra_papers.experiments.campaign.statistics import Estimate
from codra_papers.experiments.lab.arms import PRECONDITIONS
from codra_papers.experiments.studies.factors.design import CELLS, FACTORS, NAIVE_LIDS, PACED_ARMS, Cell
from codra_papers.experiments.studies.factors.findings import CellFinding
from codra_papers.experiments.studies.robustness import paper

_WIDTH_IN, _HEIGHT_IN = 11.0, 5.9
_NAIVE_STYLE: dict[str, Any] = {"marker": "s", "color": "#444444"}
_PRECONDITIONS_STYLE: dict[str, Any] = {"marker": "o", "color": "#1f5fa8"}
_NEED_STYLE: dict[str, Any] = {"marker": "D", "color": "#00795c"}
_ON_EVENT_STYLE: dict[str, Any] = {"marker": "^", "color": "#b3590c"}
"""The marks of arms. They differ in shape, and not only in colour."""

_LANE = 0.16
"""The distance between the marks of two arms in a row, so that no mark hides another."""

_PAPER_STYLE: dict[str, Any] = {"color": "#777777", "linestyle": "--", "linewidth": 1.2}


def cells_picture(findings: Sequence[CellFinding]) -> Drawing:
    """Draw the ratio of `centrifuge_open`, and the saved triggers of the PCR-cycler's lid, in each cell.

    Args:
        findings: the findings of all cells that have runs.
    """
    with figure_style():
        figure = Figure(figsize=(_WIDTH_IN, _HEIGHT_IN), layout="constrained")
        ratios, triggers = figure.subplots(1, 2, sharey=True)
        for lane, (arm, style) in enumerate(((NAIVE_LIDS, _NAIVE_STYLE), (PRECONDITIONS, _PRECONDITIONS_STYLE))):
            by_cell = {finding.cell: finding.ratio for finding in _of(findings, "centrifuge_open", arm.name)}
            _draw_arm(ratios, arm.name, by_cell, style, (lane - 0.5) * _LANE)
        _draw_constant_answers(ratios, _of(findings, "centrifuge_open", NAIVE_LIDS.name))
        for arm, style in zip(PACED_ARMS, (_PRECONDITIONS_STYLE, _NEED_STYLE, _ON_EVENT_STYLE), strict=True):
            by_cell = {finding.cell: finding.triggers.fewer for finding in _of(findings, "pcr_cycler_open", arm.name)}
            _draw_arm(triggers, arm.name, by_cell, style, 0.0)
        _draw_paper(ratios, {paper.NAIVE: paper.NAIVE_RATIO, paper.CONTEXT_DRIVEN: paper.CONTEXT_DRIVEN_RATIO})
        _draw_paper(triggers, {paper.CONTEXT_DRIVEN: 1 - paper.CONTEXT_DRIVEN_TRIGGERS / paper.NAIVE_TRIGGERS})
        _label(ratios, "ratio of centrifuge_open")
        _label(triggers, "saved share of triggers of the PCR-cycler's lid")
        ratios.set_yticks(range(len(CELLS)), [", ".join(cell.levels) for cell in CELLS])
        ratios.set_ylim(len(CELLS) - 0.5, -0.5)
        ratios.set_ylabel(", ".join(FACTORS))
        return Drawing(
            caption=(
                "Each cell of the design, with 95 % intervals over runs. Dashed: P1. A black bar: the "
                "ratio of a constant answer."
            ),
            svg=svg_of(figure),
        )


def _of(findings: Sequence[CellFinding], variable: str, arm: str) -> Sequence[CellFinding]:
    return [finding for finding in findings if (finding.variable, finding.arm) == (variable, arm)]


def _draw_arm(axes: Axes, name: str, estimates: dict[Cell, Estimate], style: dict[str, Any], offset: float) -> None:
    for row, cell in zip(range(len(CELLS)), CELLS, strict=True):
        estimate = estimates.get(cell)
        if estimate is None or estimate.value is None:
            continue
        if estimate.low is not None and estimate.high is not None:
            axes.plot([estimate.low, estimate.high], [row + offset] * 2, color=style["color"], linewidth=2.0)
        axes.plot([estimate.value], [row + offset], linestyle="none", markersize=6.5, **style)
    axes.plot([], [], linestyle="none", markersize=6.5, label=name, **style)


def _draw_constant_answers(axes: Axes, findings: Sequence[CellFinding]) -> None:
    for finding in findings:
        if finding.comparison.constant_ratio is not None:
            row = CELLS.index(finding.cell)
            axes.plot([finding.comparison.constant_ratio] * 2, [row - 0.3, row + 0.3], color="black", linewidth=1.5)
    axes.plot([], [], color="black", linewidth=1.5, label="constant answer")


def _draw_paper(axes: Axes, value_by_name: dict[str, float]) -> None:
    for (name, value), side in zip(value_by_name.items(), ("right", "left"), strict=False):
        axes.axvline(value, **_PAPER_STYLE)
        axes.text(value, -0.55, name, ha=side, va="bottom", fontsize=8.5, color="#555555")


def _label(axes: Axes, title: str) -> None:
    axes.set_xlabel(title)
    axes.set_xlim(0.0, 1.02)
    axes.grid(axis="x", color="#dddddd", linewidth=0.8)
    axes.set_axisbelow(True)
    axes.legend(loc="upper left", bbox_to_anchor=(0.0, -0.12), frameon=False)
