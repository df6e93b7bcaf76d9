"""A fleet of replicas on a faulty network in simulated time, with crashes, new replicas, and one that breaks the rules.

A seed determines a run. After the run all replicas must have the same graph: the one that follows from all
acknowledged commits by `expected_graph`, which applies them one after another in the order of their stamps.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from random import Random
from typing import Any

from codra_dsl.runtime.clock import SimClock, Timer
from codra_dsl.runtime.geometry import Motion, Pose
from codra_dsl.runtime.knowledge import KnowledgeModel, Snapshot, Writer
from codra_dsl.runtime.knowledge.change_set import ChangeSet
from codra_dsl.runtime.knowledge.declarations import (
    AgentModel,
    AttributeModel,
    EdgeModel,
    EdgeTypeModel,
    NodeModel,
    NodeTypeModel,
    TaskModel,
    by,
    ranked,
)
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema
from codra_dsl.runtime.knowledge.operations import Operation, Verb
from codra_dsl.runtime.remote.fake_network import FakeNetwork, Faults
from codra_dsl.runtime.replication import Commit, Replica
from codra_dsl.runtime.replication.graph_state import _GraphBuilder, graph_state
from codra_dsl.runtime.replication.hybrid_time import BEFORE_ALL
from codra_dsl.runtime.replication.messages import Commits, decode
from codra_dsl.runtime.replication.transactions import apply_operations
from codra_dsl.runtime.values.model import integer, real
from tests.runtime.remote.skewed_clock import SkewedClock
from tests.runtime.replication.expected_graph import Graph, expected_graph, is_permitted

MAX_REPLICAS = 7
AGENTS = tuple(f"agent_{number}" for number in range(MAX_REPLICAS + 1))
OWNER = AGENTS[0]
VALID_FOR_S = 4.0
NAMES = ("ann", "bob", "cup", "dot")

MAX_SKEW_S = 5.0
MAX_LOSS = 0.3
ACTIVE_S = 8.0
ALL_CUT_S = 2.0
VERBS = (
    *(Verb.SET, Verb.PLACE) * 5,
    *(Verb.INSERT_NODE, Verb.INSERT_EDGE) * 3,
    *(Verb.DELETE_NODE, Verb.DELETE_EDGE, Verb.SET_OF_EDGE) * 2,
)
LAST_VERBS = ((Verb.SET,), (Verb.PLACE,), (Verb.INSERT_NODE, Verb.DELETE_NODE, Verb.SET), VERBS)
WRITES_PER_REPLICA_S = 3.0
SETTLING_STEP_S = 0.2
MAX_SETTLING_STEPS = 600

OPERATION_ERRORS = (LookupError, ValueError, TypeError, PermissionError)


def model(extra_writers: tuple[Writer, ...] = (), tasks: tuple[TaskModel, ...] = ()) -> KnowledgeModel:
    """Return the declarations: attributes, types of nodes and types of edges with equal and with ranked writers."""
    equal, descending = (*by(*AGENTS), *extra_writers), (*ranked(*AGENTS), *extra_writers)
    owned = (*by(OWNER), *extra_writers)
    attributes = (
        AttributeModel(name="level", type=integer(), sources=equal),
        AttributeModel(name="mark", type=integer(), sources=descending),
        AttributeModel(name="speed", type=real(), sources=descending, valid_for_s=VALID_FOR_S),
        AttributeModel(name="owned", type=integer(), sources=owned),
    )
    things, origins = ("box", "spot"), ("box", "spot", "world")
    moving = {"label": "RT", "origins": origins, "targets": things}
    strength = (AttributeModel(name="strength", type=integer(), sources=equal),)
    return KnowledgeModel(
        name="fleet",
        node_types=(
            NodeTypeModel(name="world"),
            NodeTypeModel(name="box", sources=equal, attributes=attributes),
            NodeTypeModel(name="spot", sources=descending, attributes=attributes),
        ),
        edge_types=(
            EdgeTypeModel(name="near", label="at", origins=things, targets=things, sources=equal, attributes=strength),
            EdgeTypeModel(name="far", label="at", origins=things, targets=things, sources=descending),
            EdgeTypeModel(name="carried", sources=equal, motion=Motion(), attributes=strength, **moving),
            EdgeTypeModel(name="standing", sources=descending, motion=Motion(valid_for_s=VALID_FOR_S), **moving),
        ),
        nodes=(
            NodeModel(name="world", type="world"),
            NodeModel(name="ann", type="box", values={"level": 1}),
            NodeModel(name="bob", type="spot"),
        ),
        edges=(
            EdgeModel(origin="world", type="carried", target="ann", values={"strength": 2}),
            EdgeModel(origin="ann", type="near", target="bob"),
        ),
        tasks=tasks,
        agents=tuple(AgentModel(name=name) for name in AGENTS),
    )


MODEL = model()
SCHEMA = GraphSchema(MODEL)


class CrashError(Exception):
    """The program of a replica ends in the middle of a write."""


@dataclass
class MemoryJournal:
    """A journal that survives the crash of its replica.

    Attributes:
        crashes: before each line, returns whether the replica crashes before (True) or after (False) the line is
            stored, or not at all (None).
    """

    crashes: Callable[[], bool | None] = lambda: None
    stored_lines: list[bytes] = field(default_factory=list)

    def lines(self) -> list[bytes]:
        return list(self.stored_lines)

    def append(self, line: bytes) -> None:
        self._store([*self.stored_lines, line])

    def replace(self, lines: Iterable[bytes]) -> None:
        self._store(list(lines))

    def _store(self, lines: list[bytes]) -> None:
        crash = self.crashes()
        if crash is not True:
            self.stored_lines = lines
        if crash is not None:
            raise CrashError


@dataclass
class Member:
    """A robot with a replica, and the journal that survives the replica's crashes."""

    name: str
    agent: str
    model: KnowledgeModel
    others: tuple[str, ...]
    joins: bool
    journal: MemoryJournal = field(default_factory=MemoryJournal)
    replica: Replica | None = None
    refusals_before_crashes: int = 0

    def refusal_count(self) -> int:
        """Return how many commits of the rogue the programs of this robot have refused."""
        refusals = self.replica.audit.refusals() if self.replica else ()
        return self.refusals_before_crashes + sum(refusal.agent == "rogue" for refusal in refusals)


