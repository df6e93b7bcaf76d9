"""The tree of frames: RT edges with their history, and the transform between two frames at any instant (P2, 3.1).

Like a pose, the link from a frame to its parent has a stamp. So a transform at an instant follows the tree of this
instant.
Each cached transform is stored with the tracks from which it was computed. The transform is used only while these
tracks are the same objects, so it always equals a newly computed one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from codra_dsl.runtime.geometry.motion import ANY_MOTION, Motion, Outcome, Placement, Track
from codra_dsl.runtime.geometry.pose import IDENTITY, Pose, compose_poses
from codra_dsl.runtime.values.persistent import PersistentMap

MAX_CACHED_TRANSFORMS = 4096
"""The maximum number of cached transforms."""


class FrameError(LookupError):
    """Frames are unknown, were not connected at an instant, or would form a cycle."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Transform:
    """The pose of one frame in another at an instant.

    Attributes:
        pose: the pose of the source in the target; this pose maps points of the source to points of the target.
        outcome: the worst outcome along the chain.
        gap_s: the longest time along the chain between the instant and the nearest measured pose.
        weakest: the frame whose edge has the worst outcome; if there are several, the one with the longest gap. Empty
            if all outcomes are exact.
    """

    pose: Pose
    outcome: Outcome = Outcome.EXACT
    gap_s: float = 0.0
    weakest: str = ""


_CachedTransform = tuple[Transform, tuple[tuple[str, Track], ...]]
"""A transform, and the tracks that it was computed from."""


