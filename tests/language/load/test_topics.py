"""Topics of ROS 2: their messages are read from definitions, without ROS. The findings are in tests/cases."""

from __future__ import annotations

import sys
from pathlib import Path

import pytest

from codra_dsl.compiler import plan_paths
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.load import load_spec
from codra_dsl.language.load.message_types import MAX_DEFINITION_BYTES
from codra_dsl.language.model import Spec, Topic

DOOR = "{topic: /door, type: door_msgs/msg/Door, field: open}"
FOURTH_DOOR = "{topic: /door, type: door_msgs/msg/Door, field: 'open[3]'}"
BATTERY = "{topic: /battery, type: sensor_msgs/msg/BatteryState, field: percentage, scale: 100, unit: percent}"


def load(root: Path, *variables: str) -> tuple[Spec, tuple[Diagnostic, ...]]:
    lines = "".join(f"  variable_{number}: {variable}\n" for number, variable in enumerate(variables))
    (root / "spec.yaml").write_text(f"codra: 1\nname: base\nagents: {{base: {{}}}}\ncontext:\n{lines}")
    spec, findings = load_spec(root / "spec.yaml", root)
    assert spec is not None
    return spec, findings


def rule_names(root: Path, *variables: str) -> list[str]:
    return [finding.rule.name for finding in load(root, *variables)[1]]


def define(root: Path, folder: str, text: str) -> None:
    package = root / folder / "door_msgs" / "msg"
    package.mkdir(parents=True)
    (package / "Door.msg").write_text(text)


def topic_of(root: Path, variable: str) -> Topic:
    spec, findings = load(root, variable)
    topic = spec.context[0].ros
    assert findings == ()
    assert topic is not None
    return topic


def test_the_factor_converts_a_field_to_the_unit_of_the_variable(tmp_path: Path) -> None:
    odometry = "{topic: /odom, type: nav_msgs/msg/Odometry, field: pose.pose.position.x, unit: m}"
    battery = topic_of(tmp_path, f"{{type: float, unit: percent, source: base, ros: {BATTERY}}}")
    position = topic_of(tmp_path, f"{{type: float, unit: cm, source: base, ros: {odometry}}}")

    assert (battery.factor, position.factor) == (100.0, 100.0)


@pytest.mark.parametrize(
    ("source", "writer"),
    [("base", "base"), ("main_execution", "main_execution"), ("[observer, base, main_execution]", "base")],
)
def test_the_first_source_that_is_not_an_observer_writes_the_values(tmp_path: Path, source: str, writer: str) -> None:
    assert topic_of(tmp_path, f"{{type: float, unit: percent, source: {source}, ros: {BATTERY}}}").writer == writer


def test_definitions_are_found_in_the_project_and_in_its_folder_src(tmp_path: Path) -> None:
    variable = f"{{type: bool, source: base, ros: {DOOR}}}"
    without_definition = rule_names(tmp_path, variable)
    define(tmp_path, "src", "bool open\n")

    assert without_definition == ["unknown-message-type"]
    assert rule_names(tmp_path, variable) == []


def test_settings_name_other_folders_with_definitions(tmp_path: Path) -> None:
    variable = f"{{type: bool, source: base, ros: {DOOR}}}"
    define(tmp_path, "interfaces/doors", "bool open\n")
    without_setting = rule_names(tmp_path, variable)
    (tmp_path / "pyproject.toml").write_text('[tool.codra.ros]\nmessages = ["src", "interfaces/doors"]\n')

    assert without_setting == ["unknown-message-type"]
    assert rule_names(tmp_path, variable) == []


def test_definitions_outside_the_project_are_not_read(tmp_path: Path) -> None:
    root = tmp_path / "project"
    root.mkdir()
    define(tmp_path, "outside", "bool open\n")
    (root / "pyproject.toml").write_text('[tool.codra.ros]\nmessages = ["../outside"]\n')

    findings = load(root, f"{{type: bool, source: base, ros: {DOOR}}}")[1]

    assert [finding.rule.name for finding in findings] == ["unknown-message-type"]
    assert "'../outside/door_msgs/msg/Door.msg' cannot be read: it " in findings[0].message
    assert "'messages' in [tool.codra.ros]" in findings[0].help


@pytest.mark.parametrize(
    "text", ["bool[ open", "float64[" + "9" * 5000 + "] open", "\x00", "bool open\n" + "#" * MAX_DEFINITION_BYTES]
)
def test_a_definition_that_cannot_be_read_is_reported_with_its_file(tmp_path: Path, text: str) -> None:
    define(tmp_path, "src", text)

    findings = load(tmp_path, f"{{type: bool, source: base, ros: {DOOR}}}")[1]

    assert [finding.rule.name for finding in findings] == ["unknown-message-type"]
    assert "'src/door_msgs/msg/Door.msg' cannot be read" in findings[0].message


def test_a_definition_can_have_the_line_ends_of_windows(tmp_path: Path) -> None:
    define(tmp_path, "src", "# A door\r\nbool open\r\n")

    assert rule_names(tmp_path, f"{{type: bool, source: base, ros: {DOOR}}}") == []


@pytest.mark.parametrize(
    ("definition", "message"),
    [
        ("bool[0] open", "the field 'open[3]' of 'door_msgs/msg/Door' has at most 0 items, and the first is [0]"),
        ("bool[3] open", "the field 'open[3]' of 'door_msgs/msg/Door' has at most 3 items, and the first is [0]"),
        ("bool[<=3] open", "the field 'open[3]' of 'door_msgs/msg/Door' has at most 3 items, and the first is [0]"),
    ],
)
def test_an_item_past_the_end_of_a_list_is_reported(tmp_path: Path, definition: str, message: str) -> None:
    define(tmp_path, "src", definition)

    findings = load(tmp_path, f"{{type: bool, source: base, ros: {FOURTH_DOOR}}}")[1]

    assert [finding.message for finding in findings] == [message]


def test_a_list_without_bound_can_have_any_item(tmp_path: Path) -> None:
    define(tmp_path, "src", "bool[] open")

    assert rule_names(tmp_path, f"{{type: bool, source: base, ros: {FOURTH_DOOR}}}") == []


def test_an_edited_definition_is_read_again(tmp_path: Path) -> None:
    (tmp_path / "pyproject.toml").write_text("[tool.codra]\n")
    define(tmp_path, "src", "bool open\n")
    load(tmp_path, f"{{type: bool, source: base, ros: {DOOR}}}")
    before = plan_paths([tmp_path / "spec.yaml"], tmp_path)
    (tmp_path / "src/door_msgs/msg/Door.msg").write_text("bool closed\n")
    after = plan_paths([tmp_path / "spec.yaml"], tmp_path)

    assert "unknown-message-field" not in [finding.rule.name for finding in before.diagnostics]
    assert "unknown-message-field" in [finding.rule.name for finding in after.diagnostics]


def test_without_rosbags_one_finding_names_all_variables_that_are_not_checked(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "rosbags.typesys", None)
    misspelt = "{topic: /battery, type: sensor_msgs/msg/BatteryState, field: percentag}"

    spec, findings = load(
        tmp_path, f"{{type: bool, source: base, ros: {DOOR}}}", f"{{type: float, source: base, ros: {misspelt}}}"
    )

    assert [finding.rule.name for finding in findings] == ["unknown-message-type"]
    assert findings[0].message == (
        "types and fields of messages are not checked: the package 'rosbags' is not installed"
    )
    assert findings[0].help == "install codra with the extra 'ros'"
    assert [related.message for related in findings[0].related] == ["also 'variable_1'"]
    assert all(variable.ros is not None for variable in spec.context)
