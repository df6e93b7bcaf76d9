"""A main execution in another process: real sockets, real processes, real time."""

from __future__ import annotations

import json
import math
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from codra_dsl.runtime import ContextManager, NotDeclaredError, NotOfTypeError, UnknownNameError, WallClock
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.remote import MessageError, RemoteContext, Server
from codra_dsl.runtime.remote.json_lines import MAX_LINE_BYTES
from codra_dsl.runtime.values.model import real
from tests.runtime.door import GIVEN_NEAR, Door, Manager
from tests.runtime.forests import World, forest, given
from tests.runtime.hostile_errors import HOSTILE_ERRORS, hostile_error

ROOT = Path(__file__).parents[3]
PATIENCE_S = 60.0

PROGRAM = """
import sys
from codra_dsl.runtime.remote import RemoteContext

codra = RemoteContext(sys.argv[1], lease_s=float(sys.argv[2]))
codra.expect("drive")
with codra.skill("open_door"):
    print("under way", flush=True)
    sys.stdin.read()
"""


@pytest.fixture
def door() -> Door:
    return Door(angle_rad=1.0, duration_s=0.02)


@pytest.fixture
def codra(door: Door) -> Iterator[Manager]:
    with (
        WallClock() as clock,
        ContextManager[str, str](GIVEN_NEAR, clock=clock, resources={"door": door}) as manager,
    ):
        manager.set("near", True)
        yield manager


@pytest.fixture
def server(codra: Manager, tmp_path: Path) -> Iterator[Server]:
    with Server(codra, tmp_path / "codra.sock") as made:
        yield made


