"""P2's NavigationAgent: it drives to the goal in the graph, and records the state of the robot's body.

The agent plans on the map, with the known containers. If the way stays blocked, it plans again, around the obstacles
that the lasers see. After a bump the robot first draws back. If all tries fail, the result of the task is the reason.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import partial

from codra_dsl.runtime import Reading, Reason
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.knowledge import Knowledge, Snapshot
from codra_papers.store.agents.surroundings import containers_m, obstacles, people_m, room_m, step_away
from codra_papers.store.agents.working import Executor, PeriodicCalls
from codra_papers.store.body import Body, Outcome, StopFunction, Way
from codra_papers.store.geometry import Disc, Point, Pose2D, wrapped
from codra_papers.store.knowledge import floor_pose_of
from codra_papers.store.layout import CONTAINER_M
from codra_papers.store.routes import NoRouteError, route

PERIOD_S = 0.5
MAX_TRIES = 8
"""Number of tries before the result is `blocked`. In each try the motion layer waits for a free way."""

MAX_TRIES_BACKWARD = 3
"""Number of tries when the robot drives backwards, because there is then no other way."""

MOST_BUMPS = 3
"""If the robot bumps more often than this on the way to a goal, the result is `bumped`."""

SETTLE_S = 1.0
"""How long the robot waits after a bump."""

CRAWL_M_S = 0.3
"""The robot drives no faster than this while its maximum speed, which was known before, is unknown."""

FACING_TOLERANCE_RAD = 0.03
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
        self._try_count, self._bump_count = 0, 0
        self._way: Way | None = None
        self._step_after_recovery: Callable[[], None] | None = None
        self._stop_command: StopFunction | None = None
        self._task = Executor(knowledge, self._handle, "navigating", self._begin, self._stop)
        self._follower = knowledge.follow("robot", "max_speed", self._limit_speed)
        self._periodic_calls = PeriodicCalls(clock, PERIOD_S, self._record_body)

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
        elif reading.reason is not Reason.NEVER_OBSERVED:  # no loop has limited the speed of this robot yet
            self._body.set_max_speed(CRAWL_M_S)

    def _begin(self, snapshot: Snapshot) -> None:
        """Start to drive. If the robot is still drawing back after a bump, it starts when it has drawn back."""
        if self._step_after_recovery is not None:
            self._step_after_recovery = partial(self._set_off, snapshot)
        else:
            self._set_off(snapshot)

    def _set_off(self, snapshot: Snapshot) -> None:
        self._goal = floor_pose_of(snapshot.transform("world", "goal").pose)
        self._try_count, self._bump_count = 0, 0
        way = snapshot.get("goal", "goal_way")
        if way.known and way.value == Way.BACKWARD:
            self._back_up()
        else:
            self._drive_to_goal(())

    def _stop(self) -> None:
        """Stop driving. A robot that is drawing back after a bump first draws back completely."""
        if self._step_after_recovery is not None:
            self._step_after_recovery = _do_nothing
        elif self._stop_command is not None:
            self._stop_command()

    # Ways

    def _drive_to_goal(self, avoid: tuple[Disc, ...]) -> None:
        try:
            known_discs = (Disc(point_m, CONTAINER_M / 2) for point_m in self._containers())
            points = route(self._body.believed_pose(), self._goal, (*known_discs, *avoid))
        except NoRouteError:
            if not avoid:
                self._task.finish("unreachable")
                return
            self._drive_to_goal(())
            return
        self._drive(points, Way.FORWARD, self._end_callback(self._turn_to_goal, self._reroute, self._reroute))

    def _turn_to_goal(self) -> None:
        angle_rad = wrapped(self._goal.heading_rad - self._body.believed_pose().heading_rad)
        if abs(angle_rad) < FACING_TOLERANCE_RAD:
            self._finish_arrived()
            return
        self._turn(angle_rad, self._end_callback(self._finish_arrived, self._reroute, self._reroute))

    def _back_up(self) -> None:
        """Back up straight to the goal. A bump ends the task: the requester must then measure the goal again."""
        retry = partial(self._try_again, self._back_up, MAX_TRIES_BACKWARD)
        finish_bumped = partial(self._task.finish, "bumped")
        self._drive((self._goal.point_m,), Way.BACKWARD, self._end_callback(self._finish_arrived, retry, finish_bumped))

    def _reroute(self) -> None:
        """Draw back to get room for turning, and go another way."""
        self._try_again(partial(self._draw_back, self._go_another_way), MAX_TRIES)

    def _go_another_way(self) -> None:
        self._drive_to_goal(obstacles(self._body, self._containers()))

    def _draw_back(self, next_step: Callable[[], None]) -> None:
        """Drive a little away from near obstacles, straight on or straight back, and then do the next step.

        After a bump the robot does not drive away, because the lasers do not see the obstacle.
        """
        if self._bump_count:
            next_step()
            return
        self._drive_step(
            step_away(self._body, self._people(), DRAW_BACK_M), self._end_callback(next_step, next_step, next_step)
        )

    def _drive_back(self) -> None:
        """Drive a little back to where the robot came from, because no laser sees the bumped obstacle."""
        back = Way.FORWARD if self._way is Way.BACKWARD else Way.BACKWARD
        people = self._people()
        length_m = min(room_m(self._body, people, back), DRAW_BACK_M)
        step = (back, length_m) if self._way and length_m > 0.0 else step_away(self._body, people, DRAW_BACK_M)
        self._drive_step(step, self._on_returned)

    def _on_returned(self, outcome: Outcome) -> None:
        """Continue with the stored next step, even if another command has replaced the command to draw back."""
        if outcome is Outcome.BUMPED:
            self._on_bump(_do_nothing)
            return
        next_step, self._step_after_recovery = self._step_after_recovery, None
        if next_step is not None:
            next_step()

    def _drive_step(self, step: tuple[Way, float], done: Callable[[Outcome], None]) -> None:
        way, length_m = step
        if length_m <= 0.0:
            done(Outcome.DONE)
            return
        end_m = self._body.believed_pose().point_at(length_m if way is Way.FORWARD else -length_m)
        self._drive((end_m,), way, done)

    def _drive(self, points_m: Sequence[Point], way: Way, done: Callable[[Outcome], None]) -> None:
        self._way = way
        self._stop_command = self._body.drive(points_m, way, done)

    def _turn(self, angle_rad: float, done: Callable[[Outcome], None]) -> None:
        self._way = None
        self._stop_command = self._body.turn(angle_rad, done)

    # Ends

    def _end_callback(
        self, on_done: Callable[[], None], on_blocked: Callable[[], None], on_bumped: Callable[[], None]
    ) -> Callable[[Outcome], None]:
        """Return the callback for the end of a command of the body. It does nothing if the command was stopped.

        Args:
            on_done: called when the command was done.
            on_blocked: called when an obstacle was in the way for too long.
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

    def _try_again(self, retry: Callable[[], None], max_tries: int) -> None:
        self._try_count += 1
        if self._try_count < max_tries:
            retry()
        else:
            self._task.finish("blocked")

    def _on_bump(self, next_step: Callable[[], None]) -> None:
        """Wait for a moment, draw back, and continue."""
        self._bump_count += 1
        if self._bump_count > MOST_BUMPS:
            self._step_after_recovery = None
            self._task.finish("bumped")
            return
        if self._step_after_recovery is None:
            self._step_after_recovery = next_step
        self._clock.call_at(self._clock.now_s() + SETTLE_S, self._drive_back)

    # Knowledge

    def _containers(self) -> list[Point]:
        return containers_m(self._knowledge.snapshot())

    def _people(self) -> list[Point]:
        return people_m(self._knowledge.snapshot())


def _do_nothing() -> None:
    """Do nothing: no step follows."""
