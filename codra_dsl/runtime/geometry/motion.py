"""The motion of one frame in its parent: stamped poses, and poses at instants between and beyond them."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from codra_dsl.runtime.geometry.pose import Pose


class Outcome(IntEnum):
    """How a pose at an instant was determined; the most trustworthy outcome is first.

    The outcome of a chain of poses is the worst outcome of these poses.
    """

    EXACT = 0
    INTERPOLATED = 1
    EXTRAPOLATED = 2
    CLAMPED = 3
    STALE = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """The declared motion of an edge.

    Attributes:
        history_s: how far back poses are kept, counted from the newest pose.
        extrapolate_s: for how long after the newest pose the motion is extrapolated.
        valid_for_s: how long the newest pose is valid; afterwards it is stale.
        is_static: whether the frame moves only in steps; then each pose holds exactly until the next one.
    """

    history_s: float = 10.0
    extrapolate_s: float = 0.0
    valid_for_s: float = math.inf
    is_static: bool = False


ANY_MOTION = Motion()

EXTRAPOLATION_UPDATE_PERIOD_S = 0.01
"""The time after which the pose of a frame is computed again while its motion is extrapolated."""

_MIN_OUTDATED_POSES = 64
"""A track's lists are copied without their outdated poses only if more poses than this number are outdated."""


class Placement(NamedTuple):
    """The parent and pose of a frame at an instant.

    Attributes:
        parent: the parent of the frame; None if the frame has no parent.
        pose: the pose in the parent.
        outcome: how the pose was determined.
        gap_s: the time between the instant and the nearest measured pose.
    """

    parent: str | None
    pose: Pose
    outcome: Outcome = Outcome.EXACT
    gap_s: float = 0.0


class TrackEntry(NamedTuple):
    """One stamped pose of a track, with its parent (None if the frame has no parent from then on) and its motion."""

    stamp_s: float
    parent: str | None
    pose: Pose
    motion: Motion


