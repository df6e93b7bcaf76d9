"""How one frame moved in its parent: stamped poses, and what they tell about an instant between or beyond them."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

from codra_dsl.runtime.geometry.pose import Pose


class Outcome(IntEnum):
    """How a pose at an instant was come by, the most trustworthy first: a chain is as good as its worst part."""

    EXACT = 0
    INTERPOLATED = 1
    EXTRAPOLATED = 2
    CLAMPED = 3
    STALE = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """What is declared of an edge.

    Attributes:
        history_s: how far back poses are kept, counted from the newest.
        extrapolate_s: how far beyond the newest pose its motion is taken to go on.
        valid_for_s: how long the newest pose is worth something: beyond, it is stale.
        is_static: whether the frame only moves in steps: then a pose holds, exactly, until the next one.
    """

    history_s: float = 10.0
    extrapolate_s: float = 0.0
    valid_for_s: float = math.inf
    is_static: bool = False


ANY_MOTION = Motion()

LOOK_S = 0.01
"""How often to ask where a frame stands whose motion is taken to go on."""

_MOST_DROPPED = 64
"""Poses in front of the history that lists hold at least until they are copied without them."""


class Standing(NamedTuple):
    """Where a frame stands at an instant.

    Attributes:
        parent: the frame in which it stands; None if in none.
        pose: in the parent.
        outcome: how the pose was come by.
        gap_s: how far the instant is from the nearest pose that was measured.
    """

    parent: str | None
    pose: Pose
    outcome: Outcome = Outcome.EXACT
    gap_s: float = 0.0


class Track:
    """The stamped poses of one frame, each in the parent and with the motion that it had then. It never changes.

    Tracks share their lists. One that is longer by a newer pose appends it to the list that the shorter one has, which
    does not look beyond its own end; whatever else is changed makes new lists.
    """

    __slots__ = ("_end", "_motions", "_parents", "_poses", "_stamps_s", "_start")

    def __init__(self) -> None:
        """Know of no pose."""
        self._stamps_s: list[float] = []
        self._parents: list[str | None] = []
        self._poses: list[Pose] = []
        self._motions: list[Motion] = []
        self._start = 0
        self._end = 0

    def __len__(self) -> int:
        return self._end - self._start

    @property
    def newest_s(self) -> float:
        """Return the instant of the newest pose."""
        return self._stamps_s[self._end - 1]

    @property
    def parent(self) -> str | None:
        """Return the parent by the newest pose; None if the frame stands in nothing."""
        return self._parents[self._end - 1] if self._end else None

    @property
    def motion(self) -> Motion:
        """Return what is declared of the edge on which the frame stands now."""
        return self._motions[self._end - 1]

    def with_pose(self, stamp_s: float, parent: str | None, pose: Pose, motion: Motion) -> Track:
        """Return the track with one more pose.

        One of the same instant is replaced, one that is older than the history is dropped. Tracks that share lists are
        changed by one thread at a time.
        """
        made = Track.__new__(Track)
        if (not self._end or stamp_s > self._stamps_s[self._end - 1]) and len(self._motions) == self._end:
            self._share_with(made, self._start)
            made._stamps_s.append(stamp_s)
            made._parents.append(parent)
            made._poses.append(pose)
            made._motions.append(motion)  # the last, by which a track sees that nobody has appended yet
            made._end = self._end + 1
        else:
            made._copy(self)
            made._put(stamp_s, parent, pose, motion)
        made._drop_old()
        return made

    def at(self, instant_s: float) -> Standing | None:
        """Return where the frame stands at an instant; None if nothing is known of it."""
        stamps_s, start = self._stamps_s, self._start
        if start == self._end:
            return None
        last = bisect_right(stamps_s, instant_s, start, self._end) - 1
        if last < start:
            return Standing(self._parents[start], self._poses[start], Outcome.CLAMPED, stamps_s[start] - instant_s)
        gap_s = instant_s - stamps_s[last]
        if gap_s == 0.0 or self._motions[last].is_static:
            return Standing(self._parents[last], self._poses[last])
        if last + 1 < self._end and self._goes_on(last):
            return self._between(last, gap_s)
        return self._beyond(last, gap_s)

    def next_s(self, instant_s: float) -> float:
        """Return when what is told of the present is next to be asked again though nothing more is said of the frame.

        That is `LOOK_S` later while its motion is taken to go on, and when that or its validity ends; infinite if it
        stands still for good.
        """
        if self._start == self._end or self.motion.is_static or self.parent is None:
            return math.inf
        last, motion, newest_s = self._end - 1, self.motion, self.newest_s
        gap_s = instant_s - newest_s
        if gap_s >= motion.valid_for_s:
            return math.inf
        stale_s = math.inf if motion.valid_for_s == math.inf else _first_at(newest_s, motion.valid_for_s)
        is_told_to_move = last > self._start and self._goes_on(last - 1) and self._poses[last - 1] != self._poses[last]
        if gap_s > motion.extrapolate_s or not is_told_to_move:
            return stale_s
        stops_s = _first_at(newest_s, math.nextafter(motion.extrapolate_s, math.inf))
        return min(stale_s, stops_s, instant_s + LOOK_S)

    def spans(self, start_s: float, end_s: float) -> Iterator[tuple[float, float, str]]:
        """Yield the parents from one instant until before another, each with the time for which it was the parent."""
        first = max(self._start, bisect_right(self._stamps_s, start_s, self._start, self._end) - 1)
        for position in range(first, self._end):
            parent = self._parents[position]
            from_s = max(start_s, self._stamps_s[position] if position > self._start else -math.inf)
            until_s = min(end_s, self._until_s(position))
            if parent is not None and from_s < until_s:
                yield from_s, until_s, parent

    def reach(self, stamp_s: float) -> tuple[float, float]:
        """Return from when until when a pose of an instant would say where the frame stands."""
        after, start = bisect_right(self._stamps_s, stamp_s, self._start, self._end), self._start
        is_first = after == start or (after == start + 1 and self._stamps_s[start] == stamp_s)
        return -math.inf if is_first else stamp_s, self._until_s(after - 1)

    def _until_s(self, position: int) -> float:
        return self._stamps_s[position + 1] if position + 1 < self._end else math.inf

    def _goes_on(self, position: int) -> bool:
        """Return whether the frame moves from one pose to the next, in one parent and in one way."""
        motion, after = self._motions[position], self._motions[position + 1]
        return self._parents[position + 1] == self._parents[position] and (after is motion or after == motion)

    def _between(self, last: int, gap_s: float) -> Standing:
        span_s = self._stamps_s[last + 1] - self._stamps_s[last]
        pose = self._poses[last].towards(self._poses[last + 1], gap_s / span_s)
        return Standing(self._parents[last], pose, Outcome.INTERPOLATED, min(gap_s, span_s - gap_s))

    def _beyond(self, last: int, gap_s: float) -> Standing:
        """Return where the frame stands some time after its last pose in a parent."""
        parent, pose, motion = self._parents[last], self._poses[last], self._motions[last]
        if gap_s >= motion.valid_for_s:
            return Standing(parent, pose, Outcome.STALE, gap_s)
        if gap_s > motion.extrapolate_s:
            return Standing(parent, pose, Outcome.CLAMPED, gap_s)
        if last > self._start and self._goes_on(last - 1):
            span_s = self._stamps_s[last] - self._stamps_s[last - 1]
            pose = self._poses[last - 1].towards(pose, 1.0 + gap_s / span_s)
        return Standing(parent, pose, Outcome.EXTRAPOLATED, gap_s)

    def _share_with(self, other: Track, start: int) -> None:
        other._stamps_s, other._parents = self._stamps_s, self._parents
        other._poses, other._motions = self._poses, self._motions
        other._start, other._end = start, self._end

    def _copy(self, other: Track) -> None:
        seen = slice(other._start, other._end)
        self._stamps_s, self._parents = other._stamps_s[seen], other._parents[seen]
        self._poses, self._motions = other._poses[seen], other._motions[seen]
        self._start, self._end = 0, len(self._stamps_s)

    def _put(self, stamp_s: float, parent: str | None, pose: Pose, motion: Motion) -> None:
        """Put a pose into lists of its own."""
        position = bisect_left(self._stamps_s, stamp_s)
        end = position + (position < self._end and self._stamps_s[position] == stamp_s)
        self._stamps_s[position:end] = [stamp_s]
        self._parents[position:end] = [parent]
        self._poses[position:end] = [pose]
        self._motions[position:end] = [motion]
        self._end = len(self._stamps_s)

    def _drop_old(self) -> None:
        """Drop what is older than the history, but for the last pose before it: it tells where the history begins."""
        begin_s = self._stamps_s[self._end - 1] - self._motions[self._end - 1].history_s
        self._start = max(self._start, bisect_right(self._stamps_s, begin_s, self._start, self._end) - 1)
        if self._start > _MOST_DROPPED and self._start > self._end // 2:
            self._copy(self)


def _first_at(stamp_s: float, gap_s: float) -> float:
    """Return the first instant that is some time after another, by what subtracting them gives."""
    instant_s = stamp_s + gap_s
    while instant_s - stamp_s < gap_s:
        instant_s = math.nextafter(instant_s, math.inf)
    return instant_s
