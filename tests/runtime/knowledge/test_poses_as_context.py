"""Comparisons with poses as context-variables: they enable observers, and agree with the poses at every instant."""

from __future__ import annotations

import math
import threading
import time
from dataclasses import replace
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from codra_dsl.runtime import ContextManager, Journal, Kind, NotASourceError, SimClock, WallClock
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.journal.latest_events import LatestEvents
from codra_dsl.runtime.knowledge.declarations import distance
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.cell import Reason
from codra_dsl.runtime.values.declarations import POSES
from codra_dsl.runtime.values.model import VariableModel, boolean
from codra_dsl.runtime.why import explain
from tests.runtime.journal.journals import read
from tests.runtime.knowledge.bay import (
    ASKED,
    CUP_NEAR,
    IN_VIEW,
    MODEL,
    NEAR,
    VALID_FOR_S,
    Lid,
    knowledge,
    manager,
    sees,
)

Manager = ContextManager[str, str]


def drive(codra: ContextManager[str, str], *positions_m: float) -> None:
    """Place the robot at another position every half second."""
    navigation = codra.agent("navigation")
    for x_m in positions_m:
        navigation.graph.place("world", "robot_pose", "robot", Pose.of((x_m, 0.0, 0.0)))
        codra.clock.sleep(0.5)
    navigation.close()


def test_an_observer_looks_while_the_robot_is_near_and_no_longer() -> None:
    clock, lid = SimClock(), Lid()
    with manager(clock, lid) as codra:
        codra.declare("lid_open")
        drive(codra, 0.0, 1.5, 3.0)
        assert (lid.looks_s, codra.get("lid_open").known) == ([], False)
        assert codra.obstacle("lid_open") == NEAR
        drive(codra, 3.2, 3.3, 3.4)
        assert lid.looks_s == [1.5, 2.5]
        assert codra.get("lid_open").value is True
        drive(codra, 3.05, 1.0, 0.0)
        assert lid.looks_s == [1.5, 2.5]
        assert (codra.get("lid_open").reason, codra.get(NEAR).value) == (Reason.FORGOTTEN, False)
        drive(codra, 3.5)
        assert lid.looks_s[2:] == [4.5]


def test_it_is_blocked_when_the_pose_becomes_stale() -> None:
    clock, lid = SimClock(), Lid()
    with manager(clock, lid) as codra:
        codra.declare("lid_open")
        drive(codra, 3.5)
        codra.knowledge.as_agent("navigation").place("world", "robot_pose", "robot", Pose.of((3.6, 0, 0)), stamp_s=0.25)
        clock.sleep(1.7)
        assert codra.get(NEAR).value is True
        clock.sleep(0.05)
        reading = codra.get(NEAR)
        assert (reading.reason, reading.evidence_s) == (Reason.STALE, 2.25)
        assert reading.detail == "the pose of 'robot' is too old"
        assert codra.get("lid_open").reason is Reason.FORGOTTEN
        assert codra.obstacle("lid_open") == NEAR
        looks = len(lid.looks_s)
        clock.sleep(5.0)
        assert len(lid.looks_s) == looks
        drive(codra, 3.5)
        assert len(lid.looks_s) == looks + 1


def test_a_comparison_is_unknown_for_a_node_without_a_pose() -> None:
    clock = SimClock()
    with manager(clock, Lid()) as codra:
        people = codra.agent("people")
        assert codra.get(CUP_NEAR).reason is Reason.NEVER_OBSERVED
        assert codra.get(CUP_NEAR).detail == "the pose of 'machine' relative to 'cup' is unknown"
        assert codra.get(ASKED).value is False
        people.graph.place("world", "cup_pose", "cup", Pose.of((3.0, 0.0, 0.0)))
        assert (codra.get(CUP_NEAR).value, codra.get(ASKED).value) == (True, True)
        people.graph.place("robot", "cup_pose", "cup", Pose.of((0.0, 0.0, 1.0)))
        assert (codra.get(CUP_NEAR).reason, codra.get(IN_VIEW).value) == (Reason.FORGOTTEN, True)
        people.graph.delete_edge("robot", "cup_pose", "cup")
        assert (codra.get(IN_VIEW).reason, codra.get(ASKED).value) == (Reason.FORGOTTEN, False)
        people.graph.place("robot", "cup_pose", "cup", Pose.of((0.0, 0.0, 1.0)))
        people.graph.delete_node("cup")
        assert codra.get(IN_VIEW).reason is Reason.FORGOTTEN


