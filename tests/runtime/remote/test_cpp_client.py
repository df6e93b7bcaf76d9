"""The client in C++: real programs, which g++ builds with sanitizers of memory and of data races."""

from __future__ import annotations

import json
import math
import socket
import subprocess
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as some

from codra_dsl.runtime import ContextManager, WallClock
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.remote import Server
from codra_dsl.runtime.values.model import VariableModel, boolean, integer, real, text
from tests.runtime.cycler import HOLDS
from tests.runtime.cycler import MODEL as CYCLER
from tests.runtime.door import GIVEN_NEAR, Door, Manager
from tests.runtime.remote.cpp_programs import PATIENCE_S, SOURCES, Driver, RefusedError, compile_program
from tests.test_docs import blocks

GUIDE = Path(__file__).parents[3] / "docs/how-to/cpp.md"

GIVEN = {"level": real(), "count": integer(), "word": text(), "ready": boolean()}
MODEL = replace(
    GIVEN_NEAR,
    variables=(
        *GIVEN_NEAR.variables,
        *(VariableModel(name=name, type=type_, sources=("main_execution",)) for name, type_ in GIVEN.items()),
    ),
)


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The driver, with the sanitizers of addresses, leaks and undefined behaviour."""
    folder = tmp_path_factory.mktemp("memory")
    return compile_program(SOURCES / "driver.cpp", folder, "-fsanitize=address,undefined", "-fno-sanitize-recover=all")


@pytest.fixture(scope="module")
def racing_program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The driver, with the sanitizer of data races and deadlocks."""
    return compile_program(SOURCES / "driver.cpp", tmp_path_factory.mktemp("races"), "-fsanitize=thread")


@pytest.fixture
def codra() -> Iterator[Manager]:
    door = Door(angle_rad=1.0, duration_s=0.02)
    with WallClock() as clock, ContextManager[str, str](MODEL, clock=clock, resources={"door": door}) as manager:
        manager.set("near", True)
        yield manager


@pytest.fixture
def server(codra: Manager, tmp_path: Path) -> Iterator[Server]:
    with Server(codra, tmp_path / "codra.sock") as server:
        yield server


@pytest.fixture
def driver(program: Path, server: Server) -> Iterator[Driver]:
    with Driver(program) as driver:
        driver.call("connect", path=str(server.address))
        yield driver


@contextmanager
def refused(kind: str, message: str) -> Iterator[None]:
    with pytest.raises(RefusedError) as refusal:
        yield
    assert refusal.value.args == (kind, message)


def eventually(ready: Callable[[], bool]) -> None:
    end_s = time.monotonic() + PATIENCE_S
    while not ready():
        assert time.monotonic() < end_s
        time.sleep(0.005)


def is_unreachable(driver: Driver) -> bool:
    try:
        driver.call("get", name="near")
    except RefusedError as error:
        return error.args[0] == "unreachable"
    return False


# Values


@pytest.mark.parametrize(
    ("name", "value"),
    [
        ("near", False),
        ("count", 1 - 2**63),
        ("count", 2**63 - 1),
        ("level", 0.1),
        ("level", 5e-324),
        ("level", -1.7976931348623157e308),
        ("level", 3.0),
        ("word", ""),
        ("word", 'a "quoted" \\ text,\n\t\x00\x7f ä € 😀'),
    ],
)
def test_a_value_comes_back_as_it_was_set(driver: Driver, codra: Manager, name: Any, value: object) -> None:
    driver.call("set", name=name, value=value)

    reading = codra.get(name)
    assert (reading.value, type(reading.value)) == (value, type(value))
    answer = driver.call("get", name=name)
    assert (answer["known"], answer["value"], type(answer["value"])) == (True, value, type(value))
    assert (answer["source"], answer["reason"], answer["evidence_s"]) == ("main_execution", "", reading.evidence_s)


@pytest.mark.parametrize("sign", [1, -1])
def test_infinite_values_keep_their_sign(driver: Driver, codra: Manager, sign: int) -> None:
    driver.call("set", name="level", infinite=sign)

    assert codra.get("level").value == sign * math.inf
    answer = driver.call("get", name="level")
    assert (answer["known"], answer["infinite"]) == (True, sign)
    assert "value" not in answer


