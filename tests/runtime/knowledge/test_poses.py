"""Geometry in the graph: RT edges that move, change their parent, end and become stale, against matrices by hand."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from scipy.spatial.transform import Rotation, Slerp

from codra_dsl.runtime import SimClock
from codra_dsl.runtime.geometry import FrameError, Motion, Outcome, Pose
from codra_dsl.runtime.knowledge import Knowledge
from codra_dsl.runtime.knowledge.declarations import EdgeTypeModel, KnowledgeModel, NodeModel, NodeTypeModel, by
from tests.runtime.knowledge.store import store

COUNT = 9
EXTRAPOLATE_S = 0.75
HORIZON_S = 12

PARTS = KnowledgeModel(
    name="parts",
    node_types=(NodeTypeModel(name="part", sources=by("hand")),),
    edge_types=(
        EdgeTypeModel(
            name="moves",
            origins=("part",),
            targets=("part",),
            sources=by("hand"),
            motion=Motion(history_s=math.inf, extrapolate_s=EXTRAPOLATE_S),
        ),
        EdgeTypeModel(
            name="fixed",
            origins=("part",),
            targets=("part",),
            sources=by("hand"),
            motion=Motion(history_s=math.inf, is_static=True),
        ),
    ),
    nodes=tuple(NodeModel(name=f"n{number}", type="part") for number in range(COUNT)),
)


@dataclass
class PoseOracle:
    """All placements, and matrices computed from them for every transform."""

    placements: dict[str, dict[float, tuple[str, str, Any]]] = field(default_factory=dict)

    def pose_at(self, name: str, at_s: float) -> tuple[str, Any, Outcome]:
        stamped_poses = self.placements[name]
        stamps_s = sorted(stamped_poses)
        before = [stamp_s for stamp_s in stamps_s if stamp_s <= at_s]
        if not before:
            kind, parent, matrix = stamped_poses[stamps_s[0]]
            return parent, matrix, Outcome.CLAMPED
        kind, parent, matrix = stamped_poses[before[-1]]
        if kind == "fixed" or before[-1] == at_s:
            return parent, matrix, Outcome.EXACT
        after = [stamp_s for stamp_s in stamps_s if stamp_s > at_s]
        if after and stamped_poses[after[0]][:2] == (kind, parent):
            return parent, between(before[-1], matrix, after[0], stamped_poses[after[0]][2], at_s), Outcome.INTERPOLATED
        if at_s - before[-1] > EXTRAPOLATE_S:
            return parent, matrix, Outcome.CLAMPED
        if len(before) > 1 and stamped_poses[before[-2]][:2] == (kind, parent):
            matrix = between(before[-2], stamped_poses[before[-2]][2], before[-1], matrix, at_s)
        return parent, matrix, Outcome.EXTRAPOLATED

    def to_root(self, name: str, at_s: float) -> tuple[Any, dict[str, Outcome]]:
        matrix_to_root, outcomes = np.eye(4), {}
        while name in self.placements:
            parent, matrix, outcomes[name] = self.pose_at(name, at_s)
            matrix_to_root, name = matrix @ matrix_to_root, parent
        return matrix_to_root, outcomes

    def transform(self, target: str, source: str, at_s: float) -> tuple[Any, Outcome]:
        (down, downs), (up, ups) = self.to_root(target, at_s), self.to_root(source, at_s)
        chain = [outcome for name, outcome in (*downs.items(), *ups.items()) if not (name in downs and name in ups)]
        return np.linalg.inv(down) @ up, max(chain, default=Outcome.EXACT)


def between(a_s: float, a: Any, b_s: float, b: Any, at_s: float) -> Any:
    """Return a pose between two poses by scipy's Slerp and a straight line, or beyond them at the same rate."""
    made, share = np.eye(4), (at_s - a_s) / (b_s - a_s)
    made[:3, 3] = a[:3, 3] + share * (b[:3, 3] - a[:3, 3])
    turns = Rotation.from_matrix([a[:3, :3], b[:3, :3]])
    if a_s <= at_s <= b_s:
        made[:3, :3] = Slerp([a_s, b_s], turns)(at_s).as_matrix()
    else:
        step = (turns[0].inv() * turns[1]).as_rotvec()
        made[:3, :3] = (turns[0] * Rotation.from_rotvec(step * share)).as_matrix()
    return made