@dataclass
class RobotClock(SkewedClock):
    """The clock of a robot: it is wrong, and its events end with a crash of the robot's program."""

    run: Callable[[Callable[[], None]], None]

    def call_at(self, instant_s: float, callback: Callable[[], None]) -> Timer:
        return super().call_at(instant_s, lambda: self.run(callback))


class Fleet:
    """A run.

    Attributes:
        failures: what the run has shown to be wrong.
        commits: the acknowledged commits, and those that were stored before a crash, by replica and number.
        crash_count: the number of crashes.
        digest: a hash of all messages, in their order.
    """

    def __init__(self, seed: int) -> None:
        """Set up the replicas of a run."""
        self.failures: list[str] = []
        self.commits: dict[tuple[str, int], Commit] = {}
        self.crash_count = 0
        self.digest = hashlib.sha256()
        self._random = Random(f"{seed} fleet")
        self._clock = SimClock()
        random = self._random
        count = random.randint(2, MAX_REPLICAS)
        delay_s = (0.0, random.choice((0.01, 0.3, 1.5)))
        self._faults = Faults(delay_s=delay_s, loss=random.uniform(0.0, MAX_LOSS), duplication=random.uniform(0.0, 0.3))
        self._is_in_step = random.random() < 0.3  # without skew and at whole instants, clocks are often equal
        self._networks: dict[frozenset[str], FakeNetwork] = {}
        self._members: dict[str, Member] = {}
        self._is_active = True
        self._compaction_period_s = random.choice((0.0, 0.0, 1.0, 10.0))
        self._max_journal_lines = random.choice((10, 1_000))
        self._last_verbs = random.choice(LAST_VERBS)
        self.rogue = f"robot_{count - 1}" if count > 2 and random.random() < 0.25 else ""
        names = [f"robot_{number}" for number in range(count)]
        for number, name in enumerate(names):
            has_own_rules = name == self.rogue
            member_model = model(by("rogue")) if has_own_rules else MODEL
            agent = "rogue" if has_own_rules else AGENTS[number]
            self._add_member(Member(name, agent, member_model, tuple(names), joins=False))
        if not self.rogue and count < MAX_REPLICAS and random.random() < 0.5:
            self._at(random.uniform(1.0, ACTIVE_S), lambda: self._join(f"robot_{count}", AGENTS[count]))
        for _ in range(random.choice((0, 0, 2, 4))):
            self._at(random.uniform(0.0, ACTIVE_S), self._cut_some_links)
        if random.random() < 0.5:
            self._at(ACTIVE_S - ALL_CUT_S, self._cut_all_links)

    @property
    def honest_replicas(self) -> dict[str, Replica]:
        """Return the replicas that keep the rules."""
        members = self._members.values()
        return {member.name: member.replica for member in members if member.replica and member.name != self.rogue}

    @property
    def foreign_count(self) -> int:
        """Return the number of commits that break the rules."""
        return sum(not is_permitted(MODEL, commit) for commit in self.commits.values())

    def run(self) -> list[str]:
        """Run the fleet, let it settle, and return what is wrong."""
        self._clock.sleep(ACTIVE_S)
        self._is_active = False
        for network in self._networks.values():
            network.is_cut = False
        self._settle(lambda replicas: all(_vector(replica) == _vector(replicas[0]) for replica in replicas))
        self._compare_graphs()
        last_time = max(commit.time for commit in self.commits.values()) if self.commits else BEFORE_ALL
        self._settle(lambda replicas: all(replica._log.is_empty for replica in replicas))
        self._settle(lambda replicas: all(replica._merged.stable >= last_time for replica in replicas))
        self._compare_graphs()
        self._compare_registers()
        for member in self._members.values():
            if member.replica is not None:
                member.replica.close()
        return self.failures

    def _settle(self, is_settled: Callable[[list[Replica]], bool]) -> None:
        """Let time pass until all replicas run, have joined and are settled."""
        honest_members = [member for member in self._members.values() if member.name != self.rogue]
        for _ in range(MAX_SETTLING_STEPS):
            replicas = list(self.honest_replicas.values())
            are_complete = len(replicas) == len(honest_members) and all(replica.has_joined for replica in replicas)
            if are_complete and is_settled(replicas):
                return
            self._clock.sleep(SETTLING_STEP_S)
        self.failures.append("the replicas do not settle")

    # Events

    def _at(self, instant_s: float, event: Callable[[], None]) -> None:
        if self._is_in_step:
            instant_s = round(instant_s * 2.0) / 2.0
        self._clock.call_at(instant_s, event)

    def _add_member(self, member: Member) -> None:
        for other in self._members:
            network = FakeNetwork(self._clock, seed=self._random.randrange(2**32), faults=self._faults)
            self._networks[frozenset((member.name, other))] = network
        self._members[member.name] = member
        member.journal.crashes = self._crashes
        self._start(member)
        self._schedule_write(member)

    def _join(self, name: str, agent: str) -> None:
        sponsor = self._random.choice(sorted(self._members))
        self._add_member(Member(name, agent, MODEL, (sponsor,), joins=True))

    def _start(self, member: Member) -> None:
        """Start a replica, or recover it after a crash; its clock may show another time than before."""
        offset_s = 0.0 if self._is_in_step else self._random.uniform(0.0, MAX_SKEW_S)
        crashes, member.journal.crashes = member.journal.crashes, lambda: None
        member.replica = Replica(
            member.name,
            member.model,
            clock=RobotClock(self._clock, offset_s, 0.0, lambda action: self._run(member, action)),
            journal=member.journal,
            send=lambda receiver, message: self._send(member.name, receiver, message),
            others=member.others,
            joins=member.joins,
            compaction_period_s=self._compaction_period_s,
            max_journal_lines=self._max_journal_lines,
        )
        member.journal.crashes = crashes

    def _crashes(self) -> bool | None:
        """Return whether a replica crashes while it writes to its journal."""
        if not self._is_active or self._random.random() > 0.01:
            return None
        return self._random.random() < 0.5

    def _run(self, member: Member, action: Callable[[], None]) -> None:
        """Let a replica act; if it crashes, it recovers later."""
        try:
            action()
        except CrashError:
            assert member.replica is not None
            member.replica.close()
            member.refusals_before_crashes = member.refusal_count()
            member.replica = None
            self.crash_count += 1
            self._note_stored_commit(member)
            self._clock.call_at(self._clock.now_s() + self._random.uniform(0.0, 3.0), lambda: self._start(member))

    def _note_stored_commit(self, member: Member) -> None:
        """Expect a commit that was stored but not acknowledged, because the crash was between the two."""
        for line in member.journal.stored_lines[-1:]:
            record = decode(line)
            if isinstance(record, Commits):
                for commit in record.commits:
                    if commit.replica == member.name:
                        self.commits[commit.replica, commit.number] = commit

    def _send(self, sender: str, receiver: str, message: bytes) -> None:
        self.digest.update(message)
        member = self._members.get(receiver)
        if member is not None:
            network = self._networks[frozenset((sender, receiver))]
            network.transmit(lambda: self._clock.call_at(self._clock.now_s(), lambda: self._deliver(member, message)))

    def _deliver(self, member: Member, message: bytes) -> None:
        replica = member.replica
        if replica is not None:
            self._run(member, lambda: replica.receive(message))

    def _cut_some_links(self) -> None:
        """Divide the fleet, or cut some links, for a while."""
        members = set(self._random.sample(sorted(self._members), self._random.randint(1, len(self._members))))
        cut_networks = [network for ends, network in self._networks.items() if len(ends & members) == 1]
        for network in cut_networks:
            network.is_cut = True
        duration_s = self._random.uniform(0.5, 5.0)
        self._clock.call_at(self._clock.now_s() + duration_s, lambda: self._mend(cut_networks))

    def _cut_all_links(self) -> None:
        """Let each robot write alone until the end, so that the last writes are in conflict."""
        for network in self._networks.values():
            network.is_cut = True

    @staticmethod
    def _mend(networks: Iterable[FakeNetwork]) -> None:
        for network in networks:
            network.is_cut = False

    # Writes

    def _schedule_write(self, member: Member) -> None:
        instant_s = self._clock.now_s() + self._random.expovariate(WRITES_PER_REPLICA_S)
        if instant_s < ACTIVE_S:
            self._at(instant_s, lambda: self._write(member))

    def _write(self, member: Member) -> None:
        self._schedule_write(member)
        replica = member.replica
        if replica is not None and replica.has_joined and self._clock.now_s() < ACTIVE_S:
            self._run(member, lambda: self._make_transaction(member, replica))

    def _make_transaction(self, member: Member, replica: Replica) -> None:
        snapshot = replica.snapshot()
        count = self._random.choice((1, 1, 1, 3))
        operations = [self._operation(member.agent, snapshot) for _ in range(count)]
        expected = _writes_on_whole_graph(member, replica, operations)
        try:
            commit = replica.write(member.agent, operations)
        except OPERATION_ERRORS as error:
            commit, written = None, type(error)
        else:
            written = (commit and commit.writes) or ()
        if written != expected:
            self.failures.append(f"{member.name} wrote {written} by {operations}, and not {expected}")
        if commit is None:
            return
        self.commits[commit.replica, commit.number] = commit
        if count == 1 and not self._is_visible(member, replica, operations[0], commit.time.physical_s):
            self.failures.append(f"{member.name} does not see its own write {operations[0]}")

    @staticmethod
    def _is_visible(member: Member, replica: Replica, operation: Operation, now_s: float) -> bool:
        """Return whether the graph of a replica has the value or pose that was written last.

        A new pose may stay behind an older one of higher rank, or make a cycle with one, if the older one is left out
        because of a cycle: the author did not see it.
        """
        schema = GraphSchema(member.model)
        snapshot = Snapshot(schema, graph_state(replica._merged, schema, now_s), now_s)
        match operation:
            case (Verb.SET, (name, attribute, value, None)):
                return bool(snapshot.get(name, attribute).content == value)
            case (Verb.PLACE, (parent, edge_type, name, _, None)):
                builder = _GraphBuilder(replica._merged, replica._merged.registers, schema, now_s)
                builder.build()
                has_cycle = len(snapshot.edges("RT")) < len(builder._poses())
                return has_cycle or snapshot.has_edge(parent, edge_type, name)
        return True

    def _operation(self, agent: str, snapshot: Snapshot) -> Operation:
        """Return a random operation, which often fits the graph."""
        random = self._random
        present_names = [name for name in NAMES if name in snapshot] or NAMES
        name, other = random.choice(present_names), random.choice(present_names)
        verb = random.choice(VERBS)
        if self._clock.now_s() > ACTIVE_S - ALL_CUT_S and random.random() < 0.8:
            verb = random.choice(self._last_verbs)
        if verb is Verb.INSERT_NODE:
            name = next((absent for absent in NAMES if absent not in snapshot), name)
        evidence_s = snapshot.instant_s - random.choice((0.5, 1.0, 3.0)) if random.random() < 0.4 else None
        edge_type = random.choice(("near", "far"))
        match verb:
            case Verb.SET:
                attribute = random.choice(("level", "level", "mark", "speed", "owned" if agent == "rogue" else "level"))
                value = random.choice((None, *range(1, 100))) if random.random() < 0.2 else random.randrange(100)
                return Operation(verb, (name, attribute, value, evidence_s))
            case Verb.INSERT_NODE:
                values = {"level": random.randrange(100)} if random.random() < 0.3 else {}
                return Operation(verb, (name, random.choice(("box", "spot")), values))
            case Verb.DELETE_NODE:
                return Operation(verb, (name,))
            case Verb.PLACE:
                pose = Pose.of((random.randrange(9), 0.0, 0.0))
                if random.random() < 0.5:  # two nodes that are often placed relative to each other
                    name, other = random.sample(present_names[:2] * 2, 2)
                parent = random.choice((other, other, "world")) if name != other else "world"
                return Operation(verb, (parent, random.choice(("carried", "standing")), name, pose, evidence_s))
            case Verb.INSERT_EDGE:
                return Operation(verb, (name, edge_type, other, {}))
            case Verb.DELETE_EDGE:
                edges = snapshot.edges()
                edge = random.choice(edges) if edges else None
                return Operation(verb, (edge.origin, edge.type, edge.target) if edge else (name, edge_type, other))
        edges = tuple(edge for edge in snapshot.edges() if edge.type in ("near", "carried"))
        key = random.choice(edges).key if edges else (name, "near", other)
        type_name = "carried" if key[1] == "RT" else "near"
        return Operation(verb, (key[0], type_name, key[2], "strength", random.randrange(100), evidence_s))

    # Comparison

    def _compare_registers(self) -> None:
        """Compare the registers of all replicas after compaction, and the numbers of refused commits."""
        registers = {name: replica._state_snapshot().writes for name, replica in self.honest_replicas.items()}
        if len(set(registers.values())) > 1:
            self.failures.append(f"the replicas {', '.join(registers)} have different registers")
        for name in self.honest_replicas:
            if self._members[name].refusal_count() < self.foreign_count:
                self.failures.append(f"{name} did not count all foreign commits")

    def _compare_graphs(self) -> None:
        """Compare the graphs of all replicas with the expected graph, at instants with different valid values."""
        permitted_commits = [commit for commit in self.commits.values() if is_permitted(MODEL, commit)]
        for instant_s in (ACTIVE_S - 1.0, ACTIVE_S + 2.0, ACTIVE_S + 100.0):
            expected = expected_graph(MODEL, permitted_commits, instant_s)
            for name, replica in self.honest_replicas.items():
                graph = graph_of(Snapshot(SCHEMA, graph_state(replica._merged, SCHEMA, instant_s), instant_s))
                if graph != expected:
                    self.failures.append(f"{name} at {instant_s} s has\n{graph}\nand not\n{expected}")