def test_the_detail_of_an_unknown_comparison_names_a_pose_that_is_missing_now() -> None:
    nearer = VariableModel(
        name="nearer",
        type=boolean(),
        sources=(POSES,),
        pose_condition=distance("robot", "machine") < distance("cup", "machine"),
    )
    model, clock = replace(MODEL, variables=(*MODEL.variables, nearer)), SimClock()
    with Manager(model, clock=clock, resources={"lid": Lid()}, knowledge=knowledge()) as codra:
        assert codra.get("nearer").detail == "the pose of 'machine' relative to 'robot' is unknown"
        drive(codra, 3.5)
        assert codra.get("nearer").detail == "the pose of 'machine' relative to 'cup' is unknown"


def test_agents_cannot_write_comparisons_with_poses() -> None:
    clock = SimClock()
    with manager(clock, Lid()) as codra:
        drive(codra, 0.0)
        for write in (
            lambda: codra.set(NEAR, True),
            lambda: codra.declare(NEAR, True),
            lambda: codra.agent("navigation").set(NEAR, True),
        ):
            with pytest.raises(NotASourceError, match="follows from poses and cannot be written"):
                write()
        with pytest.raises(LookupError):
            codra.agent("the knowledge graph")
        assert codra.decide(NEAR, lambda: True, max_age_s=0.1) is True
        assert codra.get(NEAR).value is False
        assert codra.obstacle(NEAR) == "it follows from poses"
        assert NEAR not in {reading.name for node in codra.knowledge.snapshot().nodes() for reading in node.histories}


def test_a_pose_that_changes_no_comparison_notifies_no_subscriber() -> None:
    clock, readings = SimClock(), list[object]()
    with manager(clock, Lid()) as codra:
        codra.subscribe(NEAR, readings.append)
        drive(codra, *(0.001 * step for step in range(1000)), *(3.2 + 0.0001 * step for step in range(1000)))
        events = codra.record.of(Kind.VARIABLE, NEAR)
    assert [event.details.get("value") for event in events] == [None, False, True]
    assert len(readings) == 3


def test_evidence_has_the_stamp_of_the_pose_and_never_goes_back() -> None:
    clock = SimClock()
    with manager(clock, Lid()) as codra:
        drive(codra, 0.0)
        graph = codra.agent("navigation").graph
        graph.place("world", "robot_pose", "robot", Pose.of((3.5, 0.0, 0.0)), stamp_s=0.4)
        assert (codra.get(NEAR).value, codra.get(NEAR).evidence_s, codra.get(NEAR).identified_s) == (True, 0.4, 0.5)
        graph.place("world", "robot_pose", "robot", Pose.of((9.0, 0.0, 0.0)), stamp_s=0.3)
        assert (codra.get(NEAR).value, codra.get(NEAR).evidence_s) == (True, 0.4)
        clock.sleep(0.1)
        graph.delete_edge("world", "robot_pose", "robot")
        assert (codra.get(NEAR).reason, codra.get(NEAR).evidence_s) == (Reason.FORGOTTEN, 0.6)
        graph.place("world", "robot_pose", "robot", Pose.of((0.0, 0.0, 0.0)), stamp_s=0.6)
        assert (codra.get(NEAR).value, codra.get(NEAR).evidence_s) == (False, 0.6)


def run(path: Path) -> None:
    """A robot drives to the machine and waits there until its pose is stale, while a cup is carried around."""
    clock = SimClock(10.0)
    with manager(clock, Lid(), Journal(path), extrapolate_s=0.3) as codra:
        codra.declare("lid_open")
        drive(codra, 0.0, 1.0, 2.0, 3.0)
        people = codra.agent("people")
        with people.graph.transaction() as both:
            both.place("robot", "cup_pose", "cup", Pose.of((0.0, 0.0, 1.0)))
            both.place("world", "cup_pose", "cup", Pose.of((3.0, 0.0, 1.0)))
        clock.sleep(0.7)
        drive(codra, 3.6, 3.6)
        people.graph.delete_node("cup")
        clock.sleep(3.0)


