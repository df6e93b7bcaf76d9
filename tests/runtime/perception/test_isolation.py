"""Perception in a separate process: its failures affect only its variables, and no process remains at the end."""

from __future__ import annotations

import contextlib
import logging
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, Literal

import numpy as np
import pytest

from codra_dsl.logic import value
from codra_dsl.runtime import CallError, ContextManager, Journal, Reason, SimClock, WallClock
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.context.model import ContextModel
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.model import Algorithm, ResourceModel, boolean, integer, text
from tests.runtime.forests import Look, Manager, events, forest, given, observer, variable
from tests.runtime.journal.journals import read

ROOT = Path(__file__).parents[3]
PATIENCE_S = 60.0
WAYS: tuple[Literal["thread", "process"], ...] = ("thread", "process")


def eye(function: str, *, name: str = "eye", **settings: Any) -> Algorithm:
    returns = {"seen": boolean(optional=True), "number": integer(optional=True), "pid": integer(optional=True)}
    settings = {"isolate": "process", "returns": {**returns, "text": text(optional=True)}, **settings}
    return Algorithm(name=name, call=f"tests.runtime.eyes:{function}", **settings)


def looking(*algorithms: Algorithm, **settings: Any) -> ContextModel:
    """Return a model in which each algorithm identifies a variable: `a` for `eye`, otherwise one named like it."""
    looks = [(algorithm, "a" if algorithm.name == "eye" else algorithm.name) for algorithm in algorithms]
    model = forest(
        [given("x"), *(variable(name) for _, name in looks)],
        *(observer(f"o_{name}", Look(algorithm, {name: value("seen")}), **settings) for algorithm, name in looks),
    )
    handles = dict.fromkeys(handle for algorithm in algorithms for handle in algorithm.handles)
    return replace(model, resources=tuple(ResourceModel(name=name) for name in handles))


@contextmanager
def started(
    model: ContextModel, clock: Clock, handles: Mapping[str, object] | None = None, **settings: Any
) -> Iterator[Manager]:
    with ContextManager[str, str](model, clock=clock, resources=handles or {}, **settings) as manager:
        for name in manager.modelled():
            manager.declare(name, value=True if name == "x" else None)
        yield manager


@pytest.fixture
def clock() -> Iterator[WallClock]:
    with WallClock() as made:
        yield made


def wait(clock: WallClock, ready: Callable[[], bool]) -> None:
    assert clock.wait_until(ready, PATIENCE_S)


def is_alive(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] != "Z"
    except FileNotFoundError:
        return False


def await_end(*pids: int) -> None:
    """Wait until processes have ended; the machine may be busy."""
    for _ in range(int(PATIENCE_S / 0.02)):
        if not any(map(is_alive, pids)):
            return
        time.sleep(0.02)
    pytest.fail(f"alive: {[pid for pid in pids if is_alive(pid)]}")


def await_no_process() -> None:
    """Wait until all ending processes have ended, including those of other tests."""
    await_end(*(process.pid for process in processes_of(os.getpid())))
    assert processes_of(os.getpid()) == []


def values(manager: Manager, algorithm: str = "eye") -> list[Any]:
    jobs = manager.record.of(Kind.JOB)
    return [event.details["values"] for event in jobs if event.name == algorithm and event.what == "returned"]


# The same as in a thread


class Camera:
    """A handle that stays in the program, since its lock cannot be sent to another process."""

    def __init__(self) -> None:
        self.edges = 3
        self.lock = threading.Lock()
        self.lens = self
        self.names = ["left", "right"]
        self.noted: list[int] = []

    def frame(self, brightness: int, *, gain: int) -> np.ndarray:
        assert self.lock.acquire(timeout=1.0)
        self.lock.release()
        return np.full((480, 640, 3), brightness * gain, np.uint8)

    def __call__(self, index: int) -> int:
        return index + 100


SAME: dict[str, dict[str, Any]] = {
    "counts": {},
    "raises": {},
    "exits": {},
    "returns_100_mb": {},
    "returns_a_long_text": {},
    "returns_a_list": {},
    "returns_nothing": {},
    "returns_a_large_number": {},
    "echoes": {"parameters": {"what": "hello"}, "handles": ("given",)},
    "asks": {"handles": ("camera", "gain")},
    "calls_the_handle": {"handles": ("camera",)},
    "NeverSetUp": {},
}