class Track:
    """The stamped poses of one frame. Each pose has a parent and a motion. Objects are immutable.

    Tracks share their lists. A newer pose is appended to the shared lists; tracks without this pose read the lists only
    up to their own ends. Any other change makes new lists.
    """

    __slots__ = ("_end", "_motions", "_parents", "_poses", "_stamps_s", "_start")

    def __init__(self) -> None:
        """Begin without poses."""
        self._stamps_s: list[float] = []
        self._parents: list[str | None] = []
        self._poses: list[Pose] = []
        self._motions: list[Motion] = []
        self._start = 0
        self._end = 0

    @classmethod
    def of(cls, entries: Iterable[TrackEntry]) -> Track:
        """Return the track with these entries, which are ordered by their stamps."""
        track = cls()
        for entry in entries:
            track._stamps_s.append(entry.stamp_s)
            track._parents.append(entry.parent)
            track._poses.append(entry.pose)
            track._motions.append(entry.motion)
        track._end = len(track._stamps_s)
        return track

    def entries(self) -> Iterator[TrackEntry]:
        """Yield the entries, the oldest first."""
        for position in range(self._start, self._end):
            yield TrackEntry(
                self._stamps_s[position], self._parents[position], self._poses[position], self._motions[position]
            )

    def __len__(self) -> int:
        return self._end - self._start

    @property
    def newest_s(self) -> float:
        """Return the instant of the newest pose."""
        return self._stamps_s[self._end - 1]

    @property
    def parent(self) -> str | None:
        """Return the parent of the newest pose; None if the frame has no parent."""
        return self._parents[self._end - 1] if self._end else None

    @property
    def motion(self) -> Motion:
        """Return the declared motion of the frame's present edge."""
        return self._motions[self._end - 1]

    def with_pose(self, stamp_s: float, parent: str | None, pose: Pose, motion: Motion) -> Track:
        """Return the track with one more pose.

        The pose replaces a pose of the same instant; poses that are older than the history are dropped. Only one thread
        at a time may change tracks that share lists.
        """
        track = Track.__new__(Track)
        if (not self._end or stamp_s > self._stamps_s[self._end - 1]) and len(self._motions) == self._end:
            self._share_with(track, self._start)
            track._stamps_s.append(stamp_s)
            track._parents.append(parent)
            track._poses.append(pose)
            # `_motions` is extended last: other tracks read its length to see whether the lists have grown.
            track._motions.append(motion)
            track._end = self._end + 1
        else:
            track._copy(self)
            track._insert_pose(stamp_s, parent, pose, motion)
        track._drop_old_poses()
        return track

    def at(self, instant_s: float) -> Placement | None:
        """Return the placement of the frame at an instant; None if there is no pose."""
        stamps_s, start = self._stamps_s, self._start
        if start == self._end:
            return None
        last_position = bisect_right(stamps_s, instant_s, start, self._end) - 1
        if last_position < start:
            return Placement(self._parents[start], self._poses[start], Outcome.CLAMPED, stamps_s[start] - instant_s)
        gap_s = instant_s - stamps_s[last_position]
        if gap_s == 0.0 or self._motions[last_position].is_static:
            return Placement(self._parents[last_position], self._poses[last_position])
        if last_position + 1 < self._end and self._has_same_edge_as_next(last_position):
            return self._interpolated_placement(last_position, gap_s)
        return self._placement_after_pose(last_position, gap_s)

    def next_update_s(self, instant_s: float) -> float:
        """Return when to compute the present placement again, if no further poses arrive.

        This is the earliest of three instants: while the motion is extrapolated, the present instant plus
        `EXTRAPOLATION_UPDATE_PERIOD_S`; the end of the extrapolation; the end of validity. If the placement no longer
        changes, infinity is returned.
        """
        if self._start == self._end or self.motion.is_static or self.parent is None:
            return math.inf
        last_position, motion, newest_s = self._end - 1, self.motion, self.newest_s
        gap_s = instant_s - newest_s
        if gap_s >= motion.valid_for_s:
            return math.inf
        stale_s = math.inf if motion.valid_for_s == math.inf else _first_instant_s(newest_s, motion.valid_for_s)
        is_moving = (
            last_position > self._start
            and self._has_same_edge_as_next(last_position - 1)
            and self._poses[last_position - 1] != self._poses[last_position]
        )
        if gap_s > motion.extrapolate_s or not is_moving:
            return stale_s
        extrapolation_end_s = _first_instant_s(newest_s, math.nextafter(motion.extrapolate_s, math.inf))
        return min(stale_s, extrapolation_end_s, instant_s + EXTRAPOLATION_UPDATE_PERIOD_S)

    def parent_spans(self, start_s: float, end_s: float) -> Iterator[tuple[float, float, str]]:
        """Yield the parents in a half-open interval, each with the part of the interval in which it was the parent."""
        first = max(self._start, bisect_right(self._stamps_s, start_s, self._start, self._end) - 1)
        for position in range(first, self._end):
            parent = self._parents[position]
            span_start_s = max(start_s, self._stamps_s[position] if position > self._start else -math.inf)
            span_end_s = min(end_s, self._pose_end_s(position))
            if parent is not None and span_start_s < span_end_s:
                yield span_start_s, span_end_s, parent

    def affected_interval(self, stamp_s: float) -> tuple[float, float]:
        """Return the interval in which a pose with a given stamp would determine the parent of the frame."""
        next_position, start = bisect_right(self._stamps_s, stamp_s, self._start, self._end), self._start
        is_first = next_position == start or (next_position == start + 1 and self._stamps_s[start] == stamp_s)
        return -math.inf if is_first else stamp_s, self._pose_end_s(next_position - 1)

    def _pose_end_s(self, position: int) -> float:
        return self._stamps_s[position + 1] if position + 1 < self._end else math.inf

    def _has_same_edge_as_next(self, position: int) -> bool:
        """Return whether a pose and the next one have the same parent and motion."""
        motion, next_motion = self._motions[position], self._motions[position + 1]
        return self._parents[position + 1] == self._parents[position] and (
            next_motion is motion or next_motion == motion
        )

    def _interpolated_placement(self, position: int, gap_s: float) -> Placement:
        span_s = self._stamps_s[position + 1] - self._stamps_s[position]
        pose = self._poses[position].towards(self._poses[position + 1], gap_s / span_s)
        return Placement(self._parents[position], pose, Outcome.INTERPOLATED, min(gap_s, span_s - gap_s))

    def _placement_after_pose(self, last_position: int, gap_s: float) -> Placement:
        """Return the placement `gap_s` after a pose, if the next pose is missing or has another parent or motion."""
        parent, pose, motion = self._parents[last_position], self._poses[last_position], self._motions[last_position]
        if gap_s >= motion.valid_for_s:
            return Placement(parent, pose, Outcome.STALE, gap_s)
        if gap_s > motion.extrapolate_s:
            return Placement(parent, pose, Outcome.CLAMPED, gap_s)
        if last_position > self._start and self._has_same_edge_as_next(last_position - 1):
            span_s = self._stamps_s[last_position] - self._stamps_s[last_position - 1]
            pose = self._poses[last_position - 1].towards(pose, 1.0 + gap_s / span_s)
        return Placement(parent, pose, Outcome.EXTRAPOLATED, gap_s)

    def _share_with(self, other: Track, start: int) -> None:
        other._stamps_s, other._parents = self._stamps_s, self._parents
        other._poses, other._motions = self._poses, self._motions
        other._start, other._end = start, self._end

    def _copy(self, other: Track) -> None:
        used_slice = slice(other._start, other._end)
        self._stamps_s, self._parents = other._stamps_s[used_slice], other._parents[used_slice]
        self._poses, self._motions = other._poses[used_slice], other._motions[used_slice]
        self._start, self._end = 0, len(self._stamps_s)

    def _insert_pose(self, stamp_s: float, parent: str | None, pose: Pose, motion: Motion) -> None:
        """Insert a pose into the lists of this track, which no other track shares."""
        position = bisect_left(self._stamps_s, stamp_s)
        end = position + (position < self._end and self._stamps_s[position] == stamp_s)
        self._stamps_s[position:end] = [stamp_s]
        self._parents[position:end] = [parent]
        self._poses[position:end] = [pose]
        self._motions[position:end] = [motion]
        self._end = len(self._stamps_s)

    def _drop_old_poses(self) -> None:
        """Drop poses that are older than the history, except the last of them, which holds when the history begins."""
        begin_s = self._stamps_s[self._end - 1] - self._motions[self._end - 1].history_s
        self._start = max(self._start, bisect_right(self._stamps_s, begin_s, self._start, self._end) - 1)
        if self._start > _MIN_OUTDATED_POSES and self._start > self._end // 2:
            self._copy(self)


def _first_instant_s(stamp_s: float, gap_s: float) -> float:
    """Return the first instant whose floating-point difference to a stamp is at least the given duration."""
    instant_s = stamp_s + gap_s
    while instant_s - stamp_s < gap_s:
        instant_s = math.nextafter(instant_s, math.inf)
    return instant_s