def _writes_on_whole_graph(member: Member, replica: Replica, operations: list[Operation]) -> object:
    """Return the writes of operations, or the type of their error, if the whole graph is known to the check."""
    schema, now_s = GraphSchema(member.model), max(replica._clock.now_s(), replica._time.latest.physical_s)
    change_set = ChangeSet(schema, graph_state(replica._merged, schema, now_s), now_s, member.agent)
    try:
        return apply_operations(change_set, operations)
    except OPERATION_ERRORS as error:
        return type(error)


def _vector(replica: Replica) -> dict[str, int]:
    return {name: number for name, number in replica._log.vector.items() if number}


def graph_of(snapshot: Snapshot) -> Graph:
    """Return what a snapshot contains, as plain values."""
    nodes = {node.name: (node.type, node.writer, _values(node.attributes)) for node in snapshot.nodes()}
    edges = {edge.key: (edge.type, edge.writer, _values(edge.attributes)) for edge in snapshot.edges()}
    poses = {}
    for origin, label, name in edges:
        if label == "RT":
            assert snapshot.parent(name) == origin
            poses[name] = (origin, snapshot.transform(origin, name).pose.translation_m[0])
    return Graph(nodes, edges, poses)


def _values(attributes: Any) -> dict[str, Any]:
    return {name: (reading.content, reading.source, reading.evidence_s) for name, reading in attributes.items()}
