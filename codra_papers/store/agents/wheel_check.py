"""The check of a container's wheels by the laser at the tip of the fork (P2, sections 3.2 and 5.1).

A wheel is a short run of points. Two wheels form a pair if they are as far apart as the wheels on one side of a
container. The container is behind the middle of the pair, and faces the robot.
"""

from __future__ import annotations

from collections.abc import Sequence
from itertools import combinations
from math import atan2, hypot
from statistics import median

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.knowledge import Knowledge, Snapshot
from codra_papers.store.agents.working import Executor, PeriodicCalls
from codra_papers.store.body import Body, Scan, Side
from codra_papers.store.geometry import Point, Pose2D, wrapped
from codra_papers.store.knowledge import floor_pose_of, pose_of
from codra_papers.store.layout import WHEEL_OFFSET_M, WHEEL_RADIUS_M

PERIOD_S = 0.2
SCAN_COUNT = 5
MIN_MEASUREMENTS = 3
GAP_M = 0.12
"""If the points of two neighbouring rays are farther apart than this, they belong to two objects."""

WIDEST_M = 0.16
"""Largest width of a wheel, noise included."""

FARTHEST_M = 2.5
FARTHEST_ASIDE_M = 0.6
PAIR_TOLERANCE_M = 0.06
SAME_CONTAINER_M = 0.8
"""Largest distance of a container from the place where the camera saw the container."""


class WheelCheck:
    """Measures the exact pose of the container behind the robot."""

    def __init__(self, knowledge: Knowledge, body: Body, clock: Clock) -> None:
        """Wait for requests."""
        self._knowledge = knowledge
        self._handle = knowledge.as_agent("wheel_check")
        self._body = body
        self._clock = clock
        self._measured_poses: list[Pose2D] = []
        self._scan_count = 0
        self._periodic_calls: PeriodicCalls | None = None
        self._task = Executor(knowledge, self._handle, "checking", self._begin, self._end)

    def _begin(self, _: Snapshot) -> None:
        self._measured_poses, self._scan_count = [], 0
        self._periodic_calls = PeriodicCalls(self._clock, PERIOD_S, self._look)

    def _end(self) -> None:
        if self._periodic_calls is not None:
            self._periodic_calls.stop()

    def _look(self) -> None:
        self._scan_count += 1
        pose = container_behind(self._body.scan(Side.BACK))
        if pose is not None:
            self._measured_poses.append(pose)
        if self._scan_count == SCAN_COUNT:
            self._end()
            self._task.finish("found" if self._write_pose() else "lost")

    def _write_pose(self) -> bool:
        """Write the measured pose for the nearest known container. Return whether a known container is near enough."""
        if len(self._measured_poses) < MIN_MEASUREMENTS:
            return False
        x_m, y_m = (median(getattr(pose, axis) for pose in self._measured_poses) for axis in ("x_m", "y_m"))
        robot = self._body.believed_pose()
        heading_rad = wrapped(robot.heading_rad + median(pose.heading_rad for pose in self._measured_poses))
        measured_pose = Pose2D(*robot.point_at(x_m, y_m), heading_rad)
        snapshot = self._knowledge.snapshot()
        distances_m = {
            node.name: floor_pose_of(snapshot.transform("world", node.name).pose).distance_m(measured_pose)
            for node in snapshot.nodes("roll_container")
            if snapshot.parent(node.name) == "world"
        }
        name = min(distances_m, key=lambda known_name: (distances_m[known_name], known_name), default=None)
        if name is None or distances_m[name] > SAME_CONTAINER_M:
            return False
        self._handle.place("world", "container_pose", name, pose_of(measured_pose))
        return True


def container_behind(scan: Scan) -> Pose2D | None:
    """Return the pose of a container in the robot's frame, from two of its wheels; None if no pair is seen."""
    wheels = [wheel for run in _runs(scan) for wheel in _wheel_middle(scan, run)]
    pairs = [
        (one, other)
        for one, other in combinations(wheels, 2)
        if abs(hypot(one[0] - other[0], one[1] - other[1]) - 2 * WHEEL_OFFSET_M) < PAIR_TOLERANCE_M
        and abs(one[0] - other[0]) < abs(one[1] - other[1])
    ]
    if not pairs:
        return None
    one, other = max(pairs, key=lambda pair: pair[0][0] + pair[1][0])
    left, right = (one, other) if one[1] > other[1] else (other, one)
    across_rad = atan2(left[1] - right[1], left[0] - right[0])
    middle = Pose2D((one[0] + other[0]) / 2, (one[1] + other[1]) / 2, wrapped(across_rad - 1.5707963267948966))
    return middle.pose_ahead(-WHEEL_OFFSET_M)


def _runs(scan: Scan) -> list[list[Point]]:
    """Return runs of neighbouring points without a gap."""
    runs, previous_point = list[list[Point]](), (1e9, 1e9)
    for x_m, y_m in scan.points_m().tolist():
        point = (x_m, y_m)
        if hypot(point[0] - previous_point[0], point[1] - previous_point[1]) > GAP_M:
            runs.append([])
        runs[-1].append(point)
        previous_point = point
    return runs


def _wheel_middle(scan: Scan, run: Sequence[Point]) -> Sequence[Point]:
    """Return the middle of the wheel that a run of points shows, in a sequence; it is empty if there is no wheel."""
    x_m, y_m = (sum(point[axis] for point in run) / len(run) for axis in (0, 1))
    eye = scan.mount
    distance_m = hypot(x_m - eye.x_m, y_m - eye.y_m)
    width_m = hypot(run[0][0] - run[-1][0], run[0][1] - run[-1][1])
    if width_m > WIDEST_M or distance_m > FARTHEST_M or abs(y_m) > FARTHEST_ASIDE_M or len(run) < 2:
        return ()
    nearest_m = median(hypot(x - eye.x_m, y - eye.y_m) for x, y in run) + WHEEL_RADIUS_M * 0.85
    share = nearest_m / distance_m
    return ((eye.x_m + (x_m - eye.x_m) * share, eye.y_m + (y_m - eye.y_m) * share),)
