"""Mistakes of agents and callbacks do not affect the graph."""

from __future__ import annotations

import copy
import logging
import math
import pickle
import signal
from collections.abc import Callable
from contextlib import suppress
from typing import Any

import numpy as np
import pytest

from codra_dsl.runtime import SimClock
from codra_dsl.runtime.geometry import FrameError, Frames, Pose
from codra_dsl.runtime.knowledge import AbsentError, AgentTakenError, Change, Knowledge
from codra_dsl.runtime.knowledge.declarations import KnowledgeModel, NodeModel, anything, path, some
from tests.runtime.knowledge.store import store
from tests.runtime.knowledge.test_poses import PARTS

NO_POSES = {
    "a translation has 3 finite numbers": [
        Pose((math.nan, 0.0, 0.0)),
        Pose((0.0, math.inf, 0.0)),
        Pose((1.0, 2.0)),  # type: ignore[arg-type]
        Pose(("a", "b", "c")),  # type: ignore[arg-type]
        Pose(None),  # type: ignore[arg-type]
        Pose((10**400, 0, 0)),
    ],
    "a quaternion has 4 finite numbers": [Pose((0.0, 0.0, 0.0), (math.nan, 0.0, 0.0, 0.0))],
    "a rotation needs a quaternion that is not zero": [Pose((0.0, 0.0, 0.0), (0.0, 0.0, 0.0, 0.0))],
    "'robot' needs a Pose, not a tuple": [(0.0, 0.0, 0.0)],
    "'robot' needs a Pose, not a NoneType": [None],
}


@pytest.mark.parametrize("message", NO_POSES)
def test_a_pose_that_is_not_a_rigid_motion_is_refused(message: str) -> None:
    knowledge = store()
    navigation, before = knowledge.as_agent("navigation"), knowledge.snapshot()
    for pose in NO_POSES[message]:
        wrong_value: Any = pose
        with pytest.raises(ValueError, match=message):
            navigation.place("world", "robot_pose", "robot", wrong_value)
    assert knowledge.snapshot().version == before.version


def test_quaternions_are_normalized_and_given_arrays_are_not_changed() -> None:
    knowledge = store()
    array: Any = np.array([1.0, 2.0, 3.0])
    knowledge.as_agent("navigation").place("world", "robot_pose", "robot", Pose(array, (2.0, 0.0, 0.0, 2.0)))
    array[:] = 9.0
    pose = knowledge.transform("world", "robot").pose
    assert pose.translation_m == (1.0, 2.0, 3.0)
    np.testing.assert_allclose(pose.rotation, (math.sqrt(0.5), 0.0, 0.0, math.sqrt(0.5)), atol=1e-15)


def test_the_instant_of_a_transform_must_not_be_nan() -> None:
    frames = Frames().with_pose("robot", "world", Pose(), 0.0).with_pose("robot", "world", Pose(), 1.0)
    with pytest.raises(ValueError, match="the instant of a transform must not be NaN"):
        frames.transform("world", "robot", math.nan)


def test_a_chain_of_thousands_is_followed_and_cannot_become_a_cycle() -> None:
    count = 3_000
    nodes = tuple(NodeModel(name=f"n{number}", type="part") for number in range(count))
    model = KnowledgeModel(name="chain", node_types=PARTS.node_types, edge_types=PARTS.edge_types, nodes=nodes)
    knowledge = Knowledge(model, clock=SimClock())
    hand = knowledge.as_agent("hand")
    for number in range(1, count):
        hand.place(f"n{number - 1}", "moves", f"n{number}", Pose((1.0, 0.0, 0.0)))
    assert knowledge.transform("n0", f"n{count - 1}").pose.translation_m == (count - 1.0, 0.0, 0.0)
    with pytest.raises(FrameError, match=f"'n0' cannot be placed in 'n{count - 1}' from 0 s on"):
        hand.place(f"n{count - 1}", "moves", "n0", Pose())


