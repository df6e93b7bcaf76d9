"""One replica and its peers: writing, joining, recovering, refusing."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from random import Random
from typing import Any

import pytest

from codra_dsl.runtime.clock import SimClock
from codra_dsl.runtime.errors import NotASourceError, UnknownNameError
from codra_dsl.runtime.geometry import Pose
from codra_dsl.runtime.knowledge import OutrankedError, TaskModel
from codra_dsl.runtime.knowledge.declarations import by
from codra_dsl.runtime.knowledge.operations import Operation, Verb
from codra_dsl.runtime.replication import NotJoinedError, OperationFile, Replica
from codra_dsl.runtime.replication.commits import RegisterKind
from codra_dsl.runtime.replication.hybrid_time import MAX_DRIFT_S
from tests.runtime.remote.skewed_clock import SkewedClock
from tests.runtime.replication.fleet import AGENTS, MODEL, MemoryJournal, graph_of, model

FIRST, SECOND, THIRD = AGENTS[:3]


class Robots:
    """Replicas on a network without faults, except that robots can be cut off.

    Attributes:
        messages: the number of messages that were sent.
    """

    def __init__(self) -> None:
        self.clock = SimClock()
        self.replicas: dict[str, Replica] = {}
        self.journals: dict[str, Any] = {}
        self.cut_off: set[str] = set()
        self.messages = 0

    def add(self, name: str, *others: str, **options: Any) -> Replica:
        """Add a robot, or start its program again."""
        journal = self.journals.setdefault(name, options.pop("journal", None) or MemoryJournal())
        clock = SkewedClock(self.clock, options.pop("offset_s", 0.0), 0.0)
        rules = options.pop("rules", MODEL)

        def send(receiver: str, message: bytes) -> None:
            self.messages += 1
            self.clock.call_at(self.clock.now_s(), lambda: self._deliver(name, receiver, message))

        self.replicas[name] = Replica(name, rules, clock=clock, journal=journal, send=send, others=others, **options)
        return self.replicas[name]

    def _deliver(self, sender: str, receiver: str, message: bytes) -> None:
        if receiver in self.replicas and not {sender, receiver} & self.cut_off:
            self.replicas[receiver].receive(message)

    def settle(self) -> None:
        self.clock.sleep(12.0)


@pytest.fixture
def robots() -> Iterator[Robots]:
    robots = Robots()
    robots.add("one", "two")
    robots.add("two", "one")
    yield robots
    for journal in robots.journals.values():
        if isinstance(journal, OperationFile):
            journal.close()


def set_level(value: int, name: str = "ann") -> list[Operation]:
    return [Operation(Verb.SET, (name, "level", value, None))]


def insert(name: str) -> list[Operation]:
    return [Operation(Verb.INSERT_NODE, (name, "box", {}))]


def level(replica: Replica, name: str = "ann") -> Any:
    return replica.snapshot().get(name, "level").content


def test_replicas_begin_with_the_graph_of_the_spec(robots: Robots) -> None:
    snapshot = robots.replicas["one"].snapshot()

    assert [node.name for node in snapshot.nodes()] == ["world", "ann", "bob"]
    assert level(robots.replicas["one"]) == 1
    assert snapshot.get_of_edge("world", "carried", "ann", "strength").value == 2
    assert snapshot.transform("world", "ann").pose == Pose()


def test_a_transaction_becomes_visible_as_a_whole(robots: Robots) -> None:
    one, two = robots.replicas.values()
    pose = Pose.of((1.0, 2.0, 3.0))
    operations = [*insert("cup"), *set_level(7, "cup"), Operation(Verb.PLACE, ("ann", "carried", "cup", pose, None))]

    commit = one.write(FIRST, operations)
    assert commit is not None
    assert "cup" not in two.snapshot()
    robots.clock.sleep(0.1)

    assert level(two, "cup") == 7
    assert two.snapshot().transform("ann", "cup").pose == pose
    assert two.snapshot().node("cup").writer == FIRST


def test_a_robot_that_was_cut_off_works_on_and_then_converges(robots: Robots) -> None:
    one, two = robots.replicas.values()
    robots.cut_off = {"two"}
    one.write(FIRST, set_level(5))
    robots.clock.sleep(60.0)
    two.write(SECOND, insert("cup"))
    assert level(two) == 1

    robots.cut_off = set()
    robots.settle()

    assert level(two) == 5
    assert graph_of(one.snapshot()) == graph_of(two.snapshot())


def test_a_later_write_wins_although_the_clock_of_its_robot_is_slow() -> None:
    robots = Robots()
    fast = robots.add("fast", "slow", offset_s=5.0)
    slow = robots.add("slow", "fast")
    robots.clock.sleep(1.0)
    fast.write(FIRST, set_level(1))
    robots.clock.sleep(0.1)

    slow.write(SECOND, set_level(2))
    robots.settle()

    assert level(fast) == level(slow) == 2


def test_of_two_concurrent_values_the_one_of_higher_rank_stands_until_it_is_stale(robots: Robots) -> None:
    one, two = robots.replicas.values()
    robots.cut_off = {"two"}
    one.write(FIRST, [Operation(Verb.SET, ("ann", "speed", 1.0, None))])
    robots.clock.sleep(1.0)
    two.write(SECOND, [Operation(Verb.SET, ("ann", "speed", 2.0, None))])

    robots.cut_off = set()
    robots.clock.sleep(2.0)
    assert one.snapshot().get("ann", "speed").value == two.snapshot().get("ann", "speed").value == 1.0
    with pytest.raises(OutrankedError):
        two.write(SECOND, [Operation(Verb.SET, ("ann", "speed", 2.0, None))])
    robots.clock.sleep(1.5)

    assert one.snapshot().get("ann", "speed").value == two.snapshot().get("ann", "speed").value == 2.0


def test_two_robots_that_carry_each_other_do_not_make_a_cycle(robots: Robots) -> None:
    one, two = robots.replicas.values()
    robots.cut_off = {"two"}
    one.write(FIRST, [Operation(Verb.PLACE, ("bob", "carried", "ann", Pose(), None))])
    robots.clock.sleep(1.0)
    two.write(SECOND, [Operation(Verb.PLACE, ("ann", "carried", "bob", Pose(), None))])

    robots.cut_off = set()
    robots.settle()

    for replica in (one, two):
        assert replica.snapshot().has_edge("bob", "carried", "ann")
        assert not replica.snapshot().has_edge("ann", "carried", "bob")


def test_what_was_written_to_a_deleted_node_does_not_come_back(robots: Robots) -> None:
    one, two = robots.replicas.values()
    robots.cut_off = {"two"}
    one.write(FIRST, [Operation(Verb.DELETE_NODE, ("ann",))])
    robots.clock.sleep(1.0)
    two.write(SECOND, set_level(9))
    robots.clock.sleep(1.0)
    one.write(FIRST, insert("ann"))

    robots.cut_off = set()
    robots.settle()

    assert level(one) is level(two) is None
    assert not one.snapshot().edges(target="ann")


def test_a_replica_that_joins_receives_the_graph_and_may_then_write(robots: Robots) -> None:
    one, two = robots.replicas.values()
    one.write(FIRST, [*insert("cup"), *set_level(4, "cup")])
    one.write(FIRST, [Operation(Verb.DELETE_NODE, ("bob",))])
    robots.settle()
    three = robots.add("three", "two", joins=True)
    with pytest.raises(NotJoinedError):
        three.write(THIRD, set_level(3))

    robots.settle()
    three.write(THIRD, set_level(3))
    robots.settle()

    assert level(one) == level(two) == 3
    assert level(three, "cup") == 4
    assert "bob" not in three.snapshot()


def test_a_replica_recovers_from_its_file_after_a_torn_write(robots: Robots, tmp_path: Path) -> None:
    path = tmp_path / "three.jsonl"
    journal = OperationFile(path)
    three = robots.add("three", "one", "two", journal=journal, joins=True)
    robots.settle()
    robots.cut_off = {"three"}
    three.write(THIRD, set_level(8))
    three.close()
    journal.close()
    path.write_bytes(path.read_bytes() + b'["commits",[["three",2,')

    robots.journals["three"] = OperationFile(path)
    recovered = robots.add("three", "one", "two", joins=True)
    assert level(recovered) == 8
    recovered.write(THIRD, set_level(9, "bob"))
    robots.cut_off = set()
    robots.settle()

    assert level(robots.replicas["one"]) == 8
    assert level(robots.replicas["one"], "bob") == 9


def test_a_damaged_journal_is_refused_with_its_line(robots: Robots) -> None:
    robots.replicas["one"].write(FIRST, set_level(3))
    robots.journals["one"].stored_lines.insert(1, b'["commits",[["one","two"]]]')

    with pytest.raises(ValueError, match=r"line 2 of the journal of 'one' is damaged: this is not a commit"):
        robots.add("one", "two")


def test_a_journal_belongs_to_one_program(tmp_path: Path) -> None:
    with_lock = OperationFile(tmp_path / "journal.jsonl")

    with pytest.raises(BlockingIOError):
        OperationFile(tmp_path / "journal.jsonl")
    with_lock.close()


def test_a_long_journal_becomes_a_snapshot(robots: Robots, tmp_path: Path) -> None:
    path = tmp_path / "three.jsonl"
    three = robots.add("three", "one", "two", journal=OperationFile(path), joins=True, max_journal_lines=20)
    robots.settle()
    for value in range(40):
        three.write(THIRD, set_level(value))
    robots.settle()
    three.write(THIRD, set_level(99, "bob"))
    three.close()
    line_count = len(robots.journals["three"].lines())
    robots.journals["three"].close()

    robots.journals["three"] = OperationFile(path)
    recovered = robots.add("three", "one", "two", joins=True)

    assert line_count < 20
    assert level(recovered) == 39
    assert level(recovered, "bob") == 99


def test_deletions_are_forgotten_once_all_replicas_have_them(robots: Robots) -> None:
    one, two = robots.replicas.values()
    one.write(FIRST, [*insert("cup"), *set_level(4, "cup")])
    robots.cut_off = {"two"}
    one.write(FIRST, [Operation(Verb.DELETE_NODE, ("cup",))])
    robots.clock.sleep(60.0)
    assert any("cup" in register.path for register in one._merged.registers)

    robots.cut_off = set()
    robots.settle()

    for replica in (one, two):
        assert not any("cup" in register.path for register in replica._merged.registers)
        assert replica._log.is_empty


def test_a_replica_that_joins_after_compaction_does_not_stop_the_others_from_forgetting(robots: Robots) -> None:
    one, two = robots.replicas.values()
    robots.settle()
    robots.cut_off = {"two"}
    one.write(FIRST, set_level(4))
    robots.clock.sleep(0.1)
    robots.cut_off = set()
    robots.clock.sleep(1.2)
    three = robots.add("three", "two", joins=True)  # the others know it before all of them have pruned their commits
    robots.settle()

    for replica in (one, two, three):
        assert replica._log.is_empty
        assert level(replica) == 4
        assert replica._stability.promise > replica._merged.stable


def test_a_foreign_write_is_refused_by_all_replicas_and_counted(robots: Robots) -> None:
    rogue = robots.add("rogue", "one", rules=model(by("rogue")), joins=True)
    robots.settle()
    rogue.write("rogue", [*set_level(6), *insert("cup")])
    robots.settle()

    for name in ("one", "two"):
        replica = robots.replicas[name]
        assert level(replica) == 1
        assert "cup" not in replica.snapshot()
        assert [refusal.agent for refusal in replica.audit.refusals()] == ["rogue"]
    assert robots.replicas["one"]._log.is_empty, "a refused commit is acknowledged"


def test_a_snapshot_brings_no_foreign_entries(robots: Robots) -> None:
    rogue = robots.add("rogue", "one", rules=model(by("rogue")), joins=True)
    robots.settle()
    rogue.write("rogue", [*set_level(6), *insert("cup")])
    robots.settle()

    three = robots.add("three", "rogue", joins=True)
    robots.settle()

    assert three.has_joined
    assert level(three) != 6
    assert "cup" not in three.snapshot()


def test_a_commit_from_the_far_future_waits_until_the_clocks_are_near(robots: Robots) -> None:
    one, two = robots.replicas.values()
    robots.add("ahead", "one", joins=True)
    robots.settle()
    robots.replicas["ahead"].close()
    ahead = robots.add("ahead", "one", joins=True, offset_s=MAX_DRIFT_S + 30.0)
    ahead.write(THIRD, set_level(5))
    robots.settle()
    assert level(one) == 1
    assert one.postponed_count > 0
    commit = one.write(FIRST, set_level(2))
    assert commit is not None
    assert commit.time.physical_s == robots.clock.now_s(), "the clock did not follow"

    ahead.close()
    robots.clock.sleep(40.0)
    robots.add("ahead", "one", joins=True)
    robots.settle()

    assert level(one) == level(two) == 5


def test_a_task_is_not_replicated() -> None:
    robots = Robots()
    task = TaskModel(name="fetching", origin="ann", by=SECOND, requesters=(FIRST,), results=("done",))
    one = robots.add("one", rules=model(tasks=(task,)))

    assert "fetching" in one.snapshot()
    with pytest.raises(ValueError, match="'fetching' is a task: tasks are handed over at one replica"):
        one.write(FIRST, [Operation(Verb.REQUEST, ("fetching", {}))])


@pytest.mark.parametrize(
    ("agent", "operation", "error"),
    [
        ("nobody", Operation(Verb.SET, ("ann", "level", 2, None)), UnknownNameError),
        ("", Operation(Verb.SET, ("ann", "level", 2, None)), UnknownNameError),
        (SECOND, Operation(Verb.SET, ("ann", "owned", 2, None)), NotASourceError),
        (FIRST, Operation(Verb.SET, ("ann", "level", "high", None)), ValueError),
        (FIRST, Operation(Verb.SET, ("ann", "level", 2, 1e9)), ValueError),
        (FIRST, Operation(Verb.INSERT_NODE, ("ann", "box", {})), ValueError),
    ],
)
def test_an_operation_that_fails_in_one_process_fails_and_is_not_sent(
    robots: Robots, agent: str, operation: Operation, error: type[Exception]
) -> None:
    robots.settle()
    message_count = robots.messages

    with pytest.raises(error):
        robots.replicas["one"].write(agent, [*insert("cup"), operation])

    assert robots.messages == message_count
    assert "cup" not in robots.replicas["one"].snapshot()


def test_an_edge_that_exists_is_not_written_again(robots: Robots) -> None:
    one = robots.replicas["one"]
    commit = one.write(FIRST, [Operation(Verb.INSERT_EDGE, ("bob", "near", "ann", {"strength": 1}))])
    again = one.write(FIRST, [Operation(Verb.INSERT_EDGE, ("bob", "near", "ann", {"strength": 2}))])
    nothing = one.write(FIRST, [Operation(Verb.INSERT_EDGE, ("bob", "near", "ann", {}))])

    assert [write.register.kind for write in commit.writes] == [RegisterKind.EDGE, RegisterKind.EDGE_ATTRIBUTE]
    assert [write.register.kind for write in again.writes] == [RegisterKind.EDGE_ATTRIBUTE]
    assert nothing is None


def mutated_messages(messages: list[bytes], random: Random) -> Iterator[bytes]:
    """Yield messages of which one value was replaced by a value of another kind, and some that are cut short."""
    strange_values = (None, True, -1, 1e300, "", "ann", [], {}, [None], {"infinite": 1}, 10**400)
    for message in messages:
        yield message[: random.randrange(len(message))]
        for _ in range(20):
            data = json.loads(message)
            place = data
            while True:
                keys = list(place) if isinstance(place, dict) else list(range(len(place)))
                if not keys:
                    break
                key = random.choice(keys)
                if isinstance(place[key], list | dict) and place[key] and random.random() < 0.85:
                    place = place[key]
                    continue
                place[key] = random.choice(strange_values)
                break
            yield json.dumps(data).encode()


def test_a_malformed_message_is_refused_and_harms_nothing() -> None:
    robots = Robots()
    one = robots.add("one", "two", "three")
    received: list[bytes] = []
    two = robots.add("two", "one", "three")
    original_receive = two.receive
    two.receive = lambda message: (received.append(message), original_receive(message))  # type: ignore[method-assign]
    one.write(FIRST, [*insert("cup"), *set_level(4, "cup"), Operation(Verb.INSERT_EDGE, ("cup", "near", "ann", {}))])
    one.write(FIRST, [Operation(Verb.PLACE, ("ann", "carried", "cup", Pose(), None))])
    robots.clock.sleep(1.2)
    received.append(one._state_snapshot().encode())

    joining = robots.add("three", "one", "two", joins=True)
    random = Random(1)
    for message in (b"", b"[]", b"\xff", b"[" * 100_000, *mutated_messages(received, random)):
        two.receive(message)
        joining.receive(message)
    robots.clock.sleep(1.0)

    assert two.audit.total_count > 50
    assert level(two, "cup") in (4, None, True, -1)
