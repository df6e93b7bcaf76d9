"""`codra override` changes what a running robot knows, through the socket of its server."""

from __future__ import annotations

import contextlib
import math
import socket
import threading
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
        variable("count", type=integer(-(2**63) + 1, 2**63 - 1)),
        variable("gap", type=real(0.0, 5.0, unit="m")),
        variable("speed", type=real(unit="m/s")),
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
        ("label", "1.2 m/s", "1.2 m/s"),
        ("open", "False", False),
        ("level", "7.0", 7),
        ("count", "9223372036854775807", 9223372036854775807),
        ("charge", "1e3", 1000.0),
        ("charge", "inf", math.inf),
        ("gap", "30 cm", 0.3),
        ("gap", "+0.5", 0.5),
        ("speed", "1.2 m/s", 1.2),
        ("speed", "3.6 km/h", 1.0),
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
        (("open", "true", "--for", "forever", "--reason", "test"), "at most 24 h"),
        (("open", "true", "--for", "25 h", "--reason", "test"), "at most 24 h"),
        (("open", "true", "--reason", "test"), "state how long the override lasts"),
        (("open", "true", "--for", "1 s"), "state why"),
        (("level", "12", *ARGUMENTS), "12 lies outside [0, 9]"),
        (("open", "yes", *ARGUMENTS), "'yes' is not a value of 'open': write true or false"),
        (("state", "2", *ARGUMENTS), "'2' is not one of 1, true"),
        (("level", "7.5", *ARGUMENTS), "7.5 is not of type int"),
        (("level", "9" * 200, *ARGUMENTS), "a number of 665 bits is too large"),
        (("level", "7 cm", *ARGUMENTS), "'7 cm' is not a value of 'level': it has no unit, so write 7"),
        (("count", "9223372036854775808", *ARGUMENTS), "too large"),
        (("charge", "1e400", *ARGUMENTS), "1e400 is too large"),
        (("charge", "nan", *ARGUMENTS), "write --unknown in place of 'nan' to make 'charge' unknown"),
        (("gap", "30 s", *ARGUMENTS), "'30 s' is not a value of 'gap': its unit is m"),
        (("gap", "3 metres", *ARGUMENTS), "'metres' is not a unit: did you mean 'm'?"),
        (("gap", "far", *ARGUMENTS), "'far' is not a value of 'gap': write a number in m"),
        (("gap", "900 cm", *ARGUMENTS), "9.0 lies outside [0, 5]"),
        (("open", "true", "--for=-5 s", "--reason", "test"), "an override lasts for more than 0 s"),
        (("open", "true", "--for", "0 s", "--reason", "test"), "an override lasts for more than 0 s"),
        (("open", "true", "--for", "1e400 s", "--reason", "test"), "a duration is a number with ms, s, min or h"),
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


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("file.txt", "no manager listens at file.txt: Connection refused"),
        ("folder", "no manager listens at folder: Connection refused"),
        ("dead.sock", "no manager listens at dead.sock: Connection refused"),
        ("0", "no manager listens at 0: "),
        ("99999", "no manager listens at 99999: "),
        ("9" * 5000, "AF_UNIX path too long"),
        ("x" * 200, "AF_UNIX path too long"),
        ("", "no manager listens at "),
        ("foreign.sock", "the manager is gone: this line is not JSON"),
    ],
)
def test_an_address_without_a_manager_is_reported_in_one_line(tmp_path: Path, address: str, message: str) -> None:
    (tmp_path / "file.txt").touch()
    (tmp_path / "folder").mkdir()
    with socket.socket(socket.AF_UNIX) as dead_socket, socket.socket(socket.AF_UNIX) as foreign_socket:
        dead_socket.bind(str(tmp_path / "dead.sock"))
        foreign_socket.bind(str(tmp_path / "foreign.sock"))
        foreign_socket.listen()
        greeting = threading.Thread(target=greet_and_leave, args=(foreign_socket,), daemon=True)
        greeting.start()
        process = codra("override", "open", "true", *ARGUMENTS, "--connect", address, cwd=tmp_path)
    (line,) = process.stderr.splitlines()
    assert (process.returncode, message in line) == (1, True), line


def greet_and_leave(listener: socket.socket) -> None:
    with contextlib.suppress(OSError):
        connection, _ = listener.accept()
        connection.sendall(b"220 mail.example.org ready\r\n")
        connection.shutdown(socket.SHUT_WR)
        connection.recv(1 << 16)  # the command must be able to send its request
        connection.close()