def test_a_path_of_thousands_of_edges_is_followed_from_any_named_node() -> None:
    count = 3_000
    nodes = tuple(NodeModel(name=f"n{number}", type="part") for number in range(count))
    model = KnowledgeModel(name="chain", node_types=PARTS.node_types, edge_types=PARTS.edge_types, nodes=nodes)
    knowledge = Knowledge(model, clock=SimClock())
    with knowledge.as_agent("hand").transaction() as write:
        for number in range(1, count):
            write.place(f"n{number - 1}", "moves", f"n{number}", Pose())
    for start, end in ((0, count - 1), (None, count - 1)):
        first = some("part", called="first") if start is None else f"n{start}"
        parts = [part for _ in range(count - 2) for part in ("moves", anything())]
        (match,) = knowledge.snapshot().match(path(first, *parts, "moves", f"n{end}"))
        assert match.edges[0] == ("n0", "RT", "n1")
        assert len(match.edges) == count - 1


NO_PATTERNS = (None, "robot -near-> box", 3, [], KnowledgeModel)


@pytest.mark.parametrize("wrong_value", NO_PATTERNS)
def test_wrong_patterns_callbacks_and_requests_are_reported(wrong_value: Any) -> None:
    knowledge = store()
    picking = knowledge.as_agent("picking")
    for ask in (knowledge.snapshot().holds, lambda it: knowledge.subscribe(print, it)):
        with pytest.raises(TypeError, match="a pattern is a path, an absence or a condition, not"):
            ask(wrong_value)
    with pytest.raises(TypeError, match="expected the return value of request"):
        picking.abort(wrong_value)
    for hear in (knowledge.subscribe, picking.on_wake, lambda it: knowledge.follow("battery", "level", it)):
        if not callable(wrong_value):
            with pytest.raises(TypeError, match="the callback must be a function, not"):
                hear(wrong_value)
    with pytest.raises(FrameError, match="there is no frame None"):
        knowledge.transform(None, None)  # type: ignore[arg-type]


def test_a_cycle_of_new_parents_is_refused_with_its_transaction() -> None:
    knowledge = Knowledge(PARTS, clock=SimClock())
    hand = knowledge.as_agent("hand")
    hand.place("n0", "moves", "n1", Pose())
    hand.place("n1", "moves", "n2", Pose())

    def run_transaction() -> None:
        with hand.transaction() as write:
            write.place("n3", "moves", "n1", Pose())
            write.place("n2", "moves", "n3", Pose())

    with pytest.raises(FrameError, match="'n3' cannot be placed in 'n2' from 0 s on"):
        run_transaction()
    assert [str(edge) for edge in knowledge.snapshot().edges("RT")] == ["n0 -RT-> n1", "n1 -RT-> n2"]


@pytest.mark.parametrize("name", ["", "\ud800", "x" * 10_001])
def test_the_name_of_a_node_must_be_writable_text(name: str) -> None:
    with pytest.raises(ValueError, match=r"the name of a node must be|a lone surrogate|is too long"):
        store().as_agent("container_detection").insert_node(name, "roll_container")


def test_a_transaction_that_has_ended_accepts_no_changes() -> None:
    knowledge = store()
    detection = knowledge.as_agent("container_detection")
    with detection.transaction() as write:
        write.insert_node("box", "roll_container")
    with pytest.raises(PermissionError, match="this transaction is over: begin another"):
        write.insert_node("cage", "roll_container")
    assert [node.name for node in knowledge.snapshot().nodes("roll_container")] == ["box"]


# Callbacks


BOXES = path(some("roll_container", called="box"), "close_to", "robot")


def put(knowledge: Knowledge, *names: str) -> None:
    with knowledge.as_agent("container_detection") as detection, detection.transaction() as write:
        for name in names:
            write.insert_node(name, "roll_container")
            write.insert_edge(name, "close_to", "robot")


