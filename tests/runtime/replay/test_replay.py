"""Replay: the same inputs and evidence give the same events, in simulated and in real time."""

from __future__ import annotations

import random
import threading
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager, suppress
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import pytest

from codra_dsl.logic import age, known, value
from codra_dsl.runtime import (
    ContextManager,
    ContextModel,
    Journal,
    NotASourceError,
    NotDeclaredError,
    SimClock,
    WallClock,
)
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.journal import Event, Kind
from codra_dsl.runtime.journal.encoding import message_of
from codra_dsl.runtime.journal.reader import JournalReader
from codra_dsl.runtime.replay import Replayed, replay
from codra_dsl.runtime.replay.recording import RecordedEvent, Recording
from codra_dsl.runtime.values.model import SkillModel, member, real
from tests.runtime.door import GIVEN_NEAR, LOOK, MEASURE_DISTANCE, MODEL, OBSERVERS
from tests.runtime.forests import Look, World, algorithm, forest, given, observer, seen, takes, tree, variable
from tests.runtime.journal.journals import read, run_door

YES = {"seen": True}
_UNUSED_KINDS = {Kind.HOST, Kind.PREVIEW, Kind.OVERRIDE, Kind.KNOWLEDGE, Kind.ADAPTATION}
Manager = ContextManager[str, str]


@contextmanager
def journalled(model: ContextModel, world: World, path: Path, clock: Clock, seed: int = 0) -> Iterator[Manager]:
    resources = {"world": world}
    with Manager(model, clock=clock, resources=resources, seed=seed, record=Journal(path)) as manager:
        yield manager


def replay_journal(path: Path, model: ContextModel, keep: Callable[[Event], bool] = lambda _: True) -> Replayed:
    """Replay a journal, or some of its events; the copy is beside it."""
    header, events = read(path)
    return replay(
        header, [event for event in events if keep(event)], model, Manager, Journal(path.with_suffix(".again"))
    )


def assert_same(path: Path, model: ContextModel) -> Replayed:
    replay_result = replay_journal(path, model)

    assert replay_result.difference is None
    assert replay_result.compared == sum(event.kind is not Kind.INPUT for event in read(path)[1])
    assert path.with_suffix(".again").read_bytes() == path.read_bytes()
    return replay_result


def test_a_run_in_simulated_time_is_derived_again_byte_for_byte(tmp_path: Path) -> None:
    run_door(tmp_path / "run.mcap", loops=9, seed=5)

    result = assert_same(tmp_path / "run.mcap", MODEL)
    assert set(result.derived) == set(Kind) - {Kind.INPUT, *_UNUSED_KINDS}


@pytest.mark.parametrize(
    "absent",
    [{Kind.VARIABLE, Kind.DECISION}, set(Kind) - {Kind.INPUT, Kind.JOB, *_UNUSED_KINDS}],
)
def test_events_that_a_journal_lacks_are_derived_from_inputs_and_evidence(tmp_path: Path, absent: set[Kind]) -> None:
    run_door(tmp_path / "run.mcap", loops=9)

    result = replay_journal(tmp_path / "run.mcap", MODEL, lambda event: event.kind not in absent)
    assert (result.difference, set(result.absent)) == (None, absent)
    assert (tmp_path / "run.again").read_bytes() == (tmp_path / "run.mcap").read_bytes()


def test_a_changed_precondition_differs_at_its_first_consequence(tmp_path: Path) -> None:
    run_door(tmp_path / "run.mcap")
    look = Look(LOOK, {"open": value("angle") > 0.6}, when=[~value("near")], accept=[value("markers") >= 3])
    model = replace(MODEL, observers=(OBSERVERS[0], replace(OBSERVERS[1], build=tree(look))))

    result = replay_journal(tmp_path / "run.mcap", model)
    assert result.difference is not None
    recorded = result.difference.recorded
    assert recorded is not None
    assert (recorded.kind, recorded.name, recorded.what) == (Kind.JOB, "look", "started")
    assert result.difference.replayed is None
    assert result.difference.position == result.compared + 1


def test_a_journal_that_ends_anywhere_is_equal_up_to_its_end(tmp_path: Path) -> None:
    run_door(tmp_path / "run.mcap", loops=2)
    header, events = read(tmp_path / "run.mcap")

    for end in range(0, len(events), 7):
        result = replay(header, events[:end], MODEL, Manager, None)
        assert (result.difference, result.compared) == (
            None,
            sum(event.kind is not Kind.INPUT for event in events[:end]),
        )


