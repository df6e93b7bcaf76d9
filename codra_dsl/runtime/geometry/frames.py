"""The tree of frames: RT edges with their history, and the transform between two frames at any instant (P2, 3.1).

A link from a frame to its parent is stamped too: a transform at an instant follows the tree of that instant. Transforms
are cached with the tracks that they were computed from. A cached transform is only used while these tracks are the
same objects, so it always equals a newly computed one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from codra_dsl.runtime.geometry.motion import ANY_MOTION, Motion, Outcome, Placement, Track
from codra_dsl.runtime.geometry.pose import IDENTITY, Pose, chained
from codra_dsl.runtime.values.persistent import PersistentMap

MOST_KEPT = 4096
"""The maximum number of cached transforms."""


class FrameError(LookupError):
    """Frames are unknown, were not connected at an instant, or would form a cycle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Transform:
    """The pose of one frame in another at an instant.

    Attributes:
        pose: the pose of the source in the target, which maps points of the source to points of the target.
        outcome: the worst outcome along the chain.
        gap_s: the longest time along the chain between the instant and the nearest measured pose.
        weakest: the frame whose edge has the worst outcome, and among several the one with the longest gap; empty if
            all are exact.
    """

    pose: Pose
    outcome: Outcome = Outcome.EXACT
    gap_s: float = 0.0
    weakest: str = ""


_Answer = tuple[Transform, tuple[tuple[str, Track], ...]]
"""A transform, and the tracks that it was computed from."""


