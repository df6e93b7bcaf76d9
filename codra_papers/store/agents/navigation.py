"""P2's NavigationAgent: it drives to the goal in the graph, and records the state of the robot's body.

The agent plans on the map, with the known containers. If the way stays blocked, it plans again, around the obstacles
that the lasers see. After a bump the robot first draws back. If all tries fail, the result of the task is the reason.
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
"""Number of tries before the result is `blocked`. In each try the motion layer waits for a free way."""

TRIES_BACKWARD = 3
"""Number of tries for driving backwards, where no other way exists."""

MOST_BUMPS = 3
"""If the robot bumps more often than this on one way, the result is `bumped`."""

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
        self._after_recovery: Callable[[], None] | None = None
        self._halt: Stop | None = None
        self._task = Executor(knowledge, self._handle, "navigating", self._begin, self._stop)
        self._follower = knowledge.follow("robot", "max_speed", self._limit_speed)
        self._rounds = Rounds(clock, PERIOD_S, self._record_body)

    def _record_body(self) -> None:
        body = self._body
        with self._handle.transaction() as change:
            change.set("battery", "battery_level", body.battery_percent())
            change.set("battery", "charging", body.is_charging())
            change.set("robot", "bumped", body.is_bumped())
            change.set("robot", "speed", max(-1.5, min(1.5, body.speed_m_s())))

    def _limit_speed(self, reading: Reading[float]) -> None:
        if reading.known:
            self._body.set_max_speed(reading.value)

    def _begin(self, snapshot: Snapshot) -> None:
        """Start to drive. If the robot is drawing back after a bump, it starts afterwards."""
        if self._after_recovery is not None:
            self._after_recovery = partial(self._set_off, snapshot)
        else:
            self._set_off(snapshot)

    def _set_off(self, snapshot: Snapshot) -> None:
        self._goal = floor_pose_of(snapshot.transform("world", "goal").pose)
        self._tries, self._bumps = 0, 0
        way = snapshot.get("goal", "goal_way")
        if way.known and way.value == Way.BACKWARD:
            self._back_up()
        else:
            self._go(())

    def _stop(self) -> None:
        """Stop driving; but a robot that draws back after a bump finishes this, whatever is requested next."""
        if self._after_recovery is not None:
            self._after_recovery = _do_nothing
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
        self._drive(points, Way.FORWARD, self._end_callback(self._turn_to_goal, self._go_round, self._go_round))

    def _turn_to_goal(self) -> None:
        angle_rad = wrapped(self._goal.heading_rad - self._body.believed().heading_rad)
        if abs(angle_rad) < FACING_RAD:
            self._finish_arrived()
            return
        self._turn(angle_rad, self._end_callback(self._finish_arrived, self._go_round, self._go_round))

    def _back_up(self) -> None:
        """Back up straight to the goal. A bump ends the task: the requester must then measure the goal again."""
        again = partial(self._try_again, self._back_up, TRIES_BACKWARD)
        finish_bumped = partial(self._task.finish, "bumped")
        self._drive((self._goal.point_m,), Way.BACKWARD, self._end_callback(self._finish_arrived, again, finish_bumped))

    def _go_round(self) -> None:
        """Draw back to get room for turning, and go another way."""
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
        self._draw(away(self._body, self._people(), DRAW_BACK_M), self._end_callback(go_on, go_on, go_on))

    def _drive_back(self) -> None:
        """Drive back a little the way that the robot came, because no laser sees the obstacle that it bumped into."""
        back = Way.FORWARD if self._way is Way.BACKWARD else Way.BACKWARD
        people = self._people()
        length_m = min(room_m(self._body, people, back), DRAW_BACK_M)
        step = (back, length_m) if self._way and length_m > 0.0 else away(self._body, people, DRAW_BACK_M)
        self._draw(step, self._on_returned)

    def _on_returned(self, outcome: Outcome) -> None:
        """Continue with the stored next step, even if another command has replaced the drawing back."""
        if outcome is Outcome.BUMPED:
            self._on_bump(_do_nothing)
            return
        go_on, self._after_recovery = self._after_recovery, None
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

    def _end_callback(
        self, on_done: Callable[[], None], on_blocked: Callable[[], None], on_bumped: Callable[[], None]
    ) -> Callable[[Outcome], None]:
        """Return the callback for the end of a command of the body. After a stopped command it does nothing.

        Args:
            on_done: called when the command was done.
            on_blocked: called when an obstacle was in the way for long.
            on_bumped: called when the robot bumped into an obstacle and has drawn back from it.
        """

        def on_end(outcome: Outcome) -> None:
            if outcome is Outcome.DONE:
                on_done()
            elif outcome is Outcome.BLOCKED:
                on_blocked()
            elif outcome is Outcome.BUMPED:
                self._on_bump(on_bumped)

        return on_end

    def _finish_arrived(self) -> None:
        self._task.finish("arrived")

    def _try_again(self, again: Callable[[], None], tries: int) -> None:
        self._tries += 1
        if self._tries < tries:
            again()
        else:
            self._task.finish("blocked")

    def _on_bump(self, go_on: Callable[[], None]) -> None:
        """Wait for a moment, draw back, and continue."""
        self._bumps += 1
        if self._bumps > MOST_BUMPS:
            self._after_recovery = None
            self._task.finish("bumped")
            return
        if self._after_recovery is None:
            self._after_recovery = go_on
        self._clock.call_at(self._clock.now_s() + SETTLE_S, self._drive_back)

    # Knowledge

    def _containers(self) -> list[Point]:
        return containers_m(self._knowledge.snapshot())

    def _people(self) -> list[Point]:
        return people_m(self._knowledge.snapshot())


def _do_nothing() -> None:
    """Do nothing: no step follows."""