def test_an_unknown_variable_has_no_value_but_a_reason(driver: Driver) -> None:
    answer = driver.call("get", name="word")

    assert "value" not in answer
    assert (answer["known"], answer["reason"]) == (False, "never_observed")


def test_neither_unknown_nor_nan_can_be_set(driver: Driver, codra: Manager) -> None:
    for value in ({}, {"nan": True}):
        with refused("malformed", "`set` needs `value`: a text, a number, or true or false"):
            driver.call("set", name="level", **value)
    assert not codra.get("level").known


# Requests


def test_declarations_and_expectations_are_those_of_the_manager(driver: Driver, codra: Manager) -> None:
    driver.call("declare", name="near", value=False)
    driver.call("declare", name="open")
    assert (codra.declared(), codra.get("near").value) == ({"near", "open"}, False)
    driver.call("withdraw", name="near")
    driver.call("withdraw", name="open")
    driver.call("expect", skills=["drive"])
    assert codra.declared() == {"near"}
    driver.call("expect", skills=[])
    assert codra.declared() == frozenset()


def test_a_skill_begins_acts_and_ends_with_its_objects(driver: Driver, codra: Manager) -> None:
    driver.call("begin", name="open_door", number=1)
    assert codra.declared() == {"near", "open"}
    driver.call("decide", name="open", wait_up_to_s=PATIENCE_S)
    driver.call("act", number=1)
    assert driver.call("get", name="open")["reason"] == "invalidated"
    driver.call("acted", number=1)
    assert driver.call("decide", name="open", wait_up_to_s=PATIENCE_S)["value"] is True
    driver.call("finish", number=1)
    driver.call("now")
    assert codra.declared() == frozenset()


def test_evidence_can_be_from_earlier_and_from_another_agent(driver: Driver, codra: Manager) -> None:
    earlier_s = driver.call("now")["now_s"]
    driver.call("set", name="near", value=False, evidence_s=earlier_s)

    assert (codra.get("near").value, codra.get("near").evidence_s) == (False, earlier_s)
    with refused("unknown_name", "the spec has no variable whose source is 'cat'"):
        driver.call("set", name="near", value=True, agent="cat")


def test_an_override_of_a_program_in_cpp_is_one_of_the_operator(driver: Driver, codra: Manager) -> None:
    driver.call("override", name="open", value=True, for_s=60, reason="sensor broken")
    assert (codra.get("open").value, codra.get("open").source) == (True, "operator")
    driver.call("override", name="open", for_s=60, reason="sensor broken")
    assert driver.call("get", name="open")["reason"] == "overridden"
    driver.call("clear_override", name="open")
    assert codra.get("open").reason != "overridden"


ERRORS: dict[str, tuple[dict[str, Any], str, str]] = {
    "unknown name": (
        {"what": "get", "name": "oben"},
        "unknown_name",
        "the spec has no variable 'oben': did you mean 'open'?",
    ),
    "not declared": (
        {"what": "set", "name": "open", "value": True},
        "not_declared",
        "'open' may be written by observer: the main execution may write the variable only while it is declared",
    ),
    "of another type": ({"what": "set", "name": "near", "value": "yes"}, "not_of_type", "'yes' is not of type bool"),
    "from the future": (
        {"what": "override", "name": "near", "value": True, "for_s": 0, "reason": "test"},
        "not_allowed",
        "an override lasts for more than 0 s and at most 24 h (86400 s): override again before it ends",
    ),
}


@pytest.mark.parametrize("error", ERRORS)
def test_an_error_names_its_kind_and_what_is_wrong(driver: Driver, error: str) -> None:
    fields, kind, message = ERRORS[error]
    with refused(kind, message):
        driver.call(**fields)
    assert driver.call("get", name="near")["value"] is True


# Decisions