@pytest.mark.parametrize("function", SAME)
def test_in_simulated_time_a_process_and_a_thread_write_the_same_events(function: str) -> None:
    all_handles = {"camera": Camera(), "gain": np.int64(5), "given": True}
    event_texts = []
    for way in WAYS:
        algorithm = eye(function, isolate=way, timeout_s=0.5, **SAME[function])
        handles = {name: all_handles[name] for name in algorithm.handles}
        with started(looking(algorithm), SimClock(), handles, seed=3) as manager:
            manager._clock.sleep(6.3)
            event_text = manager.record.text()
        for result_values in values(manager):
            event_text = event_text.replace(f'"number": {result_values["number"]}', "").replace(
                f'"pid": {result_values["pid"]}', ""
            )
        event_texts.append(event_text)
    assert event_texts[0] == event_texts[1]
    assert event_texts[0].count('"started"') >= 6


def test_a_run_with_processes_is_replayed_from_its_journal_without_them(tmp_path: Path, clock: WallClock) -> None:
    model = looking(eye("counts", timeout_s=0.4), eye("crashes", name="b"), eye("eats_a_core", name="c", timeout_s=0.3))
    with started(model, clock, record=Journal(tmp_path / "run.mcap")) as manager:
        wait(clock, lambda: all(len(events(manager, Kind.JOB, name)) >= 4 for name in ("eye", "b", "c")))
    header, recorded_events = read(tmp_path / "run.mcap")
    replayed = replay(header, recorded_events, model, ContextManager, None)
    assert replayed.difference is None
    assert replayed.compared == sum(event.kind is not Kind.INPUT for event in recorded_events)


def test_a_process_stays_from_one_job_to_the_next(clock: WallClock) -> None:
    with started(looking(eye("counts")), clock) as manager:
        wait(clock, lambda: len(values(manager)) >= 2)
        pids = {result_values["pid"] for result_values in values(manager)}
        assert len(pids) == 1
        assert os.getpid() not in pids
    assert [result_values["number"] for result_values in values(manager)][:2] == [1, 2]
    await_end(*pids)


def test_a_job_that_is_not_needed_ends_and_its_process_stays(clock: WallClock) -> None:
    look = Look(eye("counts"), {"a": value("seen")}, [value("x")])
    with started(
        forest([given("x"), variable("a")], observer("o", look, period_s=0.01)), clock, {"world": 0}
    ) as manager:
        for _ in range(3):
            before = len(events(manager, Kind.JOB))
            wait(clock, lambda before=before: len(events(manager, Kind.JOB)) > before)
            manager.set("x", False)
            manager.set("x", True)
        wait(clock, lambda: len(values(manager)) >= 1)
        assert "voided" in events(manager, Kind.JOB)
    assert len({result_values["pid"] for result_values in values(manager)}) == 1


# Failures of a process


BAD: dict[str, tuple[Reason, str]] = {
    "raises": (Reason.FAILED, "ValueError: no picture"),
    "dies": (Reason.FAILED, "its process ended with exit code 3"),
    "crashes": (Reason.FAILED, "its process was ended by SIGSEGV"),
    "returns_100_mb": (Reason.FAILED, "returned 'seen': a bytes is not of type bool"),
    "returns_a_long_text": (
        Reason.FAILED,
        "returned 'text': a text of 100000000 characters is too long: the limit is 10000",
    ),
    "returns_much": (
        Reason.FAILED,
        "returned too much: 9017917 bytes are more than the 1048576 that a process may send",
    ),
    "eats_a_core": (Reason.TIMED_OUT, "no result within 0.3 s"),
    "floods_its_output": (Reason.TIMED_OUT, "no result within 0.3 s"),
    "floods_its_connection": (Reason.FAILED, "its process sent more than 1048576 bytes"),
    "sends_pickles": (Reason.FAILED, "its process sent an invalid message"),
    "NeverSetUp": (Reason.FAILED, "setup: ValueError: no weights"),
}


@pytest.mark.parametrize("function", BAD)
def test_a_failure_of_a_process_makes_only_its_variables_unknown_for_the_right_reason(
    function: str, clock: WallClock
) -> None:
    reason, detail = BAD[function]
    timeout_s = 0.3 if reason is Reason.TIMED_OUT else PATIENCE_S
    with started(looking(eye(function, timeout_s=timeout_s), eye("counts", name="b")), clock) as manager:
        wait(clock, lambda: manager.get("b").known and manager.get("a").reason is not Reason.NEVER_OBSERVED)
        assert (manager.get("a").reason, manager.get("a").detail) == (reason, detail)
        before = len(values(manager, "b"))
        wait(
            clock, lambda: len(values(manager, "b")) > before and events(manager, Kind.JOB, "eye").count("started") > 1
        )


