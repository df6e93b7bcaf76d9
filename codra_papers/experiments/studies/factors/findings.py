"""The numbers of the factorial design: ratios and triggers in each cell, and the effects of the factors."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from math import fsum, prod
from typing import Any

from codra_papers.experiments.campaign.statistics import (
    Estimate,
    mean_interval,
    ratio_interval,
    ratio_of_sums,
)
from codra_papers.experiments.lab.arms import Arm
from codra_papers.experiments.lab.metrics import in_window
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.studies.beyond.arm_comparison import (
    ArmComparison,
    arm_comparison,
    arm_comparisons_as_data,
)
from codra_papers.experiments.studies.factors.design import (
    ARMS,
    CELLS,
    FACTORS,
    NAIVE_LIDS,
    Cell,
    arm_name,
    outcomes_of,
)
from codra_papers.experiments.studies.robustness.findings import LIDS, Runs, estimate_as_data, fewer_triggers

LID_ALGORITHMS: Mapping[str, str] = {name: f"localize_{name.removesuffix('_open')}_lid" for name in LIDS}
"""The algorithm of each variable of `LIDS`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Triggers:
    """The jobs that an arm started in the runs of a cell.

    Attributes:
        lid: the jobs of the algorithm of one lid.
        observable_share: the share of these jobs that were started while the preconditions of the spec were true.
        fewer: the share of the naive arm's jobs of this algorithm that the arm saves.
        other_camera: all other jobs that look at frames.
        distance_polls: the jobs that look at no frame.
    """

    lid: int
    observable_share: float | None
    fewer: Estimate
    other_camera: int
    distance_polls: int


@dataclass(frozen=True, slots=True, kw_only=True)
class CellFinding:
    """What one arm knew about one lid in the runs of a cell, and the triggers that this took.

    Attributes:
        comparison: the comparison with the naive arm of the same cell.
        ratio: the ratio of right values, with its interval over runs.
    """

    cell: Cell
    variable: str
    arm: str
    comparison: ArmComparison
    ratio: Estimate
    triggers: Triggers


def cell_findings(outcomes: Mapping[str, Outcome], camera_algorithms: Sequence[str]) -> Sequence[CellFinding]:
    """Return the findings of all cells that have runs.

    Args:
        outcomes: the outcomes of `factorial_trials`; the key is the name of the trial.
        camera_algorithms: the algorithms that look at frames.
    """
    return [
        _finding(runs, cell, variable, arm, camera_algorithms)
        for variable in LIDS
        for cell in CELLS
        for runs in [outcomes_of(cell, outcomes)]
        if runs
        for arm in ARMS
    ]


def _finding(
    outcomes: Sequence[Outcome], cell: Cell, variable: str, arm: Arm, camera_algorithms: Sequence[str]
) -> CellFinding:
    name, naive = arm_name(arm, cell.localiser), arm_name(NAIVE_LIDS, cell.localiser)
    windows = [in_window(outcome, variable, name) for outcome in outcomes]
    return CellFinding(
        cell=cell,
        variable=variable,
        arm=arm.name,
        comparison=arm_comparison(outcomes, (variable,), name, naive, camera_algorithms),
        ratio=ratio_interval([window.paper_share for window in windows if window is not None]),
        triggers=_triggers(outcomes, LID_ALGORITHMS[variable], name, naive, camera_algorithms),
    )


def _triggers(
    outcomes: Sequence[Outcome], algorithm: str, arm: str, naive: str, camera_algorithms: Sequence[str]
) -> Triggers:
    runs = Runs(outcomes)
    lid_count, camera_count = (sum(runs.triggers(arm, names)) for names in ((algorithm,), camera_algorithms))
    return Triggers(
        lid=lid_count,
        observable_share=ratio_of_sums([runs.observable_share(arm, algorithm)]),
        fewer=fewer_triggers(runs, arm, naive, (algorithm,)),
        other_camera=camera_count - lid_count,
        distance_polls=sum(sum(outcome.arms[arm].triggers.values()) for outcome in outcomes) - camera_count,
    )


# Effects


@dataclass(frozen=True, slots=True, kw_only=True)
class Effect:
    """The effect of a factor, or the interaction of several factors, on the ratio of an arm.

    The effect of one factor is the mean ratio of the cells with its second level minus that of the cells with its first
    level. The interaction of two factors is half the difference between the effects that one factor has at the two
    levels of the other.

    Attributes:
        factors: the names of the factors.
        estimate: the mean over seeds, with its interval.
    """

    factors: tuple[str, ...]
    arm: str
    variable: str
    estimate: Estimate


def effects(outcomes: Mapping[str, Outcome], variable: str, arm: Arm) -> Sequence[Effect]:
    """Return the effects of all factors and their interactions on the ratio of a variable.

    A seed takes part if the arm has a ratio in each cell.
    """
    ratios_by_cell = {
        cell: {
            outcome.seed: _ratio(outcome, variable, arm_name(arm, cell.localiser))
            for outcome in outcomes_of(cell, outcomes)
        }
        for cell in CELLS
    }
    seeds = sorted(set.intersection(*(set(ratios) for ratios in ratios_by_cell.values())))
    ratios_by_seed = [[ratios_by_cell[cell][seed] for cell in CELLS] for seed in seeds]
    complete_ratios = [[ratio for ratio in ratios if ratio is not None] for ratios in ratios_by_seed]
    return [
        Effect(
            factors=names,
            arm=arm.name,
            variable=variable,
            estimate=mean_interval(
                [_contrast(names, ratios) for ratios in complete_ratios if len(ratios) == len(CELLS)]
            ),
        )
        for count in range(1, len(FACTORS) + 1)
        for names in combinations(FACTORS, count)
    ]


def _ratio(outcome: Outcome, variable: str, arm: str) -> float | None:
    window = in_window(outcome, variable, arm)
    return None if window is None else ratio_of_sums([window.paper_share])


def _contrast(factors: tuple[str, ...], ratios: Sequence[float]) -> float:
    """Return the contrast of some factors, given the ratio of each cell in the order of `CELLS`."""
    signs = [prod(_sign(cell, factor) for factor in factors) for cell in CELLS]
    return fsum(sign * ratio for sign, ratio in zip(signs, ratios, strict=True)) / (len(CELLS) / 2)


def _sign(cell: Cell, factor: str) -> int:
    first_level, _ = FACTORS[factor]
    return -1 if cell.levels[list(FACTORS).index(factor)] == first_level else 1


# Data


def findings_as_data(findings: Sequence[CellFinding], all_effects: Sequence[Effect]) -> Mapping[str, Any]:
    """Return the findings and the effects as plain data."""
    return {
        "cells": [
            {
                **dict(zip(FACTORS, finding.cell.levels, strict=True)),
                "variable": finding.variable,
                "arm": finding.arm,
                "paper_ratio_interval": estimate_as_data(finding.ratio),
                **next(iter(arm_comparisons_as_data([finding.comparison]).values())),
                "triggers": {**asdict(finding.triggers), "fewer": estimate_as_data(finding.triggers.fewer)},
            }
            for finding in findings
        ],
        "effects": [
            {
                "factors": list(effect.factors),
                "arm": effect.arm,
                "variable": effect.variable,
                "paper_ratio_change": estimate_as_data(effect.estimate),
            }
            for effect in all_effects
        ],
    }
