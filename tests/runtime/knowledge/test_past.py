"""Earlier versions of the graph are unaffected by later writes."""

from __future__ import annotations

import inspect
import sys
import threading
from collections.abc import Callable
from contextlib import ExitStack
from operator import itemgetter
from pathlib import Path
from types import FrameType
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.runtime import SimClock
from codra_dsl.runtime.knowledge import AgentHandle, Knowledge
from codra_dsl.runtime.knowledge.agent_handle import Writer
from codra_dsl.runtime.knowledge.declarations import AttributeModel, EdgeTypeModel, KnowledgeModel, NodeTypeModel, by
from codra_dsl.runtime.knowledge.shared_graph import MAX_PAST_INSTANTS
from codra_dsl.runtime.knowledge.snapshot import Snapshot
from codra_dsl.runtime.values.model import integer
from codra_dsl.runtime.values.persistent import PersistentMap

MOST = 3

COUNT = AttributeModel(name="count", type=integer(), sources=by("author"), history=MOST)

MODEL = KnowledgeModel(
    name="past",
    node_types=(NodeTypeModel(name="thing", sources=by("author"), attributes=(COUNT,)),),
    edge_types=(
        EdgeTypeModel(name="near", origins=("thing",), targets=("thing",), sources=by("author"), attributes=(COUNT,)),
    ),
)

FILES = (str(Path(inspect.getfile(Knowledge)).parent), inspect.getfile(PersistentMap))

EDGE = ("a", "near", "b")

Values = dict[str, list[int]]
"""The values of the attribute by node, ordered by evidence, and the present value of the edge."""

Step = tuple[str, str, float]
"""An operation, its node, and the age of its evidence."""

STEPS = st.tuples(
    st.sampled_from(["set", "set", "set", "set of edge", "delete"]),
    st.sampled_from(["a", "b"]),
    st.sampled_from([0.0, 0.0, 0.5, 1.5]),
)


class Record:
    """All writes, as lists that are sorted when they are read."""

    def __init__(self) -> None:
        self.written: dict[str, list[tuple[float, int]]] = {}
        self.count = 0

    def values(self) -> Values:
        values = {name: sorted(readings, key=itemgetter(0)) for name, readings in self.written.items()}
        return {
            name: [count for _, count in readings[-1 if name == "edge" else -MOST :]]
            for name, readings in values.items()
        }

    def take(self, write: Writer, step: Step, now_s: float) -> None:
        """Apply a step to the graph and to this record; insert the node or the edge first if it is missing."""
        what, name, age_s = step
        self.count += 1
        if what == "delete":
            if self.written.pop(name, None) is not None:
                write.delete_node(name)
                self.written.pop("edge", None)
            return
        for node in (name,) if what == "set" else ("a", "b"):
            if node not in self.written:
                write.insert_node(node, "thing")
                self.written[node] = []
        if what == "set":
            write.set(name, "count", self.count, evidence_s=now_s - age_s)
        else:
            write.insert_edge(*EDGE)
            write.set_of_edge(*EDGE, "count", self.count, evidence_s=now_s - age_s)
        self.written.setdefault(name if what == "set" else "edge", []).append((now_s - age_s, self.count))


def values_in(snapshot: Snapshot) -> Values:
    """Return the values in a snapshot; all ways to read them must agree."""
    values: Values = {}
    for node in snapshot.nodes():
        readings = snapshot.history(node.name, "count")
        values[node.name] = [reading.value for reading in readings]
        assert tuple(node.attributes.values()) == readings[-1:]
        assert snapshot.get(node.name, "count").content == (readings[-1].value if readings else None)
    for edge in snapshot.edges():
        assert list(edge.attributes.values()) == [snapshot.get_of_edge(*EDGE, "count")]
        values["edge"] = [reading.value for reading in edge.attributes.values()]
    return values


@given(st.lists(st.tuples(st.booleans(), st.lists(STEPS, max_size=4)), max_size=30))
def test_a_snapshot_always_contains_exactly_the_earlier_writes(runs: list[tuple[bool, list[Step]]]) -> None:
    clock, record = SimClock(100.0), Record()
    knowledge = Knowledge(MODEL, clock=clock)
    agent = knowledge.as_agent("author")
    kept = []
    for is_one, steps in runs:
        clock.sleep(1.0)
        if is_one:
            with agent.transaction() as write:
                for step in steps:
                    record.take(write, step, clock.now_s())
        else:
            for step in steps:
                record.take(agent, step, clock.now_s())
        kept.append((knowledge.snapshot(), clock.now_s(), record.values()))
    for snapshot, instant_s, expected in kept:
        assert values_in(snapshot) == expected
        assert values_in(knowledge.at(instant_s)) == expected


def test_nodes_and_histories_never_change_despite_later_writes() -> None:
    knowledge = Knowledge(MODEL, clock=SimClock())
    agent = knowledge.as_agent("author")
    agent.insert_node("a", "thing", count=0)
    kept = []
    for count in range(1, 500):
        agent.set("a", "count", count)
        kept.append((count, knowledge.snapshot(), knowledge.snapshot().node("a"), knowledge.snapshot().nodes()))
    for count, snapshot, node, nodes in kept:
        assert [reading.value for reading in snapshot.history("a", "count")] == list(range(count + 1))[-MOST:]
        assert [seen_node.attributes["count"].value for seen_node in (node, *nodes)] == [count, count]