def test_a_replay_computes_comparisons_from_the_poses(tmp_path: Path) -> None:
    run(tmp_path / "run.mcap")
    head, events = read(tmp_path / "run.mcap")
    names = [event.name for event in events if event.kind is Kind.VARIABLE]
    assert {NEAR, IN_VIEW, CUP_NEAR, ASKED, "lid_open"} == set(names)
    assert not [event for event in events if event.kind is Kind.INPUT and event.name == "the knowledge graph"]
    copy = Journal(tmp_path / "copy.mcap")
    replay_result = replay(head, events, MODEL, ContextManager, copy, knowledge(0.3))
    assert replay_result.difference is None
    assert replay_result.derived[Kind.VARIABLE] == len(names)
    assert (tmp_path / "copy.mcap").read_bytes() == (tmp_path / "run.mcap").read_bytes()


def test_a_replay_of_a_threaded_run_in_real_time_is_identical_byte_for_byte(tmp_path: Path) -> None:
    clock = WallClock()
    with manager(clock, Lid(), Journal(tmp_path / "run.mcap"), extrapolate_s=0.1) as codra:
        codra.declare("lid_open")
        robot, people = codra.agent("navigation").graph, codra.agent("people").graph

        def drive_about() -> None:
            for turn in range(60):
                robot.place("world", "robot_pose", "robot", Pose.of((3.0 + 0.3 * math.sin(turn), 0.0, 0.0)))
                time.sleep(0.004)

        def carry_about() -> None:
            for turn in range(60):
                parent = ("robot", "world")[turn % 7 == 0]
                people.place(parent, "cup_pose", "cup", Pose.of((math.cos(turn), 0.0, 1.0 + math.sin(turn))))
                time.sleep(0.003)

        threads = [threading.Thread(target=drive_about), threading.Thread(target=carry_about)]
        for thread in threads:
            thread.start()
        for thread in threads:
            thread.join(60.0)
            assert not thread.is_alive()
        clock.sleep(0.15)
    head, events = read(tmp_path / "run.mcap")
    assert {NEAR, IN_VIEW, CUP_NEAR} <= {event.name for event in events if event.kind is Kind.VARIABLE}
    copy = Journal(tmp_path / "copy.mcap")
    assert replay(head, events, MODEL, ContextManager, copy, knowledge(0.1)).difference is None
    assert (tmp_path / "copy.mcap").read_bytes() == (tmp_path / "run.mcap").read_bytes()


def test_a_replay_with_another_threshold_differs_at_the_comparison(tmp_path: Path) -> None:
    run(tmp_path / "run.mcap")
    head, events = read(tmp_path / "run.mcap")
    nearer = replace(
        next(variable for variable in MODEL.variables if variable.name == NEAR),
        pose_condition=distance("robot", "machine") < 9,
    )
    model = replace(
        MODEL, variables=tuple(nearer if variable.name == NEAR else variable for variable in MODEL.variables)
    )
    replay_result = replay(head, events, model, ContextManager, None, knowledge(0.3))
    assert replay_result.difference is not None
    assert replay_result.difference.recorded is not None
    assert (replay_result.difference.recorded.name, replay_result.difference.recorded.details["value"]) == (NEAR, False)


def test_why_explains_who_placed_a_node_and_why_a_comparison_is_unknown(tmp_path: Path) -> None:
    run(tmp_path / "run.mcap")
    head, events = read(tmp_path / "run.mcap")

    def why(name: str, at_s: float) -> str:
        return str(explain(head.summary, lambda until_s: LatestEvents.of(events, until_s), name, at_s))

    assert why(NEAR, 13.0) == (
        f"{NEAR} is true at 13 s\n"
        "  determined by poses since 12.7 s\n"
        "  world -robot_pose-> robot is true at 13 s\n"
        "    inserted by agent navigation at 10 s, change 2\n"
        "    placed at (3.6, 0, 0) m by agent navigation at 12.7 s, change 9\n"
        "  world -fixed-> machine is true at 13 s\n"
        "    present from the start, 10 s\n"
        "    placed at (4, 0, 0) m from the start, 10 s"
    )
    explanation = why("lid_open", 16.0)
    assert f"{NEAR} is unknown (stale) at 16 s\n" in explanation
    assert "unknown from 15.2 s on: the pose of 'robot' is too old\n" in explanation
    assert "placed at (3.6, 0, 0) m by agent navigation at 13.2 s" in explanation
    assert explanation.endswith(f"missing: {NEAR} = true")


