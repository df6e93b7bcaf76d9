"""Derived variables of a compiled spec: poses and counts of the knowledge graph, fallbacks, why, and replay."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest

from codra_dsl.integrations.inspection.loading import CompiledSpec, compile_and_load
from codra_dsl.runtime import ContextManager, EventLog, Journal, SimClock
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.replay import replay
from codra_dsl.runtime.values.cell import Reason
from tests.runtime.journal.journals import read

WARD = """\
codra: 1
name: ward
agents:
  tracker: {}
  navigation: {}
  guard:
    wakes: [calm]
context:
  lamp: {type: bool, source: tracker, valid_for: 1 s}
  sun: {type: bool, source: tracker, valid_for: 5 s}
  bright: {type: bool, derived: lamp or sun}
  shelf: {type: bool, valid_for: 10 s, when_unobservable: forget}
  people: {type: int, range: [0, 3], derived: count(some person)}
  near: {type: int, derived: count(some person -close_to-> robot)}
  way: {type: float, unit: m, derived: "distance(robot, dock) else 50 m", resolution: 10 cm}
  calm: {type: bool, derived: "near == 0 and distance(robot, dock) < 2 m"}
  twice: {type: float, unit: cm, derived: 2 * way}
knowledge:
  types:
    person: {source: tracker}
  nodes: {world: world, robot: robot, dock: dock}
  edges:
    close_to: {from: person, to: robot, source: tracker}
    robot_pose: {label: RT, from: world, to: robot, source: navigation, valid_for: 2 s}
    dock_pose: {label: RT, from: world, to: dock, static: true, pose: {x: 5 m}}
perception:
  look_at_shelf:
    call: tests.runtime.context.test_derived_from_the_graph:look
    observable_when: [calm]
    returns: {full: {type: bool}}
    identifies: {shelf: full}
skills:
  restock: {preview: [shelf, way, people, twice]}
"""


@pytest.fixture(scope="module")
def ward(tmp_path_factory: pytest.TempPathFactory) -> CompiledSpec:
    folder = tmp_path_factory.mktemp("ward")
    (folder / "ward.yaml").write_text(WARD, "utf-8")
    return compile_and_load(folder / "ward.yaml", folder / "generated")


def look(*, job: object) -> dict[str, object]:  # noqa: ARG001 - the parameters of every perception function
    return {"full": True}


@contextmanager
def started(ward: CompiledSpec, record: Any = None) -> Iterator[Any]:
    with ward.start(clock=SimClock(), resources={}, record=EventLog() if record is None else record) as codra:
        yield codra


def drive(codra: Any, *positions_m: float) -> None:
    for x_m in positions_m:
        codra.agent("navigation").graph.place("world", "robot_pose", "robot", Pose.of((x_m, 0.0, 0.0)))


def test_a_distance_is_rounded_and_changes_only_with_its_rounded_value(ward: CompiledSpec) -> None:
    with started(ward) as codra:
        assert codra.get("way").value == 50.0
        drive(codra, 4.0, 4.03, 4.04, 3.96, 3.9)
        assert [reading.content for reading in codra.history("way")] == [50.0, 1.0, 1.1]
        assert codra.get("twice").value == pytest.approx(220.0)
        codra.clock.sleep(2.5)
        assert (codra.get("way").value, codra.get("way").evidence_s) == (50.0, 2.0)


def test_a_distance_that_is_too_large_to_be_rounded_is_not_rounded(ward: CompiledSpec) -> None:
    with started(ward) as codra:
        drive(codra, 1e308)
        assert codra.get("way").value == 1e308


def test_a_count_follows_the_nodes_and_edges_of_the_graph(ward: CompiledSpec) -> None:
    with started(ward) as codra:
        tracker = codra.agent("tracker")
        assert (codra.get("people").value, codra.get("near").value) == (0, 0)
        for name in ("ann", "bob"):
            tracker.graph.insert_node(name, "person")
        tracker.graph.insert_edge("ann", "close_to", "robot")
        assert (codra.get("people").value, codra.get("near").value) == (2, 1)
        tracker.graph.delete_node("ann")
        assert (codra.get("people").value, codra.get("near").value) == (1, 0)
        for name in ("cy", "dot", "eve"):
            tracker.graph.insert_node(name, "person")
        assert (codra.get("people").reason, codra.get("people").detail) == (Reason.FAILED, "4 lies outside [0, 3]")


def test_a_derived_variable_is_an_attribute_that_patterns_read(ward: CompiledSpec) -> None:
    with started(ward) as codra:
        drive(codra, 4.0)
        assert codra.knowledge.snapshot().get("context", "calm").content is True
        codra.agent("tracker").graph.insert_node("ann", "person")
        codra.agent("tracker").graph.insert_edge("ann", "close_to", "robot")
        assert codra.knowledge.snapshot().get("context", "calm").content is False


def test_the_graph_agrees_with_the_context_when_an_input_expires_that_does_not_decide(ward: CompiledSpec) -> None:
    with started(ward) as codra:
        codra.agent("tracker").set("lamp", True)
        codra.clock.sleep(0.5)
        codra.agent("tracker").set("sun", True)
        for values in ((True, True), (True, True), (None, None)):
            assert (codra.get("bright").content, codra.knowledge.snapshot().get("context", "bright").content) == values
            codra.clock.sleep(2.5)


def test_why_explains_a_derived_variable_by_its_inputs(ward: CompiledSpec) -> None:
    with started(ward) as codra:
        assert str(codra.why("calm")).splitlines() == [
            "calm is unknown (never_observed) at 0 s  [ward.yaml:16]",
            "  unknown from 0 s on: distance(robot, dock) < 2 m is unknown (never_observed)",
            "  by the rule: near == 0 and distance(robot, dock) < 2 m  [ward.yaml:16]",
            "    distance(robot, dock) < 2 m is unknown (never_observed) at 0 s  [ward.yaml:16]",
            "      unknown from 0 s on: the pose of 'dock' relative to 'robot' is unknown",
            "      world -dock_pose-> dock is true at 0 s  [ward.yaml:25]",
            "        present from the start, 0 s",
            "        placed at (5, 0, 0) m from the start, 0 s",
        ]
        drive(codra, 4.0)
        codra.clock.sleep(0.5)
        why = codra.why("calm")
        assert why.derivation is not None
        assert [why_input.variable for why_input in why.derivation.inputs] == ["distance(robot, dock) < 2 m", "near"]
        assert "derived at 0 s from evidence taken at 0 s or later" in str(why)
        codra.agent("tracker").graph.insert_node("ann", "person")
        codra.agent("tracker").graph.insert_edge("ann", "close_to", "robot")
        assert "count(some person -close_to-> robot) = 0" in [str(change) for change in codra.why("shelf").missing]


def test_a_replay_derives_the_same_readings(ward: CompiledSpec, tmp_path: Path) -> None:
    path = tmp_path / "run.mcap"
    with started(ward, Journal(path)) as codra, codra.skill("restock"):
        drive(codra, 4.0)
        codra.clock.sleep(1.5)
        codra.agent("tracker").graph.insert_node("ann", "person")
        codra.agent("tracker").graph.insert_edge("ann", "close_to", "robot")
        codra.clock.sleep(3.0)
        live = codra.history("calm")
    header, recorded_events = read(path)
    package = ward.package
    replayed = replay(header, recorded_events, package.MODEL, ContextManager, None, package.KNOWLEDGE)
    assert replayed.difference is None
    assert [reading.content for reading in live] == [None, True, False]