def pose_of(chance: np.random.Generator) -> Pose:
    return Pose.about(chance.normal(size=3), chance.uniform(-1.4, 1.4), chance.normal(size=3))


class Tree:
    """A random tree, at least six edges deep, with moving and fixed edges that change their parents."""

    def __init__(self, seed: int) -> None:
        self.chance = np.random.default_rng(seed)
        self.clock = SimClock(float(HORIZON_S))
        self.knowledge = Knowledge(PARTS, clock=self.clock)
        self.hand = self.knowledge.as_agent("hand")
        self.pose_oracle = PoseOracle()
        self.kinds = {number: "fixed" if self.chance.random() < 0.2 else "moves" for number in range(1, COUNT)}
        for number in range(1, COUNT):
            self.place_part(number, number - 1 if number <= 6 else int(self.chance.integers(number)), 0.0)

    def place_part(self, number: int, parent: int, stamp_s: float) -> None:
        pose = pose_of(self.chance)
        self.pose_oracle.placements.setdefault(f"n{number}", {})[stamp_s] = (
            self.kinds[number],
            f"n{parent}",
            np.array(pose.matrix()),
        )
        self.hand.place(f"n{parent}", self.kinds[number], f"n{number}", pose, stamp_s=stamp_s)

    def place_random_part(self) -> None:
        """Place a random part at a random instant, in its last parent or in another part with a lower number."""
        number = int(self.chance.integers(1, COUNT))
        stamp_s = float(self.chance.integers(0, 4 * HORIZON_S)) / 4
        is_moved = number > 6 and self.chance.random() < 0.4
        last = self.pose_oracle.placements[f"n{number}"][max(self.pose_oracle.placements[f"n{number}"])][1]
        self.place_part(number, int(self.chance.integers(number)) if is_moved else int(last[1:]), stamp_s)

    def question(self) -> tuple[str, str, float]:
        a, b = self.chance.integers(COUNT, size=2)
        return f"n{a}", f"n{b}", float(self.chance.integers(-2, 8 * (HORIZON_S + 2))) / 8


@settings(max_examples=25)
@given(seed=some.integers(0, 2**32 - 1))
def test_every_transform_agrees_with_matrices_by_hand_after_any_interleaving(seed: int) -> None:
    tree, asked = Tree(seed), []
    for _ in range(25):
        tree.place_random_part()
        asked.append(tree.question())
        for target, source, at_s in asked[-5:]:  # earlier transforms again, after further placements
            transform = tree.knowledge.transform(target, source, at_s)
            matrix, outcome = tree.pose_oracle.transform(target, source, at_s)
            np.testing.assert_allclose(np.array(transform.pose.matrix()), matrix, atol=1e-7)
            assert transform.outcome == outcome


@settings(max_examples=40)
@given(seed=some.integers(0, 2**32 - 1))
def test_transforms_invert_chain_and_keep_distances(seed: int) -> None:
    tree = Tree(seed)
    for _ in range(10):
        tree.place_random_part()
    seen = tree.knowledge.snapshot()
    for _ in range(10):
        (a, b, at_s), (c, *_) = tree.question(), tree.question()
        there, back = seen.transform(a, b, at_s).pose, seen.transform(b, a, at_s).pose
        np.testing.assert_allclose(np.array((there @ back).matrix()), np.eye(4), atol=1e-9)
        chained = seen.transform(a, c, at_s).pose @ seen.transform(c, b, at_s).pose
        np.testing.assert_allclose(np.array(chained.matrix()), np.array(there.matrix()), atol=1e-8)
        p, q = tree.chance.normal(size=(2, 3)).tolist()
        assert math.dist(there.apply(p), there.apply(q)) == pytest.approx(math.dist(p, q))
        assert there.angle_rad(chained) == pytest.approx(0.0, abs=1e-6)


