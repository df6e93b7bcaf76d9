"""How one frame moved in its parent: stamped poses, and what they tell about an instant between or beyond them."""

from __future__ import annotations

import math
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass
from enum import IntEnum

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
        is_static: whether the frame only ever moves in steps: then a pose holds, exactly, until the next one.
    """

    history_s: float = 10.0
    extrapolate_s: float = 0.0
    valid_for_s: float = math.inf
    is_static: bool = False


STATIC = Motion(history_s=math.inf, is_static=True)


@dataclass(frozen=True, slots=True)
class Standing:
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
    """The stamped poses of one frame, each in the parent that it had then. Readers and writers hold the same lock.

    Attributes:
        motion: what is declared of the frame's edge.
        version: counts changes, so that whoever keeps an answer knows whether it still holds.
    """

    __slots__ = ("_parents", "_poses", "_stamps_s", "motion", "version")

    def __init__(self, motion: Motion) -> None:
        self.motion = motion
        self.version = 0
        self._stamps_s: list[float] = []
        self._parents: list[str | None] = []
        self._poses: list[Pose] = []

    def __len__(self) -> int:
        return len(self._stamps_s)

    def write(self, stamp_s: float, parent: str | None, pose: Pose) -> None:
        """Take a pose; one of the same instant is replaced, one that is older than the history is dropped."""
        position = bisect_left(self._stamps_s, stamp_s)
        end = position + (position < len(self._stamps_s) and self._stamps_s[position] == stamp_s)
        self._stamps_s[position:end] = [stamp_s]
        self._parents[position:end] = [parent]
        self._poses[position:end] = [pose]
        self._drop_old()
        self.version += 1

    def at(self, instant_s: float) -> Standing | None:
        """Return where the frame stands at an instant; None if nothing is known of it."""
        stamps_s = self._stamps_s
        if not stamps_s:
            return None
        last = bisect_right(stamps_s, instant_s) - 1
        if last < 0:
            return Standing(self._parents[0], self._poses[0], Outcome.CLAMPED, stamps_s[0] - instant_s)
        gap_s = instant_s - stamps_s[last]
        if gap_s == 0.0 or self.motion.is_static:
            return Standing(self._parents[last], self._poses[last])
        if last + 1 < len(stamps_s) and self._parents[last + 1] == self._parents[last]:
            return self._between(last, gap_s)
        return self._beyond(last, gap_s)

    def spans(self, start_s: float, end_s: float) -> Iterator[tuple[float, float, str]]:
        """Yield the parents from one instant until before another, each with the time for which it was the parent."""
        for position, parent in enumerate(self._parents):
            from_s = max(start_s, self._stamps_s[position] if position else -math.inf)
            until_s = min(end_s, self._until_s(position))
            if parent is not None and from_s < until_s:
                yield from_s, until_s, parent

    def reach(self, stamp_s: float) -> tuple[float, float]:
        """Return from when until when a pose of an instant would say where the frame stands."""
        after = bisect_right(self._stamps_s, stamp_s)
        is_first = after == 0 or (after == 1 and self._stamps_s[0] == stamp_s)
        return -math.inf if is_first else stamp_s, self._until_s(after - 1)

    def _until_s(self, position: int) -> float:
        return self._stamps_s[position + 1] if position + 1 < len(self._stamps_s) else math.inf

    def _between(self, last: int, gap_s: float) -> Standing:
        span_s = self._stamps_s[last + 1] - self._stamps_s[last]
        pose = self._poses[last].towards(self._poses[last + 1], gap_s / span_s)
        return Standing(self._parents[last], pose, Outcome.INTERPOLATED, min(gap_s, span_s - gap_s))

    def _beyond(self, last: int, gap_s: float) -> Standing:
        """Return where the frame stands some time after its last pose in a parent."""
        parent, pose = self._parents[last], self._poses[last]
        if gap_s >= self.motion.valid_for_s:
            return Standing(parent, pose, Outcome.STALE, gap_s)
        if gap_s > self.motion.extrapolate_s:
            return Standing(parent, pose, Outcome.CLAMPED, gap_s)
        if last > 0 and self._parents[last - 1] == parent:
            span_s = self._stamps_s[last] - self._stamps_s[last - 1]
            pose = self._poses[last - 1].towards(pose, 1.0 + gap_s / span_s)
        return Standing(parent, pose, Outcome.EXTRAPOLATED, gap_s)

    def _drop_old(self) -> None:
        """Drop what is older than the history, but for the last pose before it: it tells where the history begins."""
        count = bisect_right(self._stamps_s, self._stamps_s[-1] - self.motion.history_s) - 1
        if count > 0:
            del self._stamps_s[:count], self._parents[:count], self._poses[:count]
