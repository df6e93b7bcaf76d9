"""What makes a comparison of arms fair: the same world, the same code with the same inputs, and nobody in the way."""

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
def by_all(tmp_path_factory: pytest.TempPathFactory) -> LabRun:
    return watched_by(ARMS, tmp_path_factory.mktemp("all"))


def happened(run: LabRun) -> list[tuple[Any, ...]]:
    """All that the main execution asked, found out and did, with its instants."""
    asked = [(one.instant_s, one.variable, one.skill, one.answer, one.answered_s, one.looked_s) for one in run.asked]
    return [*asked, *((span.name, span.start_s, span.end_s) for span in run.skills), (run.duration_s, run.error)]


def test_what_happens_in_the_world_depends_on_nobody_who_watches(by_all: LabRun, tmp_path: Path) -> None:
    by_one = watched_by((NEED,), tmp_path / "one")
    by_nobody = watched_by((), tmp_path / "nobody")

    assert happened(by_all) == happened(by_one) == happened(by_nobody)
    assert by_all.truth == by_one.truth
    assert len(by_all.asked) >= 4
    assert len(by_all.truth) == 15


def test_all_arms_call_the_functions_of_the_spec_with_the_same_arguments_and_handles() -> None:
    def calls(arm: Arm) -> list[tuple[Any, ...]]:
        spec = read_spec(SPEC)
        for edit in arm.edits:
            spec = edit(spec)
        return [(one.name, one.call, one.parameters, one.uses, one.given, one.timeout_s) for one in spec.perception]

    expected = calls(NEED)

    assert len(expected) == 7
    assert [calls(arm) for arm in ARMS] == [expected] * len(ARMS)


def test_evidence_of_the_same_instant_is_the_same_in_every_arm_that_took_it(by_all: LabRun) -> None:
    measured: dict[tuple[str, float], dict[str, Any]] = defaultdict(dict)
    for arm in by_all.arms:
        for event in arm.record.of(Kind.JOB):
            if event.what == "returned":
                measured[event.name, event.details["evidence_s"][1]][arm.name] = event.details["values"]
    shared = [found for found in measured.values() if len(found) > 1]

    assert all(len({repr(values) for values in found.values()}) == 1 for found in shared)
    assert {arm for found in shared for arm in found} == {arm.name for arm in ARMS}
    assert sum("distance" not in next(iter(found.values())) for found in shared) >= 10


def test_every_frame_that_was_rendered_was_perceived(by_all: LabRun) -> None:
    assert by_all.frames == by_all.perceived > 50


def test_another_arm_changes_nothing_of_what_an_arm_came_to(tmp_path: Path) -> None:
    def outcome(name: str, *arms: Arm) -> Outcome:
        trial = Trial(name=name, spec=SPEC, seed=SEED, arms=arms, duration_s=DURATION_S)
        return run_trial(trial, tmp_path / name)

    alone, beside = outcome("alone", NEED), outcome("beside", NAIVE, NEED)

    assert alone.arms[NEED.name] == beside.arms[NEED.name]
    assert [(one.instant_s, one.held[NEED.name], one.fresh[NEED.name]) for one in alone.decisions] == [
        (one.instant_s, one.held[NEED.name], one.fresh[NEED.name]) for one in beside.decisions
    ]
    assert alone.truth == beside.truth
    assert sum(alone.arms[NEED.name].triggers.values()) > 20
