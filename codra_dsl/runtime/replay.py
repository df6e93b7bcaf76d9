"""Deriving the events of a run anew from its journal: the same inputs and the same evidence, taken at the same places.

No perception function is called and no time passes. What observers, variables and decisions come to is worked out by
the same code as in the run, so a difference means that the spec, the runtime or the journal is another.
"""

from __future__ import annotations

import contextlib
import heapq
import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from codra_dsl.logic import Value
from codra_dsl.runtime.cell import Reason
from codra_dsl.runtime.clock import Clock, Outcome, Timer, Work
from codra_dsl.runtime.context import ContextManager
from codra_dsl.runtime.decisions import Decision, Demand
from codra_dsl.runtime.inputs import Inputs
from codra_dsl.runtime.journal.encoding import message_of
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.head import Head
from codra_dsl.runtime.journal.record import Record
from codra_dsl.runtime.model import Algorithm, ContextModel
from codra_dsl.runtime.perception import Failure, Function, Interval, Job, Result

Key = tuple[str, int]
"""An algorithm, and the number of one of its jobs."""

Build = Callable[..., ContextManager[Any, Any]]
"""Makes the context manager of a package: its class, which takes what `ContextManager` takes."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Difference:
    """Where a replay first differs from its journal; None stands for no event in that place.

    Attributes:
        position: of the event among all that are compared, from 1.
    """

    position: int
    recorded: Event | None
    replayed: Event | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Replayed:
    """What came of a replay.

    Attributes:
        compared: how many events are equal.
        derived: how many events of each kind were derived.
        absent: kinds of events that the journal does not hold, and that were therefore not compared.
        difference: the first, if there is one.
    """

    compared: int
    derived: Mapping[Kind, int]
    absent: tuple[Kind, ...]
    difference: Difference | None


class _DivergedError(Exception):
    """The replay has come to where the journal cannot be followed any more."""


class _ReplayedWork(Work):
    """The time of a job that is not done again: only what it told about its evidence is told anew."""

    def __init__(self) -> None:
        super().__init__()
        self.instant_s = 0.0

    def now_s(self) -> float:
        return self.instant_s

    def sleep(self, duration_s: float) -> None:
        raise AssertionError(f"no function is called that could sleep {duration_s} s")


class _Jobs:
    """The jobs of a journal: what they told, and what they brought."""

    def __init__(self, events: Iterable[Event]) -> None:
        self._told: dict[Key, list[tuple[float, Interval]]] = {}
        self._outcomes: dict[Key, Event] = {}
        self._unstarted: dict[Key, str] = {}
        self._pending: dict[Key, Callable[[Any], None]] = {}
        self._returns: dict[str, Sequence[str]] = {}
        self._beginning: tuple[_ReplayedWork, Key | None] = (_ReplayedWork(), None)
        for event in events:
            self._take(event)

    def _take(self, event: Event) -> None:
        if "index" not in event.details:
            return
        key = (event.name, int(event.details["index"]))
        match event.kind, event.what:
            case Kind.INPUT, "evidence":
                start_s, stamp_s = event.details["evidence_s"]
                self._told.setdefault(key, []).append((event.details["told_s"], Interval(start_s, stamp_s)))
            case Kind.INPUT, "unstarted":
                self._unstarted[key] = event.details["message"]
            case Kind.JOB, "returned" | "failed":
                self._outcomes.setdefault(key, event)
            case _:
                pass

    def find(self, algorithm: Algorithm) -> Function:
        """Return what stands for the function of an algorithm."""
        self._returns[algorithm.name] = tuple(algorithm.returns)

        def play(*, job: Job, **_: object) -> Mapping[str, Value]:
            work, _key = self._beginning
            key = (algorithm.name, job.index)
            for told_s, interval in self._told.get(key, ()):
                work.instant_s = told_s
                job.evidence(interval.start_s, told_s if interval.stamp_s is None else interval.stamp_s)
            self._beginning = (work, key)
            return {}

        return play

    def start(self, run: Callable[[Work], Outcome], deliver: Callable[[Outcome], None]) -> Work:
        """Begin a job, which ends when the journal says so."""
        work = _ReplayedWork()
        self._beginning = (work, None)
        run(work)
        key = self._beginning[1]
        if key is None:
            raise _DivergedError
        if key in self._unstarted:
            raise RuntimeError(self._unstarted[key])
        self._pending[key] = deliver
        return work

    def deliver(self, key: Key) -> None:
        """End a job with what it brought in the run."""
        deliver = self._pending.pop(key, None)
        if deliver is None:
            raise _DivergedError
        deliver(self._outcome(key))

    def _outcome(self, key: Key) -> Result | Failure:
        event = self._outcomes.get(key)
        if event is None or event.what == "failed":
            message = "" if event is None else str(event.details.get("message", ""))
            return Failure(Reason.FAILED, message)  # nobody waits any more for one of which nothing is told
        values = event.details.get("values", {})
        return Result({name: values.get(name) for name in self._returns[key[0]]})


class _ReplayClock(Clock):
    """Time that passes as a journal says. Only a context manager uses it."""

    def __init__(self, start_s: float, jobs: _Jobs) -> None:
        self._now_s = start_s
        self._jobs = jobs
        self._events: list[tuple[float, int, Timer]] = []
        self._scheduled = 0
        self.steps = 0

    def now_s(self) -> float:
        return self._now_s

    def advance(self, instant_s: float) -> None:
        """Let it be an instant, or stay at a later one."""
        self._now_s = max(self._now_s, instant_s)

    def next_s(self) -> float:
        """Return when the next event is due."""
        return self._events[0][0] if self._events else math.inf

    def step(self) -> None:
        """Let the next event happen."""
        if not self._events:
            raise _DivergedError
        instant_s, _, timer = heapq.heappop(self._events)
        self.advance(instant_s)
        self.steps += 1
        timer.fire()

    def call_at(self, instant_s: float, callback: Callable[[], None]) -> Timer:
        timer = Timer(instant_s, callback)
        heapq.heappush(self._events, (instant_s, self._scheduled, timer))
        self._scheduled += 1
        return timer

    def notify(self) -> None:
        pass

    def start(self, run: Callable[[Work], Outcome], deliver: Callable[[Outcome], None]) -> Work:
        return self._jobs.start(run, deliver)

    def sleep(self, duration_s: float) -> None:
        raise AssertionError(f"nobody sleeps {duration_s} s in a replay")

    def wait_until(self, ready: Callable[[], bool], timeout_s: float) -> bool:
        raise AssertionError(f"nobody waits {timeout_s} s in a replay for {ready}")


class _Comparison(Record):
    """Takes the events of a replay and compares them, one by one, with those of the journal.

    Attributes:
        may_go_on: whether events may follow on what is expected.
    """

    def __init__(self, expected: Sequence[Event], copy: Record | None) -> None:
        super().__init__(limit=1)
        self.may_go_on = False
        self.takes_inputs = copy is not None
        self.position = 0
        self.derived: dict[Kind, int] = {}
        self.difference: Difference | None = None
        self._expected = expected
        self._kinds = frozenset(event.kind for event in expected)
        self._copy = copy

    @property
    def is_over(self) -> bool:
        """Return whether there is nothing left to compare."""
        return self.difference is not None or self.position == len(self._expected)

    def begin(self, head: Callable[[], Head]) -> None:
        if self._copy is not None:
            self._copy.begin(head)

    def add(self, event: Event) -> None:
        if self._copy is not None:
            self._copy.add(event)
        if event.kind is not Kind.INPUT:
            self.derived[event.kind] = self.derived.get(event.kind, 0) + 1
            if event.kind in self._kinds and self.difference is None:
                self._compare(event)

    def end(self) -> None:
        if self._copy is not None:
            self._copy.end()

    def miss(self) -> None:
        """Take note that nothing more follows, although more was recorded."""
        if not self.is_over:
            self.difference = Difference(
                position=self.position + 1, recorded=self._expected[self.position], replayed=None
            )

    def _compare(self, event: Event) -> None:
        recorded = self._expected[self.position] if self.position < len(self._expected) else None
        if recorded is None and self.may_go_on:
            return
        if recorded is None or recorded.kind is not event.kind or message_of(recorded) != message_of(event):
            self.difference = Difference(position=self.position + 1, recorded=recorded, replayed=event)
        else:
            self.position += 1


class _Player:
    """Takes the inputs of a journal, each at its place."""

    def __init__(self, inputs: Inputs, jobs: _Jobs, close: Callable[[], None]) -> None:
        self._inputs = inputs
        self._jobs = jobs
        self._close = close
        self._decisions: dict[int, Decision] = {}

    def take(self, event: Event) -> None:
        """Let an input reach the context manager; what was refused in the run is refused again."""
        with contextlib.suppress(PermissionError, ValueError):
            self._apply(event, event.details)

    def _apply(self, event: Event, details: Mapping[str, Any]) -> None:
        inputs = self._inputs
        match event.what:
            case "declare":
                inputs.declare(details["variable"])
            case "withdraw":
                inputs.withdraw(details["variable"])
            case "expect":
                inputs.expect(details["skills"])
            case "begin":
                inputs.begin(details["skill"])
            case "act":
                inputs.act(details["skill"])
            case "finish":
                inputs.finish(details["number"])
            case "write":
                (evidence_s,) = details.get("evidence_s", (None,))
                inputs.write(details["variable"], details.get("value"), event.name, evidence_s)
            case "request":
                inputs.request_slots(tuple(details["resources"]), _nothing)
            case "release":
                inputs.release_slots(details["number"])
            case "delivered":
                self._jobs.deliver((event.name, details["index"]))
            case "close":
                self._close()
            case _:
                self._decide(event.what, details)

    def _decide(self, what: str, details: Mapping[str, Any]) -> None:
        number = details.get("number", 0)
        match what:
            case "decide":
                asked = {key: part for key, part in details.items() if key not in ("step", "number")}
                self._decisions[number] = self._inputs.ask(Demand(**asked))
            case "waited":
                self._inputs.resume(self._decisions[number])
            case "found":
                found = self._decisions.pop(number)
                self._inputs.conclude(found, details.get("value"), details.get("raised"))
            case _:
                pass


def replay(head: Head, events: Sequence[Event], model: ContextModel, build: Build, copy: Record | None) -> Replayed:
    """Derive the events of a run anew, and compare them with those of its journal.

    Args:
        head: of the journal.
        events: of the journal.
        model: what the spec is compiled to.
        build: makes its context manager.
        copy: takes what is derived, e.g. a `Journal`; it becomes the same, byte for byte, if nothing differs.
    """
    jobs = _Jobs(events)
    clock = _ReplayClock(head.start_s, jobs)
    expected = [event for event in events if event.kind is not Kind.INPUT]
    comparison = _Comparison(expected, copy)
    handles = {resource.name: None for resource in model.resources if resource.slots is None}
    manager = build(model, clock=clock, resources=handles, seed=head.seed, record=comparison, find=jobs.find)
    player = _Player(manager.inputs, jobs, manager.close)
    try:
        _play(player, clock, comparison, [event for event in events if event.kind is Kind.INPUT])
        _run_on(clock, comparison, events[-1].instant_s if events else head.start_s)
    except (_DivergedError, KeyError, TypeError):
        pass
    comparison.miss()
    comparison.end()
    absent = tuple(kind for kind in comparison.derived if kind not in {event.kind for event in expected})
    return Replayed(
        compared=comparison.position,
        derived=comparison.derived,
        absent=absent,
        difference=comparison.difference,
    )


def _play(player: _Player, clock: _ReplayClock, comparison: _Comparison, inputs: Sequence[Event]) -> None:
    last = next((event for event in reversed(inputs) if event.what != "evidence"), None)
    for event in inputs:
        while clock.steps < event.details["step"] and comparison.difference is None:
            if clock.next_s() > event.instant_s:
                raise _DivergedError
            clock.step()
        if comparison.difference is not None:
            return
        clock.advance(event.instant_s)
        comparison.may_go_on |= event is last  # a journal may be torn in the midst of what its last input brought
        player.take(event)


def _run_on(clock: _ReplayClock, comparison: _Comparison, end_s: float) -> None:
    """Let happen what still happened after the last input, in a journal that ends in the middle."""
    while not comparison.is_over and clock.next_s() <= end_s:
        clock.step()


def _nothing() -> None:
    pass
