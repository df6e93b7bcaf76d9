"""Patterns, and subscriptions to their changes, which never block a writer."""

from __future__ import annotations

import logging
import threading
from collections.abc import Callable, Iterator
from typing import Any

import pytest

from codra_dsl.logic import age, known, value
from codra_dsl.runtime import Reason, SimClock, UnknownNameError, WallClock
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge import AgentHandle, Change, Knowledge
from codra_dsl.runtime.knowledge.declarations import Path, absent, anything, backward, distance, in_view, path, some
from tests.runtime.knowledge.store import store

PATIENCE_S = 60.0


def at(x_m: float, y_m: float = 0.0) -> Pose:
    return Pose.of((x_m, y_m, 0.0))


@pytest.fixture
def clock() -> SimClock:
    return SimClock()


@pytest.fixture
def knowledge(clock: SimClock) -> Knowledge:
    """Return the store with two people, one of them near the robot, and a container."""
    knowledge = store(clock)
    with knowledge.as_agent("person_detection") as people:
        for name, height_m in (("anna", 1.7), ("bob", 1.9)):
            people.insert_node(name, "person", height=height_m)
        people.insert_edge("bob", "close_to", "robot", distance=1.0)
    with knowledge.as_agent("container_detection") as detection:
        detection.insert_node("box", "roll_container")
        detection.place("world", "container_pose", "box", at(3.0))
        detection.insert_edge("box", "close_to", "robot")
    return knowledge


# Patterns


@pytest.mark.parametrize(
    ("patterns", "people"),
    [
        ([path(some("person", called="who"), "close_to", "robot")], ["bob"]),
        ([path(anything(called="who"), "close_to", "robot")], ["bob", "box"]),
        ([path("robot", backward("close_to"), anything(called="who"))], ["bob", "box"]),
        ([path(some("person", called="who"))], ["anna", "bob"]),
        ([path("world", "RT", anything(called="who"))], ["box"]),
        ([path("world", "container_pose", some("roll_container", called="who"), "close_to", "robot")], ["box"]),
        ([path("world", "container_pose", some("person", called="who"))], []),
        ([path("nobody", "close_to", "robot")], []),
        ([path(some("person", called="who")), absent(anything(called="who"), "close_to", "robot")], ["anna"]),
        ([path(some("person", called="who")), value("who.height") > 1.8], ["bob"]),
        ([path(some("person", called="who"), "close_to", "robot"), path("box", "close_to", "robot")], ["bob"]),
        (
            [path(anything(called="who"), "close_to", "robot", backward("close_to"), some("person"))],
            ["bob", "box"],
        ),
        ([path(some("roll_container", called="who")), known("who.load")], []),
        ([path(some("roll_container", called="who")), ~known("who.load")], ["box"]),
        ([path(some("person", called="who")), value("nobody.height") > 1.0], []),
    ],
    ids=lambda values: ", ".join(map(str, values)) or "none",
)
def test_a_pattern_finds_its_matches(knowledge: Knowledge, patterns: list[Any], people: list[str]) -> None:
    assert [match.node("who") for match in knowledge.snapshot().match(*patterns)] == people


def test_places_of_the_same_name_match_one_node(knowledge: Knowledge) -> None:
    twice = path(some("person", called="a"), "close_to", "robot"), path(anything(called="b"), "close_to", "robot")
    pairs = [(match.node("a"), match.node("b")) for match in knowledge.snapshot().match(*twice)]
    assert pairs == [("bob", "bob"), ("bob", "box")]
    assert knowledge.snapshot().match(twice[0], path(anything(called="a"), "close_to", "robot"))[0].edges == (
        ("bob", "close_to", "robot"),
        ("bob", "close_to", "robot"),
    )


def test_undeclared_names_in_a_pattern_are_reported(knowledge: Knowledge) -> None:
    with pytest.raises(UnknownNameError, match="no type of edges 'close': did you mean 'close_to'"):
        knowledge.snapshot().match(path("robot", "close", "box"))
    with pytest.raises(UnknownNameError, match="no type of nodes 'persons': did you mean 'person'"):
        knowledge.subscribe(print, path(some("persons")))
    with pytest.raises(ValueError, match="a path must end with a node"):
        path("robot", "wants")


