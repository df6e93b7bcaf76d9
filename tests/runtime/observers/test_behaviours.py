"""Real py_trees, ticked by the forest: Figure 4's order, asynchronous perception, cancellation, evidence intervals."""

from __future__ import annotations

import pytest
from py_trees.common import Status
from py_trees.display import unicode_tree

from codra_dsl.logic import value
from codra_dsl.runtime import Job, Reason, SimClock
from codra_dsl.runtime.journal import Kind
from tests.runtime.door import GIVEN_NEAR, Door, started
from tests.runtime.forests import World, events, forest, given, observer, seen, takes, variable
from tests.runtime.forests import started as started_forest

FIGURE_4 = """\
[-] door_lid
    --> control flag
    --> near
    --> due or running
    --> look
    --> markers >= 3
    --> identify open
"""


def names_in(text: str) -> list[str]:
    return [line.strip(" {}[]-o>*/\\_").strip() for line in text.splitlines()]


def test_a_tree_shows_the_order_of_figure_4() -> None:
    with started(Door()) as (manager, _):
        assert unicode_tree(manager._forest.observers["door_lid"].tree) == FIGURE_4


def test_a_tree_shows_figure_4_for_every_alternative() -> None:
    model = forest(
        [given("bright"), variable("open")],
        observer("lid", seen("camera", "open", when=[value("bright")]), seen("sonar", "open")),
    )
    with started_forest(model, World()) as manager:
        assert names_in(unicode_tree(manager._forest.observers["lid"].tree)) == [
            "lid",
            "control flag",
            "alternatives",
            *("camera", "value('bright')", "due or running", "camera", "identify open"),
            *("sonar", "due or running", "sonar", "identify open"),
        ]


def test_perception_does_not_repeat_at_every_tick() -> None:
    """There are ten ticks and one look per second."""
    with started(Door(duration_s=0.2), GIVEN_NEAR) as (manager, clock):
        manager.declare("open")
        for _ in range(100):
            manager._forest.observers["door_lid"].request_tick()
            clock.sleep(0.1)
        assert manager._forest.observers["door_lid"].tree.status is Status.RUNNING
    assert len(manager.record.of(Kind.JOB)) == 20
    assert events(manager, Kind.JOB) == ["started", "returned"] * 10


def test_a_look_that_takes_longer_than_its_period_is_followed_by_the_next_at_once() -> None:
    door = Door(duration_s=2.5)
    with started(door, GIVEN_NEAR) as (manager, clock):
        manager.declare("open")
        clock.sleep(8)
    assert door.asked_s("look") == [0.0, 2.5, 5.0, 7.5]


def test_during_a_job_the_node_is_running() -> None:
    with started(Door(duration_s=0.8), GIVEN_NEAR) as (manager, clock):
        manager.declare("open")
        clock.sleep(0.5)
        manager.set("near", True)
        clock.sleep(0.1)
        statuses = {node.name: node.status for node in manager._forest.observers["door_lid"].tree.iterate()}
    assert statuses["look"] is Status.RUNNING
    assert statuses["due or running"] is Status.SUCCESS
    assert statuses["identify open"] is Status.INVALID


def test_a_job_is_cancelled_when_its_tree_stops() -> None:
    with started(Door(duration_s=2.0), GIVEN_NEAR) as (manager, clock):
        manager.declare("open")
        clock.sleep(1)
        manager.withdraw("open")
        assert events(manager, Kind.JOB) == ["started", "cancelled"]
        assert manager._forest.observers["door_lid"].tree.status is Status.FAILURE
        clock.sleep(10)
    assert events(manager, Kind.JOB) == ["started", "cancelled"]
    assert manager.history("open") == ()


def test_a_tree_that_stops_and_starts_at_one_instant_begins_a_new_look() -> None:
    door = Door(duration_s=2.0)
    with started(door, GIVEN_NEAR) as (manager, clock):
        manager.declare("open")
        clock.sleep(1)
        manager.withdraw("open")
        manager.declare("open")
        clock.sleep(2)
        assert manager.get("open").evidence_s == 1.0
    assert door.asked_s("look") == [0.0, 1.0, 3.0]


