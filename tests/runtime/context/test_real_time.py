"""Real time and real threads: perception cannot disturb the forest or the main execution."""

from __future__ import annotations

import random
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from codra_dsl.logic import value
from codra_dsl.runtime import Reason, WallClock
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.values.model import SkillModel
from tests.runtime.forests import Manager, World, events, forest, given, observer, seen, started, takes, variable
from tests.runtime.observers.test_activation import papers_answer, random_forest, running_by_record

ROOT = Path(__file__).parents[3]
YES = {"seen": True}
PATIENCE_S = 60.0


@pytest.fixture
def clock() -> Iterator[WallClock]:
    with WallClock() as wall_clock:
        yield wall_clock


def wait(clock: WallClock, ready: Callable[[], bool]) -> None:
    assert clock.wait_until(ready, PATIENCE_S)


class Gate:
    """Perception that blocks until it is released, and does not react to `job`."""

    def __init__(self) -> None:
        self.entered = threading.Event()
        self.released = threading.Event()

    def __call__(self, _: Any) -> object:
        self.entered.set()
        assert self.released.wait(PATIENCE_S)
        return YES


@pytest.fixture
def gate() -> Iterator[Gate]:
    new_gate = Gate()
    yield new_gate
    new_gate.released.set()


def dies(_: Any) -> object:
    raise SystemExit(1)


def interrupts(_: Any) -> object:
    raise KeyboardInterrupt


def raises(_: Any) -> object:
    raise ValueError("no picture")


BEHAVIOURS: dict[str, tuple[object, Reason, str]] = {
    "raises": (raises, Reason.FAILED, "ValueError: no picture"),
    "exits": (dies, Reason.FAILED, "SystemExit: 1"),
    "interrupts": (interrupts, Reason.FAILED, "KeyboardInterrupt: "),
    "sleeps a minute": (lambda _: time.sleep(60), Reason.TIMED_OUT, "no result within 0.2 s"),
    "waits a minute": (takes(60.0, YES), Reason.TIMED_OUT, "no result within 0.2 s"),
    "returns a list": ([True], Reason.FAILED, "returned a list, not a mapping"),
    "returns too much": ({"seen": True, "heard": 1}, Reason.FAILED, "returned 'heard', which `returns` does not name"),
    "returns another type": ({"seen": "yes"}, Reason.FAILED, "returned 'seen': 'yes' is not of type bool"),
    "returns 100 MB": (lambda _: {"seen": b"x" * 10**8}, Reason.FAILED, "returned 'seen': a bytes is not of type bool"),
    "returns nothing": ({}, Reason.REJECTED, "the result has no value for it"),
}


@pytest.mark.parametrize("behaviour", BEHAVIOURS)
def test_with_any_perception_get_answers_and_only_its_variables_become_unknown(
    behaviour: str, clock: WallClock
) -> None:
    find, reason, detail = BEHAVIOURS[behaviour]
    timeout_s = 0.2 if reason is Reason.TIMED_OUT else PATIENCE_S
    eye, ear = seen("eye", "a", timeout_s=timeout_s), seen("ear", "b", timeout_s=PATIENCE_S)
    model = forest([variable("a"), variable("b")], observer("o", eye), observer("p", ear))
    with started(model, World({"eye": find, "ear": YES}), clock) as manager:
        manager.declare("a")
        manager.declare("b")
        wait(clock, lambda: manager.get("b").known and manager.get("a").reason is not Reason.NEVER_OBSERVED)
        reading = manager.get("a")
        assert (reading.reason, reading.detail) == (reason, detail)
        assert manager.get("b").value is True
        assert manager.decide("a", lambda: None) is None


def test_get_answers_while_a_writer_holds_the_lock(clock: WallClock) -> None:
    with started(forest([given("x")]), World(), clock) as manager:
        manager.set("x", True)
        answers: list[object] = []
        with manager._lock:
            reader = threading.Thread(target=lambda: answers.append(manager.get("x").value))
            reader.start()
            reader.join(PATIENCE_S)
            assert answers == [True]


def test_a_function_that_hangs_is_not_called_again_before_it_returns(clock: WallClock, gate: Gate) -> None:
    world = World({"eye": gate, "ear": YES})
    model = forest(
        [variable("a"), variable("b")],
        observer("o", seen("eye", "a", timeout_s=0.05), period_s=0.01),
        observer("p", seen("ear", "b"), period_s=0.01),
    )
    with started(model, world, clock) as manager:
        manager.declare("a")
        manager.declare("b")
        wait(clock, lambda: manager.get("a").reason is Reason.TIMED_OUT and len(world.asked_s("ear")) >= 20)
        assert len(world.asked_s("eye")) == 1
        gate.released.set()
        wait(clock, lambda: manager.get("a").known)
        assert len(world.asked_s("eye")) >= 2


