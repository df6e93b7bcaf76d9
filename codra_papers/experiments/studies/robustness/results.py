"""All numbers of `lab-robustness` as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from codra_papers.experiments.campaign.statistics import CONFIDENCE_LEVEL, RESAMPLE_COUNT, ratio_of_sums
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.studies.robustness import paper
from codra_papers.experiments.studies.robustness.findings import (
    VARIABLES,
    Comparison,
    Runs,
    estimate_as_data,
    label,
    measures_as_data,
)
from codra_papers.experiments.studies.robustness.frames import RepeatedDetection
from codra_papers.experiments.studies.robustness.mistakes import Mistake


def runs_as_data(runs: Runs) -> Mapping[str, Any]:
    """Return the results of runs: of each run, of each variable for each arm, and of each arm."""
    return {
        "runs": [_run(outcome) for outcome in runs.outcomes],
        "variables": {label(name): {arm: _variable(runs, name, arm) for arm in runs.arms} for name in VARIABLES},
        "arms": {arm: _arm(runs, arm) for arm in runs.arms},
    }


def _run(outcome: Outcome) -> Mapping[str, Any]:
    return {
        "seed": outcome.seed,
        "duration_s": outcome.duration_s,
        "loops": outcome.loops,
        "error": outcome.error,
        "frames_rendered": outcome.frames,
        "frames_perceived": outcome.perceived,
        "decisions": len(outcome.decisions),
    }


def _variable(runs: Runs, name: str, arm: str) -> Mapping[str, Any]:
    window_seconds, whole_run_seconds, variable_lags, variable_causes = (
        runs.total(name, arm),
        runs.whole_run_seconds(name, arm),
        runs.lags(name, arm),
        runs.causes((name,), arm),
    )
    return {
        "window_by_run": [
            None if arm_seconds is None else asdict(arm_seconds) for arm_seconds in runs.seconds(name, arm)
        ],
        "window_total": asdict(window_seconds),
        "window_wrong_by_cause": asdict(runs.causes_in_windows(name, arm)),
        **measures_as_data(runs.total_by_truth(name, arm)),
        "runs_left_out": runs.left_out(name, arm),
        "whole_runs": asdict(whole_run_seconds),
        "wrong_by_cause": asdict(variable_causes),
        "first_known_s": list(runs.first_s(name, arm)),
        "lags_s": list(variable_lags.seen_s),
        "changes_never_seen": variable_lags.unseen,
        "preview": asdict(runs.answers((name,), arm, previews=True)),
        "monitoring": asdict(runs.answers((name,), arm, previews=False)),
    }


def _arm(runs: Runs, arm: str) -> Mapping[str, Any]:
    algorithms = sorted({name for outcome in runs.outcomes for name in outcome.arms[arm].triggers})
    return {
        "triggers": {name: sum(runs.triggers(arm, (name,))) for name in algorithms},
        "observable_trigger_shares": {name: ratio_of_sums([runs.observable_share(arm, name)]) for name in algorithms},
        "slot_s": runs.slot_s(arm),
        "wrong_by_cause": asdict(runs.causes(VARIABLES, arm)),
        "preview": asdict(runs.answers(VARIABLES, arm, previews=True)),
        "monitoring": asdict(runs.answers(VARIABLES, arm, previews=False)),
    }


def comparisons_as_data(comparisons: Sequence[Comparison]) -> Mapping[str, Any]:
    """Return the differences between arms with their intervals."""
    differences = [
        {
            "variable": label(comparison.variable),
            "arm": comparison.arm,
            "against": comparison.other_arm,
            "runs": comparison.runs,
            "paper_ratio_difference": estimate_as_data(comparison.paper_difference),
            "strict_ratio_difference": estimate_as_data(comparison.strict_difference),
        }
        for comparison in comparisons
    ]
    return {"level": CONFIDENCE_LEVEL, "resamples": RESAMPLE_COUNT, "differences": differences}


def mistakes_as_data(wrong_values: Sequence[Mistake]) -> Sequence[Mapping[str, Any]]:
    """Return wrong values at decisions, with their evidence."""
    return [
        {
            "seed": mistake.outcome.seed,
            "instant_s": mistake.decision.instant_s,
            "variable": label(mistake.decision.variable),
            "purpose": mistake.purpose,
            "skill": mistake.decision.skill,
            "arm": mistake.arm,
            "held": mistake.decision.held[mistake.arm],
            "true": mistake.decision.truth,
            "cause": mistake.cause,
            "fresh": mistake.decision.fresh[mistake.arm],
            "algorithm": mistake.basis.algorithm,
            "evidence_s": mistake.basis.evidence_s,
            "measured": dict(mistake.basis.values),
            "frame": mistake.frame or None,
        }
        for mistake in wrong_values
    ]


def detected_as_data(detected_frames: Sequence[RepeatedDetection]) -> Mapping[str, Any]:
    """Return how many frames gave the recorded evidence again, and which frames gave other evidence."""
    different_frames = [
        {
            "frame": f"{detected_frame.trial}/{detected_frame.kept.file}",
            "algorithm": detected_frame.kept.algorithm,
            "recorded": dict(detected_frame.kept.values),
        }
        | {"again": None if detected_frame.values is None else dict(detected_frame.values)}
        for detected_frame in detected_frames
        if not detected_frame.agrees
    ]
    return {
        "frames": len(detected_frames),
        "agreed": len(detected_frames) - len(different_frames),
        "different": different_frames,
    }


def paper_as_data() -> Mapping[str, Any]:
    """Return P1's numbers, with corrections."""
    return {
        "table_2": [
            {"variable": label(row.variable), "observer": row.observer}
            | {"agreement_s": list(row.agreement_s), "disagreement_s": list(row.disagreement_s)}
            | {"ratio": row.printed_ratio}
            for row in paper.TABLE_2
        ],
        "corrected": {
            "run_4_ratio_printed": paper.PRINTED_RUN_4_RATIO,
            "run_9_agreement_printed_s": paper.PRINTED_RUN_9_AGREEMENT_S,
        },
        "triggers": {"context_driven": paper.CONTEXT_DRIVEN_TRIGGERS, "naive": paper.NAIVE_TRIGGERS},
    }