@pytest.mark.parametrize("snapshot", [False, True])
def test_a_precondition_that_fails_cancels_a_job_only_while_its_evidence_is_being_taken(snapshot: bool) -> None:
    with started(Door(duration_s=2.0, angle_rad=1.0, snapshot=snapshot), GIVEN_NEAR) as (manager, clock):
        manager.declare("open")
        clock.sleep(1)
        manager.set("near", False)
        clock.sleep(5)
        assert events(manager, Kind.JOB) == ["started", "returned" if snapshot else "cancelled"]
        assert manager.get("open").known is snapshot


@pytest.mark.parametrize("snapshot", [False, True])
def test_a_precondition_that_fails_and_holds_again_between_ticks_voids_evidence_whose_interval_was_open(
    snapshot: bool,
) -> None:
    """Evidence that was complete before is not voided."""
    with started(Door(duration_s=2.0, angle_rad=1.0, snapshot=snapshot), GIVEN_NEAR) as (manager, clock):
        manager.declare("open")
        clock.sleep(1)
        manager.set("near", False)
        manager.set("near", True)
        clock.sleep(1.5)
        assert manager.get("open").known is snapshot
        assert events(manager, Kind.JOB)[:2] == ["started", "returned" if snapshot else "voided"]
        clock.sleep(3)
        assert manager.get("open").known


def test_the_event_log_contains_the_condition_that_voided_evidence() -> None:
    with started(Door(duration_s=2.0, snapshot=False), GIVEN_NEAR) as (manager, clock):
        manager.declare("open")
        clock.sleep(1)
        manager.set("near", False)
        manager.set("near", True)
        clock.sleep(0)
        (voided_event,) = [event for event in manager.record.of(Kind.JOB) if event.what == "voided"]
    assert voided_event.details == {"index": 0, "condition": "near"}


def test_evidence_that_takes_part_of_a_job_is_open_until_the_job_reports_it() -> None:
    """The camera is aimed for 0.5 s and exposed for 0.5 s; its image is processed for 1 s."""

    def exposes(job: Job) -> object:
        job.sleep(0.5)
        start_s = job.now_s()
        job.sleep(0.5)
        job.evidence(start_s, job.now_s())
        job.sleep(1.0)
        return {"angle": 1.0, "markers": 4}

    for change_s, counts in [(0.25, False), (0.75, False), (1.25, True), (1.75, True)]:
        with started(Door(instead=exposes), GIVEN_NEAR) as (manager, clock):
            manager.declare("open")
            clock.sleep(change_s)
            manager.set("near", False)
            clock.sleep(10)
            assert (manager.get("open").known, change_s) == (counts, change_s)


def exposes_late(job: Job) -> object:
    job.sleep(1.0)
    job.evidence(job.now_s(), job.now_s())
    return {"angle": 1.0, "markers": 4}


def test_the_evidence_of_a_job_is_not_known_before_the_job_reports_it() -> None:
    """In simulated time the function has run already; in real time its report is still unknown, so evidence is open."""
    with started(Door(instead=exposes_late), GIVEN_NEAR) as (manager, clock):
        manager.declare("open")
        clock.sleep(0.25)
        manager.set("near", False)
        clock.sleep(0.25)
        manager.set("near", True)
        clock.sleep(0.45)
        assert events(manager, Kind.JOB) == ["started", "cancelled"]


def test_evidence_still_to_come_is_not_judged_by_a_validity_that_may_be_renewed() -> None:
    model = forest(
        [given("near", valid_for_s=0.7), given("calm"), variable("a")],
        observer("o", seen("eye", "a", when=[value("near"), value("calm")])),
    )

    def sees(job: Job) -> object:
        exposes_late(job)
        return {"seen": True}

    clock = SimClock()
    with started_forest(model, World({"eye": sees}), clock) as manager:
        manager.set("near", True)
        manager.set("calm", True)
        manager.declare("a")
        for name in ("calm", "near", "calm"):
            clock.sleep(0.25)
            manager.set(name, True)
        clock.sleep(0.25)
        assert manager.get("a").value is True


