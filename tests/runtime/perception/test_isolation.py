"""Perception in a separate process: its failures affect only its variables, and its results are those of a thread."""

from __future__ import annotations

import logging
import os
import signal
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest

from codra_dsl.logic import value
from codra_dsl.runtime import CallError, ContextManager, Journal, Reason, SimClock, WallClock
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.replay import replay
from tests.runtime.forests import Look, events, forest, given, observer, variable
from tests.runtime.hostile_errors import HOSTILE_ERRORS, hostile_error
from tests.runtime.journal.journals import read
from tests.runtime.perception.isolated import (
    PATIENCE_S,
    Camera,
    await_end,
    await_no_process,
    eye,
    looking,
    own_memory_mb,
    processes_of,
    started,
    values,
    wait,
)

WAYS: tuple[Literal["thread", "process"], ...] = ("thread", "process")

# The same as in a thread


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


def test_hostile_exceptions_of_a_process_end_only_their_jobs() -> None:
    clock = SimClock()
    with started(looking(eye("raises_hostile_errors")), clock) as manager:
        clock.sleep(len(HOSTILE_ERRORS) - 0.5)
        failed = [event.details["message"] for event in manager.record.of(Kind.JOB) if event.what == "failed"]
    assert failed == list(HOSTILE_ERRORS.values())


def test_hostile_exceptions_of_a_handle_end_only_the_jobs_that_call_it() -> None:
    class Camera:
        def __init__(self) -> None:
            self._kinds = iter(HOSTILE_ERRORS)

        def __call__(self, _: int) -> int:
            raise hostile_error(next(self._kinds))

    clock = SimClock()
    algorithm = eye("calls_the_handle", handles=("camera",))
    with started(looking(algorithm), clock, {"camera": Camera()}) as manager:
        clock.sleep(len(HOSTILE_ERRORS) - 0.5)
        failed = [event.details["message"] for event in manager.record.of(Kind.JOB) if event.what == "failed"]
    assert len(failed) == len(HOSTILE_ERRORS)
    for message, text in zip(failed, HOSTILE_ERRORS.values(), strict=True):
        assert message.removeprefix("RuntimeError: ").startswith(text[:150])


def test_the_memory_of_a_process_is_freed_at_its_end_and_never_used_in_the_program(clock: WallClock) -> None:
    before = own_memory_mb()
    # a slow machine may need long for 100 MB
    algorithms = (eye("returns_100_mb", timeout_s=30.0), eye("keeps_100_mb", name="b", timeout_s=30.0))
    with started(looking(*algorithms), clock) as manager:
        wait(clock, lambda: manager.get("a").reason is Reason.FAILED and manager.get("b").known)
        assert own_memory_mb() < before + 50
        pids = [process.pid for process in processes_of(os.getpid()) if process.memory_mb > 100]
        assert 1 <= len(pids) <= 2  # the process that returns 100 MB has them only for a while
    await_end(*pids)


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
    clock = SimClock()
    with started(looking(eye("eats_a_core", timeout_s=0.4)), clock) as manager:
        monkeypatch.setattr("codra_dsl.runtime.perception.process_executor.SETUP_TIMEOUT_S", 0.5)
        clock.sleep(0.5)
        assert (manager.get("a").reason, manager.get("a").detail) == (Reason.TIMED_OUT, "no result within 0.4 s")
        assert [event.instant_s for event in manager.record.of(Kind.JOB) if event.what == "failed"] == [0.4]


def test_the_output_of_a_process_is_logged(clock: WallClock, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO, "codra_dsl.perception")
    with started(looking(eye("floods_its_output", timeout_s=0.3)), clock) as manager:
        wait(clock, lambda: manager.get("a").reason is Reason.TIMED_OUT)
    wait(clock, lambda: any(message.startswith("eye: nonsense nonsense") for message in caplog.messages))
    assert sum(map(len, caplog.messages)) < 2_000_000


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
