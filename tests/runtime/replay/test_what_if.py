"""A replay after its first difference: its claims about decisions, against runs of the changed package."""

from __future__ import annotations

import math
import random
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, fields, replace
from itertools import zip_longest
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
from hypothesis import example, settings
from hypothesis import given as given_examples
from hypothesis import strategies as st

from codra_dsl.logic import Term, known, value
from codra_dsl.runtime import ContextManager, ContextModel, EventLog, Journal, SimClock, boolean
from codra_dsl.runtime.journal import Event, Kind
from codra_dsl.runtime.journal.encoding import message_of
from codra_dsl.runtime.journal.run_header import RunHeader
from codra_dsl.runtime.replay import DecisionCounts, Replayed, replay, what_if
from codra_dsl.runtime.replay.decision_counts import total
from codra_dsl.runtime.replay.undetermined import Undetermined
from codra_dsl.runtime.values.declarations import DERIVED
from codra_dsl.runtime.values.model import PreviewCondition, SkillModel, integer
from tests.runtime.forests import Look, World, algorithm, forest, given, observer, seen, takes, variable
from tests.runtime.journal.journals import read

Manager = ContextManager[str, str]
DECISIONS = 5
SLOT_S = 2.0
"""The time between two decisions of the program; every decision is over after it."""

PASS = SkillModel(
    name="pass",
    preview=("near", "open"),
    preview_conditions=(PreviewCondition(text="near and not open", condition=value("near") & ~value("open")),),
)
RESULT = {"number": integer(0, 9), "quality": integer(0, 9)}


@dataclass(frozen=True, kw_only=True)
class Thresholds:
    """What differs between two packages."""

    near: int = 4
    open: int = 4
    quality: int = 0
    light: int = 0
    has_spare: bool = False
    near_valid_s: float = 3.0
    open_valid_s: float = 4.0
    light_valid_s: float = math.inf
    period_s: float = 0.5
    timeout_s: float = 5.0

    def model(self) -> ContextModel:
        settings: dict[str, Any] = {"period_s": self.period_s}
        measure = self._look("measure", "near", self.near, [value("light") > self.light])
        looks = [self._look("look", "open", self.open, [value("near")])]
        if self.has_spare:
            looks.append(self._look("spare", "open", self.open, [value("light") > self.light]))
        return forest(
            [
                given("light", type=integer(0, 9), valid_for_s=self.light_valid_s),
                variable("near", valid_for_s=self.near_valid_s),
                variable("open", valid_for_s=self.open_valid_s, when_unobservable="forget"),
                variable("ready", derived=value("near") & ~value("open"), sources=(DERIVED,)),
            ],
            observer("o_near", measure, **settings),
            observer("o_open", *looks, **settings),
            skills=[SkillModel(name="push", changes=("open",)), PASS],
        )

    def _look(self, name: str, identified: str, threshold: int, when: Sequence[Term]) -> Look:
        accept = [value("quality") >= self.quality]
        look = algorithm(name, RESULT, timeout_s=self.timeout_s)
        return Look(look, {identified: value("number") > threshold}, when, accept)


def world_of(chance: random.Random) -> Callable[[str, float], Mapping[str, int]]:
    """Return a world that changes now and then; every look sees the world as it is when the look begins."""
    changes = {name: sorted(chance.uniform(0, 30) for _ in range(6)) for name in ("measure", "look", "spare")}
    values = {(name, index): (chance.randrange(10), chance.randrange(10)) for name in changes for index in range(7)}

    def see(name: str, now_s: float) -> Mapping[str, int]:
        number, quality = values[name, sum(change_s <= now_s for change_s in changes[name])]
        return {"number": number, "quality": quality}

    return see


