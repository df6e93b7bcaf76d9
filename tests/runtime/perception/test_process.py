"""Whatever a separate process does, it can be ended, and no process remains at the end of the program."""

from __future__ import annotations

import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from codra_dsl.runtime import Reason, WallClock
from codra_dsl.runtime.journal import Kind
from tests.runtime.perception.isolated import (
    PATIENCE_S,
    ROOT,
    await_end,
    eye,
    is_alive,
    looking,
    processes_of,
    started,
    wait,
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


LOST = "its process ended, because its supervisor was stopped or killed"
TIMED_OUT = "no result within 1 s"
ATTACKS = {
    "supervisor STOP": (LOST, LOST),
    "supervisor KILL": (LOST, LOST),
    "guard STOP": (TIMED_OUT, TIMED_OUT),
    "guard KILL": (TIMED_OUT, "its process was ended by SIGTERM"),
    "supervisor STOP, guard STOP": (TIMED_OUT, LOST),
    "guard STOP, supervisor STOP": (TIMED_OUT, TIMED_OUT),
    "guard STOP, supervisor KILL": (LOST, TIMED_OUT),
    "again: guard STOP, supervisor STOP": (TIMED_OUT, TIMED_OUT),
    "supervisor STOP, guard KILL": (LOST, "its process was ended by SIGTERM"),
}
"""The signals that a process sends to its supervisor and to its guard, and the possible failures of its job."""


def test_a_process_that_stops_or_kills_its_supervisor_is_replaced_and_leaves_no_process(
    tmp_path: Path, clock: WallClock
) -> None:
    algorithms = [
        eye(
            "attacks_its_supervisor",
            name=f"a{number}",
            parameters={"pids": str(tmp_path / str(number)), "signals": signals},
            timeout_s=1.0,
        )
        for number, signals in enumerate(ATTACKS)
    ]
    names = [algorithm.name for algorithm in algorithms]
    with started(looking(*algorithms), clock) as manager:
        wait(clock, lambda: all(manager.get(name).known for name in names))
        for name, failures in zip(names, ATTACKS.values(), strict=True):
            failed = [event for event in manager.record.of(Kind.JOB) if event.name == name and event.what == "failed"]
            assert failed[0].details["message"] in failures
        await_end(*(int(pid) for path in tmp_path.iterdir() for pid in path.read_text().split()))


PROGRAM = """
import sys
from codra_dsl.runtime import Reason, WallClock
from tests.runtime.perception.isolated import eye, looking, started

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
            assert len(set(below)) == 17, "five processes, two helpers of each, and two that one of them has started"
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


FORKING_PROGRAM = """
import os
import signal
import sys
from codra_dsl.runtime import SimClock
from codra_dsl.runtime.journal import Kind
from tests.runtime.forests import events
from tests.runtime.perception.isolated import eye, looking, started, values

clock = SimClock()
with started(looking(eye("counts")), clock) as manager:
    def last_pid():
        clock.sleep(2.5)
        return values(manager)[-1]["pid"]

    print(last_pid(), flush=True)
    child = os.fork()
    if child != 0:
        os.waitpid(child, 0)
    print(last_pid(), events(manager, Kind.JOB).count("failed"), flush=True)
if child == 0:
    sys.exit()
context = started(looking(eye("counts")), clock)
manager = context.__enter__()
print(last_pid(), flush=True)
if os.fork() == 0:
    sys.stdin.read()
os.kill(os.getpid(), signal.SIGKILL)
"""


def test_a_fork_of_the_program_has_its_own_processes_and_does_not_end_those_of_the_program() -> None:
    command = [sys.executable, "-c", FORKING_PROGRAM]
    process = subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True)
    assert process.stdin is not None
    assert process.stdout is not None
    with process.stdout:
        with process.stdin:  # the second fork of the program lives until the end of this block
            before, in_child, after, last = (process.stdout.readline().split() for _ in range(4))
            assert process.wait(PATIENCE_S) == -signal.SIGKILL
            await_end(int(last[0]))
        assert after == [*before, "0"]
        assert in_child[0] != after[0]
        assert in_child[1] == "0"
        await_end(int(before[0]), int(in_child[0]))