def eventually(ready: Callable[[], bool]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not ready():
        assert time.monotonic() < end_s
        time.sleep(0.005)


def main_execution(server: Server, lease_s: float) -> subprocess.Popen[str]:
    process = subprocess.Popen(
        [sys.executable, "-c", PROGRAM, str(server.address), str(lease_s)],
        cwd=ROOT,
        text=True,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
    )
    assert process.stdout is not None
    assert process.stdout.readline() == "under way\n"
    return process


def end(process: subprocess.Popen[str]) -> None:
    process.kill()
    process.communicate(timeout=PATIENCE_S)


def test_a_main_execution_elsewhere_works_as_one_in_the_same_process(server: Server, codra: Manager) -> None:
    with RemoteContext(server.address) as remote:
        assert remote.hello["skills"] == ["drive", "open_door"]
        remote.expect("open_door")
        with remote.skill("open_door") as skill:
            assert remote.decide("open", lambda: None, wait_up_to_s=PATIENCE_S) is True
            with skill.acting():
                assert not remote.get("open").known
            assert remote.decide("open", lambda: False) is False
            assert codra.get("open").value is False
        remote.declare("near", True)
        remote.set("near", False, evidence_s=remote.get("near").evidence_s)
        assert remote.get("near").value is False
        remote.withdraw("near")
        assert codra.declared() == frozenset()
    assert [event.what for event in codra.record.of(Kind.DECISION)] == ["answered", "fell_back"]


def test_errors_are_those_of_the_context_manager(server: Server) -> None:
    with RemoteContext(server.address) as remote:
        with pytest.raises(UnknownNameError, match="did you mean 'open'"):
            remote.get("oben")
        with pytest.raises(NotDeclaredError, match="while it is declared"):
            remote.set("open", value=True)
        with pytest.raises(NotOfTypeError, match="'ajar' is not of type bool"):
            remote.declare("open", "ajar")
        with pytest.raises(MessageError, match="`value` of `set` must be a text"):
            remote.set("near", None)
        assert remote.get("near").value is True


def test_numbers_of_numpy_are_values_as_in_the_program_of_the_manager(tmp_path: Path) -> None:
    model = forest([given("level", type=real(0.0, 9.0)), given("told")])
    with (
        WallClock() as clock,
        ContextManager[str, str](model, clock=clock, resources={}) as codra,
        Server(codra, tmp_path / "numpy.sock") as server,
        RemoteContext(server.address) as remote,
    ):
        remote.set("told", np.bool_(True))
        remote.declare("level", np.float32(0.5))
        assert (remote.get("told").value, remote.get("level").value) == (True, 0.5)
        remote.override("level", np.int64(4), for_s=np.float32(60.0), reason="test")
        assert remote.get("level").value == 4.0
        remote.clear_override("level")
        assert remote.decide("level", lambda: np.float64(7.0), max_age_s=np.float32(0.0)) == 7.0
        assert remote.decide("level", lambda: np.float32(math.nan), since_s=math.inf) is None
        with pytest.raises(NotOfTypeError, match="a value is a text, a number, or true or false, not this ndarray"):
            remote.decide("level", lambda: np.zeros(3), since_s=math.inf)
        looks = [(event.what, event.details.get("raised")) for event in codra.record.of(Kind.DECISION)]
        assert looks == [("fell_back", None), ("fell_back", None), ("fell_back", "NotOfTypeError")]


def test_an_error_of_looking_reaches_the_program_and_the_event_log(server: Server, codra: Manager) -> None:
    def look() -> bool:
        raise FileNotFoundError("no camera")

    with RemoteContext(server.address) as remote, pytest.raises(FileNotFoundError, match="no camera"):
        remote.decide("open", look)
    (decision,) = codra.record.of(Kind.DECISION)
    assert decision.details["raised"] == "FileNotFoundError"


def test_a_subscriber_elsewhere_is_called_with_each_reading(server: Server, codra: Manager) -> None:
    values: list[Any] = []
    with RemoteContext(server.address) as remote:
        unsubscribe = remote.subscribe("near", lambda reading: values.append(reading.content))
        for value in (False, True, False):
            codra.set("near", value)
        eventually(lambda: values[-1:] == [False] and len(values) >= 1)
        unsubscribe()
        codra.set("near", True)
        remote.get("near")
    assert values[-1] is False


def test_declarations_of_a_killed_main_execution_are_withdrawn(server: Server, codra: Manager) -> None:
    process = main_execution(server, lease_s=3600.0)
    assert codra.declared() == {"near", "open"}
    end(process)
    eventually(lambda: not codra.declared() and not codra.running())


def test_declarations_of_a_stopped_main_execution_are_withdrawn_when_its_lease_is_over(
    server: Server, codra: Manager
) -> None:
    process = main_execution(server, lease_s=0.3)
    os.kill(process.pid, signal.SIGSTOP)
    try:
        eventually(lambda: not codra.declared() and not codra.running())
    finally:
        os.kill(process.pid, signal.SIGCONT)
        end(process)


def test_the_heartbeat_of_a_busy_main_execution_keeps_its_lease(server: Server, codra: Manager) -> None:
    with RemoteContext(server.address, lease_s=0.3) as remote:
        remote.declare("open")
        time.sleep(1.0)
        assert codra.declared() == {"open"}


def test_without_a_manager_a_program_looks_by_itself_and_logs_it(
    codra: Manager, tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    server = Server(codra, tmp_path / "codra.sock")
    remote = RemoteContext(server.address)
    remote.declare("open")
    server.close()
    assert remote.decide("open", lambda: "seen by itself", wait_up_to_s=5.0) == "seen by itself"
    assert any(
        message.startswith("the decision on open falls back to sequential perception: ") for message in caplog.messages
    )
    with pytest.raises(ConnectionError):
        remote.get("open")
    assert codra.declared() == frozenset()


def test_connecting_raises_where_no_manager_listens(tmp_path: Path) -> None:
    with pytest.raises(ConnectionError, match=r"no manager listens at .*nobody.sock"):
        RemoteContext(tmp_path / "nobody.sock")


def raw(server: Server) -> socket.socket:
    made = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
    made.settimeout(PATIENCE_S)
    made.connect(str(server.address))
    return made


def test_invalid_lines_are_answered_with_errors_and_the_session_continues(server: Server) -> None:
    with raw(server) as peer, peer.makefile("rb") as answer_stream:
        peer.sendall(b'{"codra": 1, "ask": \n\xff\xfe\n' + b"[" * 100_000 + b'\n{"codra": NaN}\n')
        for _ in range(4):
            assert json.loads(answer_stream.readline())["error"]["kind"] == "malformed"
        peer.sendall(b'{"codra": 1, "id": "a", "ask": "keep"}\r\n')
        assert json.loads(answer_stream.readline())["id"] == "a"


def test_a_line_without_end_ends_the_session(server: Server, codra: Manager) -> None:
    with raw(server) as peer, peer.makefile("rb") as answers:
        peer.sendall(b'{"codra": 1, "id": 1, "ask": "declare", "variable": "open"}\n')
        assert json.loads(answers.readline())["answer"] == {}
        peer.sendall(b" " * (MAX_LINE_BYTES + 1))
        assert json.loads(answers.readline())["message"] == f"a request may have at most {MAX_LINE_BYTES} bytes"
        assert answers.readline() == b""
    eventually(lambda: not codra.declared())


def test_a_socket_that_a_dead_manager_left_behind_is_taken_over(codra: Manager, tmp_path: Path) -> None:
    path = tmp_path / "codra.sock"
    with socket.socket(socket.AF_UNIX, socket.SOCK_STREAM) as left:
        left.bind(str(path))
    with Server(codra, path) as server, RemoteContext(server.address) as remote:
        assert remote.get("near").value is True
        with pytest.raises(OSError, match="in use"):
            Server(codra, path)
    assert not path.exists()


def test_a_file_that_is_not_a_socket_is_left_alone(codra: Manager, tmp_path: Path) -> None:
    path = tmp_path / "notes.txt"
    path.write_text("mine", encoding="utf-8")
    with pytest.raises(OSError, match="in use"):
        Server(codra, path)
    assert path.read_text(encoding="utf-8") == "mine"


def test_many_threads_share_a_connection(server: Server) -> None:
    wrong: list[object] = []
    with RemoteContext(server.address) as remote:

        def ask() -> None:
            for _ in range(200):
                reading = remote.get("near")
                if reading.name != "near" or remote.get("open").name != "open":
                    wrong.append(reading)

        threads = [threading.Thread(target=ask) for _ in range(6)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(PATIENCE_S)
            assert not thread.is_alive()
    assert wrong == []


def test_a_lost_connection_does_not_hide_an_error_of_the_program(codra: Manager, tmp_path: Path) -> None:
    server = Server(codra, tmp_path / "codra.sock")
    remote = RemoteContext(server.address)

    def lose() -> None:
        with remote.skill("open_door") as skill, skill.acting():
            server.close()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        lose()


def test_a_callback_that_raises_is_called_again(server: Server, codra: Manager) -> None:
    values: list[Any] = []

    def callback(reading: Any) -> None:
        values.append(reading.content)
        raise ZeroDivisionError

    with RemoteContext(server.address) as remote:
        remote.subscribe("near", callback)
        eventually(lambda: values == [True])
        codra.set("near", False)
        eventually(lambda: values == [True, False])


def test_a_callback_that_raises_hostile_exceptions_is_called_again(server: Server, codra: Manager) -> None:
    values: list[Any] = []
    kinds = list(HOSTILE_ERRORS)

    def callback(reading: Any) -> None:
        values.append(reading.content)
        raise hostile_error(kinds[len(values) - 1])

    with RemoteContext(server.address) as remote:
        remote.subscribe("near", callback)
        for number in range(1, len(kinds)):
            eventually(lambda number=number: len(values) == number)
            codra.set("near", number % 2 == 0)
        eventually(lambda: len(values) == len(kinds))


def test_a_lease_that_is_refused_leaves_no_thread(server: Server) -> None:
    with pytest.raises(MessageError, match="lease_s"):
        RemoteContext(server.address, lease_s=-1.0)
    eventually(lambda: "codra-client" not in {thread.name for thread in threading.enumerate()})


def test_a_decision_without_limit_waits_for_context(server: Server) -> None:
    with RemoteContext(server.address) as remote:
        remote.declare("open")
        assert remote.decide("open", lambda: "looked", wait_up_to_s=float("inf")) is True


def test_a_server_that_is_closed_twice_leaves_the_next_one_alone(codra: Manager, tmp_path: Path) -> None:
    first = Server(codra, tmp_path / "codra.sock")
    first.close()
    with Server(codra, tmp_path / "codra.sock") as second:
        first.close()
        with RemoteContext(second.address) as remote:
            assert remote.get("near").known


@pytest.mark.parametrize("address", ["no/folder/codra.sock", "x" * 200, 70_000])
def test_the_error_of_an_unusable_address_names_it(codra: Manager, address: str | int) -> None:
    with pytest.raises(OSError, match=f"cannot listen at {address}"):
        Server(codra, Path(address) if isinstance(address, str) else address)
    with pytest.raises(ConnectionError, match=f"no manager listens at {address}"):
        RemoteContext(Path(address) if isinstance(address, str) else address)


def test_infinite_numbers_reach_the_manager(codra: Manager, tmp_path: Path) -> None:
    """The variable `near` is a bool, so an infinite value is refused because of its type and not as a message."""
    with Server(codra, tmp_path / "infinite.sock") as server, RemoteContext(server.address) as remote:
        with pytest.raises(NotOfTypeError, match="inf is not of type bool"):
            remote.set("near", math.inf)
        assert remote.decide("near", lambda: "looked", since_s=-math.inf) is True
        assert remote.decide("near", lambda: None, since_s=math.inf) is None


def test_a_server_removes_only_its_own_socket(codra: Manager, tmp_path: Path) -> None:
    path = tmp_path / "codra.sock"
    first = Server(codra, path)
    path.unlink()
    with Server(codra, path) as second:
        first.close()
        with RemoteContext(second.address) as remote:
            assert remote.get("near").known
        path.unlink()
        path.symlink_to(tmp_path / "target")
    assert path.is_symlink()


def test_a_look_elsewhere_that_returns_nan_has_found_no_value(tmp_path: Path) -> None:
    model = forest([given("level", type=real())])
    with (
        WallClock() as clock,
        ContextManager[str, str](model, clock=clock, resources={"world": World()}) as manager,
        Server(manager, tmp_path / "codra.sock") as server,
        RemoteContext(server.address) as remote,
    ):
        remote.declare("level")
        assert remote.decide("level", lambda: math.nan) is None
        assert not remote.get("level").known
        server.close()
        eventually(lambda: remote.decide("level", lambda: math.nan) is None)


def test_a_fork_cannot_use_the_connection_of_its_parent_and_leaves_it_alone(server: Server) -> None:
    with RemoteContext(server.address) as remote:
        child = os.fork()
        if child == 0:
            try:
                with pytest.raises(ConnectionError, match="create a `RemoteContext` in this process"):
                    remote.get("near")
                assert remote.decide("near", lambda: "looked") == "looked"
                open_files = set(Path("/proc/self/fd").iterdir())
                remote.close()
                assert len(open_files - set(Path("/proc/self/fd").iterdir())) == 1
                remote.close()
                with RemoteContext(server.address) as own:
                    assert own.get("near").known
                os._exit(0)
            finally:
                os._exit(1)
        assert os.waitpid(child, 0)[1] == 0
        assert remote.get("near").known


def test_a_fork_that_closes_a_server_leaves_the_server_of_its_parent_alone(server: Server) -> None:
    with RemoteContext(server.address) as remote:
        child = os.fork()
        if child == 0:
            try:
                server.close()
            finally:
                os._exit(0)
        os.waitpid(child, 0)
        assert remote.get("near").known
        with RemoteContext(server.address) as other:
            assert other.get("near").known
