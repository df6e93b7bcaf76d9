"""The tree of frames over time, compared with a model that keeps all poses and searches them for every answer."""

from __future__ import annotations

import contextlib
import itertools
import math
from dataclasses import dataclass, field
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some
from scipy.spatial.transform import Rotation, Slerp

from codra_dsl.runtime.geometry import FrameError, Frames, Motion, Outcome, Pose

COUNT = 8
EXTRAPOLATE_S = 1.5


@dataclass
class Model:
    """All poses of every frame: by stamp, its parent and its pose as a matrix."""

    poses: dict[str, dict[float, tuple[str | None, Any]]] = field(default_factory=dict)

    def placement(self, name: str, at_s: float) -> tuple[str | None, Any, Outcome]:
        track = sorted(self.poses.get(name, {}).items())
        if not track:
            return None, None, Outcome.EXACT
        before = [entry for entry in track if entry[0] <= at_s]
        if not before:
            return *track[0][1], Outcome.CLAMPED
        stamp_s, (parent, pose) = before[-1]
        if stamp_s == at_s:
            return parent, pose, Outcome.EXACT
        after = track[len(before)] if len(before) < len(track) else None
        if after is not None and after[1][0] == parent:
            return parent, blend(pose, after[1][1], (at_s - stamp_s) / (after[0] - stamp_s)), Outcome.INTERPOLATED
        if at_s - stamp_s > EXTRAPOLATE_S:
            return parent, pose, Outcome.CLAMPED
        if len(before) > 1 and before[-2][1][0] == parent:
            earlier_s, (_, earlier) = before[-2]
            pose = blend(earlier, pose, (at_s - earlier_s) / (stamp_s - earlier_s))
        return parent, pose, Outcome.EXTRAPOLATED

    def to_root(self, name: str, at_s: float) -> tuple[str, Any, list[tuple[str, Outcome]]]:
        matrix_to_root, path = np.eye(4), []
        for _ in range(COUNT + 2):
            parent, pose, outcome = self.placement(name, at_s)
            if parent is None:
                return name, matrix_to_root, path
            matrix_to_root = pose @ matrix_to_root
            path.append((name, outcome))
            name = parent
        raise AssertionError("a cycle")

    def has_cycle(self) -> bool:
        instants = sorted({stamp for track in self.poses.values() for stamp in track})
        probes = [-1e9, *instants, *((a + b) / 2 for a, b in itertools.pairwise(instants))]
        try:
            for at_s in probes:
                for name in self.poses:
                    self.to_root(name, at_s)
        except AssertionError:
            return True
        return False


def blend(a: Any, b: Any, share: float) -> Any:
    made = np.eye(4)
    step = (Rotation.from_matrix(a[:3, :3]).inv() * Rotation.from_matrix(b[:3, :3])).as_rotvec()
    made[:3, :3] = (Rotation.from_matrix(a[:3, :3]) * Rotation.from_rotvec(step * share)).as_matrix()
    made[:3, 3] = a[:3, 3] + share * (b[:3, 3] - a[:3, 3])
    return made


names = some.integers(0, COUNT - 1).map(lambda number: f"f{number}")
stamps = some.integers(0, 40).map(lambda tenth: tenth / 4)
small = some.floats(-2.0, 2.0)
poses = some.builds(
    Pose.about,
    some.sampled_from([(0.0, 0.0, 1.0), (1.0, 2.0, 0.5), (-1.0, 0.1, 0.0)]),
    some.floats(-1.4, 1.4),
    some.tuples(small, small, small),
)
steps = some.lists(
    some.one_of(
        some.tuples(some.just("set"), names, names, poses, stamps),
        some.tuples(some.just("remove"), names, stamps),
        some.tuples(some.just("ask"), names, names, stamps.map(lambda at_s: at_s + 0.125) | stamps),
    ),
    min_size=10,
    max_size=60,
)


FREE = Motion(history_s=math.inf, extrapolate_s=EXTRAPOLATE_S)