@settings(max_examples=20)
@given(seed=some.integers(0, 2**32 - 1))
def test_interpolation_between_poses_turns_at_a_constant_rate(seed: int) -> None:
    chance = np.random.default_rng(seed)
    knowledge = Knowledge(PARTS, clock=SimClock(1.0))
    hand, (a, b) = knowledge.as_agent("hand"), (pose_of(chance), pose_of(chance))
    hand.place("n0", "moves", "n1", a, stamp_s=0.0)
    hand.place("n0", "moves", "n1", b, stamp_s=1.0)
    for share in (0.25, 0.5, 0.9):
        interpolated_pose = knowledge.transform("n0", "n1", share).pose
        assert a.angle_rad(interpolated_pose) == pytest.approx(share * a.angle_rad(b), abs=1e-7)
        assert a.distance_m(interpolated_pose) == pytest.approx(share * a.distance_m(b))


@settings(max_examples=25)
@given(seed=some.integers(0, 2**32 - 1))
def test_the_transforms_of_a_snapshot_never_change(seed: int) -> None:
    tree, earlier_answers = Tree(seed), []
    for _ in range(20):
        tree.place_random_part()
        seen, question = tree.knowledge.snapshot(), tree.question()
        earlier_answers.append((seen, question, seen.transform(*question)))
    assert [seen.transform(*question) for seen, question, _ in earlier_answers] == [
        answer for *_, answer in earlier_answers
    ]


# Edges of the graph


def parts(*placed: tuple[str, str, str, float]) -> tuple[Knowledge, SimClock]:
    clock = SimClock()
    knowledge = Knowledge(PARTS, clock=clock)
    hand = knowledge.as_agent("hand")
    for origin, kind, target, x_m in placed:
        hand.place(origin, kind, target, Pose.of((x_m, 0.0, 0.0)))
    return knowledge, clock


def edges(knowledge: Knowledge) -> list[str]:
    return sorted(f"{edge.origin} {edge.type} {edge.target}" for edge in knowledge.snapshot().edges("RT"))


def test_a_part_that_is_picked_up_has_one_edge_and_its_past_is_unchanged() -> None:
    knowledge, clock = parts(("n0", "moves", "n1", 1.0), ("n0", "moves", "n2", 5.0), ("n1", "fixed", "n3", 0.5))
    clock.sleep(10.0)
    knowledge.as_agent("hand").place("n2", "moves", "n3", Pose.of((0.25, 0.0, 0.0)))
    assert edges(knowledge) == ["n0 moves n1", "n0 moves n2", "n2 moves n3"]
    before, after = (knowledge.transform("n0", "n3", at_s) for at_s in (9.0, 10.0))
    assert (before.pose.translation_m[0], after.pose.translation_m[0]) == (1.5, 5.25)
    assert [knowledge.snapshot().parent("n3", at_s) for at_s in (9.0, 10.0)] == ["n1", "n2"]


def test_a_late_pose_does_not_change_the_present_edge() -> None:
    knowledge, clock = parts(("n0", "moves", "n1", 1.0))
    clock.sleep(10.0)
    hand = knowledge.as_agent("hand")
    hand.place("n2", "moves", "n1", Pose(), stamp_s=10.0)
    hand.place("n0", "moves", "n1", Pose.of((3.0, 0.0, 0.0)), stamp_s=2.0)
    assert edges(knowledge) == ["n2 moves n1"]
    assert knowledge.transform("n0", "n1", 1.0).pose.translation_m[0] == 2.0


