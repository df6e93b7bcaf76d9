"""The state of the laboratory at any instant: a pure function of time and of the moves that are scheduled so far.

Nothing in this module runs in the background, and the state does not depend on who reads it.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Callable, Mapping, Sequence
from copy import copy
from dataclasses import dataclass, field, replace
from enum import StrEnum
from math import cos, pi, sin
from random import Random
from threading import Lock
from types import MappingProxyType

from codra_papers.lab.perception.layout import Part
from codra_papers.lab.perception.poses import Pose, camera_at, planar
from codra_papers.lab.simulator.laboratory import LABORATORY, Laboratory, Mount

Values = tuple[float, ...]
Path = Callable[[float], Values]


class Quantity(StrEnum):
    """The quantities that change, other than the angles of the machines' joints.

    Each text below states the numbers that describe the quantity.
    """

    BASE = "base"
    """x, y in metres and heading in radians of the robot's base in the map."""
    GAZE = "gaze"
    """The camera's position and a point that it looks at, both in the robot's base frame: six numbers in metres."""
    MAST = "mast"
    """The point that the camera on the mast looks at, in the robot's base frame: three numbers in metres."""
    REACH = "reach"
    """How far the hand extends past the camera: from 0 (behind the camera, out of sight) to 1."""
    OPENING = "opening"
    """The gap between the fingers in metres."""
    HOLDING = "holding"
    """Whether the hand holds a sample tray: 0 or 1."""
    LIGHT = "light"
    """The light in the room: 1 is an ordinary day, 0 is dark."""
    LOCALIZED = "localized"
    """Whether the robot is localised: 0 or 1."""
    PERSON = "person"
    """The position of a visitor: x and y in metres in the map."""


@dataclass(frozen=True, slots=True, order=True)
class JointKey:
    """The joint that moves one part of one machine. Its value is the angle in radians."""

    machine: str
    part: Part


Channel = Quantity | JointKey


@dataclass(frozen=True, slots=True, kw_only=True)
class Move:
    """A smooth move of one channel. It begins and ends at rest.

    Attributes:
        channel: the channel that moves.
        path: the values as a function of the progress from 0 to 1. At 0 they must be the values before the move.
        duration_s: how long the move takes; 0 for a jump.
        delay_s: the time from the instant of scheduling to the start of the move.
    """

    channel: Channel
    path: Path
    duration_s: float
    delay_s: float = 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LabState:
    """The complete state at one instant, for cameras and ground truth.

    Attributes:
        base: x, y in metres and heading in radians of the robot's base in the map.
        eye_m: the position of the arm's camera, in the robot's base frame.
        target_m: a point on the axis of the arm's camera, in the robot's base frame.
        mast_target_m: a point on the axis of the camera on the mast, in the robot's base frame.
        reach: how far the hand extends past the camera, from 0 to 1.
        opening_m: the gap between the fingers.
        is_holding: whether the hand holds a sample tray.
        light: the light in the room: 1 is that of an ordinary day, 0 is dark.
        joints_rad: the angles of all joints of machines.
        person_m: x and y of a visitor in the map.
        laboratory: the description of the laboratory.
    """

    t_s: float
    base: tuple[float, float, float]
    eye_m: tuple[float, float, float]
    target_m: tuple[float, float, float]
    mast_target_m: tuple[float, float, float]
    reach: float
    opening_m: float
    is_holding: bool
    light: float
    is_localized: bool
    joints_rad: Mapping[JointKey, float]
    person_m: tuple[float, float]
    laboratory: Laboratory

    def map_from_robot(self) -> Pose:
        """Return the true pose of the robot's base."""
        return planar(*self.base)

    def robot_from_hand(self) -> Pose:
        """Return the pose of the arm's camera, which is also that of the hand, in the robot's base frame."""
        return camera_at(self.eye_m, self.target_m)

    def robot_from_camera(self) -> Pose:
        """Return the pose of the laboratory's camera in the robot's base frame."""
        if self.laboratory.camera is Mount.PAN_TILT:
            return camera_at(MAST_CAMERA_M, self.mast_target_m)
        return self.robot_from_hand()

    def map_from_camera(self) -> Pose:
        """Return the true pose of the camera (x right, y down, z forward)."""
        return self.map_from_robot() @ self.robot_from_camera()

    def map_from_part(self, machine: str, part: Part) -> Pose:
        """Return the true pose of a part of a machine."""
        angle_rad = self.joints_rad.get(JointKey(machine, part), 0.0)
        return self.laboratory.machine(machine).map_from_part(part, angle_rad)