def test_many_changes_at_one_instant_do_not_shorten_the_past() -> None:
    clock = SimClock()
    knowledge = Knowledge(MODEL, clock=clock)
    agent = knowledge.as_agent("author")
    agent.insert_node("a", "thing", count=-1)
    clock.sleep(1.0)
    for count in range(MAX_PAST_INSTANTS + 1):
        agent.set("a", "count", count)
    assert knowledge.at(0.5).get("a", "count").value == -1
    assert knowledge.at(1.0).get("a", "count").value == MAX_PAST_INSTANTS


def test_evidence_may_be_taken_during_a_transaction() -> None:
    clock = SimClock()
    knowledge = Knowledge(MODEL, clock=clock)
    with knowledge.as_agent("author").transaction() as write:
        write.insert_node("a", "thing")
        clock.sleep(2.0)
        write.set("a", "count", 1, evidence_s=1.5)
    assert knowledge.get("a", "count").evidence_s == 1.5


def test_a_write_to_a_transaction_that_has_ended_is_refused() -> None:
    knowledge = Knowledge(MODEL, clock=SimClock())
    agent = knowledge.as_agent("author")
    agent.insert_node("a", "thing")
    transactions, refused = ExitStack(), []
    write = transactions.enter_context(agent.transaction())
    write.insert_node("b", "thing")

    def write_in_another_thread() -> None:
        try:
            write.insert_node("c", "thing")
        except PermissionError as error:
            refused.append(str(error))

    thread = threading.Thread(target=write_in_another_thread)

    class Ending:
        """A number; no other thread can write to the graph while the graph converts it."""

        def item(self) -> int:
            if thread.ident is None:
                thread.start()
                thread.join(0.05)  # it waits for its turn
                transactions.close()
            return 1

    agent.set("a", "count", Ending())
    thread.join()
    assert refused == ["this transaction is over: begin another"]
    assert [node.name for node in knowledge.snapshot().nodes()] == ["a", "b"]


@pytest.mark.parametrize("names", [("a", "b"), ("a",)])
def test_an_interrupted_write_is_complete_or_absent(names: tuple[str, ...]) -> None:
    knowledge = Knowledge(MODEL, clock=SimClock())
    agent = knowledge.as_agent("author")
    for name in (*names, "another"):
        agent.insert_node(name, "thing", count=0)

    def counts() -> list[int]:
        return [knowledge.get(name, "count").value for name in names]

    line, seen_counts = 1, []
    while _is_interrupted(agent, names, line):
        assert [knowledge.at(0.0).get(name, "count").value for name in names] == counts()
        seen_counts.append(counts())
        agent.set("another", "count", line)
        assert counts() == seen_counts[-1]
        line += 1
    assert all(len(set(values)) == 1 for values in seen_counts)
    assert {values[0] == line for line, values in enumerate(seen_counts, 1)} == {True, False}


@pytest.mark.parametrize("names", [("a", "b"), ("a",)])
def test_the_write_of_a_signal_handler_within_a_write_is_kept(names: tuple[str, ...]) -> None:
    """Python runs signal handlers in the writing thread between its own steps, such as at the start of a call."""
    knowledge = Knowledge(MODEL, clock=SimClock())
    agent = knowledge.as_agent("author")
    for name in (*names, "of the handler"):
        agent.insert_node(name, "thing", count=0)
    held: list[Snapshot] = []
    kept: list[tuple[Snapshot, list[int]]] = []

    def counts(snapshot: Snapshot) -> list[int]:
        return [node.attributes["count"].value for node in snapshot.nodes()]

    def handle() -> None:
        agent.set("of the handler", "count", call)
        agent.set("a", "count", -call)
        agent.insert_node(f"inserted {call}", "thing", count=call)
        held.append(knowledge.snapshot())

    call = 1
    while _is_hit(agent, names, "call", call, handle):
        present = knowledge.snapshot()
        kept += [(held[-1], counts(held[-1])), (present, counts(present))]
        assert {present.get(name, "count").value for name in names} <= {call, -call}
        assert present.get("of the handler", "count").value == call
        assert len(present) == len(names) + 1 + call
        call += 1
    assert len(held) == call - 1 > 5
    assert all(counts(snapshot) == then for snapshot, then in kept)


def _interrupt() -> None:
    raise KeyboardInterrupt


def _is_interrupted(agent: AgentHandle, names: tuple[str, ...], at_line: int) -> bool:
    try:
        return _is_hit(agent, names, "line", at_line, _interrupt)
    except KeyboardInterrupt:
        return True


def _is_hit(agent: AgentHandle, names: tuple[str, ...], event: str, at: int, happen: Callable[[], object]) -> bool:
    """Write a number to one or several nodes in one change; call `happen` before a line, or at the start of a call.

    Returns:
        Whether the write reached this point.
    """
    left = at

    def trace(frame: FrameType, kind: str, _: Any) -> Any:
        nonlocal left
        if not frame.f_code.co_filename.startswith(FILES):
            return None
        if kind == event:
            left -= 1
            if not left:
                sys.settrace(before)
                happen()
                return None
        return trace

    before = sys.gettrace()
    sys.settrace(trace)
    try:
        if len(names) == 1:
            agent.set(names[0], "count", at)
        else:
            with agent.transaction() as write:
                for name in names:
                    write.set(name, "count", at)
    finally:
        sys.settrace(before)
    return left <= 0
