"""The tree of frames: RT edges with their past, and the transform between any two frames at any instant (P2, 3.1).

A link from a frame to its parent has a stamp as well: what is asked about an instant follows the tree as it stood then.
Answers are kept, each with the tracks and links that it came from, and are given again only while none of these has
changed: so a kept answer is never another than a fresh one.
"""

from __future__ import annotations

import math
from contextlib import AbstractContextManager
from dataclasses import dataclass
from threading import RLock

from codra_dsl.runtime.geometry.motion import Motion, Outcome, Standing, Track
from codra_dsl.runtime.geometry.pose import IDENTITY, Pose

MOST_KEPT = 4096
"""Answers that are kept at most."""


class FrameError(LookupError):
    """Frames are unknown, were not connected at an instant, or would be in themselves."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Transform:
    """Where one frame stands in another at an instant.

    Attributes:
        pose: of the source in the target: it turns points of the source into points of the target.
        outcome: the worst along the chain.
        gap_s: the longest time along the chain between the instant and the nearest pose that was measured.
        weakest: the frame whose edge has the worst outcome, the one with the longest gap if several have; empty if all
            are exact.
    """

    pose: Pose
    outcome: Outcome = Outcome.EXACT
    gap_s: float = 0.0
    weakest: str = ""


@dataclass(frozen=True, slots=True)
class _Kept:
    transform: Transform
    tracks: tuple[tuple[Track, int], ...]


class Frames:
    """All frames of a world. Threads may share it."""

    def __init__(self, lock: AbstractContextManager[object] | None = None) -> None:
        """Begin without frames.

        Args:
            lock: taken for each call, and by whoever wants several calls to see one state; by default one of its own.
        """
        self.lock = RLock() if lock is None else lock
        self._tracks: dict[str, Track] = {}
        self._kept: dict[tuple[str, str, float], _Kept] = {}

    def declare(self, name: str, motion: Motion) -> None:
        """Say how a frame moves in its parents; a frame that is not declared moves as `Motion()` says.

        Raises:
            FrameError: if poses of the frame are there already.
        """
        with self.lock:
            if self._tracks.get(name):
                raise FrameError(f"frame {name!r} has poses already: declare it before its first one")
            self._tracks[name] = Track(motion)

    def set(self, child: str, parent: str, pose: Pose, stamp_s: float) -> None:
        """Say where a frame stands at an instant; it stands in that parent until it is said to stand in another.

        Args:
            child: the frame.
            parent: another frame.
            pose: of the child in the parent.
            stamp_s: when that was so; instants may come in any order.

        Raises:
            FrameError: if the parent stands in the child at that time, directly or through others.
            ValueError: if the stamp is not finite.
        """
        _check_instant(stamp_s)
        with self.lock:
            track = self._track(child)
            if child == parent or self._stands_in(parent, child, *track.reach(stamp_s)):
                raise FrameError(f"{child!r} cannot stand in {parent!r} from {stamp_s:g} s on: that stands in it")
            self._track(parent)
            track.write(stamp_s, parent, pose)

    def remove(self, child: str, stamp_s: float) -> None:
        """Say that a frame stands in nothing from an instant on, until it is said to stand somewhere.

        Raises:
            FrameError: if there is no such frame.
            ValueError: if the stamp is not finite.
        """
        _check_instant(stamp_s)
        with self.lock:
            self._known(child).write(stamp_s, None, IDENTITY)

    def names(self) -> tuple[str, ...]:
        """Return all frames, in the order in which they came."""
        with self.lock:
            return tuple(self._tracks)

    def parent(self, name: str, instant_s: float) -> str | None:
        """Return the parent of a frame at an instant; None if it has none.

        Raises:
            FrameError: if there is no such frame.
        """
        with self.lock:
            standing = self._known(name).at(instant_s)
            return None if standing is None else standing.parent

    def transform(self, target: str, source: str, instant_s: float) -> Transform:
        """Return where a frame stands in another, along the tree as it stood at an instant.

        Args:
            target: the frame to express it in.
            source: the frame that is asked about.
            instant_s: when.

        Raises:
            FrameError: if a frame is unknown, or the two were not connected then.
        """
        key = (target, source, instant_s)
        with self.lock:
            kept = self._kept.get(key)
            if kept is not None:
                for track, version in kept.tracks:
                    if track.version != version:
                        break
                else:
                    return kept.transform
            fresh = self._computed(target, source, instant_s)
            if len(self._kept) >= MOST_KEPT:
                self._kept.clear()
            self._kept[key] = fresh
            return fresh.transform

    # Within

    def _computed(self, target: str, source: str, instant_s: float) -> _Kept:
        ups, downs = self._climb(source, instant_s), self._climb(target, instant_s)
        common = next((name for name in ups if name in downs), None)
        if common is None:
            raise FrameError(
                f"{source!r} and {target!r} were not connected at {instant_s:g} s: "
                f"they stood in {list(ups)[-1]!r} and {list(downs)[-1]!r}"
            )
        up, down = _below(common, ups), _below(common, downs)
        inner, outer = _chained(up), _chained(down)
        worst = max(((each.outcome, each.gap_s, name) for name, each in (*up, *down)), default=_CERTAIN)
        transform = Transform(
            pose=outer.inverse() @ inner if down else inner,
            outcome=worst[0],
            gap_s=max((each.gap_s for _, each in (*up, *down)), default=0.0),
            weakest=worst[2] if worst[0] else "",
        )
        # What the common frame itself stands in plays no part.
        tracks = [self._tracks[name] for name, _ in (*up, *down)]
        return _Kept(transform, tuple((track, track.version) for track in tracks))

    def _climb(self, name: str, instant_s: float) -> dict[str, Standing | None]:
        """Return a frame, its parent at an instant, and so on to the root, each with where it stands."""
        found: dict[str, Standing | None] = {}
        above: str | None = name
        while above is not None:
            if above in found:  # of a past whose end is not kept any more: each frame's oldest pose holds before it
                raise FrameError(f"what {name!r} stood in at {instant_s:g} s is not kept any more")
            found[above] = standing = self._known(above).at(instant_s)
            above = None if standing is None else standing.parent
        return found

    def _known(self, name: str) -> Track:
        if name not in self._tracks:
            raise FrameError(f"there is no frame {name!r}")
        return self._tracks[name]

    def _track(self, name: str) -> Track:
        if name not in self._tracks:
            self._tracks[name] = Track(Motion())
        return self._tracks[name]

    def _stands_in(self, name: str, outer: str, start_s: float, end_s: float) -> bool:
        """Return whether a frame stands in another at some instant from one until before another."""
        if name not in self._tracks:
            return False
        return any(
            parent == outer or self._stands_in(parent, outer, from_s, until_s)
            for from_s, until_s, parent in self._tracks[name].spans(start_s, end_s)
        )


_CERTAIN = (Outcome.EXACT, 0.0, "")


def _below(common: str, climbed: dict[str, Standing | None]) -> list[tuple[str, Standing]]:
    """Return what was climbed until a frame was reached."""
    below: list[tuple[str, Standing]] = []
    for name, standing in climbed.items():
        if name == common or standing is None:
            break
        below.append((name, standing))
    return below


def _chained(standings: list[tuple[str, Standing]]) -> Pose:
    """Return where the first frame stands in the parent of the last."""
    if not standings:
        return IDENTITY
    pose = standings[0][1].pose
    for _, standing in standings[1:]:
        pose = standing.pose @ pose
    return pose


def _check_instant(stamp_s: float) -> None:
    if not math.isfinite(stamp_s):
        raise ValueError(f"a pose has an instant, not {stamp_s}")