def add_pose(frames: Frames, model: Model, step: tuple[str, str, Pose, float]) -> Frames:
    """Add a pose to both; they must agree on whether it makes a cycle."""
    child, parent, pose, stamp_s = step
    track = model.poses.setdefault(child, {})
    before = dict(track)
    track[stamp_s] = (parent, np.array(pose.matrix()))
    if child == parent or model.has_cycle():
        with pytest.raises(FrameError, match="cannot be placed in"):
            frames.with_pose(child, parent, pose, stamp_s, FREE)
        model.poses[child] = before
        return frames
    return frames.with_pose(child, parent, pose, stamp_s, FREE)


def compare(frames: Frames, model: Model, target: str, source: str, at_s: float) -> None:
    if any(name not in frames.names() for name in (source, target)):
        with pytest.raises(FrameError, match="there is no frame"):
            frames.transform(target, source, at_s)
        return
    source_root, up, ups = model.to_root(source, at_s)
    target_root, down, downs = model.to_root(target, at_s)
    if source_root != target_root:
        with pytest.raises(FrameError, match="not connected"):
            frames.transform(target, source, at_s)
        return
    transform = frames.transform(target, source, at_s)
    np.testing.assert_allclose(np.array(transform.pose.matrix()), np.linalg.inv(down) @ up, atol=1e-8)
    shared = {name for name, _ in ups} & {name for name, _ in downs}
    outcomes = [outcome for name, outcome in (*ups, *downs) if name not in shared]
    assert transform.outcome == max(outcomes, default=Outcome.EXACT)
    back = frames.transform(source, target, at_s)
    np.testing.assert_allclose(np.array((transform.pose @ back.pose).matrix()), np.eye(4), atol=1e-8)


@settings(max_examples=40)
@given(steps=steps)
def test_after_any_interleaving_every_answer_equals_that_of_the_model(steps: list[tuple[Any, ...]]) -> None:
    frames, model = Frames(), Model()
    questions = []
    for step in steps:
        match step:
            case ("set", *arguments):
                frames = add_pose(frames, model, tuple(arguments))
            case ("remove", child, stamp_s) if child in frames:
                model.poses.setdefault(child, {})[stamp_s] = (None, np.eye(4))
                frames = frames.without_parent(child, stamp_s)
            case ("ask", target, source, at_s):
                questions.append((target, source, at_s))
        for question in questions[-6:]:
            compare(frames, model, *question)


@settings(max_examples=4)
@given(seed=some.integers(0, 10_000))
def test_deep_trees_agree_with_matrices_at_every_instant(seed: int) -> None:
    chance = np.random.default_rng(seed)
    frames, model = Frames(), Model()
    for stamp_s in range(5):
        for number in range(1, COUNT):
            pose = Pose.about(chance.normal(size=3), chance.uniform(-1.5, 1.5), chance.normal(size=3))
            frames = add_pose(frames, model, (f"f{number}", f"f{number - 1}", pose, float(stamp_s)))
    for at_s in chance.uniform(-1.0, 6.0, size=10):
        compare(frames, model, "f0", f"f{COUNT - 1}", float(at_s))
        compare(frames, model, f"f{COUNT - 1}", "f2", float(at_s))


def turned(angle_rad: float, x_m: float = 0.0) -> Pose:
    return Pose.about((0.0, 0.0, 1.0), angle_rad, (x_m, 0.0, 0.0))


def test_the_figure_of_the_paper_chains_an_inverse_with_an_edge() -> None:
    """P2, Figure 1: the roll container in the robot's frame is RT^-1 x RT''."""
    frames = Frames()
    robot, container = turned(0.5, 2.0), turned(-0.25, 5.0)
    frames = frames.with_pose("robot", "world", robot, 1.0)
    frames = frames.with_pose("roll_container", "world", container, 1.0)
    by_hand = np.linalg.inv(np.array(robot.matrix())) @ np.array(container.matrix())
    transform = frames.transform("robot", "roll_container", 1.0)
    np.testing.assert_allclose(np.array(transform.pose.matrix()), by_hand, atol=1e-12)
    assert transform.outcome is Outcome.EXACT