def test_a_process_that_ignores_signals_is_killed_with_its_children(tmp_path: Path, clock: WallClock) -> None:
    pids = tmp_path / "pids"
    algorithm = eye("deaf", parameters={"pids": str(pids)}, timeout_s=0.5, min_interval_s=PATIENCE_S)
    with started(looking(algorithm), clock) as manager:
        wait(clock, lambda: manager.get("a").reason is Reason.TIMED_OUT)
        began = [int(line) for line in pids.read_text().split()]
        assert began
        await_end(*began)
        await_end(*(int(line) for line in pids.read_text().split()))
        assert len(pids.read_text().split()) == 3


def test_the_memory_of_a_process_is_freed_at_its_end_and_never_used_in_the_program(clock: WallClock) -> None:
    before = own_memory_mb()
    with started(looking(eye("returns_100_mb"), eye("keeps_100_mb", name="b")), clock) as manager:
        wait(clock, lambda: manager.get("a").reason is Reason.FAILED and manager.get("b").known)
        assert own_memory_mb() < before + 50
        (pid,) = [process.pid for process in processes_of(os.getpid()) if process.memory_mb > 100]
    await_end(pid)


def test_a_process_that_ended_between_two_jobs_is_replaced_unnoticed(tmp_path: Path, clock: WallClock) -> None:
    pids = tmp_path / "pids"
    with started(looking(eye("dies_when_asked", parameters={"pids": str(pids)})), clock) as manager:
        wait(clock, lambda: manager.get("a").known)
        os.kill(int(pids.read_text()), signal.SIGKILL)
        wait(clock, lambda: len(values(manager)) == 3)
        assert "failed" not in events(manager, Kind.JOB)
    assert len(set(pids.read_text().split())) == 2