def test_a_future_pose_and_a_cycle_are_refused() -> None:
    knowledge, _ = parts(("n0", "moves", "n1", 1.0), ("n1", "moves", "n2", 1.0))
    hand = knowledge.as_agent("hand")
    before = knowledge.snapshot().version
    with pytest.raises(ValueError, match=r"a pose of 'n1' cannot be from 1\.0: the present instant is 0\.0"):
        hand.place("n0", "moves", "n1", Pose(), stamp_s=1.0)
    with pytest.raises(FrameError, match="'n0' cannot be placed in 'n2' from 0 s on: this makes a cycle"):
        hand.place("n2", "moves", "n0", Pose())
    with pytest.raises(ValueError, match=r"edges of type 'moves' have a pose: use place\(\) for 'n3' relative to 'n2'"):
        hand.insert_edge("n2", "moves", "n3")
    assert knowledge.snapshot().version == before


def test_the_target_of_a_deleted_edge_has_no_pose_from_then_on() -> None:
    knowledge, clock = parts(("n0", "moves", "n1", 1.0), ("n1", "moves", "n2", 1.0))
    clock.sleep(5.0)
    knowledge.as_agent("hand").delete_edge("n0", "moves", "n1")
    assert edges(knowledge) == ["n1 moves n2"]
    assert knowledge.transform("n0", "n2", 4.0).pose.translation_m[0] == 2.0
    with pytest.raises(FrameError, match="'n2' and 'n0' were not connected at 5 s"):
        knowledge.transform("n0", "n2")
    assert knowledge.snapshot().distance_m("n0", "n2") is None


def test_the_children_of_a_deleted_part_have_no_pose() -> None:
    knowledge, clock = parts(("n0", "moves", "n1", 1.0), ("n1", "moves", "n2", 1.0), ("n0", "fixed", "n3", 1.0))
    clock.sleep(5.0)
    hand = knowledge.as_agent("hand")
    hand.delete_node("n1")
    assert edges(knowledge) == ["n0 fixed n3"]
    assert knowledge.snapshot().parent("n2") is None
    assert knowledge.transform("n0", "n2", 4.0).pose.translation_m[0] == 2.0
    hand.delete_node("n0")
    assert edges(knowledge) == []


def test_the_poses_of_deleted_nodes_do_not_pile_up() -> None:
    clock = SimClock()
    knowledge = store(clock)
    detection = knowledge.as_agent("container_detection")
    for number in range(200):
        clock.sleep(1.0)
        detection.insert_node(f"box_{number}", "roll_container")
        detection.place("world", "container_pose", f"box_{number}", Pose())
        clock.sleep(1.0)
        detection.delete_node(f"box_{number}")
    known_names = [
        f"box_{number}" for number in range(200) if _is_known(knowledge, f"box_{number}", clock.now_s() - 3.5)
    ]
    assert 1 <= len(known_names) <= 10
    assert "box_199" in known_names


def _is_known(knowledge: Knowledge, name: str, at_s: float) -> bool:
    try:
        knowledge.transform("world", name, at_s)
    except FrameError as error:
        return "no frame" not in str(error)
    return True


def test_the_outcome_of_a_chain_is_that_of_its_worst_edge() -> None:
    clock = SimClock()
    knowledge = store(clock)
    knowledge.as_agent("navigation").place("world", "robot_pose", "robot", Pose())
    outcomes = []
    for duration_s in (0.0, 0.1, 1.0, 5.0):
        clock.sleep(duration_s)
        transform = knowledge.transform("world", "camera")
        outcomes.append((transform.outcome.name, transform.weakest, round(transform.gap_s, 3)))
    assert outcomes == [
        ("EXACT", "", 0.0),
        ("EXTRAPOLATED", "robot", 0.1),
        ("CLAMPED", "robot", 1.1),
        ("STALE", "robot", 6.1),
    ]
