"""Models with perception in separate processes, and the running processes of a program."""

from __future__ import annotations

import contextlib
import os
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from codra_dsl.logic import value
from codra_dsl.runtime import ContextManager, WallClock
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.context.model import ContextModel
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.values.model import Algorithm, ResourceModel, boolean, integer, text
from tests.runtime.forests import Look, Manager, forest, given, observer, variable

ROOT = Path(__file__).parents[3]
PATIENCE_S = 60.0


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


class Camera:
    """A handle that stays in the program, since its lock cannot be sent to another process."""

    def __init__(self) -> None:
        self.edges = 3
        self.lock = threading.Lock()
        self.names = ["left", "right"]
        self.noted: list[int] = []

    def frame(self, brightness: int, *, gain: int) -> np.ndarray:
        assert self.lock.acquire(timeout=1.0)
        self.lock.release()
        return np.full((480, 640, 3), brightness * gain, np.uint8)

    def __call__(self, index: int) -> int:
        return index + 100


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
    """Return all running descendants of a process; threads and processes may end meanwhile.

    The resource tracker of multiprocessing, which another test of this process may have started, is left out.
    """
    descendants: list[Process] = []
    for task in Path(f"/proc/{pid}/task").iterdir():
        with contextlib.suppress(FileNotFoundError, ProcessLookupError):
            for child in map(int, (task / "children").read_text().split()):
                with contextlib.suppress(FileNotFoundError, ProcessLookupError):
                    if b"resource_tracker" not in Path(f"/proc/{child}/cmdline").read_bytes():
                        descendants += [*([Process(child)] if is_alive(child) else []), *processes_of(child)]
    return descendants
