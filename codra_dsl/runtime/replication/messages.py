"""The messages between replicas, and the lines of a replica's journal: JSON in UTF-8."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Any

from codra_dsl.runtime.journal.encoding import bytes_of, json_text, parse_json
from codra_dsl.runtime.replication.commits import (
    Commit,
    Write,
    commit_of,
    plain_stamped_write,
    stamped_write_of,
    time_of,
)
from codra_dsl.runtime.replication.hybrid_time import HybridTime, Stamp


@dataclass(frozen=True, slots=True, kw_only=True)
class Digest:
    """What a replica has received: the acknowledgement of commits, and the request for missing ones.

    Attributes:
        sender: the replica.
        vector: as in `CommitLog`.
        promise: from now on the replica writes only after this instant.
        horizon: the replica has received everything that members write up to this instant.
        members: the replicas that the sender knows.
        has_joined: whether the replica has a graph; otherwise it needs a snapshot.
    """

    sender: str
    vector: Mapping[str, int]
    promise: HybridTime
    horizon: HybridTime
    members: tuple[str, ...]
    has_joined: bool

    def encode(self) -> bytes:
        """Return the message."""
        fields = [self.sender, dict(self.vector), list(self.promise), list(self.horizon), list(self.members)]
        return _encode("digest", *fields, self.has_joined)


@dataclass(frozen=True, slots=True, kw_only=True)
class Commits:
    """Commits that a replica has made or passes on."""

    commits: tuple[Commit, ...]

    def encode(self) -> bytes:
        """Return the message."""
        return _encode("commits", [commit.plain_data() for commit in self.commits])


@dataclass(frozen=True, slots=True, kw_only=True)
class StateSnapshot:
    """Everything that a replica knows, for a replica that joins.

    Attributes:
        time: an instant after all writes of the snapshot.
        stable: as in `MergedState`.
        vector: as in `CommitLog`.
        pruned: as in `CommitLog`.
        members: the replicas that the sender knows.
        writes: the entries of all registers, with their stamps.
        commits: the commits that the sender keeps.
    """

    time: HybridTime
    stable: HybridTime
    vector: Mapping[str, int]
    pruned: Mapping[str, int]
    members: tuple[str, ...]
    writes: tuple[tuple[Write, Stamp], ...]
    commits: tuple[Commit, ...]

    @property
    def is_complete(self) -> bool:
        """Return whether the snapshot has all commits that its sender had received and not pruned."""
        kept_numbers = {(commit.replica, commit.number) for commit in self.commits}
        counts = Counter(
            replica
            for replica, number in kept_numbers
            if self.pruned.get(replica, 0) < number <= self.vector.get(replica, 0)
        )
        return all(counts[name] == number - self.pruned.get(name, 0) for name, number in self.vector.items())

    def encode(self) -> bytes:
        """Return the message."""
        times = [list(self.time), list(self.stable)]
        writes = [plain_stamped_write(write, stamp) for write, stamp in self.writes]
        commits = [commit.plain_data() for commit in self.commits]
        return _encode("snapshot", *times, dict(self.vector), dict(self.pruned), list(self.members), writes, commits)


@dataclass(frozen=True, slots=True, kw_only=True)
class Promise:
    """A record of a journal: the replica has promised to write only after an instant."""

    instant: HybridTime

    def encode(self) -> bytes:
        """Return the line."""
        return _encode("promise", *self.instant)


@dataclass(frozen=True, slots=True, kw_only=True)
class NewMembers:
    """A record of a journal: the replica has heard of further replicas."""

    names: tuple[str, ...]

    def encode(self) -> bytes:
        """Return the line."""
        return _encode("members", list(self.names))


Message = Digest | Commits | StateSnapshot | Promise | NewMembers


def decode(line: bytes) -> Message:
    """Return the message that bytes encode.

    Raises:
        ValueError: if they encode none.
    """
    try:
        return _message_of(parse_json(line.decode("utf-8")))
    except (OverflowError, RecursionError):
        raise ValueError(f"a number is too large, or lists are nested too deeply: {line[:100]!r}") from None


def _message_of(plain_data: Any) -> Message:
    match plain_data:
        case ["digest", str(sender), dict(vector), promise, horizon, list(members), bool(has_joined)]:
            return Digest(
                sender=sender,
                vector=_vector_of(vector),
                promise=time_of(promise),
                horizon=time_of(horizon),
                members=_names_of(members),
                has_joined=has_joined,
            )
        case ["commits", list(commits)]:
            return Commits(commits=tuple(map(commit_of, commits)))
        case ["snapshot", time, stable, dict(vector), dict(pruned), list(members), list(writes), list(commits)]:
            snapshot = StateSnapshot(
                time=time_of(time),
                stable=time_of(stable),
                vector=_vector_of(vector),
                pruned=_vector_of(pruned),
                members=_names_of(members),
                writes=tuple(map(stamped_write_of, writes)),
                commits=tuple(map(commit_of, commits)),
            )
            if snapshot.is_complete:
                return snapshot
        case ["promise", physical_s, counter]:
            return Promise(instant=time_of([physical_s, counter]))
        case ["members", list(names)]:
            return NewMembers(names=_names_of(names))
    raise ValueError(f"this is not a message of a replica: {plain_data!r:.100}")


def _encode(*fields: Any) -> bytes:
    return bytes_of(json_text(list(fields)))


def _vector_of(plain_data: Mapping[str, Any]) -> Mapping[str, int]:
    if not all(type(number) is int and number >= 0 for number in plain_data.values()):
        raise ValueError(f"this is not a version vector: {plain_data!r:.100}")
    return plain_data


def _names_of(names: Iterable[Any]) -> tuple[str, ...]:
    if not all(isinstance(name, str) and name for name in names):
        raise ValueError(f"these are not names of replicas: {names!r:.100}")
    return tuple(names)
