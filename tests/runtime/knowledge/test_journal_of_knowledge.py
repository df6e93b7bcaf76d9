"""Knowledge in the journal, in replays and in `why`."""

from __future__ import annotations

import json
import signal
import subprocess
import sys
import threading
from pathlib import Path

import jsonschema
import pytest
from mcap.reader import make_reader

from codra_dsl.runtime import ContextManager, Event, Journal, Kind, NotASourceError, SimClock, WallClock
from codra_dsl.runtime.errors import UnknownNameError
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.journal.latest_events import LatestEvents
from codra_dsl.runtime.knowledge import ConflictError, Snapshot
from codra_dsl.runtime.replay import knowledge_at, replay
from codra_dsl.runtime.why import explain
from tests.runtime.journal.journals import read
from tests.runtime.knowledge.manager import KNOWLEDGE, MODEL, manager


def run(path: Path) -> ContextManager[str, str]:
    """A robot finds a container, hands over tasks, and is refused writes without permission."""
    clock = SimClock(10.0)
    with manager(clock, Journal(path)) as codra:
        navigation, detection = codra.agent("navigation"), codra.agent("container_detection")
        picking, page = codra.agent("picking"), codra.agent("picker_page")
        navigation.set("charge", 80.0)
        navigation.graph.place("world", "robot_pose", "robot", Pose.of((1.0, 0.0, 0.0)), stamp_s=9.5)
        clock.sleep(1.0)
        request = picking.graph.request("detecting")
        clock.sleep(0.5)
        with detection.graph.transaction() as transaction:
            transaction.acknowledge(request)
            transaction.insert_node("box", "roll_container")
            transaction.place("world", "container_pose", "box", Pose.about((0, 0, 1), 0.5, (3.0, 0.0, 0.0)))
            transaction.insert_edge("box", "close_to", "robot", distance=2.0)
        page.graph.set("box", "locked", True)
        for write in (
            lambda: detection.graph.set("box", "load", "full"),
            lambda: detection.graph.set("battery", "charge", 1.0),
            lambda: detection.set("charge", 1.0),
        ):
            with pytest.raises(NotASourceError):
                write()
        with pytest.raises(ConflictError):
            picking.graph.request("detecting")
        clock.sleep(1.0)
        with navigation.graph.transaction() as both:
            both.set("robot", "docked", True)
            both.set("battery", "level", float("nan"))
        detection.graph.finish(request, "ok")
        picking.graph.request(
            "rotating",
        )
        clock.sleep(2.0)
        detection.graph.delete_node("box")
    return codra


def test_every_message_of_a_journal_fits_its_closed_schema(tmp_path: Path) -> None:
    run(tmp_path / "run.mcap")
    seen = set()
    with (tmp_path / "run.mcap").open("rb") as stream:
        for schema, channel, message in make_reader(stream, validate_crcs=True).iter_messages():
            assert schema is not None
            jsonschema.validate(json.loads(message.data), json.loads(schema.data))
            if channel.topic == "/codra/knowledge":
                seen.add(json.loads(message.data)["what"])
    assert seen >= {
        *("node_inserted", "node_deleted", "edge_inserted", "edge_deleted", "placed", "written", "refused"),
        *("wants", "is", "finished", "aborted"),
    }


def test_a_replay_writes_the_same_journal_byte_for_byte(tmp_path: Path) -> None:
    run(tmp_path / "run.mcap")
    head, events = read(tmp_path / "run.mcap")
    replay_result = replay(head, events, MODEL, ContextManager[str, str], Journal(tmp_path / "again.mcap"), KNOWLEDGE)
    assert replay_result.difference is None
    assert replay_result.derived[Kind.KNOWLEDGE] > 30
    assert (tmp_path / "again.mcap").read_bytes() == (tmp_path / "run.mcap").read_bytes()


def test_a_replay_restores_knowledge_that_was_stripped_from_a_journal(tmp_path: Path) -> None:
    run(tmp_path / "run.mcap")
    head, events = read(tmp_path / "run.mcap")
    kept = [event for event in events if event.kind is Kind.INPUT]
    copy = Journal(tmp_path / "again.mcap")
    assert replay(head, kept, MODEL, ContextManager[str, str], copy, KNOWLEDGE).difference is None
    assert read(tmp_path / "again.mcap")[1] == events


def test_a_replay_with_other_permissions_reports_the_first_different_write(tmp_path: Path) -> None:
    run(tmp_path / "run.mcap")
    head, events = read(tmp_path / "run.mcap")
    changed = [
        event
        if event.details.get("operations") is None or "finish" not in event.details["operations"]
        else Event(event.instant_s, event.kind, event.name, event.what, {**event.details, "operations": "[]"})
        for event in events
    ]
    result = replay(head, changed, MODEL, ContextManager[str, str], None, KNOWLEDGE)
    assert result.difference is not None
    assert result.difference.recorded is not None
    assert (result.difference.recorded.name, result.difference.recorded.what) == ("detecting", "finished")