@dataclass(frozen=True, slots=True)
class _Segment:
    start_s: float
    end_s: float
    path: Path

    def at(self, t_s: float) -> Values:
        if t_s >= self.end_s:
            return self.path(1.0)
        return self.path(_minimum_jerk((t_s - self.start_s) / (self.end_s - self.start_s)))


@dataclass(slots=True)
class _Track:
    """The moves of one channel, in order. They never overlap."""

    initial: Values
    starts_s: list[float] = field(default_factory=list)
    segments: list[_Segment] = field(default_factory=list)

    def at(self, t_s: float) -> Values:
        """Return the values at an instant.

        A move has no effect on the values at its start instant. Its effect begins right after this instant. So the
        frame of an instant is the same whether a move that starts at this instant is scheduled before or after the
        frame is taken.
        """
        index = bisect_left(self.starts_s, t_s)
        return self.segments[index - 1].at(t_s) if index else self.initial

    def right_after(self, t_s: float) -> Values:
        index = bisect_right(self.starts_s, t_s)
        return self.segments[index - 1].at(t_s) if index else self.initial

    def append(self, segment: _Segment) -> None:
        self.segments.append(segment)
        self.starts_s.append(segment.start_s)

    def end_s(self) -> float:
        return self.segments[-1].end_s if self.segments else -1.0

    def is_at_rest(self, t_s: float) -> bool:
        return self.end_s() <= t_s

    def moves_within(self, start_s: float, end_s: float) -> bool:
        index = bisect_left(self.starts_s, end_s)
        return index > 0 and self.segments[index - 1].end_s >= start_s


HOME = (2.6, 1.1, pi / 2)
"""The pose of the robot's base at the start: x and y in metres, heading in radians."""

TRAVEL_GAZE = (0.25, 0.0, 1.25, 1.6, 0.0, 0.75)
"""The gaze while the robot drives: the camera's position, then a point on its axis, in the robot's base frame."""

MAST_CAMERA_M = (-0.25, 0.0, 1.60)
"""The position of the camera on the mast, in the robot's base frame: behind the arm's shoulder, and above it.

The camera sees a machine past the arm, so the arm hides parts of the machine. The mast itself is not drawn."""

OUTSIDE = (-3.0, -3.0)
"""The position of a visitor who is not in the room: x and y in metres."""

_INITIAL_VALUES: Mapping[Quantity, Values] = MappingProxyType(
    {
        Quantity.BASE: HOME,
        Quantity.GAZE: TRAVEL_GAZE,
        Quantity.MAST: TRAVEL_GAZE[3:],
        Quantity.REACH: (0.0,),
        Quantity.OPENING: (0.08,),
        Quantity.HOLDING: (0.0,),
        Quantity.LIGHT: (1.0,),
        Quantity.LOCALIZED: (1.0,),
        Quantity.PERSON: OUTSIDE,
    }
)
"""The quantities at 0 s. The angles of all joints begin at 0 rad: lids closed, latches locked, the rotor in its first
position."""


