"""P2's NavigationAgent: it drives to the goal that is set in the graph, and tells how the robot's body is.

It plans on the map, with the containers that are known to stand there. When the way stays blocked it plans again, round
what the laser sees, and at last says so.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from math import hypot

from codra_dsl.runtime.cell import Reading
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.knowledge import Knowledge, Snapshot
from codra_dsl.worlds.store.agents.working import Executor, Rounds
from codra_dsl.worlds.store.body import FRONT, Body, Outcome, Way
from codra_dsl.worlds.store.geometry import Disc, Point, Stand, wrapped
from codra_dsl.worlds.store.knowledge import stand_of
from codra_dsl.worlds.store.layout import CONTAINER_M
from codra_dsl.worlds.store.routes import LANE_M, NoRouteError, has_room, route

PERIOD_S = 0.5
TRIES = 8
"""How often it tries before it says that the way is blocked; each try waits as long as the motion layer does."""

FACING_RAD = 0.03
BACK_OFF_M = 0.5
BACK_ROOM_M = 1.2
"""No container may be known to stand nearer than this to where it backs off to."""

OBSTACLE_M = 0.3
"""The radius of what the laser sees in the way."""


class Navigation:
    """Drives the robot."""

    def __init__(self, knowledge: Knowledge, body: Body, clock: Clock) -> None:
        """Tell of the body, follow the maximum speed, and wait until somebody wants to go somewhere."""
        self._knowledge = knowledge
        self._handle = knowledge.as_agent("navigation")
        self._body = body
        self._goal = Stand(0.0, 0.0)
        self._tries = 0
        self._task = Executor(knowledge, self._handle, "navigating", self._begin, self._stop)
        self._follower = knowledge.follow("robot", "max_speed", self._limit)
        self._rounds = Rounds(clock, PERIOD_S, self._tell)

    def _tell(self) -> None:
        body = self._body
        with self._handle.transaction() as change:
            change.set("battery", "battery_level", body.battery_percent())
            change.set("battery", "charging", body.is_charging())
            change.set("robot", "bumped", body.is_bumped())
            change.set("robot", "speed", max(-1.5, min(1.5, body.speed_m_s())))

    def _limit(self, reading: Reading[float]) -> None:
        if reading.known:
            self._body.set_max_speed(reading.value)

    def _begin(self, snapshot: Snapshot) -> None:
        self._goal, self._tries = stand_of(snapshot.transform("world", "goal").pose), 0
        way = snapshot.get("goal", "goal_way")
        if way.known and way.value == Way.BACKWARD:
            self._body.drive((self._goal.point_m,), Way.BACKWARD, self._ending(self._arrived, self._give_up))
        else:
            self._go(())

    def _stop(self) -> None:
        self._body.stop()

    def _go(self, avoid: tuple[Disc, ...]) -> None:
        try:
            points = route(self._body.believed(), self._goal, (*self._containers(), *avoid))
        except NoRouteError:
            if not avoid:
                self._task.finish("unreachable")
                return
            self._go(())
            return
        self._body.drive(points, Way.FORWARD, self._ending(self._face, self._go_round))

    def _ending(self, arrived: Callable[[], None], blocked: Callable[[], None]) -> Callable[[Outcome], None]:
        """Return what is to happen when a command of the body ends; nothing when it was stopped."""

        def done(outcome: Outcome) -> None:
            if outcome is Outcome.DONE:
                arrived()
            elif outcome is Outcome.BLOCKED:
                blocked()
            elif outcome is Outcome.BUMPED:
                self._task.finish("bumped")

        return done

    def _face(self) -> None:
        angle_rad = wrapped(self._goal.heading_rad - self._body.believed().heading_rad)
        if abs(angle_rad) < FACING_RAD:
            self._arrived()
        else:
            self._body.turn(angle_rad, self._ending(self._arrived, self._face_again))

    def _arrived(self) -> None:
        self._task.finish("arrived")

    def _give_up(self) -> None:
        self._task.finish("blocked")

    def _go_round(self) -> None:
        """Back off, so that there is room to turn, and go another way."""
        if not self._may_try():
            return
        avoid, robot = self._in_the_way(), self._body.believed()
        back_m = robot.out(-BACK_OFF_M)
        is_free = all(hypot(back_m[0] - x, back_m[1] - y) > BACK_ROOM_M for x, y in self._container_points())
        if not is_free or not has_room(robot.point_m, back_m, LANE_M):
            self._go(avoid)
            return
        go_on = partial(self._go, avoid)
        self._body.drive((back_m,), Way.BACKWARD, self._ending(go_on, go_on))

    def _face_again(self) -> None:
        if self._may_try():
            self._face()

    def _may_try(self) -> bool:
        self._tries += 1
        if self._tries >= TRIES:
            self._give_up()
        return self._tries < TRIES

    def _in_the_way(self) -> tuple[Disc, ...]:
        """Return what the laser sees ahead, if it is near."""
        robot, points = (
            self._body.believed(),
            [point for side in FRONT for point in self._body.scan(side).points_m().tolist()],
        )
        ahead = [point for point in points if point[0] > 0.0 and abs(point[1]) < 0.5]
        nearest = min(ahead, key=lambda point: hypot(*point), default=None)
        return () if nearest is None else (Disc(robot.out(*nearest), OBSTACLE_M),)

    def _containers(self) -> tuple[Disc, ...]:
        return tuple(Disc(point_m, CONTAINER_M / 2) for point_m in self._container_points())

    def _container_points(self) -> list[Point]:
        """Return where containers are known to stand."""
        snapshot = self._knowledge.snapshot()
        return [
            stand_of(snapshot.transform("world", node.name).pose).point_m
            for node in snapshot.nodes("roll_container")
            if snapshot.parent(node.name) == "world"
        ]