def test_a_decision_that_context_answers_does_not_look(driver: Driver, codra: Manager) -> None:
    assert driver.call("decide", name="near", **{"raise": True}) == {"value": True}
    driver.call("declare", name="open")
    assert driver.call("decide", name="open", wait_up_to_s=PATIENCE_S, **{"raise": True}) == {"value": True}
    assert [event.what for event in codra.record.of(Kind.DECISION)] == ["answered", "answered"]


def test_a_decision_without_context_takes_what_the_program_finds(driver: Driver, codra: Manager) -> None:
    later_s = codra.clock.now_s() + 1000.0

    assert driver.call("decide", name="word", value="found") == {"value": "found"}
    assert driver.call("decide", name="near", since_s=later_s, value=False) == {"value": False}
    assert driver.call("decide", name="level", nan=True) == {}
    assert driver.call("decide", name="level", infinite=-1) == {"infinite": -1}
    assert (codra.get("near").value, codra.get("word").value) == (False, "found")
    with refused("not_of_type", "'high' is not of type float"):
        driver.call("decide", name="level", since_s=later_s, value="high")


def test_the_manager_learns_which_error_a_look_raised(driver: Driver, codra: Manager) -> None:
    with refused("LookError", "the camera is off"):
        driver.call("decide", name="word", **{"raise": True})

    (decision,) = codra.record.of(Kind.DECISION)
    assert decision.details["raised"].endswith("::LookError")


def test_without_a_manager_the_program_decides_by_its_own_look(driver: Driver, server: Server) -> None:
    server.close()

    eventually(lambda: driver.call("decide", name="near", value=False) == {"value": False})
    with refused("LookError", "the camera is off"):
        driver.call("decide", name="near", **{"raise": True})


def test_previews_in_cpp_are_those_of_the_manager(program: Path, tmp_path: Path) -> None:
    with (
        WallClock() as clock,
        ContextManager[str, str](CYCLER, clock=clock, resources={}) as codra,
        Server(codra, tmp_path / "codra.sock") as server,
        Driver(program) as driver,
    ):
        driver.call("connect", path=str(server.address))
        assert driver.call("preview", name="open_cycler")["outcome"] == "unknown"
        for name, value in HOLDS.items():
            codra.set(name, value)
        assert driver.call("preview", name="open_cycler") == {
            "skill": "open_cycler",
            "outcome": "holds",
            "violated": [],
            "undecided": [],
            "unknown": [],
            "looked": [],
        }
        codra.set("battery", 3.0)
        preview = driver.call("preview", name="open_cycler")
        assert (preview["outcome"], preview["violated"]) == ("violated", ["battery > 20 percent"])
        later_s = clock.now_s() + 1000.0
        preview = driver.call("preview", name="open_cycler", looks=True, since_s=later_s, value=True, nan=True)
        assert (preview["looked"], preview["outcome"]) == (list(HOLDS), "unknown")
        assert {name for name, _, _ in preview["unknown"]} == {*HOLDS}
        with refused("LookError", "the camera is off"):
            driver.call("preview", name="open_cycler", looks=True, since_s=later_s, **{"raise": True})


# Subscriptions


def test_a_subscription_reports_the_present_reading_and_each_change_until_it_ends(
    driver: Driver, codra: Manager
) -> None:
    driver.call("subscribe", variables=["near", "word"])
    readings = [driver.reading(), driver.reading()]
    assert {(reading["variable"], reading.get("value")) for reading in readings} == {("near", True), ("word", None)}
    codra.set("near", False)
    assert driver.reading()["value"] is False
    driver.call("unsubscribe", number=0)
    codra.set("near", True)
    driver.call("subscribe", variables=["near"])
    driver.call("now")
    assert driver.reading()["value"] is True
    assert driver.readings.empty()


def test_subscribers_learn_that_the_manager_is_unreachable(driver: Driver, server: Server) -> None:
    driver.call("subscribe", variables=["near"])
    assert driver.reading()["known"] is True
    server.close()

    reading = driver.reading()
    assert (reading["known"], reading["reason"], reading["detail"]) == (False, "unreachable", "the manager has closed")
    with refused("unreachable", "the manager has closed"):
        driver.call("get", name="near")