class LabWorld:
    """The laboratory over time. Any thread may read it while one thread schedules.

    Attributes:
        seed: the seed of the localisation error. The camera and its computer also use it.
        laboratory: the description of the laboratory.
    """

    def __init__(self, seed: int, laboratory: Laboratory = LABORATORY) -> None:
        """Create the laboratory in its state at 0 s.

        Args:
            seed: the seed of the robot's localisation error. Nothing else in this class is random.
            laboratory: the description of the laboratory.
        """
        self.seed = seed
        self.laboratory = laboratory
        joints = [JointKey(machine.name, joint.part) for machine in laboratory.machines for joint in machine.joints]
        self._joint_keys = tuple(joints)
        initial = {**_INITIAL_VALUES, Quantity.LIGHT: (laboratory.light,)}
        self._tracks: dict[Channel, _Track] = {quantity: _Track(values) for quantity, values in initial.items()}
        self._tracks.update({joint: _Track((0.0,)) for joint in joints})
        self._lock = Lock()
        self._now_s = 0.0
        self._localization_error = _LocalizationError(seed)

    def schedule(self, now_s: float, moves: Sequence[Move]) -> None:
        """Schedule moves, which begin now or after their delays.

        Args:
            now_s: the current time, which must not be earlier than in the last call.
            moves: the moves to schedule; moves of the same channel must be in order of time.

        Raises:
            ValueError: `now_s` is earlier than in the last call, the delay or the duration of a move is negative, or
                the channel of a move is still moving. In all these cases, no move is scheduled.
        """
        with self._lock:
            if now_s < self._now_s:
                raise ValueError(
                    f"cannot schedule moves at {now_s:g} s: moves at {self._now_s:g} s are already scheduled"
                )
            busy_until_s = {move.channel: self._tracks[move.channel].end_s() for move in moves}
            segments: list[_Segment] = []
            for move in moves:
                segments.append(_segment(now_s, move, busy_until_s[move.channel]))
                busy_until_s[move.channel] = segments[-1].end_s
            self._now_s = now_s
            for move, segment in zip(moves, segments, strict=True):
                self._tracks[move.channel].append(segment)

    def values(self, channel: Channel, t_s: float) -> Values:
        """Return the numbers of one channel at an instant."""
        with self._lock:
            return self._tracks[channel].at(t_s)

    def is_at_rest(self, channel: Channel, t_s: float) -> bool:
        """Return whether a channel is at rest at an instant and afterwards, according to the moves scheduled so far."""
        with self._lock:
            return self._tracks[channel].is_at_rest(t_s)

    def moves_to(
        self, now_s: float, channel: Channel, values: Values, duration_s: float, *, delay_s: float = 0.0
    ) -> Move:
        """Return the move of a channel on a straight path from its values when the move starts to other values."""
        with self._lock:
            start = self._tracks[channel].right_after(now_s + delay_s)
        return Move(channel=channel, path=straight_path(start, values), duration_s=duration_s, delay_s=delay_s)

    def state(self, t_s: float) -> LabState:
        """Return the state at an instant."""
        with self._lock:
            values = {channel: track.at(t_s) for channel, track in self._tracks.items()}
        x_m, y_m, heading_rad = values[Quantity.BASE]
        gaze, mast_target = values[Quantity.GAZE], values[Quantity.MAST]
        return LabState(
            t_s=t_s,
            base=(x_m, y_m, heading_rad),
            eye_m=(gaze[0], gaze[1], gaze[2]),
            target_m=(gaze[3], gaze[4], gaze[5]),
            mast_target_m=(mast_target[0], mast_target[1], mast_target[2]),
            reach=values[Quantity.REACH][0],
            opening_m=values[Quantity.OPENING][0],
            is_holding=values[Quantity.HOLDING][0] > 0.5,
            light=values[Quantity.LIGHT][0],
            is_localized=values[Quantity.LOCALIZED][0] > 0.5,
            joints_rad=MappingProxyType({joint: values[joint][0] for joint in self._joint_keys}),
            person_m=(values[Quantity.PERSON][0], values[Quantity.PERSON][1]),
            laboratory=self.laboratory,
        )

    def seen_by(self, camera: Mount) -> LabWorld:
        """Return this world as another camera sees it. Only the original world can be scheduled."""
        view = copy(self)
        view.laboratory = replace(self.laboratory, camera=camera)
        return view

    def moves_within(self, start_s: float, end_s: float) -> bool:
        """Return whether the state can change from one instant to another."""
        with self._lock:
            return any(track.moves_within(start_s, end_s) for track in self._tracks.values())

    def moving_spans(self) -> tuple[tuple[float, float], ...]:
        """Return the spans in which anything moves, in order, as (start, end) in s. Spans that touch are joined."""
        with self._lock:
            segments = [segment for track in self._tracks.values() for segment in track.segments]
        spans: list[tuple[float, float]] = []
        for start_s, end_s in sorted((segment.start_s, segment.end_s) for segment in segments):
            if spans and start_s <= spans[-1][1]:
                spans[-1] = (spans[-1][0], max(end_s, spans[-1][1]))
            else:
                spans.append((start_s, end_s))
        return tuple(spans)

    def believed_map_from_robot(self, t_s: float) -> Pose:
        """Return the believed pose of the robot's base: a few centimetres off, or much more while the robot is lost."""
        with self._lock:
            x_m, y_m, heading_rad = self._tracks[Quantity.BASE].at(t_s)
            is_localized = self._tracks[Quantity.LOCALIZED].at(t_s)[0] > 0.5
        return planar(x_m, y_m, heading_rad) @ self._localization_error.at(t_s, is_localized=is_localized)


