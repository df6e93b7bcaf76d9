"""`codra override` changes what a running robot knows, through the socket of its server."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

from codra_dsl.runtime import WallClock
from codra_dsl.runtime.remote import Server
from codra_dsl.runtime.values.model import integer, member, real, text
from tests.cli.test_commands import codra
from tests.runtime.forests import Manager, World, forest, variable

MODEL = forest(
    [
        variable("open"),
        variable("level", type=integer(0, 9)),
        variable("state", type=member("1", "true")),
        variable("label", type=text()),
        variable("charge", type=real()),
    ]
)


@pytest.fixture
def robot(tmp_path: Path) -> Iterator[Manager]:
    with (
        WallClock() as clock,
        Manager(MODEL, clock=clock, resources={"world": World()}) as manager,
        Server(manager, tmp_path / "robot.sock"),
    ):
        yield manager


def override(folder: Path, *arguments: str) -> tuple[int, str]:
    process = codra("override", *arguments, "--connect", "robot.sock", cwd=folder)
    return process.returncode, " ".join(process.stderr.split())


ARGUMENTS = ("--for", "10 min", "--reason", "sensor broken")


@pytest.mark.parametrize(
    ("name", "argument", "value"),
    [
        ("open", "true", True),
        ("level", "7", 7),
        ("state", "1", "1"),
        ("state", "true", "true"),
        ("label", "on", "on"),
    ],
)
def test_a_value_is_read_in_the_type_of_the_variable(
    robot: Manager, tmp_path: Path, name: str, argument: str, value: object
) -> None:
    assert override(tmp_path, name, argument, *ARGUMENTS) == (0, "")
    reading = robot.get(name)
    assert (reading.content, reading.source, reading.detail) == (value, "operator", "sensor broken")
    assert reading.expires_s - reading.evidence_s == pytest.approx(600.0)


def test_a_negative_number_follows_two_hyphens(robot: Manager, tmp_path: Path) -> None:
    process = codra("override", "--connect", "robot.sock", *ARGUMENTS, "--", "charge", "-2.5", cwd=tmp_path)

    assert (process.returncode, robot.get("charge").content) == (0, -2.5)


def test_an_override_can_make_a_variable_unknown_and_can_be_cleared(robot: Manager, tmp_path: Path) -> None:
    assert override(tmp_path, "open", "--unknown", *ARGUMENTS) == (0, "")
    assert robot.get("open").reason == "overridden"
    assert override(tmp_path, "open", "--clear") == (0, "")
    assert robot.get("open").reason == "never_observed"


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("open", *ARGUMENTS), "give either a value, or --unknown, or --clear"),
        (("open", "true", "--clear"), "give either a value, or --unknown, or --clear"),
        (("open", "true", "--for", "600", "--reason", "test"), "a duration has a unit: '600 s'"),
        (("open", "true", "--for", "forever", "--reason", "test"), "not forever"),
        (("open", "true", "--reason", "test"), "state how long the override lasts"),
        (("open", "true", "--for", "1 s"), "state why"),
        (("level", "12", *ARGUMENTS), "12 lies outside [0, 9]"),
        (("charge", "nan", *ARGUMENTS), "'nan' is not of type float"),
        (("opne", "true", *ARGUMENTS), "did you mean 'open'?"),
    ],
)
def test_a_wrong_override_is_a_usage_error(
    robot: Manager, tmp_path: Path, arguments: tuple[str, ...], message: str
) -> None:
    returncode, text_of_error = override(tmp_path, *arguments)

    assert (returncode, message in text_of_error.replace("│ ", "")) == (2, True), text_of_error
    assert robot.get("open").reason == "never_observed"


def test_a_robot_that_does_not_run_is_reported(tmp_path: Path) -> None:
    assert override(tmp_path, "open", "true", *ARGUMENTS) == (
        1,
        "codra: no manager listens at robot.sock: No such file or directory",
    )