def test_a_run_in_real_time_with_threads_replays_exactly(tmp_path: Path) -> None:
    with WallClock() as clock, manager(clock, Journal(tmp_path / "run.mcap")) as codra:

        def write(name: str) -> None:
            agent = codra.agent(name)
            for turn in range(60):
                if name == "navigation":
                    with agent.graph.transaction() as both:
                        both.set("battery", "charge", float(turn))
                        both.place("world", "robot_pose", "robot", Pose.of((turn, 0, 0)))
                elif name == "fork":
                    agent.graph.set("robot", "docked", turn % 2 == 0)
                else:
                    agent.graph.insert_node(f"box_{turn}", "roll_container")
                codra.set("light", turn % 2 == 0)

        threads = [
            threading.Thread(target=write, args=(name,)) for name in ("navigation", "fork", "container_detection")
        ]
        for thread in threads:
            thread.start()
        codra.agent("picking").graph.request("detecting")
        for thread in threads:
            thread.join(60.0)
        clock.sleep(1.2)
    head, events = read(tmp_path / "run.mcap")
    result = replay(head, events, MODEL, ContextManager[str, str], None, KNOWLEDGE)
    assert result.difference is None, result.difference
    assert result.derived[Kind.KNOWLEDGE] > 120


def test_the_graph_at_any_instant_is_the_same_live_and_from_a_file(tmp_path: Path) -> None:
    codra = run(tmp_path / "run.mcap")
    head, events = read(tmp_path / "run.mcap")
    for instant_s in (10.0, 10.5, 11.0, 11.5, 12.0, 12.5, 13.5, 14.5):
        live_snapshot, replayed_snapshot = (
            codra.knowledge.at(instant_s),
            knowledge_at(head, events, MODEL, KNOWLEDGE, instant_s),
        )
        assert _plain(replayed_snapshot) == _plain(live_snapshot)
        assert replayed_snapshot.handover("detecting") == live_snapshot.handover("detecting")
        if "box" in live_snapshot:
            assert replayed_snapshot.transform("robot", "box") == live_snapshot.transform("robot", "box")


def test_a_journal_that_does_not_follow_from_its_inputs_has_no_graph(tmp_path: Path) -> None:
    run(tmp_path / "run.mcap")
    head, events = read(tmp_path / "run.mcap")
    close = max(index for index, event in enumerate(events) if event.kind is Kind.INPUT)
    end = Event(
        instant_s=events[close].instant_s,
        kind=Kind.INPUT,
        name="look",
        what="delivered",
        details={"index": 0, "step": events[close].details["step"]},
    )
    with pytest.raises(ValueError, match="'look' has no job 0 that could end"):
        knowledge_at(head, [*events[:close], end], MODEL, KNOWLEDGE, end.instant_s)


def _plain(snapshot: Snapshot) -> object:
    nodes = [(node.name, node.type, node.writer, node.since_s, dict(node.attributes)) for node in snapshot.nodes()]
    edges = [(edge.key, edge.type, edge.writer, edge.since_s, dict(edge.attributes)) for edge in snapshot.edges()]
    return nodes, edges


def test_the_past_of_the_graph_is_as_it_was_known_then(tmp_path: Path) -> None:
    codra = run(tmp_path / "run.mcap")
    assert "box" not in codra.knowledge.at(11.0)
    assert codra.knowledge.at(11.5).get("box", "locked").value is True
    assert codra.knowledge.at(10.0).get("battery", "charge").value == 80.0
    assert "box" not in codra.knowledge.snapshot()
    with pytest.raises(ValueError, match="lies in the future"):
        codra.knowledge.at(100.0)
    with pytest.raises(ValueError, match="read it from a journal"):
        codra.knowledge.at(9.0)


WHYS = {
    ("box.locked", 12.0): """\
box.locked is true at 12 s
  written as true by agent picker_page at 11.5 s, change 6, valid until 16.5 s""",
    ("box.load", 12.0): """\
box.load is unknown (never_observed) at 12 s
  agent container_detection was refused at 11.5 s: 'box.load' may be written by picker_page, \
not by 'container_detection'""",
    ("box", 12.0): """\
box is true at 12 s
  inserted by agent container_detection at 11.5 s, change 5""",
    ("box -close_to-> robot", 14.5): """\
box -close_to-> robot is false at 14.5 s
  inserted by agent container_detection at 11.5 s, change 5
  deleted by agent container_detection at 14.5 s, change 11""",
    ("world -RT-> box", 12.0): """\
world -container_pose-> box is true at 12 s
  inserted by agent container_detection at 11.5 s, change 5
  placed at (3, 0, 0) m by agent container_detection at 11.5 s, change 5""",
    ("detecting", 12.0): """\
detecting is 'is' at 12 s
  present from the start, 10 s
  requested by agent picking at 11 s, change 4 (request 1 of picking, until 12 s at the latest)
  begun by agent container_detection at 11.5 s, change 5 (request 1 of picking, until 71.5 s at the latest)""",
    ("robot -wants-> rotating", 14.0): """\
rotating is 'aborted' at 14 s
  present from the start, 10 s
  requested by agent picking at 12.5 s, change 9 (request 1 of picking, until 13.5 s at the latest)
  aborted by the graph itself at 13.5 s, change 10 (request 1 of picking, unacknowledged)""",
}