def test_the_text_of_a_path_has_the_notation_of_the_spec() -> None:
    pattern: Path = path("world", "container_pose", some("roll_container", called="c"), backward("near"), anything())
    assert str(pattern) == "world -container_pose-> some roll_container as c <-near- anything"
    assert str(absent("robot", "is", "detecting")) == "not robot -is-> detecting"


def test_conditions_can_read_poses(knowledge: Knowledge, clock: SimClock) -> None:
    navigation = knowledge.as_agent("navigation")
    assert not knowledge.snapshot().holds(~(distance("robot", "box") < 5.0))
    navigation.place("world", "robot_pose", "robot", at(1.0))
    seen = knowledge.snapshot()
    assert seen.distance_m("robot", "box") == 2.0
    assert seen.holds(distance("robot", "box") < 2.1, in_view("box", "camera"))
    navigation.place("world", "robot_pose", "robot", Pose.about((0.0, 0.0, 1.0), 1.0, (1.0, 0.0, 0.0)))
    assert knowledge.snapshot().holds(~in_view("box", "camera"))
    clock.sleep(5.0)
    assert knowledge.snapshot().distance_m("robot", "box") is None
    assert knowledge.snapshot().in_view("anna", "camera") is None
    with pytest.raises(ValueError, match="'box' is not a camera: its type 'roll_container' has no view"):
        knowledge.snapshot().in_view("robot", "box")


# Subscriptions


def record_notifications(knowledge: Knowledge, *patterns: Any) -> list[tuple[list[str], list[str]]]:
    changes: list[tuple[list[str], list[str]]] = []

    def callback(change: Change) -> None:
        changes.append(([match.node("who") for match in change.new], [match.node("who") for match in change.ended]))

    knowledge.subscribe(callback, *patterns)
    return changes


def test_a_subscriber_is_notified_of_present_matches_and_then_of_changes(knowledge: Knowledge, clock: SimClock) -> None:
    changes = record_notifications(knowledge, path(some("person", called="who"), "close_to", "robot"))
    clock.sleep(1.0)
    people = knowledge.as_agent("person_detection")
    people.insert_edge("anna", "close_to", "robot")
    clock.sleep(1.0)
    people.set("anna", "height", 1.75)
    people.set_of_edge("anna", "close_to", "robot", "distance", 0.5)
    clock.sleep(1.0)
    people.delete_node("bob")
    clock.sleep(1.0)
    assert changes == [(["bob"], []), (["anna"], []), ([], ["bob"])]


def test_changes_at_one_instant_cause_one_notification(knowledge: Knowledge, clock: SimClock) -> None:
    changes = record_notifications(knowledge, path(some("person", called="who"), "close_to", "robot"))
    clock.sleep(1.0)
    people = knowledge.as_agent("person_detection")
    for name in ("carl", "dora"):
        people.insert_node(name, "person")
        people.insert_edge(name, "close_to", "robot")
    people.delete_edge("bob", "close_to", "robot")
    people.insert_edge("bob", "close_to", "robot")
    clock.sleep(1.0)
    assert changes == [(["bob"], []), (["carl", "dora"], [])]


def test_a_condition_changes_when_a_value_expires_and_when_it_reaches_an_age(
    knowledge: Knowledge, clock: SimClock
) -> None:
    heard: list[tuple[float, str]] = []
    for name, condition in (("known", known("battery.level")), ("old", age("battery.level") > 20.0)):
        knowledge.subscribe(
            lambda change, name=name: heard.append((round(clock.now_s(), 3), f"{name} {bool(change.matches)}")),
            condition,
        )
    clock.sleep(100.0)
    assert heard == [(0.0, "known True"), (20.0, "old True"), (60.0, "known False"), (60.0, "old False")]


def test_a_distance_changes_when_a_pose_is_written_and_when_it_becomes_stale(
    knowledge: Knowledge, clock: SimClock
) -> None:
    heard: list[tuple[float, bool]] = []
    knowledge.subscribe(
        lambda change: heard.append((clock.now_s(), bool(change.matches))), distance("robot", "box") < 1.0
    )
    navigation = knowledge.as_agent("navigation")
    for x_m in (0.0, 1.0, 2.5):
        clock.sleep(1.0)
        navigation.place("world", "robot_pose", "robot", at(x_m))
    clock.sleep(20.0)
    assert heard == [(3.0, True), (8.0, False)]