@pytest.mark.parametrize(("aim_s", "counts"), [(0.1, True), (0.4, False)])
def test_evidence_is_void_when_it_turns_out_later_that_a_precondition_had_failed(aim_s: float, counts: bool) -> None:
    """The loss of `near` at 1.0 s is known at 1.8 s; a picture of 0.9 s or 1.2 s gives a result at 2.5 s."""

    def measures(job: Job) -> object:
        job.evidence(job.now_s(), job.now_s())
        near = job.now_s() < 1.0
        job.sleep(0.8)
        return {"seen": near}

    def reads(job: Job) -> object:
        job.sleep(aim_s)
        job.evidence(job.now_s(), job.now_s())
        job.sleep(1.7 - aim_s)
        return {"seen": True}

    model = forest(
        [variable("near"), variable("a")],
        observer("o", seen("base", "near")),
        observer("p", seen("eye", "a", when=[value("near")])),
    )
    clock = SimClock()
    with started_forest(model, World({"base": measures, "eye": reads}), clock) as manager:
        manager.declare("a")
        clock.sleep(5)
        assert manager.get("a").known is counts
        assert events(manager, Kind.JOB, "eye") == ["started", "returned" if counts else "voided"]


def test_a_condition_refines_the_result() -> None:
    with started(Door(markers=2)) as (manager, clock):
        manager.declare("open")
        clock.sleep(3)
        reading = manager.get("open")
    assert (reading.reason, reading.detail) == (Reason.REJECTED, "not markers >= 3")


def test_a_node_shows_why_it_fails() -> None:
    with started(Door(distance_m=9.0)) as (manager, clock):
        manager.declare("open")
        precondition = manager._forest.observers["door_lid"].tree.children[1]
        clock.sleep(0)
        assert (precondition.status, precondition.feedback_message) == (Status.FAILURE, "does not hold")
    with started(Door()) as (manager, clock):
        manager.set("localized", False)
        manager.declare("open")
        precondition = manager._forest.observers["door_lid"].tree.children[1]
        clock.sleep(0)
        assert (precondition.status, precondition.feedback_message) == (Status.FAILURE, "unknown")


def test_joined_trees_look_with_their_own_periods() -> None:
    world = World({"left": takes(0.2, {"seen": True}), "right": takes(3.0, {"seen": False})})
    left, right = seen("left", "a"), seen("right", "b")
    model = forest(
        [given("near"), variable("a"), variable("b")], observer("both", left, right, joined_when=[value("near")])
    )
    clock = SimClock()
    with started_forest(model, world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(6.5)
        assert (manager.get("a").value, manager.get("b").value) == (True, False)
    assert world.asked_s("left") == [0, 1, 2, 3, 4, 5, 6]
    assert world.asked_s("right") == [0, 3, 6]


def test_one_failing_look_of_joined_trees_leaves_the_other_alone() -> None:
    world = World({"left": takes(0.2, None), "right": takes(3.0, {"seen": False})})
    model = forest(
        [given("near"), variable("a"), variable("b")],
        observer("both", seen("left", "a"), seen("right", "b"), joined_when=[value("near")]),
    )
    clock = SimClock()
    with started_forest(model, world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(3.5)
        assert manager.get("a").reason is Reason.FAILED
        assert manager.get("b").value is False


def test_joined_trees_judge_evidence_by_its_own_interval() -> None:
    """The left evidence is complete when the precondition fails, the right is not."""
    world = World({"left": takes(2.0, {"seen": True}, snapshot=True), "right": takes(2.0, {"seen": True})})
    model = forest(
        [given("near"), variable("a"), variable("b")],
        observer("both", seen("left", "a"), seen("right", "b"), joined_when=[value("near")]),
    )
    clock = SimClock()
    with started_forest(model, world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(1)
        manager.set("near", False)
        clock.sleep(9)
        assert manager.get("a").known
        assert not manager.get("b").known
    assert world.calls == [("left", 0.0), ("right", 0.0)]


def test_a_joined_look_that_waits_for_a_slot_does_not_begin_under_a_broken_precondition() -> None:
    world = World({"left": takes(2.0, {"seen": True}, snapshot=True), "right": takes(2.0, {"seen": True})})
    model = forest(
        [given("near"), variable("a"), variable("b")],
        observer(
            "both", seen("left", "a", slots=("eye",)), seen("right", "b", slots=("eye",)), joined_when=[value("near")]
        ),
        slots={"eye": 1},
    )
    clock = SimClock()
    with started_forest(model, world, clock) as manager:
        manager.set("near", True)
        manager.declare("a")
        clock.sleep(1)
        manager.set("near", False)
        clock.sleep(9)
    assert world.calls == [("left", 0.0)]