def run(path: Path, thresholds: Thresholds, seed: int, *, has_previews: bool = False) -> tuple[RunHeader, list[Event]]:
    """Run a program that decides, acts and writes at the same instants with any thresholds."""
    chance = random.Random(seed)
    see, clock, duration_s = world_of(chance), SimClock(), chance.choice([0.0, 0.1, 0.3])

    def find(name: str) -> Callable[[Any], object]:
        def look(job: Any) -> object:
            seen = see(name, job.now_s())
            job.evidence(job.now_s(), job.now_s())
            job.sleep(duration_s)
            return seen

        return look

    world = World({name: find(name) for name in ("measure", "look", "spare")})
    resources = {"world": world}
    with Manager(thresholds.model(), clock=clock, resources=resources, record=Journal(path)) as manager:
        for name in ("near", "open"):
            manager.declare(name)
        for slot in range(1, DECISIONS + 1):
            name, max_age_s = chance.choice(["near", "open", "ready"]), chance.choice([0.4, 2.0, 60.0])
            manager.set("light", chance.choice([2, 5, 8]))
            clock.sleep(chance.choice([0.3, 0.45, 0.7]))
            if has_previews:
                results = chance.choices([True, False, None], k=2)
                look = dict(zip(PASS.preview, results, strict=True)).get if chance.random() < 0.7 else None
                manager.preview("pass", look, max_age_s=max_age_s)
            found, wait_up_to_s = chance.choice([True, False, None]), chance.choice([0.0, 0.4])
            manager.decide(name, lambda: found, max_age_s=max_age_s, wait_up_to_s=wait_up_to_s)  # noqa: B023
            if chance.random() < 0.3:
                with manager.skill("push") as skill, skill.acting():
                    pass
            clock.sleep(slot * SLOT_S - clock.now_s())
    return read(path)


def answers_of(events: Sequence[Event], kind: Kind) -> list[tuple[bool, object]]:
    """Return, for each decision or preview, whether context answered it, and the value or the outcome."""
    details = "outcome" if kind is Kind.PREVIEW else "value"
    return [(event.what == "answered", event.details.get(details)) for event in events if event.kind is kind]


def replayed(header: RunHeader, events: Sequence[Event], thresholds: Thresholds, from_s: float = 0.0) -> Replayed:
    return replay(header, events, thresholds.model(), Manager, None, from_s=from_s)


def claim_about(
    header: RunHeader, events: Sequence[Event], thresholds: Thresholds, index: int, kind: Kind
) -> DecisionCounts:
    """Return the counts of one decision or preview: those from its question on, less those from the next question."""
    asked_s = [event.details["asked_s"] for event in events if event.kind is kind] + [math.inf]
    results = [replayed(header, events, thresholds, from_s) for from_s in asked_s[index : index + 2]]
    now, later = (total(result.previews if kind is Kind.PREVIEW else result.decisions) for result in results)
    names = DecisionCounts.__dataclass_fields__
    return DecisionCounts(**{name: getattr(now, name) - getattr(later, name) for name in names})


THRESHOLDS = st.builds(
    Thresholds,
    near=st.integers(0, 8),
    open=st.integers(0, 8),
    quality=st.integers(0, 5),
    light=st.integers(0, 6),
    has_spare=st.booleans(),
    near_valid_s=st.sampled_from([0.4, 3.0]),
    open_valid_s=st.sampled_from([0.5, 4.0]),
    light_valid_s=st.sampled_from([0.5, 2.0, 60.0]),
    period_s=st.sampled_from([0.3, 0.5]),
    timeout_s=st.sampled_from([0.2, 5.0]),
)


@pytest.mark.parametrize(
    ("has_previews", "kind"), [(False, Kind.DECISION), (True, Kind.DECISION), (True, Kind.PREVIEW)]
)
@example(
    before=Thresholds(near=1, open=6, quality=2, light=3, has_spare=True),
    after=Thresholds(near=0, open=4, quality=5, light=3),
    seed=338,
    index=0,
)
@given_examples(before=THRESHOLDS, after=THRESHOLDS, seed=st.integers(0, 10_000), index=st.integers(0, DECISIONS - 1))
@settings(max_examples=5)
def test_a_claim_without_an_assumption_is_what_the_changed_package_does(
    before: Thresholds, after: Thresholds, seed: int, index: int, *, has_previews: bool, kind: Kind
) -> None:
    with TemporaryDirectory() as folder:
        header, events = run(Path(folder) / "before.mcap", before, seed, has_previews=has_previews)
        _, events_after = run(Path(folder) / "after.mcap", after, seed, has_previews=has_previews)

    claim = claim_about(header, events, after, index, kind)
    (was_answered, value_before), (is_answered, value_after) = (
        answers_of(each, kind)[index] for each in (events, events_after)
    )
    assert (claim.decisions, claim.recorded) == (1, was_answered)
    if not claim.unknown and not claim.assumed:
        assert claim.replayed == is_answered
        assert claim.other_value == (was_answered and is_answered and value_before != value_after)