class PoseOracle:
    """The poses of the robot and the cup, computed from all placements, in a world without rotations."""

    def __init__(self, extrapolate_s: float) -> None:
        self.extrapolate_s = extrapolate_s
        self.placements: dict[str, list[tuple[float, str, tuple[float, ...]]]] = {"robot": [], "cup": []}

    def offset(self, name: str, now_s: float) -> tuple[str, tuple[float, ...]] | None:
        """Return the parent of a node and the position in it; None if unknown."""
        placements = self.placements[name]
        if not placements or placements[-1][1] == "nothing":
            return None
        stamp_s, parent, at_m = placements[-1]
        if name == "robot" and now_s - stamp_s >= VALID_FOR_S:
            return None
        if now_s - stamp_s <= self.extrapolate_s and len(placements) > 1 and placements[-2][1] == parent:
            before_s, _, before_m = placements[-2]
            share = (now_s - stamp_s) / (stamp_s - before_s)
            at_m = tuple(now + (now - before) * share for now, before in zip(at_m, before_m, strict=True))
        return parent, at_m

    def place(self, name: str, now_s: float) -> tuple[float, ...] | None:
        offset = self.offset(name, now_s)
        if offset is None or offset[0] == "world":
            return None if offset is None else offset[1]
        robot_m = self.place("robot", now_s)
        return None if robot_m is None else tuple(map(sum, zip(robot_m, offset[1], strict=True)))

    def truths(self, now_s: float) -> dict[str, bool | None]:
        robot_m, cup_m = self.place("robot", now_s), self.place("cup", now_s)
        cup = self.offset("cup", now_s)
        in_robot = cup[1] if cup is not None and cup[0] == "robot" else None
        if in_robot is None and robot_m is not None and cup_m is not None:
            in_robot = tuple(one - other for one, other in zip(cup_m, robot_m, strict=True))
        machine_m = (4.0, 0.0, 0.0)
        return {
            NEAR: None if robot_m is None else math.dist(robot_m, machine_m) < 0.9,
            CUP_NEAR: None if cup_m is None else math.dist(cup_m, machine_m) <= 1.7,
            ASKED: cup_m is not None,
            IN_VIEW: None if in_robot is None else sees(in_robot),
        }


PLACES = some.tuples(some.integers(-4, 24), some.integers(-4, 4), some.integers(-4, 12))
STEPS = some.lists(
    some.tuples(
        some.sampled_from(["robot", "robot", "cup in world", "cup in robot", "no cup", "nothing"]),
        PLACES,
        some.integers(1, 60),
    ),
    min_size=1,
    max_size=25,
)


@pytest.mark.parametrize("extrapolate_s", [0.0, 0.4])
@settings(max_examples=40, deadline=None)
@given(steps=STEPS)
def test_comparisons_agree_with_the_poses_at_every_instant(
    extrapolate_s: float, steps: list[tuple[str, tuple[int, int, int], int]]
) -> None:
    clock, hand = SimClock(), PoseOracle(extrapolate_s)
    with manager(clock, Lid(), extrapolate_s=extrapolate_s) as codra:
        robot, people = codra.agent("navigation").graph, codra.agent("people").graph
        for what, place, pause in steps:
            now_s, at_m = clock.now_s(), tuple(0.25 * number for number in place)
            if what == "robot":
                robot.place("world", "robot_pose", "robot", Pose.of(at_m))
                hand.placements["robot"].append((now_s, "world", at_m))
            elif what.startswith("cup"):
                parent = what.removeprefix("cup in ")
                people.place(parent, "cup_pose", "cup", Pose.of(at_m))
                hand.placements["cup"].append((now_s, parent, at_m))
            elif what == "no cup" and hand.placements["cup"] and hand.placements["cup"][-1][1] != "nothing":
                people.delete_edge(hand.placements["cup"][-1][1], "cup_pose", "cup")
                hand.placements["cup"].append((now_s, "nothing", ()))
            check(codra, hand)
            for _ in range(pause // 7):
                clock.sleep(0.07)
                check(codra, hand)
            clock.sleep(0.01 * (pause % 7) + 0.003)
            check(codra, hand)


def check(codra: ContextManager[str, str], hand: PoseOracle) -> None:
    """Compare all readings with the ones computed by hand; extrapolated ones are read every 10 ms."""
    now_s = codra.clock.now_s()
    instants_s = [now_s] if hand.extrapolate_s == 0.0 else [now_s - 0.001 * step for step in range(12)]
    allowed = [hand.truths(instant_s) for instant_s in instants_s]
    for name in (NEAR, IN_VIEW, CUP_NEAR, ASKED):
        assert codra.get(name).content in [truths[name] for truths in allowed], (name, now_s)