def test_a_frame_that_is_picked_up_is_in_the_hand_from_then_on_and_on_the_table_before() -> None:
    frames = Frames()
    frames = frames.with_pose("table", "world", turned(0.0, 1.0), 0.0)
    frames = frames.with_pose("hand", "world", turned(0.0, 3.0), 0.0)
    frames = frames.with_pose("cup", "table", turned(0.0, 0.2), 0.0)
    frames = frames.with_pose("cup", "hand", turned(0.0, 0.05), 10.0)
    assert frames.transform("world", "cup", 9.0).pose.translation_m == (1.2, 0.0, 0.0)
    assert frames.transform("world", "cup", 10.0).pose.translation_m == (3.05, 0.0, 0.0)
    assert (frames.parent("cup", 9.0), frames.parent("cup", 11.0)) == ("table", "hand")


def test_poses_in_two_parents_are_not_interpolated() -> None:
    frames = Frames()
    frames = frames.with_pose("cup", "table", turned(0.0, 0.0), 0.0)
    frames = frames.with_pose("cup", "hand", turned(0.0, 8.0), 10.0)
    frames = frames.with_pose("table", "world", turned(0.0), 0.0)
    transform = frames.transform("table", "cup", 5.0)
    assert (transform.pose.translation_m, transform.outcome) == ((0.0, 0.0, 0.0), Outcome.CLAMPED)


def test_the_outcome_names_the_weakest_edge_and_the_longest_gap() -> None:
    frames = Frames()
    base, arm = Motion(valid_for_s=60.0), Motion(valid_for_s=2.0, extrapolate_s=0.5)
    frames = frames.with_pose("base", "world", turned(0.1), 10.0, base)
    frames = frames.with_pose("arm", "base", turned(0.1), 10.0, arm)
    frames = frames.with_pose("arm", "base", turned(0.2), 10.2, arm)
    frames = frames.with_pose("camera", "arm", turned(0.3), 0.0, Motion(is_static=True))
    transforms = [frames.transform("world", "camera", at_s) for at_s in (10.0, 10.1, 10.5, 11.0, 12.3)]
    assert [(transform.outcome.name, transform.weakest) for transform in transforms] == [
        ("EXACT", ""),
        ("CLAMPED", "base"),
        ("CLAMPED", "base"),
        ("CLAMPED", "base"),
        ("STALE", "arm"),
    ]
    assert [round(transform.gap_s, 9) for transform in transforms] == [0.0, 0.1, 0.5, 1.0, 2.3]
    arm_transforms = [frames.transform("base", "arm", at_s) for at_s in (9.0, 10.1, 10.4, 10.8)]
    assert [transform.outcome.name for transform in arm_transforms] == [
        "CLAMPED",
        "INTERPOLATED",
        "EXTRAPOLATED",
        "CLAMPED",
    ]


def test_a_static_edge_is_never_stale_and_moves_in_steps() -> None:
    frames = Frames()
    static = Motion(is_static=True, valid_for_s=1.0, history_s=math.inf)
    frames = frames.with_pose("camera", "head", turned(0.1), 0.0, static)
    frames = frames.with_pose("camera", "head", turned(0.9), 100.0, static)
    early, late = frames.transform("head", "camera", 99.0), frames.transform("head", "camera", 1e6)
    assert (early.outcome, late.outcome) == (Outcome.EXACT, Outcome.EXACT)
    assert early.pose.angle_rad(turned(0.1)) == pytest.approx(0.0, abs=1e-9)
    assert late.pose.angle_rad(turned(0.9)) == pytest.approx(0.0, abs=1e-9)


def test_a_frame_that_is_removed_is_not_connected_from_then_on() -> None:
    frames = Frames()
    frames = frames.with_pose("person", "world", turned(0.0, 1.0), 0.0)
    frames = frames.without_parent("person", 5.0)
    assert frames.transform("world", "person", 4.0).pose.translation_m == (1.0, 0.0, 0.0)
    with pytest.raises(FrameError, match="'person' and 'world' were not connected at 6 s: their roots were 'person'"):
        frames.transform("world", "person", 6.0)
    frames = frames.with_pose("person", "world", turned(0.0, 2.0), 7.0)
    assert frames.transform("world", "person", 8.0).pose.translation_m == (2.0, 0.0, 0.0)


