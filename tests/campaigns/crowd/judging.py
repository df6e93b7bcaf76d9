"""Invariants of a context manager that many threads use."""

from __future__ import annotations

import sys
import time
import traceback
from collections.abc import Callable
from dataclasses import dataclass

from codra_dsl.runtime import ContextModel
from codra_dsl.runtime.journal import Kind
from tests.runtime.forests import Manager
from tests.runtime.observers.test_activation import papers_answer, running_by_record

PATIENCE_S = 60.0


@dataclass(eq=False)
class Life:
    """A context manager from its start to its end.

    Attributes:
        is_closing: set before it is closed; from then on calls may be refused.
        event_count: the number of events in its log after it was closed.
    """

    manager: Manager
    is_closing: bool = False
    event_count: int = 0

    def close(self) -> None:
        self.is_closing = True
        self.manager.close()
        self.event_count = len(self.manager.record)


def require(holds: bool, mistake: str) -> None:
    if not holds:
        raise AssertionError(mistake)


def eventually(ready: Callable[[], bool]) -> bool:
    """Return whether a condition becomes true within a minute."""
    end_s = time.monotonic() + PATIENCE_S
    while not ready() and time.monotonic() < end_s:
        time.sleep(0.005)
    return ready()


def judge_life(model: ContextModel, manager: Manager, declared: set[str]) -> int:
    """Require that the running observers are the result of P1's Algorithm 1 on the declarations."""
    running, context = papers_answer(model, manager)
    wanted_names = {name for name, observer in manager._forest.observers.items() if observer.is_wanted}
    require(manager.declared() == declared, f"declared are not {sorted(manager.declared() ^ declared)}")
    require(manager.running() == running, f"missing or left running: {sorted(manager.running() ^ running)}")
    require(running_by_record(manager) == running == wanted_names, "the event log or a control flag differs")
    require(manager.in_force() == context, "C_M(t) differs from the paper")
    return len(running)


def judge_end(life: Life) -> None:
    """Require that a closed context manager runs no observer, and declared or started none after its end."""
    manager = life.manager
    later = [event for event in list(manager.record)[life.event_count :] if event.what in ("started", "declared")]
    running = manager.running() | running_by_record(manager)
    require(not (running or manager.declared() or later), f"left running after the end: {sorted(running)}, {later[:3]}")
    last = {event.name: event.what for event in manager.record.of(Kind.JOB) if event.what != "rejected"}
    require("started" not in last.values(), "a job has neither ended nor been cancelled")


def stacks() -> str:
    """Return the stack traces of all threads."""
    frames = sys._current_frames().values()
    return "".join(f"\n--\n{''.join(traceback.format_stack(frame)[-6:])}" for frame in frames)
