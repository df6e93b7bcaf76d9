"""The merge of commits: commutative, associative, idempotent; and compaction, which changes no graph."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.runtime.knowledge import Snapshot
from codra_dsl.runtime.replication import Commit
from codra_dsl.runtime.replication.commits import Register, RegisterKind, Write, commit_of
from codra_dsl.runtime.replication.graph_state import graph_state
from codra_dsl.runtime.replication.hybrid_time import HybridTime
from codra_dsl.runtime.replication.merge import Entry, MergedState, compact, join, merge
from codra_dsl.runtime.replication.ownership import entries_of
from tests.runtime.replication.expected_graph import Graph, expected_graph
from tests.runtime.replication.fleet import AGENTS, MODEL, NAMES, SCHEMA, graph_of

EMPTY_MODEL = replace(MODEL, nodes=(), edges=())
WRITERS = AGENTS[:4]
LAST_S = 12

names = st.sampled_from(NAMES)
node_types = st.sampled_from(("box", "spot"))
contents = st.one_of(st.none(), st.integers(0, 3))
presences = st.sampled_from((True, True, None))


@st.composite
def writes(draw: st.DrawFn, time_s: int) -> Write:
    evidence_s = float(draw(st.sampled_from((time_s, time_s, max(0, time_s - 1), 0))))
    name, other = draw(names), draw(names)
    match draw(st.sampled_from((*RegisterKind, RegisterKind.NODE, RegisterKind.NODE))):
        case RegisterKind.NODE:
            register = Register(RegisterKind.NODE, (name,))
            return Write(register, draw(node_types), draw(presences), float(time_s))
        case RegisterKind.EDGE:
            register = Register(RegisterKind.EDGE, (name, "at", other))
            return Write(register, draw(st.sampled_from(("near", "far"))), draw(presences), float(time_s))
        case RegisterKind.POSE:
            pose = (other, float(draw(st.integers(0, 3))), 0.0, 0.0, 1.0, 0.0, 0.0, 0.0)
            content = draw(st.sampled_from((pose, pose, None)))
            edge_type = draw(st.sampled_from(("carried", "standing")))
            return Write(Register(RegisterKind.POSE, (name,)), edge_type, content, evidence_s)
        case RegisterKind.NODE_ATTRIBUTE:
            register = Register(RegisterKind.NODE_ATTRIBUTE, (name, draw(st.sampled_from(("level", "mark")))))
            return Write(register, draw(node_types), draw(contents), evidence_s)
    register = Register(RegisterKind.EDGE_ATTRIBUTE, (name, "at", other, "strength"))
    return Write(register, "near", draw(contents), evidence_s)


@st.composite
def commits(draw: st.DrawFn) -> list[Commit]:
    """Return commits whose clocks are often equal, in any order."""
    instants = st.tuples(st.integers(1, LAST_S), st.integers(0, 1), st.sampled_from(WRITERS))
    made = []
    for time_s, counter, author in draw(st.lists(instants, unique=True, max_size=25)):
        made.append(
            Commit(
                replica=f"robot of {author}",
                number=2 * time_s + counter,
                time=HybridTime(float(time_s), counter),
                author=author,
                writes=tuple(draw(st.lists(writes(time_s), min_size=1, max_size=2))),
            )
        )
    return made


def merged(*many: Commit, state: MergedState | None = None) -> MergedState:
    state = MergedState() if state is None else state
    for commit in many:
        state = merge(state, entries_of(SCHEMA, commit))
    return state


def registers_of(state: MergedState) -> dict[Register, tuple[Entry, ...]]:
    return {register: state.registers[register] for register in state.registers}


def graphs_of(state: MergedState) -> list[Graph]:
    instants_s = (LAST_S + 1.0, LAST_S + 3.0, LAST_S + 100.0)
    return [graph_of(Snapshot(SCHEMA, graph_state(state, SCHEMA, now_s), now_s)) for now_s in instants_s]


@given(commits(), st.randoms(use_true_random=False))
def test_the_order_of_arrival_does_not_matter(made: list[Commit], random: Any) -> None:
    shuffled = random.sample(made, len(made))

    assert registers_of(merged(*made)) == registers_of(merged(*shuffled))


@given(commits(), st.randoms(use_true_random=False))
def test_a_commit_that_arrives_again_changes_nothing(made: list[Commit], random: Any) -> None:
    again = random.choices(made, k=len(made)) if made else []

    assert registers_of(merged(*made, *again)) == registers_of(merged(*made))


@given(commits(), st.integers(0, 25), st.integers(0, 25))
def test_the_grouping_of_commits_does_not_matter(made: list[Commit], first: int, second: int) -> None:
    low, high = sorted((first, second))
    parts = (lambda: merged(*made[:low])), (lambda: merged(*made[low:high])), (lambda: merged(*made[high:]))
    left, middle, right = parts

    expected = registers_of(merged(*made))
    assert registers_of(join(join(left(), middle()), right())) == expected
    assert registers_of(join(left(), join(middle(), right()))) == expected


@settings(max_examples=200)
@given(commits(), st.integers(0, LAST_S), st.randoms(use_true_random=False))
def test_compaction_changes_no_graph_whatever_is_written_later(made: list[Commit], stable_s: int, random: Any) -> None:
    stable = HybridTime(float(stable_s), 1)
    old = [commit for commit in made if commit.time <= stable]
    new = [commit for commit in made if commit.time > stable]
    early = [commit for commit in new if random.random() < 0.5]  # received before the compaction

    compacted = compact(merged(*old, *early), stable)

    assert graphs_of(merged(*new, state=compacted)) == graphs_of(merged(*made))


@settings(max_examples=200)
@given(commits(), st.integers(0, LAST_S), st.integers(0, LAST_S), st.randoms(use_true_random=False))
def test_replicas_that_have_compacted_different_prefixes_agree_after_a_snapshot(
    made: list[Commit], first_s: int, second_s: int, random: Any
) -> None:
    states = []
    for stable in (HybridTime(float(first_s), 1), HybridTime(float(second_s), 1)):
        received = [commit for commit in made if commit.time <= stable or random.random() < 0.5]
        states.append((compact(merged(*received), stable), received))
    (left, left_commits), (right, right_commits) = states
    all_commits = {(commit.replica, commit.number): commit for commit in (*left_commits, *right_commits)}

    assert graphs_of(join(left, right)) == graphs_of(merged(*all_commits.values()))
    assert registers_of(join(left, right)) == registers_of(join(right, left))


@settings(max_examples=200)
@given(commits())
def test_the_graph_is_that_of_a_plain_program(made: list[Commit]) -> None:
    instants_s = (LAST_S + 1.0, LAST_S + 3.0, LAST_S + 100.0)

    assert graphs_of(merged(*made)) == [expected_graph(EMPTY_MODEL, made, now_s) for now_s in instants_s]


@given(commits())
def test_a_commit_survives_its_encoding(made: list[Commit]) -> None:
    assert [commit_of(commit.plain_data()) for commit in made] == made