class Frames:
    """All frames of a world, as known at one time. Objects are immutable: each change returns a new one.

    Objects that are derived from each other share their cache.
    """

    __slots__ = ("_answers", "_tracks")

    def __init__(self) -> None:
        """Begin without frames."""
        self._tracks: PersistentMap[str, Track] = PersistentMap()
        self._answers: dict[tuple[str, str, float], _Answer] = {}

    def with_pose(self, child: str, parent: str, pose: Pose, stamp_s: float, motion: Motion = ANY_MOTION) -> Frames:
        """Return the frames with a pose of one frame from an instant on, until its next pose.

        Args:
            child: the frame.
            parent: another frame.
            pose: the pose of the child in the parent.
            stamp_s: the instant of the pose; instants may come in any order.
            motion: how the child moves in this parent.

        Raises:
            FrameError: if the parent is a descendant of the child at that time.
            ValueError: if the stamp is not finite, or the pose is not a rigid motion.
        """
        _check_instant(stamp_s)
        if not isinstance(pose, Pose):
            raise ValueError(f"{child!r} needs a Pose, not a {type(pose).__name__}")
        pose = pose.checked()
        tracks, known = self._tracks, self._tracks.get(child)
        track = known or Track()
        goes_on = len(track) and track.parent == parent and stamp_s >= track.newest_s
        # A new frame has no descendants, and a frame that continues in its parent was already there.
        if child == parent or (
            known is not None and not goes_on and self._is_within(parent, child, *track.reach(stamp_s))
        ):
            raise FrameError(f"{child!r} cannot be placed in {parent!r} from {stamp_s:g} s on: this makes a cycle")
        if parent not in tracks:
            tracks = tracks.with_entry(parent, Track())
        return self._with(tracks.with_entry(child, track.with_pose(stamp_s, parent, pose, motion)))

    def without_parent(self, child: str, stamp_s: float) -> Frames:
        """Return the frames in which one frame has no parent from an instant on, until its next pose.

        Raises:
            FrameError: if the frame is unknown.
            ValueError: if the stamp is not finite.
        """
        _check_instant(stamp_s)
        track = self._known(child)
        motion = track.motion if len(track) else ANY_MOTION
        return self._with(self._tracks.with_entry(child, track.with_pose(stamp_s, None, IDENTITY, motion)))

    def without(self, name: str) -> Frames:
        """Return the frames without one frame and its history."""
        return self._with(self._tracks.without(name))

    def __contains__(self, name: object) -> bool:
        return name in self._tracks

    def names(self) -> tuple[str, ...]:
        """Return all frames, in alphabetical order."""
        return tuple(sorted(self._tracks))

    def track(self, name: str) -> Track:
        """Return the history of a frame's poses.

        Raises:
            FrameError: if the frame is unknown.
        """
        return self._known(name)

    def parent(self, name: str, instant_s: float) -> str | None:
        """Return the parent of a frame at an instant; None if it has none.

        Raises:
            FrameError: if the frame is unknown.
        """
        placement = self._known(name).at(instant_s)
        return None if placement is None else placement.parent

    def transform(self, target: str, source: str, instant_s: float) -> Transform:
        """Return the pose of one frame in another, along the tree of an instant.

        Args:
            target: the frame in which the pose is expressed.
            source: the frame whose pose is returned.
            instant_s: the instant.

        Raises:
            FrameError: if a frame is unknown, or the two were not connected then.
            ValueError: if the instant is NaN.
        """
        return self._answer(target, source, instant_s)[0]

    def fresh_until_s(self, target: str, source: str, instant_s: float) -> float:
        """Return until when no edge between two frames is stale, if no further poses arrive.

        Raises:
            FrameError: if a frame is unknown, or the two were not connected at the instant.
        """
        _, tracks = self._answer(target, source, instant_s)
        return min((track.newest_s + track.motion.valid_for_s for _, track in tracks), default=math.inf)

    def next_s(self, target: str, source: str, instant_s: float) -> float:
        """Return when to compute the present transform again, if no further poses arrive; see `Track.next_s`.

        Raises:
            FrameError: if a frame is unknown, or the two were not connected at the instant.
        """
        _, tracks = self._answer(target, source, instant_s)
        return min((track.next_s(instant_s) for _, track in tracks), default=math.inf)

    def between(self, target: str, source: str, instant_s: float) -> tuple[str, ...]:
        """Return the frames whose poses determine the transform between two frames.

        Raises:
            FrameError: if a frame is unknown, or the two were not connected at the instant.
        """
        return tuple(name for name, _ in self._answer(target, source, instant_s)[1])

    def _answer(self, target: str, source: str, instant_s: float) -> _Answer:
        key = (target, source, instant_s)
        kept = self._answers.get(key)
        if kept is not None:
            tracks = self._tracks
            for name, track in kept[1]:
                if tracks.get(name) is not track:
                    break
            else:
                return kept
        made = self._computed(target, source, instant_s)
        if len(self._answers) >= MOST_KEPT:
            self._answers.clear()
        self._answers[key] = made
        return made

    def _with(self, tracks: PersistentMap[str, Track]) -> Frames:
        made = Frames.__new__(Frames)
        made._tracks, made._answers = tracks, self._answers
        return made

    def _computed(self, target: str, source: str, instant_s: float) -> tuple[Transform, tuple[tuple[str, Track], ...]]:
        if instant_s != instant_s:
            raise ValueError("the instant of a transform must not be NaN")
        ups, downs = self._climb(source, instant_s), self._climb(target, instant_s)
        common = next((name for name in ups if name in downs), None)
        if common is None:
            raise FrameError(
                f"{source!r} and {target!r} were not connected at {instant_s:g} s: "
                f"their roots were {list(ups)[-1]!r} and {list(downs)[-1]!r}"
            )
        up, down = _below(common, ups), _below(common, downs)
        inner, outer = _chained(up), _chained(down)
        parts = (*up, *down)
        worst = max([(placement.outcome, placement.gap_s, name) for name, placement in parts], default=_CERTAIN)
        transform = Transform(
            pose=outer.inverse() @ inner if down else inner,
            outcome=worst[0],
            gap_s=max([placement.gap_s for _, placement in parts], default=0.0),
            weakest=worst[2] if worst[0] else "",
        )
        # The ancestors of the common frame do not matter.
        return transform, tuple([(name, self._tracks[name]) for name, _ in parts])

    def _climb(self, name: str, instant_s: float) -> dict[str, Placement | None]:
        """Return a frame and its ancestors at an instant, each with its placement."""
        climbed: dict[str, Placement | None] = {}
        above: str | None = name
        if name is None:
            raise FrameError("there is no frame None")
        while above is not None:
            if above in climbed:  # before a frame's history, its oldest pose is used, which can make a cycle
                raise FrameError(f"the ancestors of {name!r} at {instant_s:g} s are no longer in the history")
            climbed[above] = placement = self._known(above).at(instant_s)
            above = None if placement is None else placement.parent
        return climbed

    def _known(self, name: str) -> Track:
        track = self._tracks.get(name)
        if track is None:
            raise FrameError(f"there is no frame {name!r}")
        return track

    def _is_within(self, name: str, outer: str, start_s: float, end_s: float) -> bool:
        """Return whether a frame is a descendant of another, or the same, at any instant of a half-open interval."""
        waiting = [(start_s, end_s, name)]
        while waiting:
            from_s, until_s, inner = waiting.pop()
            if inner == outer:
                return True
            track = self._tracks.get(inner)
            if track is not None:
                waiting.extend(track.spans(from_s, until_s))
        return False


_CERTAIN = (Outcome.EXACT, 0.0, "")


def _below(common: str, climbed: dict[str, Placement | None]) -> list[tuple[str, Placement]]:
    """Return the placements below a common ancestor."""
    below: list[tuple[str, Placement]] = []
    for name, placement in climbed.items():
        if name == common or placement is None:
            break
        below.append((name, placement))
    return below


def _chained(placements: list[tuple[str, Placement]]) -> Pose:
    """Return the pose of the first frame in the parent of the last."""
    if not placements:
        return IDENTITY
    return chained([placement.pose for _, placement in placements])


def _check_instant(stamp_s: float) -> None:
    if not math.isfinite(stamp_s):
        raise ValueError(f"a pose needs a finite stamp, not {stamp_s}")