@example(before=Thresholds(light_valid_s=2.0), changed=Thresholds(), names={"light_valid_s"}, seed=1)
@example(  # a look of `open` would begin at the instant at which a result arrives
    before=Thresholds(
        near=0,
        open=0,
        quality=1,
        light=0,
        near_valid_s=0.4,
        open_valid_s=0.5,
        light_valid_s=0.5,
        period_s=0.3,
        timeout_s=0.2,
    ),
    changed=Thresholds(),
    names={"near_valid_s"},
    seed=0,
)
@example(  # the changed package has made fewer steps than the run when a result and a tick come at the same instant
    before=Thresholds(
        near=0,
        open=0,
        near_valid_s=0.4,
        open_valid_s=0.5,
        light_valid_s=2.0,
        period_s=0.3,
        timeout_s=0.2,
    ),
    changed=Thresholds(),
    names={"open_valid_s"},
    seed=800,
)
@given_examples(
    before=THRESHOLDS,
    changed=THRESHOLDS,
    names=st.sets(st.sampled_from([field.name for field in fields(Thresholds)]), min_size=1, max_size=2),
    seed=st.integers(0, 10_000),
)
@settings(max_examples=10)
def test_the_first_difference_is_that_of_a_run_with_the_changed_package(
    before: Thresholds, changed: Thresholds, names: set[str], seed: int
) -> None:
    after = replace(before, **{name: getattr(changed, name) for name in names})
    with TemporaryDirectory() as folder:
        header, events = run(Path(folder) / "before.mcap", before, seed)
        _, events_after = run(Path(folder) / "after.mcap", after, seed)

    pairs = list(zip_longest(derived_messages(events), derived_messages(events_after)))
    positions = [position for position, (recorded, derived) in enumerate(pairs, 1) if recorded != derived]
    difference = replayed(header, events, after).difference
    assert ([] if difference is None else [difference.position]) == positions[:1]
    if difference is not None and difference.replayed is not None:
        assert message_of(difference.replayed) == pairs[positions[0] - 1][1]


def derived_messages(events: Sequence[Event]) -> list[bytes]:
    return [message_of(event) for event in events if event.kind is not Kind.INPUT]


# A door that a robot approaches: the cases one by one


def door_run(path: Path, near: int = 4, light: int = 0, **settings: Any) -> tuple[RunHeader, list[Event]]:
    """Run a robot that decides on `near` four times; the light is too weak before 3 s in the changed packages."""
    clock, world = SimClock(), World({"measure": {"number": 6, "quality": 9}})
    model = Thresholds(near=near, light=light).model()
    with Manager(model, clock=clock, resources={"world": world}, record=Journal(path), **settings) as manager:
        manager.declare("near")
        manager.set("light", 3)
        for instant_s in (1.2, 2.2, 4.2, 5.2):
            if instant_s > 3.0:
                clock.sleep(3.3 - min(clock.now_s(), 3.3))
                manager.set("light", 9)
            clock.sleep(instant_s - clock.now_s())
            manager.decide("near", lambda: None)
    return read(path)


