"""Replicas on a faulty network converge, and wrong rules are found; `tests.campaigns.replicas` makes many runs."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import pytest

from codra_dsl.runtime.knowledge.permissions import Permissions
from codra_dsl.runtime.replication import graph_state, merge, ownership, replica
from codra_dsl.runtime.replication.commit_log import CommitLog
from codra_dsl.runtime.replication.commits import Register, RegisterKind
from codra_dsl.runtime.replication.hybrid_time import HybridClock, HybridTime, Stamp
from codra_dsl.runtime.replication.merge import Entry, MergedState, Presence
from codra_dsl.runtime.replication.stability import Stability
from tests.campaigns.replicas import main
from tests.runtime.replication.fleet import Fleet

RUN_COUNT = 15
MAX_RUNS_TO_FIND = 80

BEGINNING = Stamp(-math.inf, 0, "", "", 0)

original_presence, original_join, original_undominated = merge.presence, merge.join, merge.undominated
original_entry, original_without_cycles = ownership.entry_of, graph_state.without_cycles


def test_all_replicas_have_the_same_graph_in_the_end(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(RUN_COUNT, 1) == 0, capsys.readouterr().out


def test_a_rogue_that_compacts_too_much_takes_no_entry_from_the_others(capsys: pytest.CaptureFixture[str]) -> None:
    assert main(1, 201_504) == 0, capsys.readouterr().out


def test_a_seed_determines_all_messages() -> None:
    digests = []
    for _ in range(2):
        fleet = Fleet(seed=5)
        fleet.run()
        digests.append(fleet.digest.hexdigest())

    assert digests[0] == digests[1]
    assert fleet.commits


# Wrong rules


def everywhere(name: str, function: Callable[..., Any]) -> list[tuple[Any, str, Callable[..., Any]]]:
    """Plant a function in the modules of the merge and of the graph."""
    return [(merge, name, function), (graph_state, name, function)]


def keep_last_arrival(left: MergedState, right: MergedState) -> MergedState:
    joined = original_join(left, right)
    values = {
        register: right.registers[register]
        for register in right.registers
        if register.kind not in (RegisterKind.NODE, RegisterKind.EDGE)
    }
    return MergedState(joined.registers.with_changes(values), joined.stable)


def entry_without_rank(*arguments: Any) -> Entry:
    return original_entry(*arguments)._replace(rank=0)


def dominates_by_clock(entry: Entry, other: Entry) -> bool:
    return merge._slot(entry) == merge._slot(other) and entry.stamp > other.stamp


def dominates_by_evidence(entry: Entry, other: Entry) -> bool:
    return merge._slot(entry) == merge._slot(other) and entry.order > other.order


def keep_first_of_equal_clocks(kind: RegisterKind, entries: Iterable[Entry]) -> tuple[Entry, ...]:
    kept: dict[Any, Entry] = {}
    for entry in entries:
        kept.setdefault((merge._slot(entry), entry.evidence_s, entry.stamp.time), entry)
    return original_undominated(kind, kept.values())


def presence_without_return(entries: Iterable[Entry], since: Stamp | None = None) -> Presence | None:
    counted = [entry for entry in entries if since is None or entry.stamp > since]
    return None if any(entry.content is None for entry in counted) else original_presence(counted)


def presence_without_rank(entries: Iterable[Entry], since: Stamp | None = None) -> Presence | None:
    return original_presence([entry._replace(rank=0) for entry in entries], since)


def presence_since_ever(entries: Iterable[Entry], since: Stamp | None = None) -> Presence | None:
    present = original_presence(entries, since)
    return present and present._replace(first=present.first._replace(stamp=BEGINNING))


def without_cycles_from_newest(poses: Mapping[str, Entry]) -> dict[str, Entry]:
    newest_first = sorted(poses, key=lambda name: poses[name].stamp, reverse=True)
    renumbered = {name: poses[name]._replace(stamp=(rank,)) for rank, name in enumerate(newest_first)}  # type: ignore[arg-type]
    return {name: poses[name] for name in original_without_cycles(renumbered)}


def stable_without_acknowledgements(stability: Stability) -> HybridTime:
    return max(stability._promises.values(), default=stability.promise)


def advance_over_gaps(log: CommitLog, name: str) -> None:
    commits, number = log._commits.get(name, {}), log.vector.get(name, 0)
    for gap in range(number + 1, max(commits, default=0)):
        commits.setdefault(gap, replace(commits[max(commits)], number=gap, writes=()))
    log.vector[name] = max(number, *commits, 0)


def merge_and_forget(state: MergedState, entries: Iterable[tuple[Register, Entry]]) -> MergedState:
    merged = merge.merge(state, entries)
    return MergedState(merge.compact(merged, HybridTime(math.inf, 0)).registers, merged.stable)


WRONG_RULES: Mapping[str, Sequence[tuple[Any, str, Callable[..., Any]]]] = {
    "the value that arrives last wins": [(merge, "join", keep_last_arrival)],
    "the rank of writers does not count": [(ownership, "entry_of", entry_without_rank)],
    "the newest clock wins over newer evidence": [(merge, "dominates", dominates_by_clock)],
    "older evidence never counts again": [(merge, "dominates", dominates_by_evidence)],
    "equal clocks are not ordered by author": [(merge, "undominated", keep_first_of_equal_clocks)],
    "a deletion is final": everywhere("presence", presence_without_return),
    "every writer can delete": everywhere("presence", presence_without_rank),
    "attributes of a deleted node come back": everywhere("presence", presence_since_ever),
    "the newest pose of a cycle stays": [(graph_state, "without_cycles", without_cycles_from_newest)],
    "deletions are forgotten at once": [(replica, "merge", merge_and_forget)],
    "nothing waits for acknowledgements": [(Stability, "stable", stable_without_acknowledgements)],
    "foreign writes are accepted": [(Permissions, "check", lambda *_: None)],
    "gaps count as received": [(CommitLog, "_advance", advance_over_gaps)],
    "clocks do not follow each other": [(HybridClock, "receive", lambda *_: None)],
}


@pytest.mark.parametrize("rule", WRONG_RULES)
def test_a_wrong_rule_is_found_in_few_runs(rule: str, monkeypatch: pytest.MonkeyPatch) -> None:
    for place, name, function in WRONG_RULES[rule]:
        monkeypatch.setattr(place, name, function)

    assert any(Fleet(seed).run() for seed in range(1, MAX_RUNS_TO_FIND + 1))
