"""The laboratory's PCR-cycler, tended by a state machine of RAFCON: real frames, real perception."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from codra_dsl.integrations.rafcon import Ended, opened, register
from codra_dsl.runtime import Kind
from codra_dsl.runtime.replay import replay
from examples.rafcon_lab import drawing
from examples.rafcon_lab.comparison import Arm, comparison_table, read_figures
from examples.rafcon_lab.running import FOLDER, run
from generated import lab
from tests.runtime.journal.journals import read

SEED = 1


@pytest.fixture(scope="module")
def runs(tmp_path_factory: pytest.TempPathFactory) -> dict[Arm, tuple[Ended, Path]]:
    folder = tmp_path_factory.mktemp("journals")
    paths = {arm: folder / f"{arm}.mcap" for arm in Arm}
    return {arm: (run(arm, SEED, path), path) for arm, path in paths.items()}


def decisions_and_answers(path: Path) -> list[tuple[str, object]]:
    """Return the decisions with their answers, in order."""
    events = [event for event in read(path)[1] if event.kind is Kind.DECISION]
    return [(event.name, event.details["found" if event.what == "fell_back" else "value"]) for event in events]


def test_the_checked_in_state_machine_equals_the_one_that_is_built() -> None:
    register()
    built_machine = drawing.state_machine()

    with opened(FOLDER) as machine:
        assert machine.root_state.mutable_hash().hexdigest() == built_machine.root_state.mutable_hash().hexdigest()


def test_the_task_is_done_with_observers_and_without(runs: dict[Arm, tuple[Ended, Path]]) -> None:
    assert [(ended.outcome, ended.error) for ended, _ in runs.values()] == [("success", None)] * 2


def test_with_observers_decisions_are_answered_from_context_and_without_the_robot_looks(
    runs: dict[Arm, tuple[Ended, Path]],
) -> None:
    figures_by_arm = {arm: read_figures(path) for arm, (_, path) in runs.items()}

    assert (figures_by_arm[Arm.WITH].answered_count, figures_by_arm[Arm.WITH].looked_count) == (15, 0)
    assert (figures_by_arm[Arm.WITHOUT].answered_count, figures_by_arm[Arm.WITHOUT].looked_count) == (0, 15)
    assert figures_by_arm[Arm.WITH].duration_s < figures_by_arm[Arm.WITHOUT].duration_s


def test_both_decide_the_same(runs: dict[Arm, tuple[Ended, Path]]) -> None:
    with_observers, without = (decisions_and_answers(path) for _, path in runs.values())

    assert with_observers == without


def test_without_observers_no_perception_job_runs(runs: dict[Arm, tuple[Ended, Path]]) -> None:
    jobs = {arm: [event for event in read(path)[1] if event.kind is Kind.JOB] for arm, (_, path) in runs.items()}

    assert jobs[Arm.WITH]
    assert not jobs[Arm.WITHOUT]


def test_the_journal_of_the_state_machine_can_be_replayed(runs: dict[Arm, tuple[Ended, Path]]) -> None:
    head, events = read(runs[Arm.WITH][1])

    assert replay(head, events, lab.MODEL, lab.Lab, None).difference is None


def test_the_table_has_a_line_per_run_and_per_arm(runs: dict[Arm, tuple[Ended, Path]]) -> None:
    lines = comparison_table([(SEED, arm, ended.outcome, path) for arm, (ended, path) in runs.items()]).splitlines()

    assert [line.split()[:2] for line in lines[1:-1]] == [
        ["1", "with"],
        ["1", "without"],
        ["all", "with"],
        ["all", "without"],
    ]
    assert lines[-1].startswith("with observers the task took ")


def test_every_state_that_decides_names_a_variable_of_the_spec() -> None:
    annotations = [json.loads(path.read_text("utf-8"))["codra"] for path in FOLDER.rglob("semantic_data.json")]
    names = {annotation["decide"] for annotation in annotations if "decide" in annotation}

    assert names <= {variable.name for variable in lab.MODEL.variables}
    assert len(names) == 4