def test_the_end_of_a_validity_that_was_renewed_is_no_difference(tmp_path: Path) -> None:
    def model(valid_for_s: float) -> ContextModel:
        return replace(Thresholds(light_valid_s=valid_for_s).model(), skills=())

    clock, world = SimClock(), World({"measure": {"number": 6, "quality": 9}})
    with Manager(model(2.0), clock=clock, resources={"world": world}, record=Journal(tmp_path / "run.mcap")) as manager:
        manager.declare("near")
        for _ in range(20):
            manager.set("light", 3)
            clock.sleep(0.5)
    header, events = read(tmp_path / "run.mcap")

    for valid_for_s in (0.7, 5.0, 60.0):
        assert replay(header, events, model(valid_for_s), Manager, None).difference is None
    difference = replay(header, events, model(0.5), Manager, None).difference
    assert difference is not None
    assert difference.replayed is not None
    assert (difference.replayed.name, difference.replayed.what) == ("light", "unknown"), "it ends before it is renewed"


def test_the_result_of_a_look_that_timed_out_only_in_the_run_stays_unknown(tmp_path: Path) -> None:
    clock, world = SimClock(), World({"measure": takes(0.3, {"number": 6, "quality": 9})})
    model, journal = Thresholds(timeout_s=0.2).model(), Journal(tmp_path / "run.mcap")
    with Manager(model, clock=clock, resources={"world": world}, record=journal) as manager:
        manager.declare("near")
        manager.set("light", 3)
        clock.sleep(1.2)
        manager.decide("near", lambda: None)
    header, events = read(tmp_path / "run.mcap")

    result = replayed(header, events, Thresholds())
    assert result.decisions == {"near": DecisionCounts(decisions=1, unknown=1)}
    assert result.missing_looks["measure"] > 0


def test_another_threshold_changes_values_and_everything_is_known(tmp_path: Path) -> None:
    header, events = door_run(tmp_path / "run.mcap")

    result = replayed(header, events, Thresholds(near=7))
    assert result.decisions == {"near": DecisionCounts(decisions=4, recorded=4, replayed=4, other_value=4)}
    assert (result.missing_looks, result.skipped_inputs, result.ended_because) == ({}, {}, "")


def test_decisions_that_would_need_a_look_are_counted_and_its_result_stays_unknown(tmp_path: Path) -> None:
    header, events = door_run(tmp_path / "run.mcap")

    result = replayed(header, events, Thresholds(light=5))
    counts = result.decisions["near"]
    assert (counts.decisions, counts.recorded, counts.lost) == (4, 4, 1)
    assert counts.unknown >= 1, "the first look of the main execution might have been kept"
    assert result.missing_looks.keys() == {"main_execution"}


def test_a_look_that_the_run_did_not_make_has_no_invented_result(tmp_path: Path) -> None:
    header, events = door_run(tmp_path / "run.mcap", light=5)

    result = replayed(header, events, Thresholds(light=0))
    counts = result.decisions["near"]
    assert (counts.decisions, counts.recorded, counts.gained, counts.unknown) == (4, 2, 0, 2)
    assert result.missing_looks["measure"] > 0


def test_a_decision_that_an_override_answers_is_known_even_if_the_variable_beneath_it_is_not(tmp_path: Path) -> None:
    path, clock, world = tmp_path / "run.mcap", SimClock(), World({"measure": {"number": 6, "quality": 9}})
    with Manager(Thresholds(light=5).model(), clock=clock, resources={"world": world}, record=Journal(path)) as manager:
        manager.declare("near")
        manager.set("light", 3)
        clock.sleep(1.2)
        manager.decide("near", lambda: None)
        for content in (True, None):
            manager.override("near", content, for_s=5.0, reason="sensor broken")
            manager.decide("near", lambda: None)

    result = replayed(*read(path), Thresholds(light=0))
    assert result.decisions["near"] == DecisionCounts(decisions=3, recorded=1, replayed=1, unknown=1)


def test_an_unchanged_package_gives_the_counts_of_the_run(tmp_path: Path) -> None:
    header, events = door_run(tmp_path / "run.mcap", light=5)

    result = replayed(header, events, Thresholds(light=5))
    assert result.difference is None
    assert result.decisions == {"near": DecisionCounts(decisions=4, recorded=2, replayed=2)}


