"""Decisions in RAFCON state machines, whose files are read as data."""

from __future__ import annotations

import json
import shutil
from pathlib import Path

import pytest

from codra_dsl.tooling.main_execution.model import MainExecution, SourceError
from codra_dsl.tooling.main_execution.rafcon import MAX_DEPTH, read_rafcon

TENDING = Path(__file__).parents[3] / "examples/rafcon_lab/tend_pcr_cycler"


@pytest.fixture
def machine(tmp_path: Path) -> Path:
    return Path(shutil.copytree(TENDING, tmp_path / "tend"))


def read(machine: Path) -> MainExecution:
    return read_rafcon(machine, machine.parent, machine.parent)


def found_in(machine: Path) -> set[tuple[str, str, str]]:
    return {(decision.name, decision.skill, decision.role.value) for decision in read(machine).decisions}


def test_annotations_name_variables_and_skills(machine: Path) -> None:
    found = found_in(machine)

    assert ("pcr_cycler_open", "close_pcr_cycler", "precondition") in found
    assert ("pcr_cycler_open", "close_pcr_cycler", "effect") in found
    assert len(found) == 14


def test_without_annotations_states_with_the_same_script_and_inputs_ask_for_the_same_variable(machine: Path) -> None:
    for file in machine.rglob("semantic_data.json"):
        file.unlink()

    found = found_in(machine)

    assert {name for name, _, _ in found} == {
        "near_pcr_cycler_in_manipulation_distance",
        "open_pcr_cycler_open",
        "localized_robot_is_localized",
        "now_locked_pcr_cycler_locked",
    }
    assert {skill for _, skill, _ in found} == {"before", "after", "unlock", "open", "close", "lock"}


def test_the_root_state_may_be_in_the_folder_that_the_machine_names(machine: Path) -> None:
    expected = found_in(machine)
    (machine / "root").mkdir()
    for path in [path for path in machine.iterdir() if path.name not in ("root", "statemachine.json")]:
        path.rename(machine / "root" / path.name)
    (machine / "statemachine.json").write_text('{"root_state_storage_id": "root"}')

    assert found_in(machine) == expected


def test_a_state_whose_outcomes_lead_to_the_same_place_decides_on_nothing(machine: Path) -> None:
    file = machine / "Close_CLOSE/core_data.json"
    state = json.loads(file.read_text())
    for transition in state["transitions"].values():
        if transition["from_state"] == "NEAR_ASKED":
            transition |= {"to_state": "OPEN_ASKED", "to_outcome": None}
    file.write_text(json.dumps(state))

    assert {name for name, skill, _ in found_in(machine) if skill == "close_pcr_cycler"} == {"pcr_cycler_open"}


@pytest.mark.parametrize(
    ("file", "text", "place", "message"),
    [
        ("statemachine.json", "{,", "tend/statemachine.json:1:2", "this is not valid JSON"),
        ("Close_CLOSE/core_data.json", "[]", "tend/Close_CLOSE/core_data.json:1:1", "this is not a file of RAFCON"),
        ("Close_CLOSE/core_data.json", "[" * 100_000, "tend/Close_CLOSE/core_data.json:1:1", "this is not valid JSON"),
        ("Close_CLOSE/core_data.json", "9" * 5000, "tend/Close_CLOSE/core_data.json:1:1", "this is not valid JSON"),
        ("Close_CLOSE/core_data.json", " " * (9 << 20), "tend/Close_CLOSE/core_data.json:1:1", "cannot read"),
    ],
)
def test_a_file_that_cannot_be_read_is_an_error_at_its_place(
    file: str, text: str, place: str, message: str, machine: Path
) -> None:
    (machine / file).write_text(text)

    with pytest.raises(SourceError, match=message) as caught:
        read(machine)

    span = caught.value.finding.place.span
    assert f"{span.file}:{span.line}:{span.column}" == place


def test_a_link_out_of_the_project_is_not_read(machine: Path, tmp_path_factory: pytest.TempPathFactory) -> None:
    outside = tmp_path_factory.mktemp("outside") / "core_data.json"
    outside.write_text("{}")
    (machine / "Close_CLOSE/core_data.json").unlink()
    (machine / "Close_CLOSE/core_data.json").symlink_to(outside)

    with pytest.raises(SourceError, match="leads out of the project"):
        read(machine)


def test_states_that_are_too_deep_are_refused(machine: Path) -> None:
    folder = machine
    for _ in range(MAX_DEPTH + 1):
        folder /= "State"
        folder.mkdir()
        shutil.copy(TENDING / "core_data.json", folder)

    with pytest.raises(SourceError, match="states more than 30 deep"):
        read(machine)
