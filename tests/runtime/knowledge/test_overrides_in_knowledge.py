"""An override of a context-variable is an override of its attribute in the graph, and of a comparison with poses."""

from __future__ import annotations

from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.runtime import ContextManager, Reason, SimClock
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.values.conditions import value
from tests.runtime.knowledge import bay
from tests.runtime.knowledge.manager import manager


def test_an_override_is_one_reading_in_the_context_and_in_the_graph() -> None:
    clock = SimClock()
    with manager(clock) as codra:
        codra.override("charge", 90.0, for_s=5.0, reason="calibrated")
        assert codra.knowledge.get("battery", "charge") is codra.get("charge")
        clock.sleep(1.0)
        codra.agent("navigation").graph.set("battery", "charge", 40.0)
        assert codra.knowledge.get("battery", "charge") is codra.get("charge")
        assert codra.get("charge").value == 90.0
        clock.sleep(4.0)
        assert codra.knowledge.get("battery", "charge") is codra.get("charge")
        assert (codra.get("charge").value, codra.get("charge").source) == (40.0, "navigation")


def test_the_end_of_an_override_leaves_an_attribute_that_was_never_written() -> None:
    with manager(SimClock()) as codra:
        codra.override("light", None, for_s=5.0, reason="dark")
        assert codra.knowledge.get("context", "light").reason is Reason.OVERRIDDEN
        codra.clear_override("light")
        snapshot = codra.knowledge.snapshot()
        assert snapshot.get("context", "light").reason is Reason.NEVER_OBSERVED
        assert (snapshot.history("context", "light"), snapshot.node("context").attributes) == ((), {})


def test_a_snapshot_keeps_the_readings_of_its_instant() -> None:
    clock = SimClock()
    with manager(clock) as codra:
        codra.set("light", False)
        before = codra.knowledge.snapshot()
        clock.sleep(1.0)
        codra.override("light", True, for_s=2.0, reason="lamp broken")
        during = codra.knowledge.snapshot()
        clock.sleep(1.0)
        codra.set("light", False)
        clock.sleep(3.0)
        now = codra.knowledge.snapshot()
        assert [snapshot.get("context", "light").content for snapshot in (before, during, now)] == [False, True, False]
        assert [len(snapshot.history("context", "light")) for snapshot in (before, during, now)] == [1, 2, 2]
        assert codra.knowledge.at(1.5).get("context", "light").value is True
        assert codra.knowledge.at(3.0).get("context", "light").value is False


def test_an_agent_that_follows_an_attribute_sees_the_beginning_and_the_end_of_an_override() -> None:
    clock, contents = SimClock(), list[object]()
    with manager(clock) as codra:
        codra.set("light", False)
        codra.knowledge.follow("context", "light", lambda reading: contents.append((clock.now_s(), reading.content)))
        clock.sleep(1.0)
        codra.override("light", True, for_s=2.0, reason="lamp broken")
        clock.sleep(5.0)
    assert contents == [(0.0, False), (1.0, True), (3.0, False)]


def test_an_override_wakes_an_agent_whose_pattern_reads_the_attribute() -> None:
    clock, calls_s = SimClock(), list[float]()
    with manager(clock) as codra:
        codra.agent("navigation").set("charge", 50.0)
        codra.knowledge.subscribe(lambda _: calls_s.append(clock.now_s()), value("battery.charge") < 10.0)
        clock.sleep(2.0)
        codra.override("charge", 5.0, for_s=3.0, reason="the gauge is wrong")
        assert codra.knowledge.wait_for(value("battery.charge") < 10.0, timeout_s=0.0)
        clock.sleep(0.0)
        assert calls_s == [2.0]
        assert codra.knowledge.wait_for(value("battery.charge") > 10.0, timeout_s=9.0)
        assert clock.now_s() == 5.0


def test_a_comparison_with_poses_can_be_overridden_and_follows_the_poses_afterwards() -> None:
    clock, lid = SimClock(), bay.Lid()
    with bay.manager(clock, lid) as codra, codra.agent("navigation").graph as navigation:
        codra.declare("lid_open")
        navigation.place("world", "robot_pose", "robot", Pose.of((0.0, 0.0, 0.0)))
        codra.override(bay.NEAR, True, for_s=1.0, reason="localization is wrong")
        clock.sleep(0.5)
        assert (codra.get(bay.NEAR).value, lid.looks_s) == (True, [0.0])
        navigation.place("world", "robot_pose", "robot", Pose.of((3.2, 0.0, 0.0)))
        navigation.place("world", "robot_pose", "robot", Pose.of((0.0, 0.0, 0.0)))
        clock.sleep(0.5)
        assert (codra.get(bay.NEAR).value, codra.get(bay.NEAR).source) == (False, "the knowledge graph")


_STEPS = st.lists(
    st.tuples(st.sampled_from(["override", "clear", "context", "graph", "pass"]), st.integers(0, 3), st.integers(0, 6)),
    max_size=25,
)


@settings(max_examples=24, deadline=None)
@given(_STEPS)
def test_graph_and_context_agree_for_every_order_of_overrides_and_writes(steps: list[tuple[str, int, int]]) -> None:
    clock = SimClock(100.0)
    with manager(clock) as codra, codra.agent("navigation").graph as graph:
        for verb, level, number in steps:
            if verb == "override":
                codra.override("charge", level or None, for_s=number + 1, reason="test")
            elif verb == "clear":
                codra.clear_override("charge")
            elif verb == "context":
                codra.commands.write("charge", float(level), "navigation", clock.now_s() - number)
            elif verb == "graph":
                graph.set("battery", "charge", float(level), evidence_s=clock.now_s() - number)
            else:
                clock.sleep(number)
            check_agreement(codra)


def check_agreement(codra: ContextManager[str, str]) -> None:
    reading, in_graph = codra.get("charge"), codra.knowledge.get("battery", "charge")
    assert (reading.content, reading.reason, reading.source) == (in_graph.content, in_graph.reason, in_graph.source)
    assert codra.history("charge") == codra.knowledge.snapshot().history("battery", "charge")