def test_a_callback_that_fails_gets_the_next_reading_as_well(program: Path, codra: Manager, server: Server) -> None:
    with Driver(program) as driver:
        driver.call("connect", path=str(server.address))
        driver.call("subscribe", variables=["near"], **{"raise": True})
        driver.reading()
        codra.set("near", False)
        assert driver.reading()["value"] is False
    assert driver.errors.splitlines() == ["codra: a callback raised (anonymous namespace)::LookError"] * 2


def test_a_callback_may_end_its_subscription_and_its_client(driver: Driver) -> None:
    driver.call("end_in_callback", variables=["near"])
    driver.call("get", name="near")
    driver.call("destroy_in_callback", variables=["near"])


# Connections


def test_what_a_client_declares_is_withdrawn_when_it_is_destroyed(driver: Driver, codra: Manager) -> None:
    driver.call("declare", name="open")
    assert codra.declared() == {"open"}
    driver.call("close")
    eventually(lambda: codra.declared() == frozenset())


def test_a_thread_renews_the_lease(program: Path, tmp_path: Path) -> None:
    with socket.socket(socket.AF_UNIX) as listener, Driver(program) as driver:
        listener.bind(str(tmp_path / "lease.sock"))
        listener.listen()
        driver.begin("connect", path=str(tmp_path / "lease.sock"), lease_s=0.3)
        peer = listener.accept()[0]
        with peer, peer.makefile("rb") as requests:
            for ask in ("hello", "keep", "keep", "keep"):
                request = json.loads(requests.readline())
                assert (request["ask"], request.get("lease_s", 0.3)) == (ask, 0.3)
                peer.sendall(json.dumps({"id": request["id"], "answer": {}}).encode() + b"\n")