def test_only_events_and_decisions_from_an_instant_on_are_counted(tmp_path: Path) -> None:
    header, events = door_run(tmp_path / "run.mcap")

    result = replayed(header, events, Thresholds(), from_s=4.0)
    assert result.decisions == {"near": DecisionCounts(decisions=2, recorded=2, replayed=2)}
    assert result.compared == sum(event.kind is not Kind.INPUT and event.instant_s >= 4.0 for event in events)


def test_inputs_that_are_not_possible_in_the_package_are_skipped_and_counted(tmp_path: Path) -> None:
    with Manager(
        forest([given("light", type=integer(0, 9)), given("door")]),
        clock=SimClock(),
        resources={"world": World()},
        record=Journal(tmp_path / "run.mcap"),
    ) as manager:
        manager.set("door", True)
        manager.set("light", 3)
        assert manager.decide("light", lambda: None) == 3
    header, events = read(tmp_path / "run.mcap")

    result = replay(header, events, forest([given("light", type=integer(0, 9))]), Manager, None)
    assert result.skipped_inputs == {"write": 1}
    assert result.decisions == {"light": DecisionCounts(decisions=1, recorded=1, replayed=1)}


def test_values_that_the_package_refuses_are_not_passed_on(tmp_path: Path) -> None:
    def model(high: int) -> ContextModel:
        return forest([given("light", type=integer(0, high)), variable("bright", derived=value("light") > 2)])

    with Manager(model(9), clock=SimClock(), resources={}, record=Journal(tmp_path / "run.mcap")) as manager:
        manager.set("light", 3)
        manager.set("light", 9)
        manager.override("light", 8, for_s=5.0, reason="lamp broken")
        assert manager.decide("light", lambda: None) == 8
    header, events = read(tmp_path / "run.mcap")

    result = replay(header, events, model(5), Manager, None)
    assert result.skipped_inputs == {"override": 1, "write": 1}
    assert result.decisions == {"light": DecisionCounts(decisions=1, recorded=1, replayed=1, other_value=1)}


def test_a_look_for_a_derived_variable_leaves_nothing_undetermined(tmp_path: Path) -> None:
    def model(high: int) -> ContextModel:
        light = given("light", type=integer(0, 9))
        return forest([light, variable("level", type=integer(0, high), derived=value("light"))])

    with Manager(model(9), clock=SimClock(), resources={}, record=Journal(tmp_path / "run.mcap")) as manager:
        manager.set("light", 9)
        for _ in range(2):
            manager.clock.sleep(1.0)
            manager.decide("level", lambda: None)
    header, events = read(tmp_path / "run.mcap")

    result = replay(header, events, model(5), Manager, None)
    assert result.decisions == {"level": DecisionCounts(decisions=2, recorded=2, lost=2)}


def test_a_derived_variable_is_determined_as_soon_as_its_inputs_are(tmp_path: Path) -> None:
    header, _ = door_run(tmp_path / "run.mcap")
    undetermined = Undetermined(header.summary)
    undetermined.miss_look("measure")
    undetermined.end_look("measure", is_known=True, is_assumed=False)
    assert undetermined.variables == {"near", "open", "ready"}
    for source, name in (("measure", "near"), ("look", "open")):
        details = {"value": True, "evidence_s": 1.0, "source": source, "present": True}
        undetermined.add_event(Event(instant_s=1.0, kind=Kind.VARIABLE, name=name, what="identified", details=details))
    assert undetermined.variables == set()


def preview_run(path: Path, **preview: Any) -> tuple[RunHeader, list[Event]]:
    """Run a robot that asks for the preview of a skill, which needs `near`, and decides on `near` one second later."""
    clock, world = SimClock(), World({"measure": {"number": 6, "quality": 9}})
    with Manager(preview_model(), clock=clock, resources={"world": world}, record=Journal(path)) as manager:
        manager.declare("near")
        manager.set("light", 3)
        clock.sleep(1.2)
        manager.preview("go", **preview)
        clock.sleep(1.0)
        manager.decide("near", lambda: None)
    return read(path)


