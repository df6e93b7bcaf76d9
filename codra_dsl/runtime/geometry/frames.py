"""The tree of frames: RT edges with their past, and the transform between any two frames at any instant (P2, 3.1).

A link from a frame to its parent has a stamp as well: what is asked about an instant follows the tree as it stood then.
Answers are kept, each with the tracks and links that it came from, and are given again only to who asks of these very
tracks: so a kept answer is never another than a fresh one.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from codra_dsl.runtime.geometry.motion import ANY_MOTION, Motion, Outcome, Standing, Track
from codra_dsl.runtime.geometry.pose import IDENTITY, Pose, chained
from codra_dsl.runtime.persistent import PersistentMap

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


_Answer = tuple[Transform, tuple[tuple[str, Track], ...]]
"""A transform, and the tracks that it came from."""


class Frames:
    """All frames of a world, as they are known at one time. It never changes: more that is said makes another.

    Those that came from each other keep their answers together.
    """

    __slots__ = ("_answers", "_tracks")

    def __init__(self) -> None:
        """Begin without frames."""
        self._tracks: PersistentMap[str, Track] = PersistentMap()
        self._answers: dict[tuple[str, str, float], _Answer] = {}

    def with_pose(self, child: str, parent: str, pose: Pose, stamp_s: float, motion: Motion = ANY_MOTION) -> Frames:
        """Return the frames, of which one stands somewhere from an instant on, until it is said to stand elsewhere.

        Args:
            child: the frame.
            parent: another frame.
            pose: of the child in the parent.
            stamp_s: when that was so; instants may come in any order.
            motion: how the child moves in this parent.

        Raises:
            FrameError: if the parent stands in the child at that time, directly or through others.
            ValueError: if the stamp is not finite, or the pose is no rigid motion.
        """
        _check_instant(stamp_s)
        if not isinstance(pose, Pose):
            raise ValueError(f"{child!r} stands at a Pose, not at a {type(pose).__name__}")
        pose = pose.checked()
        tracks, known = self._tracks, self._tracks.get(child)
        track = known or Track()
        goes_on = len(track) and track.parent == parent and stamp_s >= track.newest_s
        # In a frame that is new nothing stands, and one that moves on in its parent stood there until now.
        if child == parent or (
            known is not None and not goes_on and self._stands_in(parent, child, *track.reach(stamp_s))
        ):
            raise FrameError(f"{child!r} cannot stand in {parent!r} from {stamp_s:g} s on: that stands in it")
        if parent not in tracks:
            tracks = tracks.with_entry(parent, Track())
        return self._with(tracks.with_entry(child, track.with_pose(stamp_s, parent, pose, motion)))

    def without_parent(self, child: str, stamp_s: float) -> Frames:
        """Return the frames, of which one stands in nothing from an instant on, until it is said to stand somewhere.

        Raises:
            FrameError: if there is no such frame.
            ValueError: if the stamp is not finite.
        """
        _check_instant(stamp_s)
        track = self._known(child)
        motion = track.motion if len(track) else ANY_MOTION
        return self._with(self._tracks.with_entry(child, track.with_pose(stamp_s, None, IDENTITY, motion)))

    def without(self, name: str) -> Frames:
        """Return the frames as if one had never been."""
        return self._with(self._tracks.without(name))

    def __contains__(self, name: object) -> bool:
        return name in self._tracks

    def names(self) -> tuple[str, ...]:
        """Return all frames, in alphabetical order."""
        return tuple(sorted(self._tracks))

    def track(self, name: str) -> Track:
        """Return where a frame has stood.

        Raises:
            FrameError: if there is no such frame.
        """
        return self._known(name)

    def parent(self, name: str, instant_s: float) -> str | None:
        """Return the parent of a frame at an instant; None if it has none.

        Raises:
            FrameError: if there is no such frame.
        """
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
            ValueError: if the instant is NaN.
        """
        return self._answer(target, source, instant_s)[0]

    def fresh_until_s(self, target: str, source: str, instant_s: float) -> float:
        """Return until when no edge between two frames is stale, if nothing more is said of them.

        Raises:
            FrameError: if a frame is unknown, or the two were not connected at the instant.
        """
        _, tracks = self._answer(target, source, instant_s)
        return min((track.newest_s + track.motion.valid_for_s for _, track in tracks), default=math.inf)

    def next_s(self, target: str, source: str, instant_s: float) -> float:
        """Return when the transform of now is next to be asked again, if nothing more is said; see `Track.next_s`.

        Raises:
            FrameError: if a frame is unknown, or the two were not connected at the instant.
        """
        _, tracks = self._answer(target, source, instant_s)
        return min((track.next_s(instant_s) for _, track in tracks), default=math.inf)

    def between(self, target: str, source: str, instant_s: float) -> tuple[str, ...]:
        """Return the frames whose poses the transform between two frames comes from.

        Raises:
            FrameError: if a frame is unknown, or the two were not connected at the instant.
        """
        return tuple(name for name, _ in self._answer(target, source, instant_s)[1])

    # Within

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
            raise ValueError("a pose is asked for at an instant, not at NaN")
        ups, downs = self._climb(source, instant_s), self._climb(target, instant_s)
        common = next((name for name in ups if name in downs), None)
        if common is None:
            raise FrameError(
                f"{source!r} and {target!r} were not connected at {instant_s:g} s: "
                f"they stood in {list(ups)[-1]!r} and {list(downs)[-1]!r}"
            )
        up, down = _below(common, ups), _below(common, downs)
        inner, outer = _chained(up), _chained(down)
        parts = (*up, *down)
        worst = max([(each.outcome, each.gap_s, name) for name, each in parts], default=_CERTAIN)
        transform = Transform(
            pose=outer.inverse() @ inner if down else inner,
            outcome=worst[0],
            gap_s=max([each.gap_s for _, each in parts], default=0.0),
            weakest=worst[2] if worst[0] else "",
        )
        # What the common frame itself stands in plays no part.
        return transform, tuple([(name, self._tracks[name]) for name, _ in parts])

    def _climb(self, name: str, instant_s: float) -> dict[str, Standing | None]:
        """Return a frame, its parent at an instant, and so on to the root, each with where it stands."""
        found: dict[str, Standing | None] = {}
        above: str | None = name
        if name is None:
            raise FrameError("there is no frame None")
        while above is not None:
            if above in found:  # of a past whose end is not kept any more: each frame's oldest pose holds before it
                raise FrameError(f"what {name!r} stood in at {instant_s:g} s is not kept any more")
            found[above] = standing = self._known(above).at(instant_s)
            above = None if standing is None else standing.parent
        return found

    def _known(self, name: str) -> Track:
        track = self._tracks.get(name)
        if track is None:
            raise FrameError(f"there is no frame {name!r}")
        return track

    def _stands_in(self, name: str, outer: str, start_s: float, end_s: float) -> bool:
        """Return whether a frame stands in another at some instant from one until before another."""
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
    return chained([standing.pose for _, standing in standings])


def _check_instant(stamp_s: float) -> None:
    if not math.isfinite(stamp_s):
        raise ValueError(f"a pose has an instant, not {stamp_s}")