class Frames:
    """All frames of a world, as known at one time. Objects are immutable: each change returns a new object.

    Objects that are derived from each other share one cache.
    """

    __slots__ = ("_cache", "_tracks")

    def __init__(self) -> None:
        """Begin without frames."""
        self._tracks: PersistentMap[str, Track] = PersistentMap()
        self._cache: dict[tuple[str, str, float], _CachedTransform] = {}

    @classmethod
    def of(cls, tracks: Mapping[str, Track]) -> Frames:
        """Return the frames with these tracks, by the names of the frames."""
        return cls()._with_tracks(PersistentMap[str, Track]().with_changes(tracks))

    def with_pose(self, child: str, parent: str, pose: Pose, stamp_s: float, motion: Motion = ANY_MOTION) -> Frames:
        """Return the frames with one more pose of a frame; the pose holds from `stamp_s` until the frame's next pose.

        Args:
            child: the frame.
            parent: another frame.
            pose: the pose of the child in the parent.
            stamp_s: the instant of the pose; instants may come in any order.
            motion: how the child moves in this parent.

        Raises:
            FrameError: if the parent is the child itself, or its descendant during the time of this pose.
            ValueError: if the stamp is not finite, or the pose is not a rigid motion.
        """
        _check_instant(stamp_s)
        if not isinstance(pose, Pose):
            raise ValueError(f"{child!r} needs a Pose, not a {type(pose).__name__}")
        pose = pose.checked()
        tracks, known_track = self._tracks, self._tracks.get(child)
        track = known_track or Track()
        keeps_parent = len(track) and track.parent == parent and stamp_s >= track.newest_s
        # No cycle can arise if the frame is new, because it has no descendants, or if it keeps its parent.
        if child == parent or (
            known_track is not None
            and not keeps_parent
            and self._is_descendant(parent, child, *track.affected_interval(stamp_s))
        ):
            raise FrameError(f"{child!r} cannot be placed in {parent!r} from {stamp_s:g} s on: this makes a cycle")
        if parent not in tracks:
            tracks = tracks.with_entry(parent, Track())
        return self._with_tracks(tracks.with_entry(child, track.with_pose(stamp_s, parent, pose, motion)))

    def without_parent(self, child: str, stamp_s: float) -> Frames:
        """Return a copy in which the frame `child` has no parent from `stamp_s` until its next pose.

        Raises:
            FrameError: if the frame is unknown.
            ValueError: if the stamp is not finite.
        """
        _check_instant(stamp_s)
        track = self._track_of(child)
        motion = track.motion if len(track) else ANY_MOTION
        return self._with_tracks(self._tracks.with_entry(child, track.with_pose(stamp_s, None, IDENTITY, motion)))

    def without(self, name: str) -> Frames:
        """Return the frames without one frame and its history."""
        return self._with_tracks(self._tracks.without_key(name))

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
        return self._track_of(name)

    def parent(self, name: str, instant_s: float) -> str | None:
        """Return the parent of a frame at an instant; None if the frame has no parent.

        Raises:
            FrameError: if the frame is unknown.
        """
        placement = self._track_of(name).at(instant_s)
        return None if placement is None else placement.parent

    def transform(self, target: str, source: str, instant_s: float) -> Transform:
        """Return the pose of one frame in another, along the tree of an instant.

        Args:
            target: the frame in which the pose is expressed.
            source: the frame whose pose is returned.
            instant_s: the instant.

        Raises:
            FrameError: if a frame is unknown, or the two were not connected at the instant.
            ValueError: if the instant is NaN.
        """
        return self._cached_transform(target, source, instant_s)[0]

    def fresh_until_s(self, target: str, source: str, instant_s: float) -> float:
        """Return the instant until which no edge between two frames is stale, if no further poses arrive.

        Raises:
            FrameError: if a frame is unknown, or the two were not connected at the instant.
        """
        _, tracks = self._cached_transform(target, source, instant_s)
        return min((track.newest_s + track.motion.valid_for_s for _, track in tracks), default=math.inf)

    def next_update_s(self, target: str, source: str, instant_s: float) -> float:
        """Return when to compute the present transform again, if no further poses arrive; see `Track.next_update_s`.

        Raises:
            FrameError: if a frame is unknown, or the two were not connected at the instant.
        """
        _, tracks = self._cached_transform(target, source, instant_s)
        return min((track.next_update_s(instant_s) for _, track in tracks), default=math.inf)

    def frames_between(self, target: str, source: str, instant_s: float) -> tuple[str, ...]:
        """Return the frames whose poses determine the transform between two frames.

        Raises:
            FrameError: if a frame is unknown, or the two were not connected at the instant.
        """
        return tuple(name for name, _ in self._cached_transform(target, source, instant_s)[1])

    def _cached_transform(self, target: str, source: str, instant_s: float) -> _CachedTransform:
        key = (target, source, instant_s)
        entry = self._cache.get(key)
        if entry is not None:
            tracks = self._tracks
            for name, track in entry[1]:
                if tracks.get(name) is not track:
                    break
            else:
                return entry
        entry = self._compute_transform(target, source, instant_s)
        if len(self._cache) >= MAX_CACHED_TRANSFORMS:
            self._cache.clear()
        self._cache[key] = entry
        return entry

    def _with_tracks(self, tracks: PersistentMap[str, Track]) -> Frames:
        frames = Frames.__new__(Frames)
        frames._tracks, frames._cache = tracks, self._cache
        return frames

    def _compute_transform(
        self, target: str, source: str, instant_s: float
    ) -> tuple[Transform, tuple[tuple[str, Track], ...]]:
        if instant_s != instant_s:
            raise ValueError("the instant of a transform must not be NaN")
        source_placements, target_placements = (
            self._placements_to_root(source, instant_s),
            self._placements_to_root(target, instant_s),
        )
        common_frame = next((name for name in source_placements if name in target_placements), None)
        if common_frame is None:
            raise FrameError(
                f"{source!r} and {target!r} were not connected at {instant_s:g} s: "
                f"their roots were {list(source_placements)[-1]!r} and {list(target_placements)[-1]!r}"
            )
        source_chain, target_chain = (
            _placements_below(common_frame, source_placements),
            _placements_below(common_frame, target_placements),
        )
        source_pose, target_pose = _chained_pose(source_chain), _chained_pose(target_chain)
        chain = (*source_chain, *target_chain)
        worst_entry = max(
            [(placement.outcome, placement.gap_s, name) for name, placement in chain], default=_EXACT_OUTCOME
        )
        transform = Transform(
            pose=target_pose.inverse() @ source_pose if target_chain else source_pose,
            outcome=worst_entry[0],
            gap_s=max([placement.gap_s for _, placement in chain], default=0.0),
            weakest=worst_entry[2] if worst_entry[0] else "",
        )
        # The transform does not depend on the ancestors of the common frame.
        return transform, tuple([(name, self._tracks[name]) for name, _ in chain])

    def _placements_to_root(self, name: str, instant_s: float) -> dict[str, Placement | None]:
        """Return a frame and its ancestors at an instant, each with its placement."""
        placements: dict[str, Placement | None] = {}
        ancestor: str | None = name
        if name is None:
            raise FrameError("there is no frame None")
        while ancestor is not None:
            if ancestor in placements:  # before its history begins, a frame has its oldest pose: this can make a cycle
                raise FrameError(f"the ancestors of {name!r} at {instant_s:g} s are no longer in the history")
            placements[ancestor] = placement = self._track_of(ancestor).at(instant_s)
            ancestor = None if placement is None else placement.parent
        return placements

    def _track_of(self, name: str) -> Track:
        track = self._tracks.get(name)
        if track is None:
            raise FrameError(f"there is no frame {name!r}")
        return track

    def _is_descendant(self, name: str, ancestor: str, start_s: float, end_s: float) -> bool:
        """Return whether, at any instant of a half-open interval, a frame is `ancestor` or one of its descendants."""
        pending_spans = [(start_s, end_s, name)]
        while pending_spans:
            span_start_s, span_end_s, frame = pending_spans.pop()
            if frame == ancestor:
                return True
            track = self._tracks.get(frame)
            if track is not None:
                pending_spans.extend(track.parent_spans(span_start_s, span_end_s))
        return False


_EXACT_OUTCOME = (Outcome.EXACT, 0.0, "")


def _placements_below(common_frame: str, placements: dict[str, Placement | None]) -> list[tuple[str, Placement]]:
    """Return the placements below a common ancestor."""
    placements_below: list[tuple[str, Placement]] = []
    for name, placement in placements.items():
        if name == common_frame or placement is None:
            break
        placements_below.append((name, placement))
    return placements_below


def _chained_pose(placements: list[tuple[str, Placement]]) -> Pose:
    """Return the pose of the first frame in the parent of the last frame."""
    if not placements:
        return IDENTITY
    return compose_poses([placement.pose for _, placement in placements])


def _check_instant(stamp_s: float) -> None:
    if not math.isfinite(stamp_s):
        raise ValueError(f"a pose needs a finite stamp, not {stamp_s}")
