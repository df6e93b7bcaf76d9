"""The robot's own motion layer: it follows commands, while the safety lasers slow and stop the robot.

The lasers do this during every command. Like a real motion layer, this layer drives by the believed pose of
the robot. The world determines where the robot truly goes.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from math import atan2, cos, hypot, inf, pi, sin, sqrt

import numpy as np

from codra_papers.store.body import FRONT, EndCallback, Lift, Outcome, Scan, Side, Way
from codra_papers.store.geometry import Floats, Point, Pose2D, wrapped
from codra_papers.store.layout import BODY_FRONT_M, FORK_TIP_M, REACH_M
from codra_papers.store.unmapped_obstacles import CONTAINER_PLACES_M, bodies_m, gaps_m, is_seen_through, is_strange

DEFAULT_MAX_SPEED_M_S = 1.0
BACKWARD_M_S = 0.3
TURN_RAD_S = 0.7
SPEED_UP_M_S2 = 0.5
SLOW_DOWN_M_S2 = 0.6
"""Deceleration for a planned stop."""

BRAKE_M_S2 = 1.6
"""Deceleration for an emergency stop."""

TURN_UP_RAD_S2 = 1.5
KEEP_FREE_M = 0.35
"""Distance at which the robot stops before an obstacle in its lane."""

KEEP_FREE_BEHIND_M = 0.05
"""The same distance for driving backwards, which is slow. There may be a shelf close behind a container to fetch."""

LANE_M = 0.42
"""Half the width of the lane that must be free for the body, or for a container on the fork."""

FORK_LANE_M = 0.15
"""Half the width of the lane that must be free for the empty fork. It is narrow, because a container's wheels are
beside the fork."""

TOUCH_M = 0.03
"""No motion brings the robot nearer than this to a body that a laser hits, unless the motion leads away from it."""

FORESIGHT_S = 0.5
"""How far ahead in time the layer checks whether a motion touches a body. Stopping takes less time than this."""

PATIENCE_S = 8.0
"""How long the robot waits for a free way before it gives up."""

RECOVERY_FACTOR = 3.0
"""While the way is free, the waiting time decreases this many times as fast as it grows while the way is blocked."""

LIFT_S = 3.0
_EDGE_TOLERANCE_M = 0.02
_ROUNDING = 1e-9
TURN_ON_SPOT_ABOVE_RAD = 0.2
GOAL_TOLERANCE_M, GOAL_TOLERANCE_RAD = 0.015, 0.01


@dataclass(frozen=True, slots=True, kw_only=True)
class Senses:
    """The inputs of the motion layer in one step.

    Attributes:
        believed_pose: the believed pose of the robot.
        scan: returns the latest scan of a laser.
    """

    believed_pose: Pose2D
    speed_m_s: float
    turn_rate_rad_s: float
    is_loaded: bool
    scan: Callable[[Side], Scan]


@dataclass(frozen=True, slots=True, kw_only=True)
class Wish:
    """The speeds that a command wants."""

    speed_m_s: float = 0.0
    turn_rate_rad_s: float = 0.0


@dataclass(slots=True)
class Drive:
    """Drive from point to point. Forward, the robot turns on the spot if the next point lies to the side."""

    points_m: Sequence[Point]
    way: Way
    done: EndCallback
    _index: int = 0

    def wish(self, senses: Senses, max_speed_m_s: float) -> Wish | None:
        """Return the wanted speeds; None at the end of the way."""
        while self._index < len(self.points_m):
            wish = self._towards(self.points_m[self._index], senses, max_speed_m_s)
            if wish is not None:
                return wish
            self._index += 1
        return None

    def _towards(self, point_m: Point, senses: Senses, max_speed_m_s: float) -> Wish | None:
        ahead_m, left_m = senses.believed_pose.relative_point(point_m)
        sign = 1.0 if self.way is Way.FORWARD else -1.0
        distance_m = hypot(ahead_m, left_m)
        bearing_error_rad = wrapped(atan2(left_m, ahead_m) - (0.0 if sign > 0 else pi))
        remaining_m = sign * ahead_m
        if distance_m < GOAL_TOLERANCE_M or (remaining_m <= GOAL_TOLERANCE_M and (distance_m < 0.1 or sign < 0)):
            return None
        if sign > 0 and abs(bearing_error_rad) > TURN_ON_SPOT_ABOVE_RAD:
            return Wish(turn_rate_rad_s=_turn_towards(bearing_error_rad)) if abs(senses.speed_m_s) < 0.05 else Wish()
        limit_m_s = max_speed_m_s if sign > 0 else min(max_speed_m_s, BACKWARD_M_S)
        steer_rad_s = max(-0.5, min(0.5, 1.5 * bearing_error_rad)) if distance_m > 0.15 else 0.0
        speed_m_s = min(limit_m_s, sqrt(2 * SLOW_DOWN_M_S2 * max(remaining_m, 0.0)) + 0.01)
        return Wish(speed_m_s=sign * speed_m_s, turn_rate_rad_s=steer_rad_s)


@dataclass(slots=True)
class Turn:
    """Turn on the spot by an angle, in the direction of its sign."""

    angle_rad: float
    done: EndCallback
    _last_rad: float | None = None
    _remaining_rad: float = field(default=0.0)

    def wish(self, senses: Senses, _max_speed_m_s: float) -> Wish | None:
        """Return the wanted speeds; None at the end of the turn."""
        heading_rad = senses.believed_pose.heading_rad
        if self._last_rad is None:
            self._remaining_rad = self.angle_rad
        else:
            self._remaining_rad -= wrapped(heading_rad - self._last_rad)
        self._last_rad = heading_rad
        if abs(self._remaining_rad) < GOAL_TOLERANCE_RAD:
            return None
        return Wish(turn_rate_rad_s=_turn_towards(self._remaining_rad))


@dataclass(slots=True)
class Raise:
    """Move the fork up or down."""

    lift: Lift
    done: EndCallback
    _step_count: int = 0

    def wish(self, senses: Senses, _max_speed_m_s: float) -> Wish | None:
        """Return zero speeds; None once the fork has moved."""
        if abs(senses.speed_m_s) > 0.0 or abs(senses.turn_rate_rad_s) > 0.0:
            return Wish()
        self._step_count += 1
        return Wish() if self._step_count < LIFT_S * STEPS_PER_S else None


STEPS_PER_S = 10
STEP_S = 1 / STEPS_PER_S
"""The length of a step of the shop and of the motion layer."""

Command = Drive | Turn | Raise


class Driving:
    """Follows one command at a time.

    Attributes:
        max_speed_m_s: no point of the robot goes faster than this, not even a corner in a turn.
        ended_commands: ended commands with their results, until these are reported.
    """

    def __init__(self) -> None:
        """Begin without a command."""
        self.max_speed_m_s = DEFAULT_MAX_SPEED_M_S
        self.ended_commands: list[tuple[Command, Outcome]] = []
        self._command: Command | None = None
        self._blocked_s = 0.0

    @property
    def is_at_work(self) -> bool:
        """Return whether a command is running."""
        return self._command is not None

    def begin(self, command: Command) -> None:
        """Follow another command. A running command ends as stopped."""
        self.end(Outcome.STOPPED)
        self._command, self._blocked_s = command, 0.0

    def stop(self, command: Command) -> None:
        """End a command as stopped if it is running."""
        if self._command is command:
            self.end(Outcome.STOPPED)

    def end(self, outcome: Outcome) -> None:
        """End the running command, if any."""
        if self._command is not None:
            self.ended_commands.append((self._command, outcome))
            self._command = None

    def step(self, senses: Senses) -> Wish:
        """Return the speeds for the next step."""
        wish = self._wish(senses)
        safe_wish = _limited_wish(_safe_wish(wish, senses), self.max_speed_m_s)
        if wish != Wish() and safe_wish == Wish():
            self._blocked_s += STEP_S
            if self._blocked_s >= PATIENCE_S:
                self.end(Outcome.BLOCKED)
        else:  # with noise, an obstacle that is slightly too near sometimes seems far enough
            self._blocked_s = max(self._blocked_s - RECOVERY_FACTOR * STEP_S, 0.0)
        return Wish(
            speed_m_s=_next_speed(senses.speed_m_s, safe_wish.speed_m_s, SPEED_UP_M_S2, BRAKE_M_S2),
            turn_rate_rad_s=_next_speed(senses.turn_rate_rad_s, safe_wish.turn_rate_rad_s, TURN_UP_RAD_S2, 4.0),
        )

    def _wish(self, senses: Senses) -> Wish:
        if self._command is None:
            return Wish()
        wish = self._command.wish(senses, self.max_speed_m_s)
        if wish is None:
            self.end(Outcome.DONE)
            return Wish()
        return wish


def _turn_towards(angle_rad: float) -> float:
    limit = min(TURN_RAD_S, sqrt(2 * abs(angle_rad)) * 0.8, abs(angle_rad) / (2 * STEP_S))
    return limit if angle_rad > 0 else -limit


def _next_speed(now: float, wish: float, acceleration: float, deceleration: float) -> float:
    """Return the speed after one step from `now` towards `wish`."""
    rate = acceleration if abs(wish) > abs(now) and wish * now >= 0.0 else deceleration
    change = max(-rate * STEP_S, min(rate * STEP_S, wish - now))
    return now + change


def _safe_wish(wish: Wish, senses: Senses) -> Wish:
    """Return as much of a wish as the safety lasers allow: the lane must be free, and nobody may be touched."""
    safe_wish = _lane_wish(wish, senses)
    return Wish() if safe_wish != Wish() and _touches(safe_wish, senses) else safe_wish


def _lane_wish(wish: Wish, senses: Senses) -> Wish:
    if wish.speed_m_s == 0.0:
        is_turning_free = wish.turn_rate_rad_s == 0.0 or _has_room_to_turn(senses)
        return wish if is_turning_free else Wish()
    sign = 1.0 if wish.speed_m_s > 0 else -1.0
    gap_m = free_ahead_m(senses) if sign > 0 else free_behind_m(senses)
    keep_m = KEEP_FREE_M if sign > 0 else KEEP_FREE_BEHIND_M
    limit_m_s = sqrt(2 * SLOW_DOWN_M_S2 * max(gap_m - keep_m, 0.0))
    if limit_m_s < 0.02:
        return Wish()
    return Wish(speed_m_s=sign * min(abs(wish.speed_m_s), limit_m_s), turn_rate_rad_s=wish.turn_rate_rad_s)


def _touches(wish: Wish, senses: Senses) -> bool:
    """Return whether a motion brings any part of the robot too near to a person, and nearer than the robot is now.

    The fork and its load swing out in a turn, and the body is wider than the fork when the robot backs up.
    """
    return any(_touches_body_in(senses.scan(side), wish, senses) for side in Side)


def _touches_body_in(scan: Scan, wish: Wish, senses: Senses) -> bool:
    """Return whether `_touches` is true for a body that one laser hits."""
    bodies, points = bodies_m(scan), scan.points_m()
    gaps_now_m = gaps_m(bodies, is_loaded=senses.is_loaded)
    is_near = gaps_now_m < TOUCH_M + FORESIGHT_S * _fastest_m_s(wish)
    is_near[is_near] = is_strange(points[is_near], senses.believed_pose, CONTAINER_PLACES_M)
    if not is_near.any():
        return False
    bodies, gaps_now_m = bodies[is_near], gaps_now_m[is_near]
    is_touched = np.zeros(len(bodies), dtype=bool)
    for step in range(1, round(FORESIGHT_S / STEP_S) + 1):
        gaps_then_m = gaps_m(_points_relative_to(_pose_after(wish, step * STEP_S), bodies), is_loaded=senses.is_loaded)
        is_touched |= (gaps_then_m < TOUCH_M) & (gaps_then_m < gaps_now_m - _ROUNDING)
    return bool(is_touched.any()) and not is_seen_through(scan, bodies[is_touched]).all()


def _pose_after(wish: Wish, duration_s: float) -> Pose2D:
    """Return the pose after a motion, relative to the robot."""
    turn_rad, length_m = wish.turn_rate_rad_s * duration_s, wish.speed_m_s * duration_s
    return Pose2D(length_m * cos(turn_rad / 2), length_m * sin(turn_rad / 2), turn_rad)


def _points_relative_to(pose: Pose2D, points_m: Floats) -> Floats:
    east, north = cos(pose.heading_rad), sin(pose.heading_rad)
    relative_points: Floats = (points_m - pose.point_m) @ np.array([[east, -north], [north, east]])
    return relative_points


def _limited_wish(wish: Wish, max_speed_m_s: float) -> Wish:
    """Return a wish for the same curve, so slow that no point of the robot exceeds the maximum speed."""
    fastest_m_s = _fastest_m_s(wish)
    if fastest_m_s < max_speed_m_s:
        return wish
    share = max_speed_m_s / fastest_m_s * (1.0 - _ROUNDING)
    return Wish(speed_m_s=wish.speed_m_s * share, turn_rate_rad_s=wish.turn_rate_rad_s * share)


def _fastest_m_s(wish: Wish) -> float:
    return abs(wish.speed_m_s) + abs(wish.turn_rate_rad_s) * REACH_M


def free_ahead_m(senses: Senses) -> float:
    """Return the free length of the lane in front of the robot."""
    points = np.concatenate([senses.scan(side).points_m() for side in FRONT])
    gaps = points[np.abs(points[:, 1]) <= LANE_M, 0] - BODY_FRONT_M
    return float(gaps[gaps >= -_EDGE_TOLERANCE_M].min(initial=inf))


def free_behind_m(senses: Senses) -> float:
    """Return the free length of the lane behind the tip of the fork."""
    points = senses.scan(Side.BACK).points_m()
    gaps = FORK_TIP_M - points[np.abs(points[:, 1]) <= (LANE_M if senses.is_loaded else FORK_LANE_M), 0]
    return float(gaps[gaps >= -_EDGE_TOLERANCE_M].min(initial=inf))


def _has_room_to_turn(senses: Senses) -> bool:
    points = np.concatenate([senses.scan(side).points_m() for side in Side])
    return bool((np.hypot(points[:, 0], points[:, 1]) > REACH_M).all())
