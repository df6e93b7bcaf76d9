"""A replica of the knowledge graph: it writes, exchanges commits with other replicas, and recovers after a crash.

P2 names a fleet whose robots share one global graph as future work (P2, section 7). Here each robot has a replica,
which works without a connection to the others, and converges with them when messages arrive.

A replica sends its commits at once, and periodically a digest that states which commits it has received. The receiver
of a digest sends the missing commits. So messages may be lost, duplicated and reordered, and a commit is sent again
until a digest acknowledges it.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.errors import unknown_name_error
from codra_dsl.runtime.knowledge.change_set import ChangeSet
from codra_dsl.runtime.knowledge.declarations import KnowledgeModel
from codra_dsl.runtime.knowledge.graph_schema import GraphSchema
from codra_dsl.runtime.knowledge.operations import Operation
from codra_dsl.runtime.knowledge.permissions import GRAPH_WRITER, Audit, Refusal
from codra_dsl.runtime.knowledge.snapshot import Snapshot
from codra_dsl.runtime.knowledge.state import State
from codra_dsl.runtime.replication.commit_log import CommitLog
from codra_dsl.runtime.replication.commits import Commit, Register, Write
from codra_dsl.runtime.replication.graph_state import graph_state
from codra_dsl.runtime.replication.hybrid_time import HybridClock, HybridTime, Stamp
from codra_dsl.runtime.replication.merge import Entry, MergedState, compact, join, merge
from codra_dsl.runtime.replication.messages import Commits, Digest, Message, NewMembers, Promise, StateSnapshot, decode
from codra_dsl.runtime.replication.operation_journal import OperationJournal
from codra_dsl.runtime.replication.ownership import entries_of, entry_of
from codra_dsl.runtime.replication.register_index import RegisterIndex
from codra_dsl.runtime.replication.stability import Stability
from codra_dsl.runtime.replication.transactions import apply_operations, initial_operations, nodes_of

EXCHANGE_PERIOD_S = 0.5
"""How often a replica sends a digest to each other replica."""

COMPACTION_PERIOD_S = 10.0
"""The default minimum time between compactions."""

MAX_JOURNAL_LINES = 1_000
"""The default number of lines above which a compaction replaces the journal by a snapshot."""

_MAX_COMMITS_IN_MESSAGE = 100

_REFUSALS = (ArithmeticError, LookupError, PermissionError, TypeError, ValueError)
"""The errors that the check of a foreign or malformed write raises."""

Send = Callable[[str, bytes], None]
"""Sends a message to a replica, which may receive it never, late, or several times."""


class NotJoinedError(RuntimeError):
    """A new replica was asked to write before it has received the graph."""


class Replica:
    """One replica of a knowledge graph. Only one thread at a time may use it.

    Tasks are not replicated: each task is handed over at one place. The transport must authenticate the replicas: a
    replica trusts the digests of members, and checks only whether agents may write.

    Attributes:
        name: the name of the replica. After the loss of its journal, a replica must join under a new name.
        audit: the refused writes: of own agents, and of other replicas.
        postponed_count: how often a commit was not accepted yet, because its replica is not known, or because it lies
            too far in the future. It is accepted later, when it is sent again.
    """

    def __init__(
        self,
        name: str,
        model: KnowledgeModel,
        *,
        clock: Clock,
        journal: OperationJournal,
        send: Send,
        others: Iterable[str],
        joins: bool = False,
        created_s: float = 0.0,
        compaction_period_s: float = COMPACTION_PERIOD_S,
        max_journal_lines: int = MAX_JOURNAL_LINES,
    ) -> None:
        """Create a replica, or recover it from its journal.

        Args:
            name: the name of the replica.
            model: the declarations of the spec, the same for all replicas.
            clock: real or simulated time. Its instants must mean the same on all machines and after a restart; the
                clocks may differ by at most `MAX_DRIFT_S`.
            journal: where the replica stores its commits and those that it receives.
            send: sends messages.
            others: for a founder, all other founders; for a replica that joins, some members.
            joins: whether the replica joins a graph that exists already.
            created_s: when the graph was created, the same for all replicas; no clock may show an earlier instant.
            compaction_period_s: the minimum time between compactions, each of which reads all registers.
            max_journal_lines: if the journal has more lines, a compaction replaces them by a snapshot.

        Raises:
            ValueError: if the journal is damaged.
        """
        self.name = name
        self.audit = Audit()
        self.postponed_count = 0
        self._schema = GraphSchema(model)
        self._clock = clock
        self._journal = journal
        self._send = send
        self._time = HybridClock(clock.now_s, HybridTime(created_s, 0))
        self._log = CommitLog()
        self._stability = Stability(name, others)
        self._initial_entries = self._make_initial_entries(created_s)
        self._merged = merge(MergedState(), self._initial_entries.values())
        self._index = RegisterIndex()
        self._index.add(self._merged.registers)
        self._snapshot: tuple[MergedState, Snapshot] | None = None
        self._has_joined = not joins
        self._journal_line_count = self._recover()
        self._compaction_period_s = compaction_period_s
        self._next_compaction_s = clock.now_s()
        self._max_journal_lines = max_journal_lines
        self._timer = clock.call_at(clock.now_s(), self._exchange)

    @property
    def has_joined(self) -> bool:
        """Return whether the replica has a graph and may write."""
        return self._has_joined

    def close(self) -> None:
        """End the exchange with other replicas."""
        self._timer.cancel()

    def write(self, agent: str, operations: Sequence[Operation]) -> Commit | None:
        """Apply operations of an agent as one transaction. When the call returns, the journal has the commit.

        Returns:
            The commit; None if the operations change nothing.

        Raises:
            NotJoinedError: if the replica has not received the graph yet.
            UnknownNameError: if no such agent is declared.
            LookupError: if an operation fails; ValueError, TypeError, PermissionError and RuntimeError likewise.
        """
        if not self._has_joined:
            raise NotJoinedError(f"{self.name!r} has not received the graph yet: wait until `has_joined`")
        if agent not in self._schema.agents:
            raise unknown_name_error("agent", agent, self._schema.agents)
        time = self._time.tick()
        registers = self._index.registers_of(self._merged, nodes_of(operations))
        state = graph_state(self._merged, self._schema, time.physical_s, registers)
        change_set = ChangeSet(self._schema, state, time.physical_s, agent)
        try:
            writes = apply_operations(change_set, operations)
        except PermissionError as error:
            self._refuse(agent, error)
            raise
        if not writes:
            return None
        number = self._log.vector.get(self.name, 0) + 1
        commit = Commit(replica=self.name, number=number, time=time, author=agent, writes=writes)
        self._store(Commits(commits=(commit,)))
        self._send_to_others(Commits(commits=(commit,)))
        return commit

    def snapshot(self) -> Snapshot:
        """Return the present graph as far as this replica knows it."""
        now_s = self._clock.now_s()
        if self._snapshot is None or self._snapshot[0] is not self._merged or self._snapshot[1].instant_s != now_s:
            state = graph_state(self._merged, self._schema, now_s)
            self._snapshot = (self._merged, Snapshot(self._schema, state, now_s))
        return self._snapshot[1]

    def receive(self, message: bytes) -> None:
        """Receive a message of another replica. A malformed message is refused."""
        try:
            decoded_message = decode(message)
        except ValueError as error:
            self._refuse("", error)
            return
        match decoded_message:
            case Digest():
                self._answer(decoded_message)
            case Commits(commits=commits):
                for commit in commits:
                    self._receive_commit(commit)
            case StateSnapshot(time=time):
                if self._has_joined:  # it lacks no commit that others have compacted; a rogue may compact too much
                    return
                if self._time.admits(time):
                    self._store(decoded_message)
                else:
                    self.postponed_count += 1

    # Exchange

    def _exchange(self) -> None:
        """Send a digest to all other replicas, and forget commits that all replicas have received."""
        self._timer = self._clock.call_at(self._clock.now_s() + EXCHANGE_PERIOD_S, self._exchange)
        if self._has_joined and (not self._log.is_empty or self._stability.promise <= self._merged.stable):
            self._store(Promise(instant=self._time.tick()))
        if self._has_joined:
            self._forget(self._stability.stable())
        digest = Digest(
            sender=self.name,
            vector=dict(sorted(self._log.vector.items())),
            promise=self._stability.promise,
            horizon=self._stability.horizon(),
            members=tuple(sorted(self._stability.members)),
            has_joined=self._has_joined,
        )
        self._send_to_others(digest)

    def _answer(self, digest: Digest) -> None:
        """Take note of a digest, and send the commits that its sender lacks."""
        if digest.sender == self.name:
            return
        new_members = {digest.sender, *digest.members} - self._stability.members
        if new_members:
            self._store(NewMembers(names=tuple(sorted(new_members))))
        if self._log.vector.get(digest.sender, 0) >= digest.vector.get(digest.sender, 0):
            self._stability.receive_promise(digest.sender, digest.promise)
        self._stability.receive_horizon(digest.sender, digest.horizon)
        if not self._has_joined:
            return
        if not digest.has_joined or self._log.has_pruned_for(digest.vector):
            self._send(digest.sender, self._state_snapshot().encode())
            return
        commits = self._log.missing(digest.vector, _MAX_COMMITS_IN_MESSAGE)
        if commits:
            self._send(digest.sender, Commits(commits=tuple(commits)).encode())

    def _receive_commit(self, commit: Commit) -> None:
        if commit in self._log:
            return
        other_members = self._stability.members - {self.name}  # own commits come from the journal alone
        if commit.replica not in other_members or not self._time.admits(commit.time):
            self.postponed_count += 1
            return
        self._store(Commits(commits=(commit,)))

    def _forget(self, stable: HybridTime) -> None:
        """Forget the commits up to an instant that all replicas have received, and from time to time compact."""
        self._log.prune(stable)
        now_s = self._clock.now_s()
        if stable <= self._merged.stable or now_s < self._next_compaction_s:
            return
        self._next_compaction_s = now_s + self._compaction_period_s
        self._merged = compact(self._merged, stable)
        self._index.replace(self._merged.registers)
        if self._journal_line_count > self._max_journal_lines:
            lines = (self._state_snapshot().encode(), Promise(instant=self._stability.promise).encode())
            self._journal.replace(lines)
            self._journal_line_count = len(lines)

    def _send_to_others(self, message: Message) -> None:
        encoded_message = message.encode()
        for other in sorted(self._stability.members - {self.name}):
            self._send(other, encoded_message)

    # State

    def _recover(self) -> int:
        """Apply the records of the journal; return their number."""
        lines = self._journal.lines()
        for number, line in enumerate(lines, 1):
            try:
                self._apply(decode(line))
            except ValueError as error:
                raise ValueError(f"line {number} of the journal of {self.name!r} is damaged: {error}") from None
        return len(lines)

    def _store(self, record: Message) -> None:
        """Write a record to the journal, and then let it take effect."""
        self._journal.append(record.encode())
        self._journal_line_count += 1
        self._apply(record)

    def _apply(self, record: Message) -> None:
        """Let a record of the journal take effect."""
        match record:
            case Commits(commits=commits):
                for commit in commits:
                    self._apply_commit(commit)
            case StateSnapshot():
                self._adopt(record)
            case Promise(instant=instant):
                self._time.receive(instant)
                self._stability.receive_promise(self.name, instant)
            case NewMembers(names=names):
                self._stability.members.update(names)
            case _:
                raise ValueError(f"this is not a record of a journal: {record!r:.100}")

    def _apply_commit(self, commit: Commit) -> None:
        """Merge a commit into the state; a foreign one is only counted, so that it is not sent again."""
        if commit in self._log:
            return
        self._log.add(commit)
        try:
            entries = entries_of(self._schema, commit)
        except _REFUSALS as error:
            self._refuse(commit.author, error)
            return
        self._time.receive(commit.time)
        self._merged = merge(self._merged, entries)
        self._index.add(register for register, _ in entries)

    def _adopt(self, snapshot: StateSnapshot) -> None:
        """Merge the state of another replica, or an own earlier one, into the state of this replica."""
        entries = []
        for write, stamp in snapshot.writes:
            try:
                entries.append(self._entry_of(write, stamp))
            except _REFUSALS as error:
                self._refuse(stamp.author, error)
        for commit in snapshot.commits:
            self._apply_commit(commit)
        received = merge(MergedState(), entries)
        self._merged = join(self._merged, MergedState(received.registers, snapshot.stable))
        self._index.replace(self._merged.registers)
        self._log.adopt(snapshot.vector, snapshot.pruned)
        self._stability.members.update(snapshot.members)
        self._time.receive(snapshot.time)
        self._has_joined = True

    def _entry_of(self, write: Write, stamp: Stamp) -> tuple[Register, Entry]:
        if stamp.author == GRAPH_WRITER:
            return self._initial_entries[stamp]
        return write.register, entry_of(self._schema, write, stamp)

    def _state_snapshot(self) -> StateSnapshot:
        writes = (
            (Write(register, entry.type, entry.content, entry.evidence_s), entry.stamp)
            for register in sorted(self._merged.registers)
            for entry in self._merged.registers[register]
        )
        return StateSnapshot(
            time=self._time.tick(),
            stable=self._merged.stable,
            vector=dict(sorted(self._log.vector.items())),
            pruned=dict(sorted(self._log.pruned.items())),
            members=tuple(sorted(self._stability.members)),
            writes=tuple(writes),
            commits=tuple(self._log.kept_commits()),
        )

    def _make_initial_entries(self, created_s: float) -> dict[Stamp, tuple[Register, Entry]]:
        """Return the entries of the initial graph, by their stamps, which are the same on all replicas."""
        change_set = ChangeSet(self._schema, State.empty(created_s), created_s, GRAPH_WRITER)
        writes = apply_operations(change_set, initial_operations(self._schema.model))
        stamps = [Stamp(created_s, 0, GRAPH_WRITER, "", position) for position in range(len(writes))]
        return {
            stamp: (write.register, entry_of(self._schema, write, stamp))
            for write, stamp in zip(writes, stamps, strict=True)
        }

    def _refuse(self, author: str, error: Exception) -> None:
        self.audit.add(Refusal(instant_s=self._clock.now_s(), agent=author, why=str(error)))