def test_an_attribute_is_followed_from_its_present_value_until_it_expires(
    knowledge: Knowledge, clock: SimClock
) -> None:
    heard: list[object] = []
    knowledge.follow("battery", "level", lambda reading: heard.append(reading.content or reading.reason))
    clock.sleep(1.0)
    navigation = knowledge.as_agent("navigation")
    navigation.set("battery", "level", 70.0)
    clock.sleep(100.0)
    assert heard == [80.0, 70.0, Reason.STALE]


def test_an_ended_subscription_causes_no_calls(knowledge: Knowledge, clock: SimClock) -> None:
    heard: list[object] = []
    subscription = knowledge.follow("battery", "level", heard.append)
    clock.sleep(1.0)
    subscription.unsubscribe()
    knowledge.as_agent("navigation").set("battery", "level", 70.0)
    clock.sleep(100.0)
    assert len(heard) == 1


def test_an_ended_subscription_leaves_others_to_the_same_attribute(knowledge: Knowledge, clock: SimClock) -> None:
    heard: list[object] = []
    ended, _ = (
        knowledge.follow("battery", "level", lambda reading, name=name: heard.append((name, reading.content)))
        for name in ("ended", "kept")
    )
    clock.sleep(1.0)
    ended.unsubscribe()
    knowledge.as_agent("navigation").set("battery", "level", 70.0)
    clock.sleep(1.0)
    assert heard == [("ended", 80.0), ("kept", 80.0), ("kept", 70.0)]


def test_an_exception_in_a_callback_affects_no_other_callback(
    knowledge: Knowledge, clock: SimClock, caplog: pytest.LogCaptureFixture
) -> None:
    def callback(_: object) -> None:
        raise ZeroDivisionError("mine")

    heard: list[object] = []
    knowledge.follow("battery", "level", callback)
    knowledge.follow("battery", "level", heard.append)
    navigation = knowledge.as_agent("navigation")
    with caplog.at_level(logging.ERROR):
        for level in (1.0, 2.0):
            navigation.set("battery", "level", level)
            clock.sleep(1.0)
    assert [getattr(reading, "content", None) for reading in heard] == [1.0, 2.0]
    assert sum("mine" in (record.exc_text or "") for record in caplog.records) == 2


def test_an_agent_may_write_in_its_callback(knowledge: Knowledge, clock: SimClock) -> None:
    people = knowledge.as_agent("person_detection")

    def callback(change: Change) -> None:
        for match in change.new:
            people.set_of_edge(match.node("who"), "close_to", "robot", "distance", 9.0)

    knowledge.subscribe(callback, path(some("person", called="who"), "close_to", "robot"))
    clock.sleep(1.0)
    assert knowledge.snapshot().get_of_edge("bob", "close_to", "robot", "distance").value == 9.0


@pytest.fixture
def wall() -> Iterator[WallClock]:
    with WallClock() as clock:
        yield clock


def test_a_blocked_callback_delays_neither_writers_nor_other_callbacks(wall: WallClock) -> None:
    knowledge = store(wall)
    hanging, is_over, newest = threading.Event(), threading.Event(), threading.Event()

    def hang(_: object) -> None:
        hanging.set()
        is_over.wait(PATIENCE_S)

    def hear(reading: Any) -> None:
        if reading.content == 50.0:
            newest.set()

    knowledge.follow("battery", "level", hang)
    assert hanging.wait(PATIENCE_S)
    knowledge.follow("battery", "level", hear)
    navigation = knowledge.as_agent("navigation")
    for step in range(5001):
        navigation.set("battery", "level", step / 100)
    assert newest.wait(PATIENCE_S)
    is_over.set()


def test_a_wait_for_a_pattern_ends_with_a_write_of_another_thread(wall: WallClock) -> None:
    knowledge = store(wall)
    people = knowledge.as_agent("person_detection")
    writer = threading.Timer(0.05, write_of(people))
    writer.start()
    assert knowledge.wait_for(path(some("person"), "close_to", "robot"), timeout_s=PATIENCE_S)
    assert not knowledge.wait_for(value("battery.level") < 1.0, timeout_s=0.0)
    writer.join(PATIENCE_S)


def write_of(people: AgentHandle) -> Callable[[], None]:
    def write() -> None:
        with people.transaction() as seen:
            seen.insert_node("anna", "person")
            seen.insert_edge("anna", "close_to", "robot")

    return write
