"""Every behaviour of a perception function ends in its job: as a result, or as a failure with a reason."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from types import ModuleType
from typing import Any

import numpy as np
import pytest

from codra_dsl.runtime import CallError, ContextManager, Reason, SimClock, WallClock
from codra_dsl.runtime.journal import Kind
from codra_dsl.runtime.perception import Failure, Result, checked
from codra_dsl.runtime.perception.functions import JobError
from codra_dsl.runtime.values.model import Algorithm, boolean, integer, real, text
from tests.runtime.forests import World, algorithm, events, forest, observer, seen, started, takes, variable
from tests.runtime.hostile_errors import HOSTILE_ERRORS, hostile_error

YES = {"seen": True}
RETURNS = algorithm("eye", {"markers": integer(0, 12), "angle": real(optional=True), "text": text(optional=True)})


class Endless(Mapping[str, object]):
    """More keys than there is memory."""

    def __getitem__(self, key: str) -> object:
        return 1

    def __iter__(self) -> Iterator[str]:
        number = 0
        while True:
            yield f"key{number}"
            number += 1

    def __len__(self) -> int:
        return sys.maxsize


class Mute:
    def __repr__(self) -> str:
        raise RuntimeError


class _LongName(type):
    """The type of a class that states a very long name."""

    @property
    def __name__(cls) -> str:
        return "a" * 10**6


class Stranger(metaclass=_LongName):
    pass


REFUSED: dict[str, object] = {
    "returned a list, not a mapping": [1],
    "returned a NoneType, not a mapping": None,
    "returned a Stranger, not a mapping": Stranger(),
    "returned 'angle': a Stranger is not of type float": {"markers": 3, "angle": Stranger()},
    "returned a Stranger, which `returns` does not name": {"markers": 3, Stranger(): 1},
    "returned a bytes, not a mapping": b"x" * 10**8,
    "returned no 'markers'": {},
    "returned no 'markers' ": {"markers": None},
    "returned 'markers': 3.0 is not of type int": {"markers": 3.0},
    "returned 'markers': 13 lies outside [0, 12]": {"markers": 13},
    "returned 'markers': a number of 64 bits is too large": {"markers": 2**63},
    "returned 'angle': 'wide' is not of type float": {"markers": 3, "angle": "wide"},
    "returned 'angle': a ndarray is not of type float": {"markers": 3, "angle": np.zeros((3, 3))},
    "returned 'angle': a Mute is not of type float": {"markers": 3, "angle": Mute()},
    "returned 'text': a text of 100000000 characters is too long: the limit is 10000": {
        "markers": 3,
        "text": "x" * 10**8,
    },
    "returned 'mode', which `returns` does not name": {"markers": 3, "mode": 1},
    "returned a int, which `returns` does not name": {"markers": 3, 7: 1},
    "returned 'key0', which `returns` does not name": Endless(),
}


@pytest.mark.parametrize("message", REFUSED)
def test_a_result_that_does_not_match_the_spec_is_a_failure(message: str) -> None:
    assert checked(RETURNS, REFUSED[message]) == Failure(Reason.FAILED, message.strip())


def test_a_result_that_matches_the_spec_is_accepted_and_unmeasured_values_are_unknown() -> None:
    given = {"markers": np.int64(3), "angle": float("nan")}
    assert checked(RETURNS, given) == Result({"markers": 3, "angle": None, "text": None})


def hangs_up(_: Any) -> object:
    sys.exit(3)


def interrupts(_: Any) -> object:
    raise GeneratorExit("over")


def waits_on_the_clock(_: Any) -> object:
    CLOCKS[-1].sleep(1)
    return YES


def reports_the_future(job: Any) -> object:
    job.evidence(8.0, 9.0)
    return YES


def sleeps_backwards(job: Any) -> object:
    job.sleep(-1)
    return YES


CLOCKS: list[SimClock] = []
FAILURES = {
    hangs_up: "SystemExit: 3",
    interrupts: "GeneratorExit: over",
    waits_on_the_clock: (
        "RuntimeError: an event (a perception function, a callback) must not wait on the clock: use job.sleep"
    ),
    reports_the_future: "ValueError: evidence has a start, then a stamp, both in the past: not 8.0 to 9.0",
    sleeps_backwards: "ValueError: a duration is zero or more seconds, not -1",
}


@pytest.mark.parametrize("find", FAILURES, ids=lambda find: find.__name__)
def test_an_error_of_a_function_makes_only_its_variables_unknown(find: Any) -> None:
    CLOCKS.append(SimClock())
    world = World({"eye": find, "ear": takes(0.1, YES)})
    model = forest([variable("a"), variable("b")], observer("o", seen("eye", "a")), observer("p", seen("ear", "b")))
    with started(model, world, CLOCKS[-1]) as manager:
        manager.declare("a")
        manager.declare("b")
        CLOCKS[-1].sleep(5)
        reading = manager.get("a")
        assert (reading.reason, reading.detail) == (Reason.FAILED, FAILURES[find])
        assert manager.get("b").value is True
        assert len(world.asked_s("eye")) == 6
        assert manager.record.text().encode()


def raising(make_error: Callable[[], BaseException]) -> Callable[[Any], object]:
    def find(_: Any) -> object:
        raise make_error()

    return find


@pytest.mark.parametrize("kind", HOSTILE_ERRORS)
def test_a_hostile_exception_of_a_function_ends_only_its_job_in_simulated_time(kind: str) -> None:
    text = HOSTILE_ERRORS[kind]
    world, clock = World({"eye": raising(partial(hostile_error, kind))}), SimClock()
    with started(forest([variable("a")], observer("o", seen("eye", "a"))), world, clock) as manager:
        manager.declare("a")
        clock.sleep(1.5)
        assert (manager.get("a").reason, manager.get("a").detail) == (Reason.FAILED, text)
        assert len(world.asked_s("eye")) == 2


@pytest.mark.parametrize("kind", HOSTILE_ERRORS)
def test_a_function_may_raise_the_error_of_jobs_with_a_hostile_message(kind: str) -> None:
    text = HOSTILE_ERRORS[kind]
    world, clock = World({"eye": raising(lambda: JobError(hostile_error(kind)))}), SimClock()
    with started(forest([variable("a")], observer("o", seen("eye", "a"))), world, clock) as manager:
        manager.declare("a")
        clock.sleep(0.5)
        reading = manager.get("a")
    assert reading.reason is Reason.FAILED
    assert reading.detail[:200] == text.partition(": ")[2][:200]


def test_hostile_exceptions_of_functions_end_only_their_jobs_in_real_time() -> None:
    world = World({kind: raising(partial(hostile_error, kind)) for kind in HOSTILE_ERRORS})
    looks = (observer(f"o_{kind}", seen(kind, kind), period_s=0.05) for kind in HOSTILE_ERRORS)
    with WallClock() as clock, started(forest(list(map(variable, HOSTILE_ERRORS)), *looks), world, clock) as manager:
        for kind in HOSTILE_ERRORS:
            manager.declare(kind)
        assert clock.wait_until(lambda: all(len(world.asked_s(kind)) >= 3 for kind in HOSTILE_ERRORS), 60.0)
        for kind, text in HOSTILE_ERRORS.items():
            assert (manager.get(kind).reason, manager.get(kind).detail) == (Reason.FAILED, text)


def test_the_user_can_interrupt_simulated_perception() -> None:
    def interrupted(_: Any) -> object:
        raise KeyboardInterrupt

    clock = SimClock()
    with started(
        forest([variable("a")], observer("o", seen("eye", "a"))), World({"eye": interrupted}), clock
    ) as manager:
        manager.declare("a")
        with pytest.raises(KeyboardInterrupt):
            clock.sleep(5)


def one(find: object, **settings: Any) -> tuple[Any, World]:
    return forest([variable("a")], observer("o", seen("eye", "a", **settings))), World({"eye": find})


def test_a_job_that_takes_longer_than_its_timeout_has_timed_out_at_that_instant() -> None:
    model, world = one(takes(9.0, YES), timeout_s=3.0)
    clock = SimClock()
    with started(model, world, clock) as manager:
        manager.declare("a")
        clock.sleep(2.9)
        assert manager.get("a").reason is Reason.NEVER_OBSERVED
        clock.sleep(0.1)
        reading = manager.get("a")
        assert (reading.reason, reading.detail) == (Reason.TIMED_OUT, "no result within 3 s")
        assert [event.instant_s for event in manager.record.of(Kind.JOB)] == [0.0, 3.0, 3.0]


def test_a_result_at_the_very_end_of_its_time_is_in_time() -> None:
    model, world = one(takes(3.0, YES), timeout_s=3.0)
    clock = SimClock()
    with started(model, world, clock) as manager:
        manager.declare("a")
        clock.sleep(3)
        assert manager.get("a").known


def test_the_evidence_of_a_plain_result_is_taken_during_its_entire_job() -> None:
    model, world = one(takes(2.0, YES))
    clock = SimClock()
    with started(model, world, clock) as manager:
        manager.declare("a")
        clock.sleep(2)
        assert manager.get("a").evidence_s == 2.0
        returned = manager.record.of(Kind.JOB)[1]
    assert returned.details == {"index": 0, "values": {"seen": True}, "evidence_s": [0.0, 2.0]}


def test_evidence_may_be_older_than_its_job() -> None:
    """A frame that the camera had taken before the job."""

    def cached(job: Any) -> object:
        job.evidence(job.now_s() - 0.5, job.now_s() - 0.5)
        return YES

    model, world = one(cached)
    clock = SimClock(10.0)
    with started(model, world, clock) as manager:
        manager.declare("a")
        clock.sleep(0)
        assert manager.get("a").evidence_s == 9.5


def test_names_of_returned_values_do_not_disturb_the_event_log() -> None:
    names = ("index", "what", "name", "kind", "instant_s", "attempt", "self", "evidence_s")
    eye = Algorithm(
        name="eye",
        call="tests.runtime.forests:look",
        parameters={"algorithm": "eye"},
        handles=("world",),
        returns=dict.fromkeys(names, boolean()),
    )
    model = forest(
        [variable("a")], observer("o", type(seen("x"))(eye, {"a": __import__("codra_dsl").logic.value("what")}))
    )
    clock = SimClock()
    with started(model, World({"eye": dict.fromkeys(names, True)}), clock) as manager:
        manager.declare("a")
        clock.sleep(0)
        assert manager.get("a").value is True
        assert '"values": {"index": true, "what": true,' in manager.record.text()


def test_random_numbers_depend_on_seed_algorithm_and_index_only() -> None:
    def draws(job: Any) -> object:
        job.sleep(job.random.uniform(0.1, 0.9))
        return YES

    def ends(seed: int, *names: str) -> dict[str, list[float]]:
        model = forest(
            [variable(name) for name in names], *(observer(f"o_{name}", seen(f"see_{name}", name)) for name in names)
        )
        clock = SimClock()
        with started(model, World({f"see_{name}": draws for name in names}), clock, seed) as manager:
            for name in names:
                manager.declare(name)
            clock.sleep(5)
            jobs = manager.record.of(Kind.JOB)
        return {name: [event.instant_s for event in jobs if event.name == f"see_{name}"] for name in names}

    alone, together = ends(1, "b"), ends(1, "a", "b", "c")
    assert alone["b"] == together["b"]
    assert together["a"] != together["b"]
    assert ends(2, "b") != alone


# Setup of the robot


@pytest.mark.parametrize(
    ("call", "message"),
    [
        ("no.such.module:look", "ModuleNotFoundError: No module named 'no'"),
        ("tests.runtime.forests:lok", "AttributeError: module 'tests.runtime.forests' has no attribute 'lok'"),
        ("tests.runtime.forests", "AttributeError: module 'tests.runtime.forests' has no attribute ''"),
        ("tests.runtime.forests:YES", "has no attribute 'YES'"),
        ("codra_dsl:__version__", "which is not a function"),
        ("broken_on_import:look", "ZeroDivisionError"),
    ],
    ids=lambda text: text.split()[0],
)
def test_a_call_that_names_no_function_is_reported_before_anything_runs(
    call: str, message: str, tmp_path: Any, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "broken_on_import.py").write_text("1 / 0\n")
    monkeypatch.syspath_prepend(tmp_path)
    look = type(seen("x"))(Algorithm(name="eye", call=call), {})
    with pytest.raises(CallError, match=f"perception 'eye' calls '{call}'.*{message}"):
        ContextManager(forest([], observer("o", look)), clock=SimClock(), resources={})


def test_a_method_of_a_class_can_be_called(monkeypatch: pytest.MonkeyPatch) -> None:
    module = ModuleType("robot_code")
    exec("class Eye:\n    @staticmethod\n    def look(*, job):\n        return {'seen': True}\n", module.__dict__)
    monkeypatch.setitem(sys.modules, "robot_code", module)
    eye = Algorithm(name="eye", call="robot_code:Eye.look", returns={"seen": boolean()})
    look = type(seen("x"))(eye, seen("x", "a").identifies)
    clock = SimClock()
    with ContextManager(forest([variable("a")], observer("o", look)), clock=clock, resources={}) as manager:
        manager.declare("a")
        clock.sleep(0)
        assert manager.get("a").value is True


def test_jobs_are_recorded() -> None:
    model, world = one(takes(0.5, YES))
    clock = SimClock()
    with started(model, world, clock) as manager:
        manager.declare("a")
        clock.sleep(1.25)
    assert events(manager, Kind.JOB) == ["started", "returned", "started", "cancelled"]


def test_an_object_may_close_the_manager_within_its_job(monkeypatch: pytest.MonkeyPatch) -> None:
    """In simulated time, the end of the manager closes the object in the same thread."""

    class Eye:
        def perceive(self, *, job: Any) -> Mapping[str, object]:
            del job
            manager.close()
            return YES

        def close(self) -> None:
            closed_objects.append(self)

    module = ModuleType("robot_code")
    vars(module)["Eye"] = Eye
    monkeypatch.setitem(sys.modules, "robot_code", module)
    eye = Algorithm(name="eye", call="robot_code:Eye", returns={"seen": boolean()})
    look = type(seen("x"))(eye, seen("x", "a").identifies)
    clock, closed_objects = SimClock(), list[Eye]()
    manager = ContextManager(forest([variable("a")], observer("o", look)), clock=clock, resources={})
    manager.declare("a")
    clock.sleep(1.0)
    assert len(closed_objects) == 1


def test_evidence_must_have_finite_instants() -> None:
    model, world = one(lambda job: job.evidence(-math.inf, -math.inf) or YES)
    clock = SimClock()
    with started(model, world, clock) as manager:
        manager.declare("a")
        clock.sleep(0.5)
        assert "both in the past: not -inf to -inf" in manager.get("a").detail
