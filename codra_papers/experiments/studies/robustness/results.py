"""All numbers of `lab-robustness` as plain data."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import asdict
from typing import Any

from codra_papers.experiments.campaign.statistics import LEVEL, RESAMPLES, ratio_of_sums
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.studies.robustness import paper
from codra_papers.experiments.studies.robustness.findings import (
    VARIABLES,
    Comparison,
    Runs,
    label,
    plain,
)
from codra_papers.experiments.studies.robustness.frames import DetectedAgain
from codra_papers.experiments.studies.robustness.mistakes import Mistake


def runs_as_data(runs: Runs) -> Mapping[str, Any]:
    """Return the results of runs: each run, each variable and arm, triggers and answers."""
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
    total, complete, lag, cause = (
        runs.total(name, arm),
        runs.complete_runs(name, arm),
        runs.lags(name, arm),
        runs.causes((name,), arm),
    )
    return {
        "window_by_run": [
            None if run_seconds is None else asdict(run_seconds) for run_seconds in runs.seconds(name, arm)
        ],
        "window_total": asdict(total),
        "paper_ratio": ratio_of_sums([total.paper]),
        "strict_ratio": ratio_of_sums([total.strict]),
        "runs_left_out": runs.left_out(name, arm),
        "whole_runs": asdict(complete),
        "wrong_by_cause": asdict(cause),
        "first_known_s": list(runs.first_s(name, arm)),
        "lags_s": list(lag.seen_s),
        "changes_never_seen": lag.unseen,
        "preview": asdict(runs.answers((name,), arm, previews=True)),
        "monitoring": asdict(runs.answers((name,), arm, previews=False)),
    }


def _arm(runs: Runs, arm: str) -> Mapping[str, Any]:
    algorithms = sorted({name for outcome in runs.outcomes for name in outcome.arms[arm].triggers})
    return {
        "triggers": {name: sum(runs.triggers(arm, (name,))) for name in algorithms},
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
            "against": comparison.against,
            "runs": comparison.runs,
            "paper_ratio_difference": plain(comparison.paper),
            "strict_ratio_difference": plain(comparison.strict),
        }
        for comparison in comparisons
    ]
    return {"level": LEVEL, "resamples": RESAMPLES, "differences": differences}


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


def detected_as_data(detected: Sequence[DetectedAgain]) -> Mapping[str, Any]:
    """Return how many frames gave the recorded evidence again, and the frames that did not."""
    different = [
        {
            "frame": f"{again.trial}/{again.kept.file}",
            "algorithm": again.kept.algorithm,
            "recorded": dict(again.kept.values),
        }
        | {"again": None if again.values is None else dict(again.values)}
        for again in detected
        if not again.agrees
    ]
    return {"frames": len(detected), "agreed": len(detected) - len(different), "different": different}


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