@pytest.mark.parametrize(("name", "at_s"), list(WHYS))
def test_why_states_the_writer_the_time_and_the_change(name: str, at_s: float, tmp_path: Path) -> None:
    codra = run(tmp_path / "run.mcap")
    assert str(codra.why(name, at_s=at_s)) == WHYS[name, at_s]
    head, events = read(tmp_path / "run.mcap")
    assert str(explain(head.summary, lambda until_s: LatestEvents.of(events, until_s), name, at_s)) == WHYS[name, at_s]


def test_why_explains_deleted_elements_and_recreated_ones() -> None:
    clock = SimClock()
    with manager(clock) as codra:
        detection = codra.agent("container_detection").graph
        page = codra.agent("picker_page").graph
        detection.insert_node("box", "roll_container")
        page.set("box", "locked", True)
        clock.sleep(1.0)
        with detection.transaction() as again:
            again.delete_node("box")
            again.insert_node("box", "roll_container")
            again.insert_edge("box", "close_to", "robot", distance=2.0)
        contents = {
            name: codra.why(name).reading.content for name in ("box", "box.locked", "box -close_to-> robot.distance")
        }
        assert contents == {"box": True, "box.locked": None, "box -close_to-> robot.distance": 2.0}

        with detection.transaction() as again:
            again.delete_edge("box", "close_to", "robot")
            again.insert_edge("box", "close_to", "robot", distance=1.0)
        assert codra.why("box -close_to-> robot").reading.content is True
        assert codra.why("box -close_to-> robot.distance").reading.content == 1.0
        detection.delete_node("box")
        assert codra.why("box -close_to-> robot.distance").reading.detail == "its edge was deleted"


def test_why_of_a_shared_attribute_is_that_of_the_variable(tmp_path: Path) -> None:
    codra = run(tmp_path / "run.mcap")
    assert codra.why("battery.charge", at_s=12.0) == codra.why("charge", at_s=12.0)
    text = str(codra.why("battery.charge", at_s=12.0))
    assert "charge is 80 percent at 12 s" in text
    assert "container_detection" in text, "refused writes are reported as well"


def test_why_reports_a_name_that_never_existed(tmp_path: Path) -> None:
    codra = run(tmp_path / "run.mcap")
    with pytest.raises(UnknownNameError, match="did you mean 'box"):
        codra.why("boxx", at_s=12.0)


def test_the_command_why_explains_knowledge_and_reports_unknown_names(tmp_path: Path) -> None:
    run(tmp_path / "run.mcap")

    def ask(*arguments: str) -> subprocess.CompletedProcess[str]:
        command = [sys.executable, "-m", "codra_dsl", "why", *arguments, "--journal", "run.mcap"]
        return subprocess.run(command, cwd=tmp_path, check=False, text=True, capture_output=True, timeout=60)

    done = ask("world -container_pose-> box", "--at", "12")
    assert (done.returncode, done.stdout.splitlines()) == (0, WHYS["world -RT-> box", 12.0].splitlines())
    done = ask("nothing")
    assert done.returncode == 2
    assert "nothing" in done.stderr
    assert "Traceback" not in done.stderr


KILLED = """
import os, sys
from codra_dsl.runtime import Journal, SimClock
from tests.runtime.knowledge.manager import manager

clock = SimClock()
codra = manager(clock, Journal(sys.argv[1]))
detection = codra.agent("container_detection")
navigation = codra.agent("navigation")
for number in range(400):
    with detection.graph.transaction() as transaction:
        transaction.insert_node(f"box_{number}", "roll_container")
        transaction.insert_edge(f"box_{number}", "close_to", "robot", distance=float(number % 50))
    navigation.graph.set("battery", "charge", float(number % 100))
    clock.sleep(0.1)
os.kill(os.getpid(), 9)
"""


def test_a_killed_program_leaves_its_graph_in_the_journal(tmp_path: Path) -> None:
    path, root = tmp_path / "killed.mcap", Path(__file__).parents[3]
    done = subprocess.run([sys.executable, "-c", KILLED, str(path)], cwd=root, check=False, timeout=120)
    assert done.returncode == -signal.SIGKILL
    head, events = read(path)
    assert replay(head, events, MODEL, ContextManager[str, str], None, KNOWLEDGE).difference is None
    snapshot = knowledge_at(head, events, MODEL, KNOWLEDGE, events[-1].instant_s)
    assert len(snapshot.nodes("roll_container")) == 400
    assert len(snapshot.edges("close_to")) == 400
    assert snapshot.get("battery", "charge").value == 99.0
