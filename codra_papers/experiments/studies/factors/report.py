"""The part of a report about the factorial design: tables, sentences and data."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from codra_papers.experiments.campaign.cells import estimate_text, interval, percent, plain_table, rounded
from codra_papers.experiments.campaign.document import Cell as TableCell
from codra_papers.experiments.campaign.document import Drawing, Section, Table, Words
from codra_papers.experiments.campaign.statistics import Estimate
from codra_papers.experiments.lab.arms import P1_TRIGGER_PERIOD_S, PRECONDITIONS
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.studies.beyond.arm_comparison import RATIO_HEADER, ratio_cells
from codra_papers.experiments.studies.factors.design import ARMS, FACTORS, NAIVE_LIDS, PACED_ARMS
from codra_papers.experiments.studies.factors.drawing import cells_picture
from codra_papers.experiments.studies.factors.findings import (
    CellFinding,
    Effect,
    cell_findings,
    effects,
    findings_as_data,
)
from codra_papers.experiments.studies.robustness import paper
from codra_papers.experiments.studies.robustness.findings import LATE_NOTE, LIDS, MEASURES_NOTE, label
from codra_papers.experiments.studies.robustness.tables import arms_table

_NOTE = (
    "Each run takes place in each combination of levels (cell), with the same seeds. The localiser answers nothing, or "
    "“closed”, if it sees the base of a machine and not the lid (P1's error). The lid of a machine is closed, or left "
    "open, between two visits. The camera of the arms is on the wrist, or on a mast from which it looks at the machine "
    "that the robot tends. The main execution looks by itself with the wrist camera and the localiser that abstains, "
    "so a run depends on neither the localiser nor the camera of the arms. As in P1, the naive arm observes only the "
    "two lids. One arm with preconditions looks as often as the spec lets it. The other arms look at a lid at most "
    f"once in {P1_TRIGGER_PERIOD_S:g} s, so that their triggers can be compared. All arms of a run, with both "
    "localisers, share one window."
)


@dataclass(frozen=True, slots=True, kw_only=True)
class FactorialReport:
    """The part of a report about the factorial design.

    Attributes:
        summary: the results in a few sentences.
        results: the results as data.
    """

    summary: Sequence[str]
    section: Section
    results: Mapping[str, Any]


def factorial_report(outcomes: Mapping[str, Outcome], camera_algorithms: Sequence[str]) -> FactorialReport:
    """Return the report on the outcomes of `factorial_trials`.

    Args:
        outcomes: the outcomes; the key is the name of the trial.
        camera_algorithms: the algorithms that look at frames.
    """
    findings = cell_findings(outcomes, camera_algorithms)
    all_effects = [
        effect
        for arm in ((NAIVE_LIDS, PRECONDITIONS) if findings else ())
        for name in LIDS
        for effect in effects(outcomes, name, arm)
    ]
    return FactorialReport(
        summary=tuple(_summary(findings, all_effects)),
        section=Section(title="Localiser, lid and camera, crossed", parts=tuple(_parts(findings, all_effects))),
        results=findings_as_data(findings, all_effects),
    )


def _parts(findings: Sequence[CellFinding], all_effects: Sequence[Effect]) -> Iterator[Words | Table | Drawing]:
    if not findings:
        yield Words(text="No runs of the factorial design.")
        return
    yield Words(text=_NOTE)
    yield cells_picture(findings)
    yield arms_table(ARMS)
    for name in LIDS:
        yield _ratio_table(findings, name)
    yield _effect_table(all_effects)
    for name in LIDS:
        yield _trigger_table(findings, name)


_WRONG_HEADER = ("wrong s", "of these, late s", "wrong at decisions", "of these, late")


def _ratio_table(findings: Sequence[CellFinding], variable: str) -> Table:
    header = (*FACTORS, "arm", *RATIO_HEADER, *_WRONG_HEADER)
    empty = (None,) * (len(header) - len(FACTORS) - 2)
    paper_rows: list[Sequence[TableCell]] = [
        ("P1", *[""] * (len(FACTORS) - 1), row.observer, f"{row.printed_ratio:.3f}", *empty)
        for row in paper.TABLE_2
        if row.variable == variable
    ]
    rows = [
        (
            *finding.cell.levels,
            finding.arm,
            _ratio_text(finding.ratio),
            *ratio_cells(finding.comparison)[2:],
            round(finding.comparison.seconds.wrong_s, 1),
            round(finding.comparison.causes.changed_since_s, 1),
            finding.comparison.answers.wrong,
            finding.comparison.answers.late,
        )
        for finding in findings
        if finding.variable == variable
    ]
    caption = (
        f"{label(variable)} in each cell, over all runs. Differences are relative to the naive arm of the same cell, "
        f"with 95 % intervals over paired runs. {MEASURES_NOTE} {LATE_NOTE}"
    )
    return plain_table(caption, header, [*paper_rows, *rows])


def _effect_table(all_effects: Sequence[Effect]) -> Table:
    rows = [
        (label(effect.variable), effect.arm, " x ".join(map(_steps_text, effect.factors)), interval(effect.estimate))
        for effect in all_effects
    ]
    caption = (
        "How much the ratio changes from the first level of a factor to its second level: the mean over the other "
        "factors and over seeds, with its 95 % interval. An interaction of two factors is half the difference between "
        "the effects that one factor has at the two levels of the other."
    )
    return plain_table(caption, ("variable", "arm", "factors", "ratio"), rows)


def _trigger_table(findings: Sequence[CellFinding], variable: str) -> Table:
    header = (*FACTORS, "arm", "lid", "preconditions true", "fewer by %", "other camera jobs", "distance polls")
    paper_rows: list[Sequence[TableCell]] = []
    if variable == "pcr_cycler_open":
        fewer_percent = 100 * (1 - paper.CONTEXT_DRIVEN_TRIGGERS / paper.NAIVE_TRIGGERS)
        levels = ("P1", *[""] * (len(FACTORS) - 1))
        paper_rows = [
            (*levels, paper.NAIVE, paper.NAIVE_TRIGGERS, None, None, None, None),
            (*levels, paper.CONTEXT_DRIVEN, paper.CONTEXT_DRIVEN_TRIGGERS, None, f"{fewer_percent:.1f}", None, None),
        ]
    rows = [
        (
            *finding.cell.levels,
            finding.arm,
            finding.triggers.lid,
            rounded(finding.triggers.observable_share, 3),
            None if finding.arm == NAIVE_LIDS.name else percent(finding.triggers.fewer),
            finding.triggers.other_camera,
            finding.triggers.distance_polls,
        )
        for finding in findings
        if finding.variable == variable
    ]
    caption = (
        f"Triggers for {label(variable)} over all runs, at equal cadence in all arms but {PRECONDITIONS.name}. Lid: "
        "jobs of the lid's algorithm. Preconditions true: the share of these jobs that were started while the "
        "preconditions of the spec were true. Fewer: the share of the naive arm's jobs that the arm saves, with its "
        "95 % interval over runs. Other camera jobs and distance polls are those of both machines; a distance poll "
        "looks at no frame."
    )
    return plain_table(caption, header, [*paper_rows, *rows])


def _summary(findings: Sequence[CellFinding], all_effects: Sequence[Effect]) -> Iterator[str]:
    """Answer which cell is nearest to P1, which factor has the largest effect, and how many triggers are saved."""
    by_cell_and_arm = {(one.cell, one.arm): one for one in findings if one.variable == "centrifuge_open"}
    naive = [one for one in by_cell_and_arm.values() if one.arm == NAIVE_LIDS.name and one.ratio.value is not None]
    if naive:
        nearest = min(naive, key=lambda one: abs((one.ratio.value or 0.0) - paper.NAIVE_RATIO))
        preconditions = by_cell_and_arm[nearest.cell, PRECONDITIONS.name]
        levels = ", ".join(f"{name} {level}" for name, level in zip(FACTORS, nearest.cell.levels, strict=True))
        yield (
            f"In the cells of localiser, lid and camera, the ratio of centrifuge_open is {_range_of(naive)} with "
            f"{NAIVE_LIDS.name}. Of these, {_ratio_text(nearest.ratio)} is nearest to P1's {paper.NAIVE_RATIO}, with "
            f"{levels}. There, it is {_ratio_text(preconditions.ratio)} with {PRECONDITIONS.name} (P1: "
            f"{paper.CONTEXT_DRIVEN_RATIO}), and {_number_text(nearest.comparison.constant_ratio)} with a constant "
            "answer."
        )
        yield f"The largest effects on this ratio: {'; '.join(_effect_texts(all_effects))}."
        saved = "; ".join(_range_text(findings, arm.name) for arm in PACED_ARMS)
        yield (
            f"Triggers of the PCR-cycler's lid that are saved against {NAIVE_LIDS.name} at equal cadence, over the "
            f"cells (P1: 79.4 %): {saved}."
        )


def _effect_texts(all_effects: Sequence[Effect]) -> Iterator[str]:
    for arm in (NAIVE_LIDS, PRECONDITIONS):
        known_effects = [
            effect
            for effect in all_effects
            if (effect.variable, effect.arm) == ("centrifuge_open", arm.name) and effect.estimate.value is not None
        ]
        if known_effects:
            largest = max(known_effects, key=lambda effect: abs(effect.estimate.value or 0.0))
            yield f"{interval(largest.estimate)} by {' x '.join(map(_steps_text, largest.factors))} with {arm.name}"


def _steps_text(factor: str) -> str:
    """Return a factor with its levels: its effect is that of the step from the first level to the second."""
    return f"{factor} ({' to '.join(FACTORS[factor])})"


def _range_of(findings: Sequence[CellFinding]) -> str:
    ratios = [finding.ratio.value for finding in findings if finding.ratio.value is not None]
    return f"{min(ratios):.3f} to {max(ratios):.3f}"


def _range_text(findings: Sequence[CellFinding], arm: str) -> str:
    shares = [
        one.triggers.fewer.value
        for one in findings
        if (one.variable, one.arm) == ("pcr_cycler_open", arm) and one.triggers.fewer.value is not None
    ]
    return f"{100 * min(shares):.1f} to {100 * max(shares):.1f} % with {arm}" if shares else f"none with {arm}"


def _ratio_text(ratio: Estimate) -> str:
    return estimate_text(ratio, "{:.3f}".format, "none")


def _number_text(value: float | None) -> str:
    return "none" if value is None else f"{value:.3f}"