def test_a_port_needs_the_token_of_the_manager(
    program: Path, codra: Manager, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with Server(codra) as server, Driver(program) as driver:
        driver.call("connect", port=server.address)
        assert driver.call("get", name="near")["value"] is True
        assert server.token_file is not None
        message = f"the first request at a port must be `hello` with the `token` in {server.token_file}"
        with refused("wrong_token", message):
            driver.call("connect", port=server.address, token="guessed")
        server.token_file.unlink()
        with refused("unreachable", f"cannot read the token of the manager from {server.token_file}"):
            driver.call("connect", port=server.address)


def test_a_place_without_a_manager_is_unreachable(program: Path, tmp_path: Path) -> None:
    path = str(tmp_path / "nobody.sock")
    with Driver(program) as driver:
        with refused("unreachable", f"no manager listens at {path}: No such file or directory"):
            driver.call("connect", path=path)
        with refused("unreachable", f"the path of the socket is too long: {'x' * 108}"):
            driver.call("connect", path="x" * 108)


READING = b'"notice":"reading","subscription":1,"reading":'


@pytest.mark.parametrize(
    ("lines", "message"),
    [
        (b"{\n", "not JSON, at byte 1: a name is missing"),
        (b"[" * 100_000 + b"\n", "not JSON, at byte 32: it is nested too deeply"),
        (b'{"notice":"closed","message":"no room"}\n', "no room"),
        (b'{"notice":"closed"}\n', "a message of the manager has no valid field `message`"),
        (b'{"notice":1}\n', "a message of the manager has no valid field `notice`"),
        (b'{"id":1,"answer":[]}\n', "a message of the manager has no valid field `answer`"),
        (b'{"id":1,"error":{"kind":1}}\n', "a message of the manager has no valid field `kind`"),
        (b"{" + READING + b'{"variable":"x"}}\n', "a message of the manager has no valid field `detail`"),
        (b'7\n[]\n{"id":"1"}\n{"id":2,"answer":{}}\n{"notice":"news"}\n', "the manager has closed the connection"),
        (b'{"id":1,"answer":{}}', "the manager has closed the connection"),
    ],
)
def test_a_manager_that_sends_something_else_is_unreachable(
    program: Path, tmp_path: Path, lines: bytes, message: str
) -> None:
    path = tmp_path / "other.sock"
    with socket.socket(socket.AF_UNIX) as listener, Driver(program) as driver:
        listener.bind(str(path))
        listener.listen()
        driver.begin("connect", path=str(path))
        peer = listener.accept()[0]
        with peer:
            assert json.loads(peer.recv(4096))["ask"] == "hello"
            peer.sendall(lines)
            peer.shutdown(socket.SHUT_WR)
            with refused("unreachable", message):
                driver.result()


def test_subscribers_learn_that_the_manager_does_not_answer(program: Path, tmp_path: Path) -> None:
    path = tmp_path / "silent.sock"
    with socket.socket(socket.AF_UNIX) as listener, Driver(program) as driver:
        listener.bind(str(path))
        listener.listen()
        driver.begin("connect", path=str(path), lease_s=0.3)
        peer = listener.accept()[0]
        with peer, peer.makefile("rb") as requests:
            assert json.loads(requests.readline())["ask"] == "hello"
            peer.sendall(b'{"id":1,"answer":{}}\n')
            driver.result()
            driver.begin("subscribe", variables=["near"])
            while (request := json.loads(requests.readline()))["ask"] == "keep":
                peer.sendall(json.dumps({"id": request["id"], "answer": {"now_s": 1}}).encode() + b"\n")
            peer.sendall(json.dumps({"id": request["id"], "answer": {"subscription": 1}}).encode() + b"\n")
            driver.result()
            reading = driver.reading()
    assert (reading["reason"], reading["detail"]) == ("unreachable", "the manager did not answer within 5 s")


@pytest.mark.parametrize("is_lost", [False, True])
def test_threads_that_share_a_client_have_no_data_race(
    racing_program: Path, codra: Manager, tmp_path: Path, is_lost: bool
) -> None:
    with ExitStack() as stack:
        server = stack.enter_context(Server(codra, tmp_path / "race.sock"))
        driver = stack.enter_context(Driver(racing_program))
        driver.call("connect", path=str(server.address))
        driver.call("subscribe", variables=["ready"], **{"raise": True})
        if is_lost:
            codra.set("ready", True)
            closing = threading.Thread(target=server.close)
            closing.start()
            eventually(lambda: is_unreachable(driver))
            closing.join()
        else:
            assert driver.call("crowd", path=str(server.address), name="ready", number=20) == {"readings": 80}
            driver.call("destroy_in_callback", variables=["near"])


# The guide


def test_the_condition_node_of_the_guide_has_the_status_of_the_latest_reading(
    codra: Manager, server: Server, tmp_path: Path
) -> None:
    """It is compiled with a few declarations like those of BehaviorTree.CPP, which is not installed here."""
    (node,) = (block.body for block in blocks(GUIDE) if block.options.get("file") == "context_is.hpp")
    (tmp_path / "context_is.hpp").write_text(node)
    program = compile_program(SOURCES / "tick.cpp", tmp_path, "-I", str(tmp_path), "-I", str(SOURCES))
    with subprocess.Popen(
        [program, str(server.address), "ready"], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        stdin, stdout = process.stdin, process.stdout

        def statuses() -> list[str]:
            stdin.write("\n")
            stdin.flush()
            return stdout.readline().split()

        assert stdout.readline() == "unknown_name\n"
        assert statuses() == ["FAILURE", "SUCCESS"]
        codra.set("ready", True)
        eventually(lambda: statuses() == ["SUCCESS", "SUCCESS"])
        codra.set("ready", False)
        eventually(lambda: statuses() == ["FAILURE", "FAILURE"])
        server.close()
        eventually(lambda: statuses() == ["FAILURE", "SUCCESS"])


# JSON


JSON_SEEDS = [
    b'{"a":[1,2.5,-3e10,"x\\u00e9\\ud83d\\ude00\\ud800",null,true,false,{"b":{}}]}',
    '{"k":"é😀\ud800x"}'.encode("utf-8", "surrogatepass"),
    rb'"\"\\\/\b\f\n\r\t\u0000"',
    b"[1e308,5e-324,-0.0,-0,9223372036854775807,9223372036854775808,-9223372036854775808,1000000000000000000000]",
    b'{"a":1,"a":2,"":[]}',
]
JSON_EXAMPLES = [
    b"",
    b" ",
    b"01",
    b"-",
    b"1.",
    b".5",
    b"1e",
    b"1e999",
    b"-1e999",
    b"9" * 400,
    b"NaN",
    b"Infinity",
    b"tru",
]
JSON_EXAMPLES += [
    b'"\x1f"',
    b'"\xc0\x80"',
    b'"\xed\xa0\x80"',
    b'"\xf4\x90\x80\x80"',
    b'"\xe0\x9f\xbf"',
    b'"\xf0\x8f\xbf\xbf"',
]
JSON_EXAMPLES += [
    b"[1,]",
    b'{"a":}',
    b'{"a":1,}',
    b"{1:2}",
    b'["a" "b"]',
    b"1 1",
    b"\xef\xbb\xbf1",
    b"\x0b1",
    b'"a',
    b'"\\',
]
JSON_EXAMPLES += [
    b'"\\u12g4"',
    b'"\\u+123"',
    b'"\\u-123"',
    b'"\\u12',
    b'"\\ude00\\ud83d"',
    b'"\\ud83d\\u0041"',
    b'"\\ud83d\\n"',
]


@some.composite
def json_lines(draw: some.DrawFn) -> bytes:
    line = bytearray(draw(some.sampled_from(JSON_SEEDS)))
    tokens = some.sampled_from([b"{", b"}", b"[", b"]", b'"', b",", b":", b"\\", b"\\u", b"0", b"e", b".", b"-", b" "])
    for _ in range(draw(some.integers(0, 4))):
        start = draw(some.integers(0, len(line)))
        end = min(len(line), start + draw(some.integers(0, 3)))
        line[start:end] = draw(tokens | some.binary(max_size=2) | some.sampled_from(JSON_SEEDS))
    return bytes(line).replace(b"\n", b"")


@pytest.fixture(scope="module")
def echo(program: Path) -> Iterator[Callable[[bytes], bytes]]:
    """A function that returns a line as the C++ code reads and writes it."""
    with subprocess.Popen([program, "echo"], stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        stdin, stdout = process.stdin, process.stdout

        def echo_line(line: bytes) -> bytes:
            stdin.write(line + b"\n")
            stdin.flush()
            return stdout.readline().removesuffix(b"\n")

        yield echo_line
        stdin.close()
        assert process.wait() == 0


def decoded(line: bytes) -> object:
    """Return what Python reads, with doubles instead of integers of more than 64 bits."""

    def refuse(constant: str) -> object:
        raise ValueError(constant)

    def finite(number: str) -> float:
        return float(number) if math.isfinite(float(number)) else refuse(number)  # type: ignore[return-value]

    def whole(number: str) -> float:
        return int(number) if -(2**63) <= int(number) < 2**63 else finite(number)

    decoder = json.JSONDecoder(parse_constant=refuse, parse_float=finite, parse_int=whole)
    return decoder.decode(line.decode("utf-8", "surrogatepass"))


@settings(max_examples=600)
@given(line=json_lines())
def test_cpp_reads_and_writes_the_same_json_as_python(echo: Callable[[bytes], bytes], line: bytes) -> None:
    try:
        expected = repr(decoded(line))
    except ValueError:
        expected = "error"
    echoed = echo(line)
    assert (echoed.decode() if echoed == b"error" else repr(decoded(echoed))) == expected


for _line in JSON_EXAMPLES:
    test_cpp_reads_and_writes_the_same_json_as_python = example(line=_line)(  # type: ignore[assignment]
        test_cpp_reads_and_writes_the_same_json_as_python
    )


def test_json_that_is_nested_too_deeply_is_refused(echo: Callable[[bytes], bytes]) -> None:
    assert echo(b"[" * 32 + b"]" * 32) == b"[" * 32 + b"]" * 32
    for depth in (33, 34, 1_000_000):
        assert echo(b"[" * depth + b"]" * depth) == b"error"
        assert echo(b'{"a":' * depth) == b"error"