def test_a_surplus_event_and_a_missing_event_are_differences(tmp_path: Path) -> None:
    run_door(tmp_path / "run.mcap")
    header, events = read(tmp_path / "run.mcap")
    where = next(number for number, event in enumerate(events) if event.name == "open" and event.what == "identified")

    more = replay(header, [*events, events[where]], MODEL, Manager, None).difference
    assert more is not None
    assert (more.recorded, more.replayed) == (events[where], None)
    fewer = replay(header, [*events[:where], *events[where + 1 :]], MODEL, Manager, None).difference
    assert fewer is not None
    assert fewer.replayed is not None
    assert (fewer.replayed.name, fewer.replayed.what) == ("open", "identified")


def test_an_input_that_no_run_has_is_a_difference(tmp_path: Path) -> None:
    run_door(tmp_path / "run.mcap", loops=1)
    header, events = read(tmp_path / "run.mcap")
    where = next(number for number, event in enumerate(events) if event.what == "finish")
    act = replace(events[where], what="act", details=dict(events[where].details))

    difference = replay(header, [*events[: where + 1], act, *events[where + 1 :]], MODEL, Manager, None).difference
    assert difference is not None
    assert difference.because == (
        "act of main_execution cannot be replayed: RuntimeError a skill that has ended cannot act: begin it again"
    )


def test_the_progress_of_a_replay_is_the_time_since_the_start_of_the_run(tmp_path: Path) -> None:
    run_door(tmp_path / "run.mcap", loops=1, start_s=1000.0)
    header, events = read(tmp_path / "run.mcap")
    instants_s: list[float] = []

    replay(header, events, MODEL, Manager, None, progress=instants_s.append)
    assert instants_s == sorted(instants_s)
    assert (instants_s[0], instants_s[-1]) == (0.0, events[-1].instant_s - 1000.0)