def test_a_process_that_sends_nothing_in_simulated_time_times_out_at_its_timeout(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.setattr("codra_dsl.runtime.perception.process_executor.SETUP_TIMEOUT_S", 0.5)
    clock = SimClock()
    with started(looking(eye("eats_a_core", timeout_s=0.4)), clock) as manager:
        clock.sleep(1.0)
        assert (manager.get("a").reason, manager.get("a").detail) == (Reason.TIMED_OUT, "no result within 0.4 s")
        assert [event.instant_s for event in manager.record.of(Kind.JOB) if event.what == "failed"] == [0.4]


def test_the_output_of_a_process_is_logged(clock: WallClock, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "codra_dsl.perception")
    with started(looking(eye("floods_its_output", timeout_s=0.3)), clock) as manager:
        wait(clock, lambda: manager.get("a").reason is Reason.TIMED_OUT)
    wait(clock, lambda: any(message.startswith("eye: nonsense nonsense") for message in caplog.messages))
    assert sum(map(len, caplog.messages)) < 2_000_000


# Handles


def test_a_process_asks_a_handle_that_stays_in_the_program(clock: WallClock) -> None:
    camera = Camera()
    algorithm = eye("asks", handles=("camera", "gain"))
    with started(looking(algorithm), clock, {"camera": camera, "gain": 5}) as manager:
        wait(clock, lambda: manager.get("a").reason is not Reason.NEVER_OBSERVED)
        assert manager.get("a").value is True
        assert values(manager)[0]["number"] == 5
        camera.edges = 7
        wait(clock, lambda: values(manager)[-1]["number"] == 9)
    assert camera.noted == [], "a process gets a copy of a handle's attribute"


HANDLES: dict[str, tuple[Any, str]] = {
    "no attribute": (
        SimpleNamespace(edges=1),
        "AttributeError: 'types.SimpleNamespace' object has no attribute 'frame'",
    ),
    "raises": (SimpleNamespace(frame=lambda *_, **__: 1 / 0), "ZeroDivisionError: division by zero"),
    "no copy": (
        SimpleNamespace(frame=lambda *_, **__: threading.Lock()),
        "TypeError: the content of the handle: cannot be copied to another process: TypeError: cannot pickle"
        " '_thread.lock' object",
    ),
    "too large": (
        SimpleNamespace(frame=lambda *_, **__: bytes(70_000_000)),
        "ValueError: the content of the handle: 70000037 bytes are more than the 67108864 that a process can receive",
    ),
}


@pytest.mark.parametrize("what", HANDLES)
def test_an_error_of_a_handle_fails_the_job_and_the_process_stays(what: str) -> None:
    handle, message = HANDLES[what]
    clock = SimClock()
    with started(looking(eye("asks", handles=("camera", "gain"))), clock, {"camera": handle, "gain": 1}) as manager:
        clock.sleep(2.5)
        assert manager.get("a").detail == message
        assert len(processes_of(os.getpid())) == 2, "the process and its supervisor"


def test_a_process_cannot_reach_private_attributes_of_a_handle() -> None:
    clock = SimClock()
    with started(looking(eye("asks_for_what_is_hidden", handles=("camera",))), clock, {"camera": Camera()}) as manager:
        clock.sleep(0.0)
        assert manager.get("a").detail == "its process asked for a private attribute of a handle"


REFUSED: dict[str, tuple[object, str]] = {
    "class": (Camera, "it is a type: give an object with methods, or let `call` name a class with `setup`"),
    "module": (np, "it is a module: give an object with methods, or let `call` name a class with `setup`"),
    "generator": ((number for number in ()), "it is a generator: give an object with methods, or"),
    "list": ([Camera()], "it is a list whose content cannot be copied: give an object with a method instead"),
    "nothing": (object(), "it is a object without methods: give an object with a method"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_a_handle_that_a_process_cannot_use_is_refused_before_anything_runs(what: str) -> None:
    handle, message = REFUSED[what]
    with pytest.raises(
        CallError, match="perception 'eye' runs in a separate process, which cannot use handle 'camera'"
    ) as error_info:
        started(looking(eye("asks", handles=("camera",))), SimClock(), {"camera": handle}).__enter__()
    assert message in str(error_info.value)
    await_no_process()


CALLS = {
    "tests.runtime.eyes:nothing": ": AttributeError: module 'tests.runtime.eyes' has no attribute 'nothing'",
    "tests.runtime.eyes:KEPT": ", which is not a function",
    "tests.runtime.eyes:Blind": ", a class without a method 'perceive'",
    "no.such.module:look": ": ModuleNotFoundError: No module named 'no'",
    "broken_on_import:look": ": SystemExit: 4",
    "deadly_on_import:look": ": its process ended with exit code 5",
    "__main__:look": ", which its process cannot import: put the function into a module",
}


@pytest.mark.parametrize("call", CALLS)
def test_a_call_that_a_process_cannot_import_is_reported_before_anything_runs(
    call: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "broken_on_import.py").write_text("raise SystemExit(4)\n")
    (tmp_path / "deadly_on_import.py").write_text("import os; os._exit(5)\n")
    monkeypatch.syspath_prepend(tmp_path)
    model = looking(replace(eye("counts"), call=call), eye("counts", name="b"))
    with pytest.raises(CallError) as error_info:
        started(model, SimClock()).__enter__()
    assert str(error_info.value) == f"perception 'eye' calls {call!r}{CALLS[call]}"
    await_no_process()


# Classes


@pytest.mark.parametrize("way", WAYS)
def test_a_class_is_set_up_before_its_first_job_and_closed_in_the_end(way: str, tmp_path: Path) -> None:
    log, clock = tmp_path / "log", SimClock()
    algorithm = eye("Net", isolate=way, parameters={"log": str(log)}, handles=("camera",))
    with started(looking(algorithm), clock, {"camera": Camera()}) as manager:
        assert not log.exists()
        clock.sleep(2.5)
        assert [returned["number"] for returned in values(manager)] == [1, 2, 3]
    assert log.read_text().split("\n") == ["setup 3", "perceive", "perceive", "perceive", "close", ""]


def test_a_class_whose_process_is_replaced_is_set_up_again(tmp_path: Path) -> None:
    log, clock = tmp_path / "log", SimClock()
    with started(looking(eye("NetThatDies", parameters={"log": str(log)})), clock) as manager:
        clock.sleep(2.5)
        assert [event.what for event in manager.record.of(Kind.JOB)][1::2] == ["returned", "failed", "returned"]
    assert log.read_text().split() == ["setup", "perceive", "perceive", "setup", "perceive", "close"]


@pytest.mark.parametrize("way", WAYS)
def test_setting_up_may_take_longer_than_a_job_which_then_times_out(way: str, clock: WallClock) -> None:
    with started(looking(eye("SetUpLate", isolate=way, timeout_s=0.2), period_s=0.1), clock) as manager:
        wait(clock, lambda: manager.get("a").reason is Reason.TIMED_OUT)
        wait(clock, lambda: manager.get("a").known)
        assert events(manager, Kind.JOB)[:4] == ["started", "failed", "started", "returned"]


@pytest.mark.parametrize("way", WAYS)
def test_a_class_that_fails_to_close_is_logged(way: str, clock: WallClock, caplog: pytest.LogCaptureFixture) -> None:
    with started(looking(eye("NeverClosed", isolate=way)), clock) as manager:
        wait(clock, lambda: manager.get("a").known)
    assert "ValueError: no way" in caplog.text
    assert "'eye'" in caplog.text


@pytest.mark.parametrize("way", WAYS)
def test_a_class_that_is_stuck_in_close_does_not_delay_the_program(way: str, clock: WallClock) -> None:
    with started(looking(eye("StuckInClose", isolate=way)), clock) as manager:
        wait(clock, lambda: manager.get("a").known)
    assert not any(process.is_worker for process in processes_of(os.getpid()))


# The end


PROGRAM = """
import sys
from codra_dsl.runtime import Reason, WallClock
from tests.runtime.perception.test_isolation import eye, looking, started

names = ["eats_a_core", "floods_its_output", "keeps_100_mb"]
eyes = [eye(name, name=name, timeout_s=60.0) for name in names]
eyes.append(eye("deaf", name="deaf", timeout_s=60.0, parameters={"pids": sys.argv[1]}))
clock = WallClock()
context = started(looking(*eyes, eye("counts")), clock)
manager = context.__enter__()
assert clock.wait_until(lambda: manager.get("a").known and manager.get("keeps_100_mb").known, 60.0)
print("running", flush=True)
sys.stdin.readline()
if sys.argv[2] == "closes":
    manager.close()
print("end", flush=True)
"""


@pytest.mark.parametrize("end", ["closes", "just ends", "is killed"])
def test_soon_after_the_program_ended_none_of_its_processes_is_running(end: str, tmp_path: Path) -> None:
    pids = tmp_path / "pids"
    pids.touch()
    command = [sys.executable, "-c", PROGRAM, str(pids), end]
    process = subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE)
    assert process.stdin is not None
    assert process.stdout is not None
    with process.stdin, process.stdout:
        try:
            assert process.stdout.readline() == b"running\n"
            while len(pids.read_text().split()) < 3:
                time.sleep(0.02)
            below = [*(child.pid for child in processes_of(process.pid)), *map(int, pids.read_text().split())]
            assert len(set(below)) == 12, "five processes with their supervisors, and two that one of them has started"
            if end != "is killed":
                process.stdin.write(b"\n")
                process.stdin.flush()
                assert process.stdout.readline() == b"end\n"
                process.wait(PATIENCE_S)
        finally:
            process.kill()
            process.wait(PATIENCE_S)
    last_s = time.monotonic() + PATIENCE_S
    while any(map(is_alive, below)) and time.monotonic() < last_s:
        time.sleep(0.05)
    assert [pid for pid in below if is_alive(pid)] == []


# Running processes


class Process:
    """A descendant of a process, as described by Linux."""

    def __init__(self, pid: int) -> None:
        self.pid = pid
        self.memory_mb = memory_mb(pid)
        self.is_worker = bool(os.getpgid(pid) == pid and os.getsid(pid) != pid)


def memory_mb(pid: int) -> float:
    lines = Path(f"/proc/{pid}/status").read_text().splitlines()
    return next((int(line.split()[1]) / 1000 for line in lines if line.startswith("VmRSS:")), 0.0)


def own_memory_mb() -> float:
    return memory_mb(os.getpid())


def processes_of(pid: int) -> list[Process]:
    """Return all running descendants of a process; threads and processes may end meanwhile."""
    descendants: list[Process] = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):
            for child in map(int, (task / "children").read_text().split()):
                with contextlib.suppress(FileNotFoundError, ProcessLookupError):
                    descendants += [*([Process(child)] if is_alive(child) else []), *processes_of(child)]
    return descendants