def test_a_callback_that_deletes_its_matches_is_called_until_there_are_no_matches() -> None:
    clock, match_counts = SimClock(), []
    knowledge = store(clock)
    put(knowledge, "a", "b", "c")
    detection = knowledge.as_agent("container_detection")

    def delete(change: Change) -> None:
        match_counts.append((len(change.new), len(change.ended), len(change.matches)))
        for match in change.matches:
            detection.delete_node(match.node("box"))
            with pytest.raises(AbsentError):
                detection.delete_node(match.node("box"))

    knowledge.subscribe(delete, BOXES)
    clock.sleep(1.0)
    assert match_counts == [(3, 0, 3), (0, 3, 0)]
    assert knowledge.snapshot().edges("close_to") == ()


def test_a_callback_may_end_its_own_subscription_and_begin_others() -> None:
    clock, match_counts, other_match_counts = SimClock(), [], []
    knowledge = store(clock)

    def once(change: Change) -> None:
        match_counts.append(len(change.matches))
        subscription.unsubscribe()
        subscription.unsubscribe()
        knowledge.subscribe(lambda other: other_match_counts.append(len(other.matches)), BOXES)

    subscription = knowledge.subscribe(once, BOXES)
    for name in ("a", "b"):
        put(knowledge, name)
        clock.sleep(1.0)
    assert (match_counts, other_match_counts) == ([1], [1, 2])


def test_callbacks_continue_after_one_has_ended_its_thread(caplog: pytest.LogCaptureFixture) -> None:
    clock, calls, match_counts = SimClock(), [], []
    knowledge = store(clock)

    def end(_: Change) -> None:
        calls.append(1)
        raise SystemExit(3)

    knowledge.subscribe(end, BOXES)
    knowledge.subscribe(lambda change: match_counts.append(len(change.matches)), BOXES)
    with caplog.at_level(logging.ERROR):
        for name in ("a", "b"):
            put(knowledge, name)
            clock.sleep(1.0)
    assert (calls, match_counts) == ([1, 1], [1, 2])
    assert "a callback raised" in caplog.text


def test_any_number_of_late_poses_takes_limited_memory() -> None:
    knowledge = store(SimClock(10_000.0))
    navigation = knowledge.as_agent("navigation")
    for step in range(5_000):
        navigation.place("world", "robot_pose", "robot", Pose((float(step), 0.0, 0.0)), stamp_s=10_000.0 - step / 10)
        navigation.set("battery", "level", 50.0, evidence_s=10_000.0 - step / 10)
    seen = knowledge.snapshot()
    assert len(seen.history("battery", "level")) == 100
    old = seen.transform("world", "robot", 0.0)
    assert old.pose.translation_m == (100.0, 0.0, 0.0)  # ten seconds before the newest, and no further


@pytest.mark.parametrize("make_copy", [copy.copy, copy.deepcopy, pickle.dumps])
def test_the_handle_of_an_agent_and_its_transactions_cannot_be_copied(make_copy: Callable[[object], object]) -> None:
    knowledge = store()
    with knowledge.as_agent("navigation") as navigation, navigation.transaction() as transaction:
        for writer, name in ((navigation, "AgentHandle"), (transaction, "Transaction")):
            with pytest.raises(TypeError, match=f"a {name} cannot be copied: pass this object itself"):
                make_copy(writer)
        assert not knowledge.refusals()


def test_a_signal_handler_may_open_a_handle_while_another_is_opened() -> None:
    knowledge, interrupt_count = store(), 0

    def interrupt(*_: object) -> None:
        nonlocal interrupt_count
        interrupt_count += 1
        with suppress(AgentTakenError):  # the handler can interrupt itself
            knowledge.as_agent("picking").close()
        knowledge.refusals()

    old_handler = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 1e-4, 1e-4)
    try:
        while interrupt_count < 300:
            with knowledge.as_agent("navigation"), suppress(AgentTakenError):
                knowledge.as_agent("navigation")
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0.0)
        signal.signal(signal.SIGALRM, old_handler)


def test_evidence_must_have_a_finite_instant() -> None:
    knowledge = store()
    with knowledge.as_agent("navigation") as navigation, pytest.raises(ValueError, match="cannot be from -inf"):
        navigation.set("battery", "level", 50.0, evidence_s=-math.inf)