def straight_path(start: Values, end: Values) -> Path:
    """Return the straight path from one tuple of values to another."""

    def path(progress: float) -> Values:
        return tuple(a + (b - a) * progress for a, b in zip(start, end, strict=True))

    return path


def _segment(now_s: float, move: Move, busy_until_s: float) -> _Segment:
    start_s = now_s + move.delay_s
    if move.delay_s < 0 or move.duration_s < 0:
        raise ValueError(
            f"a move of {move.channel} has a negative delay or duration: it would begin at {start_s:g} s and"
            f" take {move.duration_s:g} s"
        )
    if start_s < busy_until_s - _ROUNDING_S:
        raise ValueError(f"{move.channel} is still moving at {start_s:g} s")
    return _Segment(start_s, start_s + move.duration_s, move.path)


_ROUNDING_S = 1e-3
"""A move may begin this much before the previous move of its channel ends, because sums of durations are rounded. In so
short a time, a move does not change the values noticeably."""


class _LocalizationError:
    """The localisation error: slow waves of a few centimetres, plus an offset while the robot is lost."""

    def __init__(self, seed: int) -> None:
        random = Random(f"{seed} localization")
        self._waves = tuple(
            tuple((random.uniform(90.0, 700.0), random.uniform(0.0, 2 * pi), size) for size in sizes)
            for sizes in ((0.012, 0.008), (0.012, 0.008), (0.006, 0.004))
        )
        lost_direction_rad = random.uniform(-pi, pi)
        self._lost_offset = (
            0.45 * cos(lost_direction_rad),
            0.45 * sin(lost_direction_rad),
            random.choice((-1.0, 1.0)) * 0.25,
        )

    def at(self, t_s: float, *, is_localized: bool) -> Pose:
        """Return the believed pose of the base, in the frame of the true base."""
        x_m, y_m, heading_rad = (
            slow * sin(2 * pi * t_s / slow_s + slow_phase) + quick * sin(2 * pi * t_s / quick_s + quick_phase)
            for (slow_s, slow_phase, slow), (quick_s, quick_phase, quick) in self._waves
        )
        off_x_m, off_y_m, off_rad = (0.0, 0.0, 0.0) if is_localized else self._lost_offset
        return Pose.planar(x_m + off_x_m, y_m + off_y_m, heading_rad + off_rad)


def _minimum_jerk(share_of_time: float) -> float:
    """Return the progress of a move: smooth, at rest at both ends (Flash and Hogan).

    The second half mirrors the first half, so that rounding never carries a move beyond its end.
    """
    if share_of_time > 0.5:
        return 1.0 - _minimum_jerk(1.0 - share_of_time)
    s = share_of_time
    return s * s * s * (10.0 - 15.0 * s + 6.0 * s * s)
