"""The merge of commits into the state of a replica: pure, commutative, associative and idempotent.

P2's agents share one graph (P2, section 3.2); for a fleet, P2 names a global graph as future work (P2, section 7). Here
each robot has a replica of the graph. Replicas that have received the same commits, in any order and any number of
times, have the same graph.

A state maps each register to the entries that can still matter. To merge is to unite the entries and to remove those
that are dominated by others. A state does not depend on the present instant: readers apply the validity of values.

The register of a node or edge keeps all insertions and deletions, because the order of all of them decides whether it
exists (`presence`). Of the entries of equally ranked writers, the other registers keep the one with the newest
evidence, and entries with older evidence that were written later: these count if the node was deleted and inserted
again between the two writes.

Once all replicas have received all writes up to an instant, these writes are compacted, and deletions among them are
forgotten.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from itertools import groupby
from typing import Any, NamedTuple

from codra_dsl.runtime.knowledge.declarations import RT
from codra_dsl.runtime.replication.commits import Register, RegisterKind
from codra_dsl.runtime.replication.hybrid_time import BEFORE_ALL, HybridTime, Stamp
from codra_dsl.runtime.values.persistent import PersistentMap


class Entry(NamedTuple):
    """A write in a register.

    Attributes:
        type: the type of the node or edge.
        rank: the priority of the author among the writers that the spec declares.
        content: as in `Write`; None for a deletion.
        evidence_s: when the evidence was taken.
        stamp: the identity and the clock of the write.
    """

    type: str
    rank: int
    content: Any
    evidence_s: float
    stamp: Stamp

    @property
    def order(self) -> tuple[float, Stamp]:
        """Return the order among writers of equal rank: evidence, clock, author."""
        return (self.evidence_s, self.stamp)


@dataclass(frozen=True, slots=True)
class MergedState:
    """The state of a replica, as far as merging is concerned.

    Attributes:
        registers: the entries of each register, ordered by their stamps.
        stable: all replicas have received all writes up to this instant.
    """

    registers: PersistentMap[Register, tuple[Entry, ...]] = field(default_factory=PersistentMap)
    stable: HybridTime = BEFORE_ALL


class Presence(NamedTuple):
    """The existence of a node or edge.

    Attributes:
        first: the insertion with which the existence began.
        entry: the insertion that determines type and writer.
    """

    first: Entry
    entry: Entry

    @property
    def begin(self) -> Stamp:
        """Return the stamp of the beginning; earlier writes belong to an earlier node or edge of the same name."""
        return self.first.stamp


def merge(state: MergedState, entries: Iterable[tuple[Register, Entry]]) -> MergedState:
    """Return a state with further entries, such as those of a commit."""
    ordered_entries = sorted(entries, key=_by_register)
    registers: PersistentMap[Register, tuple[Entry, ...]] = PersistentMap()
    changes = {
        register: _sorted(entry for _, entry in group) for register, group in groupby(ordered_entries, _register)
    }
    return join(state, MergedState(registers.with_changes(changes)))


def join(left: MergedState, right: MergedState) -> MergedState:
    """Return the state of a replica that has received the writes of two other replicas.

    An entry that one of the two has compacted away does not come back from the other.
    """
    changes: dict[Register, tuple[Entry, ...] | None] = {}
    registers = {*right.registers, *(left.registers if right.stable > BEFORE_ALL else ())}
    for register in registers:
        ours, theirs = left.registers.get(register) or (), right.registers.get(register) or ()
        kept = (*_uncompacted(ours, theirs, right.stable), *_uncompacted(theirs, ours, left.stable))
        changes[register] = undominated(register.kind, {entry.stamp: entry for entry in kept}.values()) or None
    return MergedState(left.registers.with_changes(changes), max(left.stable, right.stable))


def _uncompacted(entries: Iterable[Entry], other_entries: Iterable[Entry], stable: HybridTime) -> Iterable[Entry]:
    """Return entries without those that another replica has received and compacted.

    Args:
        entries: the entries of a register.
        other_entries: the entries that the other replica keeps in the same register.
        stable: the stable instant of the other replica.
    """
    kept_stamps = {entry.stamp for entry in other_entries}
    return [entry for entry in entries if entry.stamp.time > stable or entry.stamp in kept_stamps]


def undominated(kind: RegisterKind, entries: Iterable[Entry]) -> tuple[Entry, ...]:
    """Return the entries of a register that can still matter, ordered by their stamps."""
    ordered_entries = _sorted(entries)
    if kind in (RegisterKind.NODE, RegisterKind.EDGE):
        return ordered_entries
    return tuple(entry for entry in ordered_entries if not any(dominates(other, entry) for other in ordered_entries))


def dominates(entry: Entry, other: Entry) -> bool:
    """Return whether an entry makes another one obsolete in every graph, whatever is deleted later."""
    return _slot(entry) == _slot(other) and entry.evidence_s >= other.evidence_s and entry.stamp > other.stamp


def _slot(entry: Entry) -> tuple[str, int, bool]:
    return (entry.type, entry.rank, entry.content is None)


def presence(entries: Iterable[Entry], since: Stamp | None = None) -> Presence | None:
    """Return the existence of a node or edge, or None if it does not exist.

    The insertions and deletions take effect in the order of their stamps. While the node or edge exists, a writer of
    lower rank cannot delete it. The insertion of another type replaces it; the ranks of two types cannot be compared.

    Args:
        entries: the entries of the register, ordered by their stamps.
        since: only entries after this stamp count; None for all.
    """
    present: Presence | None = None
    for entry in entries:
        if since is not None and entry.stamp <= since:
            continue
        if present is None or entry.type != present.entry.type:
            present = present if entry.content is None else Presence(entry, entry)
        elif entry.rank >= present.entry.rank:
            present = None if entry.content is None else present._replace(entry=entry)
    return present


def winner(entries: Iterable[Entry], is_valid: Callable[[Entry], bool]) -> Entry | None:
    """Return the entry that determines a value or a pose; None if there are no entries.

    The entries take effect in the order of their evidence. While a value is valid, no writer of lower rank can replace
    it. A pose on an edge of another type replaces it; the ranks of two types cannot be compared.
    """
    present: Entry | None = None
    for entry in sorted(entries, key=_order):
        is_protected = present is not None and entry.type == present.type and entry.rank < present.rank
        if present is None or present.content is None or not is_protected or not is_valid(present):
            present = entry
    return present


# Compaction


def compact(state: MergedState, stable: HybridTime) -> MergedState:
    """Return a state without the entries that no longer matter once all replicas have received a prefix of all writes.

    Args:
        state: the state of a replica.
        stable: all replicas have received all writes up to this instant.
    """
    if stable <= state.stable:
        return state
    presences: dict[tuple[str, ...], Presence | None] = {}
    changes: dict[Register, tuple[Entry, ...] | None] = {}
    for register in sorted(state.registers, key=_compaction_order):
        entries = state.registers[register]
        count = sum(entry.stamp.time <= stable for entry in entries)
        kept_entries = (*_essential_entries(register, entries[:count], presences), *entries[count:])
        if len(kept_entries) < len(entries):
            changes[register] = kept_entries or None
    return MergedState(state.registers.with_changes(changes), stable)


def _essential_entries(
    register: Register, entries: tuple[Entry, ...], presences: dict[tuple[str, ...], Presence | None]
) -> tuple[Entry, ...]:
    """Return the entries of a register from which readers derive the same graph, if no earlier entries can follow.

    Args:
        register: the register.
        entries: its entries up to the stable instant.
        presences: the nodes, and then the edges, that exist at the stable instant, by path; filled by this function.
    """
    owners = [presences.get(path) for path in _owner_paths(register)]
    begins = [owner.begin for owner in owners if owner is not None]
    if len(begins) < len(owners):
        return ()
    since = max(begins, default=None)
    if register.kind in (RegisterKind.NODE, RegisterKind.EDGE):
        presences[register.path] = present = presence(entries, since)
        return () if present is None else tuple(dict.fromkeys(present))
    newest_entries = {_slot(entry): entry for entry in sorted(entries, key=_order) if since and entry.stamp > since}
    return _sorted(newest_entries.values())


def _owner_paths(register: Register) -> list[tuple[str, ...]]:
    """Return the nodes and the edge without which a register has no meaning."""
    path = register.path
    match register.kind:
        case RegisterKind.NODE:
            return []
        case RegisterKind.POSE | RegisterKind.NODE_ATTRIBUTE:
            return [path[:1]]
    edge_paths = [path[:3]] if register.kind is RegisterKind.EDGE_ATTRIBUTE and path[1] != RT else []
    return [path[:1], path[2:3], *edge_paths]


def _compaction_order(register: Register) -> int:
    """Return an order in which nodes come first, and edges before their attributes."""
    return {RegisterKind.NODE: 0, RegisterKind.EDGE: 1}.get(register.kind, 2)


def _sorted(entries: Iterable[Entry]) -> tuple[Entry, ...]:
    return tuple(sorted(entries, key=_stamp))


def _stamp(entry: Entry) -> Stamp:
    return entry.stamp


def _order(entry: Entry) -> tuple[float, Stamp]:
    return entry.order


def _register(item: tuple[Register, Entry]) -> Register:
    return item[0]


def _by_register(item: tuple[Register, Entry]) -> tuple[Register, Stamp]:
    return item[0], item[1].stamp