def preview_model(light: int = 0) -> ContextModel:
    return replace(Thresholds(light=light).model(), skills=(SkillModel(name="go", preview=("near",)),))


def test_a_look_that_a_preview_would_need_leaves_its_variable_undetermined(tmp_path: Path) -> None:
    header, events = preview_run(tmp_path / "run.mcap", otherwise=lambda _: True)

    result = replay(header, events, preview_model(light=5), Manager, None)
    assert result.decisions == {"near": DecisionCounts(decisions=1, recorded=1, unknown=1)}
    assert result.previews == {"go": DecisionCounts(decisions=1, recorded=1, lost=1)}
    assert (result.derived[Kind.PREVIEW], result.missing_looks["main_execution"]) == (1, 2)


def test_a_preview_that_waits_only_in_the_replay_ends_after_its_time(tmp_path: Path) -> None:
    header, events = preview_run(tmp_path / "run.mcap", wait_up_to_s=0.5)
    copy = EventLog()

    result = replay(header, events, preview_model(light=5), Manager, copy)
    (preview,) = copy.of(Kind.PREVIEW)
    assert (preview.what, preview.instant_s) == ("unanswered", pytest.approx(1.7))
    assert result.decisions == {"near": DecisionCounts(decisions=1, recorded=1, lost=1)}
    assert result.previews == {"go": DecisionCounts(decisions=1, recorded=1, lost=1)}


def test_previews_are_counted_by_their_outcomes_apart_from_the_decisions_on_a_variable_of_this_name(
    tmp_path: Path,
) -> None:
    def model(level: int) -> ContextModel:
        condition = PreviewCondition(text="light", condition=value("light") > level)
        skill = SkillModel(name="light", preview=("light",), preview_conditions=(condition,))
        return forest([given("light", type=integer(0, 9))], skills=[skill])

    with Manager(model(4), clock=SimClock(), resources={}, record=Journal(tmp_path / "run.mcap")) as manager:
        manager.preview("light")
        for level in (3, 6, 8):
            manager.set("light", level)
            manager.preview("light")
        manager.decide("light", lambda: None)
    header, events = read(tmp_path / "run.mcap")

    result = replay(header, events, model(7), Manager, None)
    assert result.previews == {"light": DecisionCounts(decisions=4, recorded=3, replayed=3, other_value=1)}
    assert result.decisions == {"light": DecisionCounts(decisions=1, recorded=1, replayed=1)}


def test_a_result_for_other_arguments_than_those_of_the_run_is_an_assumption(tmp_path: Path) -> None:
    def model(near: int) -> ContextModel:
        look = Look(algorithm("look", {"seen": boolean()}, given=("near",)), {"open": value("seen")}, [known("near")])
        near_look = Look(algorithm("measure", RESULT), {"near": value("number") > near})
        variables = [variable("near", valid_for_s=3.0), variable("open", valid_for_s=4.0)]
        settings: dict[str, Any] = {"period_s": 0.5}
        return forest(variables, observer("o_near", near_look, **settings), observer("o_open", look, **settings))

    world = World({"measure": {"number": 6, "quality": 9}, "look": lambda _: {"seen": world.given[-1]["near"]}})
    clock, journal = SimClock(), Journal(tmp_path / "run.mcap")
    with Manager(model(4), clock=clock, resources={"world": world}, record=journal) as manager:
        manager.declare("open")
        clock.sleep(2.0)
        assert manager.decide("open", lambda: None) is True
    header, events = read(tmp_path / "run.mcap")

    result = replay(header, events, model(7), Manager, None)
    assert result.decisions == {"open": DecisionCounts(decisions=1, recorded=1, replayed=1, assumed=1)}


