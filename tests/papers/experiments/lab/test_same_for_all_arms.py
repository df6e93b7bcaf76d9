"""The conditions of a fair comparison: arms have the same world, code and inputs, and do not influence each other."""

from __future__ import annotations

from collections import defaultdict
from pathlib import Path
from typing import Any

import pytest

from codra_dsl.integrations.inspection import read_spec
from codra_dsl.runtime.journal import Kind
from codra_papers.experiments.lab.arms import NAIVE, NEED, Arm, observers
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.lab.run import LabRun, LabSettings, run_lab
from codra_papers.experiments.lab.trials import Trial, run_trial
from codra_papers.experiments.studies.lab_robustness import ARMS

SPEC = Path(__file__).parents[4] / "specs" / "lab.yaml"
SEED, DURATION_S = 3, 70.0


def watched_by(arms: tuple[Arm, ...], folder: Path) -> LabRun:
    compiled = [observers(arm, read_spec(SPEC), folder / str(number)) for number, arm in enumerate(arms)]
    return run_lab(compiled, LabSettings(seed=SEED, duration_s=DURATION_S, moments=lambda _: {}))


@pytest.fixture(scope="module")
def run_of_all_arms(tmp_path_factory: pytest.TempPathFactory) -> LabRun:
    return watched_by(ARMS, tmp_path_factory.mktemp("all"))


def main_execution_events(run: LabRun) -> list[tuple[Any, ...]]:
    """Return all decisions and skills of the main execution, with their instants."""
    decisions = [
        (decision.instant_s, decision.variable, decision.skill, decision.answer, decision.answered_s, decision.looked_s)
        for decision in run.asked_decisions
    ]
    return [*decisions, *((span.name, span.start_s, span.end_s) for span in run.skills), (run.duration_s, run.error)]


def test_the_world_does_not_depend_on_the_arms_that_watch(run_of_all_arms: LabRun, tmp_path: Path) -> None:
    run_with_one_arm = watched_by((NEED,), tmp_path / "one")
    run_without_arms = watched_by((), tmp_path / "none")

    assert (
        main_execution_events(run_of_all_arms)
        == main_execution_events(run_with_one_arm)
        == main_execution_events(run_without_arms)
    )
    assert run_of_all_arms.truth == run_with_one_arm.truth
    assert len(run_of_all_arms.asked_decisions) >= 4
    assert len(run_of_all_arms.truth) == 15


def test_all_arms_call_the_functions_of_the_spec_with_the_same_arguments_and_handles() -> None:
    def calls(arm: Arm) -> list[tuple[Any, ...]]:
        spec = read_spec(SPEC)
        for edit in arm.edits:
            spec = edit(spec)
        return [
            (algorithm.name, algorithm.call, algorithm.parameters, algorithm.uses, algorithm.given, algorithm.timeout_s)
            for algorithm in spec.perception
        ]

    expected = calls(NEED)

    assert len(expected) == 7
    assert [calls(arm) for arm in ARMS] == [expected] * len(ARMS)


def test_evidence_of_the_same_instant_is_the_same_in_every_arm_that_took_it(run_of_all_arms: LabRun) -> None:
    values_by_evidence: dict[tuple[str, float], dict[str, Any]] = defaultdict(dict)
    for arm in run_of_all_arms.arms:
        for event in arm.record.of(Kind.JOB):
            if event.what == "returned":
                values_by_evidence[event.name, event.details["evidence_s"][1]][arm.name] = event.details["values"]
    values_by_arm_of_shared_evidence = [
        values_by_arm for values_by_arm in values_by_evidence.values() if len(values_by_arm) > 1
    ]

    assert all(
        len({repr(values) for values in values_by_arm.values()}) == 1
        for values_by_arm in values_by_arm_of_shared_evidence
    )
    assert {arm for values_by_arm in values_by_arm_of_shared_evidence for arm in values_by_arm} == {
        arm.name for arm in ARMS
    }
    assert (
        sum("distance" not in next(iter(values_by_arm.values())) for values_by_arm in values_by_arm_of_shared_evidence)
        >= 10
    )


def test_every_frame_that_was_rendered_was_perceived(run_of_all_arms: LabRun) -> None:
    assert run_of_all_arms.frames == run_of_all_arms.perceived > 50


def test_another_arm_does_not_change_the_outcome_of_an_arm(tmp_path: Path) -> None:
    def outcome(name: str, *arms: Arm) -> Outcome:
        trial = Trial(name=name, spec=SPEC, seed=SEED, arms=arms, duration_s=35.0)
        return run_trial(trial, tmp_path / name)

    outcome_alone, outcome_with_naive = outcome("alone", NEED), outcome("beside", NAIVE, NEED)

    assert outcome_alone.arms[NEED.name] == outcome_with_naive.arms[NEED.name]
    assert [
        (decision.instant_s, decision.held[NEED.name], decision.fresh[NEED.name])
        for decision in outcome_alone.decisions
    ] == [
        (decision.instant_s, decision.held[NEED.name], decision.fresh[NEED.name])
        for decision in outcome_with_naive.decisions
    ]
    assert outcome_alone.truth == outcome_with_naive.truth
    assert sum(outcome_alone.arms[NEED.name].triggers.values()) > 20
