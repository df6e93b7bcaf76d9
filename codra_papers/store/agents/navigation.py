"""P2's NavigationAgent: it drives to the goal in the graph, and records the state of the robot's body.

It plans on the map, with the known containers. If the way stays blocked, it plans again, around the obstacles that the
lasers see. After a bump it first draws back. If all tries fail, the task ends with the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from codra_dsl.runtime import Reading
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.knowledge import Knowledge, Snapshot
from codra_papers.store.agents.surroundings import away, containers_m, obstacles, people_m, room_m
from codra_papers.store.agents.working import Executor, Rounds
from codra_papers.store.body import Body, Outcome, Stop, Way
from codra_papers.store.geometry import Disc, Point, Pose2D, wrapped
from codra_papers.store.knowledge import floor_pose_of
from codra_papers.store.layout import CONTAINER_M
from codra_papers.store.routes import NoRouteError, route

PERIOD_S = 0.5
TRIES = 8
"""Number of tries before the result is `blocked`. In a try the motion layer waits for a free way."""

TRIES_BACKWARD = 3
"""The same for driving backwards, where no other way exists."""

MOST_BUMPS = 3
"""After more bumps than this on one way the result is `bumped`."""

SETTLE_S = 1.0
"""How long the robot waits after a bump."""

FACING_RAD = 0.03
DRAW_BACK_M = 0.5
"""How far the robot draws back from an obstacle, if there is room."""


class Navigation:
    """Drives the robot."""

    def __init__(self, knowledge: Knowledge, body: Body, clock: Clock) -> None:
        """Start to record the body's state, follow the maximum speed, and wait for requests."""
        self._knowledge = knowledge
        self._handle = knowledge.as_agent("navigation")
        self._body = body
        self._clock = clock
        self._goal = Pose2D(0.0, 0.0)
        self._tries, self._bumps = 0, 0
        self._way: Way | None = None
        self._recovered: Callable[[], None] | None = None
        self._halt: Stop | None = None
        self._task = Executor(knowledge, self._handle, "navigating", self._begin, self._stop)
        self._follower = knowledge.follow("robot", "max_speed", self._limit)
        self._rounds = Rounds(clock, PERIOD_S, self._record)

    def _record(self) -> None:
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
        """Start to drive; if the robot is drawing back after a bump, start afterwards."""
        if self._recovered is not None:
            self._recovered = partial(self._set_off, snapshot)
        else:
            self._set_off(snapshot)

    def _set_off(self, snapshot: Snapshot) -> None:
        self._goal = floor_pose_of(snapshot.transform("world", "goal").pose)
        self._tries, self._bumps = 0, 0
        way = snapshot.get("goal", "goal_way")
        if way.known and way.value == Way.BACKWARD:
            self._back()
        else:
            self._go(())

    def _stop(self) -> None:
        """Stop; but if the robot is drawing back after a bump, it continues that, even if the next request comes."""
        if self._recovered is not None:
            self._recovered = _no_next_step
        elif self._halt is not None:
            self._halt()

    # Ways

    def _go(self, avoid: tuple[Disc, ...]) -> None:
        try:
            known = (Disc(point_m, CONTAINER_M / 2) for point_m in self._containers())
            points = route(self._body.believed(), self._goal, (*known, *avoid))
        except NoRouteError:
            if not avoid:
                self._task.finish("unreachable")
                return
            self._go(())
            return
        self._drive(points, Way.FORWARD, self._ending(self._face, self._go_round, self._go_round))

    def _face(self) -> None:
        angle_rad = wrapped(self._goal.heading_rad - self._body.believed().heading_rad)
        if abs(angle_rad) < FACING_RAD:
            self._arrived()
            return
        self._turn(angle_rad, self._ending(self._arrived, self._go_round, self._go_round))

    def _back(self) -> None:
        """Back up to the goal, straight. After a bump the task ends: the requester must measure the goal again."""
        again = partial(self._try_again, self._back, TRIES_BACKWARD)
        bumped = partial(self._task.finish, "bumped")
        self._drive((self._goal.point_m,), Way.BACKWARD, self._ending(self._arrived, again, bumped))

    def _go_round(self) -> None:
        """Draw back, to get room for turning, and go another way."""
        self._try_again(partial(self._draw_back, self._go_another_way), TRIES)

    def _go_another_way(self) -> None:
        self._go(obstacles(self._body, self._containers()))

    def _draw_back(self, go_on: Callable[[], None]) -> None:
        """Drive a little away from near obstacles, straight on or straight back, and continue from there.

        After a bump the robot stays, because the lasers do not see the obstacle.
        """
        if self._bumps:
            go_on()
            return
        self._draw(away(self._body, self._people(), DRAW_BACK_M), self._ending(go_on, go_on, go_on))

    def _return(self) -> None:
        """Drive back a little the way that it came: the lasers do not see the obstacle that it bumped into."""
        back = Way.FORWARD if self._way is Way.BACKWARD else Way.BACKWARD
        people = self._people()
        length_m = min(room_m(self._body, people, back), DRAW_BACK_M)
        step = (back, length_m) if self._way and length_m > 0.0 else away(self._body, people, DRAW_BACK_M)
        self._draw(step, self._returned)

    def _returned(self, outcome: Outcome) -> None:
        """Continue with the stored next step. A command that another one replaced counts as drawn back as well."""
        if outcome is Outcome.BUMPED:
            self._bumped(_no_next_step)
            return
        go_on, self._recovered = self._recovered, None
        if go_on is not None:
            go_on()

    def _draw(self, step: tuple[Way, float], done: Callable[[Outcome], None]) -> None:
        way, length_m = step
        if length_m <= 0.0:
            done(Outcome.DONE)
            return
        there_m = self._body.believed().out(length_m if way is Way.FORWARD else -length_m)
        self._drive((there_m,), way, done)

    def _drive(self, points_m: Sequence[Point], way: Way, done: Callable[[Outcome], None]) -> None:
        self._way = way
        self._halt = self._body.drive(points_m, way, done)

    def _turn(self, angle_rad: float, done: Callable[[Outcome], None]) -> None:
        self._way = None
        self._halt = self._body.turn(angle_rad, done)

    # Ends

    def _ending(
        self, arrived: Callable[[], None], blocked: Callable[[], None], drawn_back: Callable[[], None]
    ) -> Callable[[Outcome], None]:
        """Return the callback for the end of a command of the body. For a stopped command it does nothing.

        Args:
            arrived: called when the command was done.
            blocked: called when an obstacle was in the way for long.
            drawn_back: called when the robot bumped into an obstacle and has drawn back from it.
        """

        def done(outcome: Outcome) -> None:
            if outcome is Outcome.DONE:
                arrived()
            elif outcome is Outcome.BLOCKED:
                blocked()
            elif outcome is Outcome.BUMPED:
                self._bumped(drawn_back)

        return done

    def _arrived(self) -> None:
        self._task.finish("arrived")

    def _try_again(self, again: Callable[[], None], tries: int) -> None:
        self._tries += 1
        if self._tries < tries:
            again()
        else:
            self._task.finish("blocked")

    def _bumped(self, go_on: Callable[[], None]) -> None:
        """Wait for a moment, draw back, and continue."""
        self._bumps += 1
        if self._bumps > MOST_BUMPS:
            self._recovered = None
            self._task.finish("bumped")
            return
        if self._recovered is None:
            self._recovered = go_on
        self._clock.call_at(self._clock.now_s() + SETTLE_S, self._return)

    # Knowledge

    def _containers(self) -> list[Point]:
        return containers_m(self._knowledge.snapshot())

    def _people(self) -> list[Point]:
        return people_m(self._knowledge.snapshot())


def _no_next_step() -> None:
    """Do nothing: no step follows."""