def test_old_poses_are_dropped_and_the_oldest_kept_pose_holds_before_it() -> None:
    frames = Frames()
    for tick in range(1000):
        frames = frames.with_pose("robot", "world", turned(0.0, float(tick)), tick / 10, Motion(history_s=2.0))
    assert frames.transform("world", "robot", 99.0).pose.translation_m == (990.0, 0.0, 0.0)
    old = frames.transform("world", "robot", 1.0)
    assert (round(old.pose.translation_m[0]), old.outcome) == (979, Outcome.CLAMPED)


def test_a_cycle_before_the_history_is_reported() -> None:
    frames = Frames()
    long, short = Motion(history_s=math.inf), Motion(history_s=1.0)
    frames = frames.with_pose("a", "b", turned(0.0), 0.0, long)
    frames = frames.with_pose("b", "world", turned(0.0), 0.0, short)
    frames = frames.with_pose("a", "world", turned(0.0), 5.0, long)
    for stamp_s in (6.0, 7.0, 20.0):
        frames = frames.with_pose("b", "a", turned(0.0), stamp_s, short)
    with pytest.raises(FrameError, match="the ancestors of 'a' at 3 s are no longer in the history"):
        frames.transform("world", "a", 3.0)


def test_a_frame_that_changes_its_parent_moves_from_then_on_as_that_edge_is_declared() -> None:
    frames = Frames()
    frames = frames.with_pose("cup", "table", turned(0.0, 1.0), 0.0, Motion(valid_for_s=1.0))
    frames = frames.with_pose("cup", "hand", turned(0.0, 2.0), 10.0, Motion(is_static=True))
    outcomes = [frames.transform(parent, "cup", at_s).outcome for parent, at_s in (("table", 9.0), ("hand", 99.0))]
    assert outcomes == [Outcome.STALE, Outcome.EXACT]


@pytest.mark.parametrize("stamp_s", [math.nan, math.inf, -math.inf])
def test_a_pose_without_an_instant_is_refused(stamp_s: float) -> None:
    with pytest.raises(ValueError, match="a pose needs a finite stamp"):
        Frames().with_pose("robot", "world", turned(0.0), stamp_s)


def test_earlier_frames_are_not_changed_by_later_poses() -> None:
    before = Frames().with_pose("robot", "world", turned(0.0, 1.0), 0.0)
    after = before.with_pose("robot", "world", turned(0.0, 3.0), 1.0)
    other = before.with_pose("robot", "world", turned(0.0, 9.0), 2.0)
    transforms = [frames.transform("world", "robot", 1.0) for frames in (before, after, other, before)]
    assert [transform.pose.translation_m[0] for transform in transforms] == [1.0, 3.0, 5.0, 1.0]


@settings(max_examples=30)
@given(steps=steps)
def test_every_earlier_state_gives_the_same_answers(steps: list[tuple[Any, ...]]) -> None:
    frames, answers = Frames(), []
    for step in steps:
        if step[0] == "ask" and step[1] in frames and step[2] in frames:
            answers.append((frames, step[1:], answer(frames, *step[1:])))
        elif step[0] == "set" and step[1] != step[2]:
            with contextlib.suppress(FrameError):
                frames = frames.with_pose(*step[1:], FREE)
    assert [answer(earlier_frames, *question) for earlier_frames, question, _ in answers] == [
        earlier_answer for *_, earlier_answer in answers
    ]


def answer(frames: Frames, target: str, source: str, at_s: float) -> object:
    try:
        return frames.transform(target, source, at_s)
    except FrameError as error:
        return str(error)


def test_an_interpolated_edge_equals_scipys_slerp() -> None:
    frames = Frames()
    a, b = Rotation.from_euler("xyz", [0.3, -0.2, 1.1]), Rotation.from_euler("xyz", [-1.0, 0.4, 0.2])
    for stamp_s, rotation in ((0.0, a), (2.0, b)):
        x, y, z, w = rotation.as_quat()
        frames = frames.with_pose("robot", "world", Pose.of((0, 0, 0), (w, x, y, z)), stamp_s)
    slerp = Slerp([0.0, 2.0], Rotation.concatenate([a, b]))
    for at_s in np.linspace(0.0, 2.0, 21):
        rotation_matrix = np.array(frames.transform("world", "robot", float(at_s)).pose.matrix())[:3, :3]
        np.testing.assert_allclose(rotation_matrix, slerp(at_s).as_matrix(), atol=1e-12)