def test_calls_that_were_refused_in_the_run_are_refused_again(tmp_path: Path) -> None:
    model = forest([variable("a", sources=("observer", "house")), given("b")], observer("o", seen("eye", "a")))
    with journalled(model, World({"eye": YES}), tmp_path / "run.mcap", SimClock(5.0)) as manager:
        with pytest.raises(NotDeclaredError):
            manager.set("a", True)
        with pytest.raises(ValueError, match="evidence for 'b'"):
            manager.set("b", True, evidence_s=6.0)
        with pytest.raises(NotASourceError):
            manager.agent("house").set("b", True)
        manager.agent("house").set("a", True, evidence_s=4.0)
        with pytest.raises(ZeroDivisionError):
            manager.decide("b", lambda: 1 // 0)

    assert assert_same(tmp_path / "run.mcap", model).derived[Kind.VARIABLE] == 2


def test_jobs_that_fail_time_out_hang_or_revise_their_evidence_are_derived_again(tmp_path: Path) -> None:
    def revises(job: Any) -> object:
        job.sleep(0.1)
        job.evidence(job.now_s() - 0.05, job.now_s())
        job.sleep(0.2)
        job.evidence(job.now_s(), job.now_s())
        job.sleep(0.1)
        return YES

    def raises(_: Any) -> object:
        raise ValueError("no picture")

    model = forest(
        [given("near"), *(variable(name, when_unobservable="forget") for name in "abcd")],
        observer("o", seen("revises", "a", when=[value("near")])),
        observer("p", seen("raises", "b")),
        observer("q", seen("hangs", "c", timeout_s=0.5)),
        observer("r", seen("rejects", "d", accept=[known("seen")])),
        skills=[SkillModel(name="act", preview=("a", "b"), monitor=("c", "d"), changes=("a",))],
    )
    finds = {"revises": revises, "raises": raises, "hangs": takes(60.0, YES), "rejects": {"seen": None}}
    clock = SimClock()
    with journalled(model, World(finds), tmp_path / "run.mcap", clock) as manager:
        manager.set("near", True)
        with manager.skill("act") as skill:
            for index in range(40):
                clock.sleep(0.13)
                manager.set("near", index % 4 != 0)
                if index == 20:
                    with skill.acting():
                        clock.sleep(0.3)

    whats = {event.what for event in read(tmp_path / "run.mcap")[1] if event.kind is Kind.JOB}
    assert whats >= {"returned", "failed", "voided", "rejected"}
    assert_same(tmp_path / "run.mcap", model)


def meddling(manager: Callable[[], Manager]) -> Callable[[Any], object]:
    """Return a perception function that calls the context manager itself, which it should not do."""

    def find(job: Any) -> object:
        chance, codra = job.random, manager()
        name, what = chance.choice(codra.modelled()), chance.randrange(7)
        try:
            if what == 0:
                codra.declare(name, chance.choice([None, True]))
            elif what == 1:
                codra.withdraw(name)
            elif what == 2:
                codra.set(name, True)
            elif what == 3:
                codra.expect("s1")
            elif what == 4:
                with codra.skill("s2") as skill, skill.acting():
                    pass
            elif what == 5:
                codra.decide(name, lambda: chance.choice([True, None]))
            else:
                codra.agent("house").set(name, False)
        except (NotDeclaredError, NotASourceError):
            pass
        job.sleep(chance.random() * 0.03)
        return {"seen": chance.random() < 0.7}

    return find


@pytest.mark.parametrize(
    ("seed", "clock"), [(0, WallClock), (1, SimClock), (2, SimClock), (3, WallClock), (5, SimClock)]
)
def test_calls_of_perception_functions_on_the_context_manager_are_repeated(
    tmp_path: Path, seed: int, clock: Callable[[], Clock]
) -> None:
    model, chance, time_ = unruly_forest(seed), random.Random(seed), clock()
    running: list[Manager] = []
    names = [name for observer_model in model.observers for name in observer_model.identifies]
    find = meddling(lambda: running[0])
    world = World({f"look_{name}_{rank}": find for name in names for rank in range(2)})
    with journalled(model, world, tmp_path / "run.mcap", time_, seed) as manager:
        running.append(manager)
        for name in names[:6]:
            manager.declare(name)
        for _ in range(20):
            with suppress(NotDeclaredError):
                manager.set(chance.choice(manager.modelled()), True)
            time_.sleep(0.05)
    if isinstance(time_, WallClock):
        time_.close()

    of_jobs = [event for event in read(tmp_path / "run.mcap")[1] if "work" in event.details]
    assert bool(of_jobs) is isinstance(time_, SimClock)
    assert_same(tmp_path / "run.mcap", model)


def test_a_name_that_the_package_lacks_is_reported(tmp_path: Path) -> None:
    run_door(tmp_path / "run.mcap")
    without = replace(MODEL, variables=MODEL.variables[1:], observers=MODEL.observers[1:])

    difference = replay_journal(tmp_path / "run.mcap", without).difference
    assert difference is not None
    assert difference.because == "the package has no variable 'localized', which the run used"


def test_changes_are_reported_from_near_to_far_and_equal_parts_are_not(tmp_path: Path) -> None:
    run_door(tmp_path / "run.mcap")
    far = Look(MEASURE_DISTANCE, {"near": value("distance") < 1.2}, when=[value("localized")])
    look = Look(LOOK, {"open": value("angle") > 0.6}, when=[value("near")], accept=[value("markers") >= 5])
    observers = tuple(
        replace(old_observer, build=tree(new_look))
        for old_observer, new_look in zip(OBSERVERS, (far, look), strict=True)
    )

    difference = replay_journal(tmp_path / "run.mcap", replace(MODEL, observers=observers)).difference
    assert difference is not None
    assert [(change.owner, change.what) for change in difference.changes][:2] == [
        ("look", "accept_when"),
        ("measure_distance", "identifies near"),
    ]
    same = replace(MODEL, observers=tuple(replace(observer_model) for observer_model in OBSERVERS))
    assert replay_journal(tmp_path / "run.mcap", same).difference is None


# Real time


def unruly(job: Any) -> object:
    """A perception function that randomly sleeps in two ways, reports evidence, fails, or measures nothing."""
    chance = job.random
    if chance.random() < 0.5:
        job.evidence(job.now_s(), job.now_s())
    duration_s = chance.random() * 0.03
    if chance.random() < 0.5:
        time.sleep(duration_s)
    else:
        job.sleep(duration_s)
    luck = chance.random()
    if luck < 0.1:
        raise ValueError("no picture")
    if luck < 0.2:
        return {"seen": None}
    if luck < 0.3:
        job.evidence(job.now_s(), job.now_s())
    return {"seen": chance.random() < 0.7}


def unruly_forest(seed: int) -> ContextModel:
    """Return a model with alternatives, shared slots, feedback, short timeouts and validity.

    Conditions have ages and unknowns.
    """
    chance = random.Random(seed)
    names = [f"v{number}" for number in range(14)]
    left, observers = names[:11], []
    while left:
        mine = [left.pop() for _ in range(min(len(left), chance.randint(1, 3)))]
        looks = [unruly_look(f"look_{mine[0]}_{rank}", mine, names, chance) for rank in range(chance.choice([1, 1, 2]))]
        period_s, priority = chance.choice([0.02, 0.05, 0.2]), chance.randint(0, 3)
        observers.append(observer(f"o_{mine[0]}", *looks, period_s=period_s, priority=priority))
    skills = [
        SkillModel(
            name=f"s{number}",
            preview=tuple(chance.sample(names, 3)),
            monitor=tuple(chance.sample(names, 2)),
            changes=tuple(chance.sample(names, 2)),
        )
        for number in range(4)
    ]
    variables = [
        variable(
            name,
            when_unobservable=chance.choice(["keep", "forget"]),
            valid_for_s=chance.choice([0.05, 0.3, 60.0]),
            sources=("observer", "house") if name in names[:11] else ("main_execution", "house"),
        )
        for name in names
    ]
    return forest(variables, *observers, skills=skills, slots={"vision": 1})


def unruly_look(name: str, mine: Sequence[str], names: Sequence[str], chance: random.Random) -> Look:
    needs = [need for need in chance.sample(names, chance.choice([0, 0, 1, 2])) if need not in mine]
    forms = [value, known, lambda need: ~value(need), lambda need: ~known(need) | (age(need) > 0.1)]
    return seen(
        name,
        *mine,
        when=[chance.choice(forms)(need) for need in needs],
        slots=chance.choice([(), ("vision",)]),
        timeout_s=chance.choice([0.02, 5.0]),
        min_interval_s=chance.choice([0.0, 0.05]),
    )


MIN_EVENT_COUNT = 600
"""A run lasts at least until it has this many events, however slow the machine is."""


def hammer(manager: Manager, clock: WallClock, seed: int, end_s: float) -> None:
    chance, names = random.Random(seed), manager.modelled()
    while clock.now_s() < end_s or len(manager.record) < MIN_EVENT_COUNT:
        name, what = chance.choice(names), chance.randrange(8)
        try:
            if what == 0:
                manager.declare(name, chance.choice([None, True, False]))
            elif what == 1:
                manager.withdraw(name)
            elif what == 2:
                manager.expect(f"s{chance.randrange(4)}", f"s{chance.randrange(4)}")
            elif what == 3:
                with manager.skill(f"s{chance.randrange(4)}") as skill, skill.acting():
                    clock.sleep(chance.random() * 0.02)
            elif what == 4:
                manager.set(name, chance.random() < 0.5)
            elif what == 5:
                manager.agent("house").set(name, True, evidence_s=clock.now_s() - chance.random() * 0.1)
            elif what == 6:
                with manager.slot("vision"):
                    clock.sleep(chance.random() * 0.01)
            else:
                wait_up_to_s, shadow = chance.choice([0.0, 0.02]), chance.random() < 0.2
                manager.decide(name, lambda: chance.choice([True, None]), wait_up_to_s=wait_up_to_s, shadow=shadow)
        except (NotDeclaredError, NotASourceError):
            pass


@pytest.mark.parametrize("seed", range(4))
def test_a_run_in_real_time_under_several_threads_is_derived_again_byte_for_byte(tmp_path: Path, seed: int) -> None:
    model = unruly_forest(seed)
    names = [name for observer_model in model.observers for name in observer_model.identifies]
    world = World({f"look_{name}_{rank}": unruly for name in names for rank in range(2)})
    errors: list[BaseException] = []
    with WallClock() as clock, journalled(model, world, tmp_path / "run.mcap", clock, seed) as manager:
        end_s = clock.now_s() + 1.0

        def body(number: int) -> None:
            try:
                hammer(manager, clock, number, end_s)
            except BaseException as error:  # noqa: BLE001 - reported below
                errors.append(error)

        threads = [threading.Thread(target=body, args=(number,), daemon=True) for number in range(4)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(60.0)

    assert errors == []
    assert assert_same(tmp_path / "run.mcap", model).compared > 200
    with_unused_variable = replace(model, variables=(*model.variables, given("unused")))
    assert replay_journal(tmp_path / "run.mcap", with_unused_variable).difference is None


def test_events_that_come_late_are_late_again(tmp_path: Path) -> None:
    """The dispatcher is delayed, as by a program that holds Python's lock for a while."""
    model = forest([given("x", valid_for_s=0.05), variable("a")], observer("o", seen("eye", "a"), period_s=0.03))
    held, release = threading.Event(), threading.Event()
    with WallClock() as clock, journalled(model, World({"eye": YES}), tmp_path / "run.mcap", clock) as manager:
        manager.declare("a")
        manager.set("x", True)
        clock.call_at(clock.now_s(), lambda: (held.set(), release.wait(60.0)))
        assert held.wait(60.0)
        clock.sleep(0.2)
        release.set()
        assert clock.wait_until(lambda: len(manager.record) > 20, 60.0)

    assert "late" in [event.what for event in read(tmp_path / "run.mcap")[1]]
    assert_same(tmp_path / "run.mcap", model)


def test_a_thread_that_cannot_be_started_is_not_started_again(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    model = forest([variable("a")], observer("o", seen("eye", "a"), period_s=0.05))
    refused: list[str] = []
    begin = threading.Thread.start

    def start(thread: threading.Thread) -> None:
        if thread.name == "codra-work" and len(refused) < 2:
            refused.append(thread.name)
            raise RuntimeError("can't start new thread")
        begin(thread)

    monkeypatch.setattr(threading.Thread, "start", start)
    with WallClock() as clock, journalled(model, World({"eye": YES}), tmp_path / "run.mcap", clock) as manager:
        manager.declare("a")
        assert clock.wait_until(lambda: manager.get("a").known, 60.0)

    assert refused == ["codra-work"] * 2
    assert_same(tmp_path / "run.mcap", model)


def test_infinite_values_are_derived_again(tmp_path: Path) -> None:
    model = forest(
        [variable("far", type=real())],
        observer("o", Look(algorithm("eye", {"distance": real()}), {"far": value("distance")})),
    )
    clock = SimClock()
    with journalled(model, World({"eye": {"distance": float("inf")}}), tmp_path / "run.mcap", clock) as manager:
        manager.declare("far", float("-inf"))
        clock.sleep(2.0)
        assert manager.get("far").value == float("inf")

    assert_same(tmp_path / "run.mcap", model)


def test_a_door_with_another_source_of_near_differs_at_the_first_event(tmp_path: Path) -> None:
    run_door(tmp_path / "run.mcap")

    result = replay_journal(tmp_path / "run.mcap", GIVEN_NEAR)
    assert result.difference is not None
    assert result.difference.position <= 3


def test_a_result_with_the_name_of_a_field_of_events_is_derived_again(tmp_path: Path) -> None:
    look = Look(algorithm("eye", {"what": member("started", "ended")}), {"phase": value("what")})
    model = forest([variable("phase", type=member("started", "ended"))], observer("o", look))
    clock = SimClock()
    with journalled(model, World({"eye": {"what": "started"}}), tmp_path / "run.mcap", clock) as manager:
        manager.declare("phase")
        clock.sleep(3.0)
        assert manager.get("phase").value == "started"

    assert_same(tmp_path / "run.mcap", model)


def test_an_event_that_cannot_be_decoded_is_not_compared(tmp_path: Path) -> None:
    run_door(tmp_path / "run.mcap", loops=2)
    header, events = read(tmp_path / "run.mcap")
    unreadable_event = RecordedEvent(Kind.VARIABLE, b"{}", lambda: None)
    recorded_events = [RecordedEvent(event.kind, message_of(event), partial(_same, event)) for event in events]
    for position in (20, len(events)):
        stored_events = [*recorded_events[:position], unreadable_event, *recorded_events[position:]]
        recording = Recording(frozenset(event.kind for event in events), iter(stored_events))
        result = replay(header, recording, MODEL, Manager, None)
        assert result.difference is None
        assert result.compared == sum(event.kind is not Kind.INPUT for event in events)


def _same(event: Event) -> Event:
    return event


def test_a_journal_that_grows_is_replayed_up_to_its_end_when_it_was_opened(tmp_path: Path) -> None:
    model, clock, path = forest([given("told")]), SimClock(), tmp_path / "run.mcap"
    with journalled(model, World(), path, clock) as manager:
        manager.set("told", True)
        with JournalReader(path) as index_reader:
            header, _ = index_reader.header(), index_reader.index()
            manager.decide("told", lambda: None)
            with JournalReader(path) as reader:
                recording = Recording.of_file(reader, index_reader.kinds(), max_messages=index_reader.message_count)
                replay_result = replay(header, recording, model, Manager, None)

    assert (replay_result.difference, replay_result.compared, replay_result.absent) == (None, 1, ())