def test_writes_of_perception_functions_are_passed_on(tmp_path: Path) -> None:
    running: list[Manager] = []

    def measure(job: Any) -> Mapping[str, int]:
        running[0].set("light", min(int(job.index), 9))
        return {"number": 6, "quality": 9}

    clock, journal, world = SimClock(), Journal(tmp_path / "run.mcap"), World({"measure": measure})
    model = replace(Thresholds(light=-1).model(), skills=())
    with Manager(model, clock=clock, resources={"world": world}, record=journal) as manager:
        running.append(manager)
        manager.set("light", 0)
        manager.declare("near")
        clock.sleep(2.2)
        assert manager.decide("light", lambda: None) > 2
    header, events = read(tmp_path / "run.mcap")

    result = replayed(header, events, Thresholds(light=-1, near=7))
    assert result.decisions == {"light": DecisionCounts(decisions=1, recorded=1, replayed=1)}


def test_a_wait_that_ends_just_before_an_event_and_an_input_does_not_stop_a_replay(tmp_path: Path) -> None:
    def model(high: int) -> ContextModel:
        light = given("light", type=integer(0, 9), valid_for_s=2.0)
        return forest([light, variable("level", type=integer(0, high), derived=value("light"))])

    clock = SimClock()
    with Manager(model(9), clock=clock, resources={}, record=Journal(tmp_path / "run.mcap")) as manager:
        clock.sleep(0.6)
        manager.set("light", 9)
        clock.sleep(2.3 - clock.now_s())
        manager.decide("level", lambda: None, wait_up_to_s=0.3)
        clock.sleep(2.605 - clock.now_s())
        manager.set("light", 9)
        clock.sleep(1.0)
    header, events = read(tmp_path / "run.mcap")

    assert 2.3 + 0.3 < 2.6, "the light becomes stale after the wait"
    result = replay(header, events, model(5), Manager, None)
    assert result.ended_because == ""
    assert result.decisions == {"level": DecisionCounts(decisions=1, recorded=1, lost=1)}


def test_what_the_main_execution_found_is_undetermined_if_it_might_not_have_looked(tmp_path: Path) -> None:
    clock, world = SimClock(), World({"measure": {"number": 6, "quality": 9}})
    model, journal = Thresholds(light=4).model(), Journal(tmp_path / "run.mcap")
    with Manager(model, clock=clock, resources={"world": world}, record=journal) as manager:
        manager.declare("near")
        manager.set("light", 5)
        for _ in range(4):
            clock.sleep(1.2)
            manager.decide("near", lambda: False, max_age_s=2.0)
            manager.set("light", 1)
    header, events = read(tmp_path / "run.mcap")
    assert [was_answered for was_answered, _ in answers_of(events, Kind.DECISION)] == [True, True, False, True]

    result = replayed(header, events, Thresholds(light=6))
    assert result.decisions == {"near": DecisionCounts(decisions=4, recorded=3, lost=1, unknown=3)}


def test_a_forged_journal_cannot_let_a_replay_go_on_forever(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(what_if, "MAX_STEPS_BETWEEN_INPUTS", 300)
    header, events = door_run(tmp_path / "run.mcap", light=5)
    last_input = max(index for index, event in enumerate(events) if event.kind is Kind.INPUT)
    forged = [*events[:last_input], replace(events[last_input], instant_s=1e12), *events[last_input + 1 :]]

    assert "steps since the last input of the run" in replayed(header, forged, Thresholds(light=0)).ended_because


def test_an_algorithm_that_has_a_host_only_in_the_package_looks_as_in_the_run(tmp_path: Path) -> None:
    def model(host: str) -> ContextModel:
        return forest([variable("door_open", valid_for_s=9.0)], observer("doors", seen("look", "door_open", host=host)))

    clock, world = SimClock(), World({"look": {"seen": True}})
    with Manager(model(""), clock=clock, resources={"world": world}, record=Journal(tmp_path / "run.mcap")) as manager:
        manager.declare("door_open")
        clock.sleep(3.5)
        manager.decide("door_open", lambda: None)
    header, events = read(tmp_path / "run.mcap")

    result = replay(header, events, model("arm_pc"), Manager, None)
    assert result.decisions == {"door_open": DecisionCounts(decisions=1, recorded=1, replayed=1)}