def test_a_function_that_is_cancelled_and_does_not_end_has_timed_out(clock: WallClock, gate: Gate) -> None:
    model = forest(
        [given("near"), variable("a")],
        observer("o", seen("eye", "a", when=[value("near")], timeout_s=1.0), period_s=0.01),
    )
    world = World({"eye": YES})
    with started(model, world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        wait(clock, lambda: manager.get("a").known)
        world.finds["eye"] = gate
        assert gate.entered.wait(PATIENCE_S)
        manager.set("near", False)
        wait(clock, lambda: not manager.get("a").known)
        reading = manager.get("a")
        assert reading.reason is Reason.TIMED_OUT
        assert reading.detail == "a job that was cancelled does not end within 1 s"
        assert events(manager, Kind.JOB)[-2:] == ["cancelled", "stuck"]


def test_an_alternative_delivers_while_the_better_one_hangs(clock: WallClock, gate: Gate) -> None:
    model = forest(
        [variable("a")], observer("o", seen("camera", "a", timeout_s=0.05), seen("sonar", "a"), period_s=0.05)
    )
    world = World({"camera": gate, "sonar": YES})
    with started(model, world, clock) as manager:
        manager.declare("a")
        wait(clock, lambda: len(world.asked_s("sonar")) >= 3)
        assert manager.get("a").source == "sonar"


def test_a_decision_wakes_up_when_an_observer_delivers(clock: WallClock) -> None:
    with started(
        forest([variable("a")], observer("o", seen("eye", "a"))), World({"eye": takes(0.1, YES)}), clock
    ) as manager:
        manager.declare("a")
        assert manager.decide("a", lambda: "looked", wait_up_to_s=PATIENCE_S) is True


def test_stopping_wakes_a_job_that_sleeps(clock: WallClock) -> None:
    ended = threading.Event()

    def sleeps(job: Any) -> object:
        try:
            job.sleep(PATIENCE_S)
        finally:
            ended.set()
        return YES

    world = World({"eye": sleeps})
    with started(forest([variable("a")], observer("o", seen("eye", "a", timeout_s=99))), world, clock) as manager:
        manager.declare("a")
        wait(clock, lambda: manager.record.of(Kind.JOB) != ())
    assert ended.wait(PATIENCE_S)


def test_the_main_execution_waits_for_a_slot_and_gets_it_before_observers(clock: WallClock, gate: Gate) -> None:
    world = World({"eye": gate, "ear": YES})
    model = forest(
        [variable("a"), variable("b")],
        observer("o", seen("eye", "a", slots=("one",), timeout_s=PATIENCE_S)),
        observer("p", seen("ear", "b", slots=("one",)), priority=9),
        slots={"one": 1},
    )
    with started(model, world, clock) as manager:
        manager.declare("a")
        assert gate.entered.wait(PATIENCE_S)
        manager.declare("b")
        threading.Timer(0.05, gate.released.set).start()
        with manager.slot("one"):
            assert world.asked_s("ear") == []
        wait(clock, lambda: manager.get("b").known)


def test_validity_ends_without_a_query(clock: WallClock) -> None:
    with started(forest([given("x", valid_for_s=0.05)]), World(), clock) as manager:
        manager.set("x", True)
        wait(clock, lambda: events(manager, Kind.VARIABLE) == ["identified", "unknown"])


def hammer(manager: Manager, clock: WallClock, seed: int, skills: tuple[SkillModel, ...]) -> None:
    chance = random.Random(seed)
    mine: set[str] = set()
    for _ in range(60):
        name = f"v{chance.randrange(60)}"
        action = chance.choice(["declare", "withdraw", "set", "expect", "skill", "get", "decide"])
        if action == "declare":
            mine.add(name)
            manager.declare(name)
        elif action == "withdraw":
            manager.withdraw(name)
        elif action == "set" and name in mine:
            manager.declare(name, value=chance.random() < 0.5)
        elif action == "expect":
            manager.expect(chance.choice(skills).name)
        elif action == "skill":
            with manager.skill(chance.choice(skills).name) as skill, skill.acting():
                clock.sleep(0.001)
        elif action == "decide":
            manager.decide(name, lambda: None, wait_up_to_s=0.002)
        else:
            reading = manager.get(name)
            assert reading.known is (reading.reason is None)


def test_many_threads_leave_no_observer_running_or_missing(clock: WallClock) -> None:
    model = random_forest(11)
    world = World({f"look_{observer_model.name[2:]}": takes(0.002, YES) for observer_model in model.observers})
    with started(model, world, clock) as manager:
        errors: list[BaseException] = []

        def body(seed: int) -> None:
            try:
                hammer(manager, clock, seed, model.skills)
            except BaseException as error:  # noqa: BLE001 - checked below
                errors.append(error)

        threads = [threading.Thread(target=body, args=(seed,), daemon=True) for seed in range(8)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(PATIENCE_S)
        assert errors == []
        assert not any(thread.is_alive() for thread in threads)
        running, context = papers_answer(model, manager)
        assert manager.running() == running == running_by_record(manager)
        assert manager.in_force() == context
    assert manager.running() == running_by_record(manager) == set()


HANGS = """
import time
from codra_dsl.runtime import Reason, WallClock
from tests.runtime.forests import World, forest, observer, seen, started, variable

model = forest(
    [variable("a"), variable("b"), variable("c")],
    observer("o", seen("eye", "a", timeout_s=0.1)),
    observer("p", seen("ear", "b", timeout_s=60.0)),
    observer("q", seen("nose", "c")),
)
world = World({"eye": lambda job: time.sleep(60), "ear": lambda job: time.sleep(60), "nose": {"seen": True}})
clock = WallClock()
with started(model, world, clock) as manager:
    for name in "abc":
        manager.declare(name)
    assert clock.wait_until(lambda: manager.get("c").known and manager.get("a").reason is Reason.TIMED_OUT, 60.0)
    assert manager.get("b").reason is Reason.NEVER_OBSERVED
print("end", flush=True)
"""


def test_the_process_ends_within_two_seconds_of_the_run_although_two_functions_hang() -> None:
    with subprocess.Popen([sys.executable, "-c", HANGS], cwd=ROOT, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        assert process.stdout.readline() == "end\n"
        assert process.wait(timeout=2) == 0
