"""P2's NavigationAgent: it drives to the goal that is set in the graph, and tells how the robot's body is.

It plans on the map, with the containers that are known to stand there. When the way stays blocked it plans again, round
what the lasers see; when it has bumped into something it draws back from it first. At last it says what is wrong.
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
from codra_papers.store.knowledge import stand_of
from codra_papers.store.layout import CONTAINER_M
from codra_papers.store.routes import NoRouteError, route

PERIOD_S = 0.5
TRIES = 8
"""How often it tries before it says that the way is blocked; each try waits as long as the motion layer does."""

TRIES_BACKWARD = 3
"""The same backwards, where there is no other way."""

MOST_BUMPS = 3
"""Who bumps into things more often on one way does not get there."""

SETTLE_S = 1.0
"""So long it stands after a bump."""

FACING_RAD = 0.03
DRAW_BACK_M = 0.5
"""So far it draws back from what is in its way, if there is so much room."""


class Navigation:
    """Drives the robot."""

    def __init__(self, knowledge: Knowledge, body: Body, clock: Clock) -> None:
        """Tell of the body, follow the maximum speed, and wait until somebody wants to go somewhere."""
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
        """Set off; who draws back from what it has bumped into does that first."""
        if self._recovered is not None:
            self._recovered = partial(self._set_off, snapshot)
        else:
            self._set_off(snapshot)

    def _set_off(self, snapshot: Snapshot) -> None:
        self._goal = stand_of(snapshot.transform("world", "goal").pose)
        self._tries, self._bumps = 0, 0
        way = snapshot.get("goal", "goal_way")
        if way.known and way.value == Way.BACKWARD:
            self._back()
        else:
            self._go(())

    def _stop(self) -> None:
        """Stop; but who draws back from what it has bumped into goes on with that, whatever is wanted of it next."""
        if self._recovered is not None:
            self._recovered = _nothing
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
        """Back up to the goal, straight: what has bumped into something there must be measured anew by who sent it."""
        again = partial(self._try_again, self._back, TRIES_BACKWARD)
        told = partial(self._task.finish, "bumped")
        self._drive((self._goal.point_m,), Way.BACKWARD, self._ending(self._arrived, again, told))

    def _go_round(self) -> None:
        """Draw back, so that there is room to turn, and go another way."""
        self._try_again(partial(self._draw_back, self._go_another_way), TRIES)

    def _go_another_way(self) -> None:
        self._go(obstacles(self._body, self._containers()))

    def _draw_back(self, go_on: Callable[[], None]) -> None:
        """Drive a little away from what is near, straight on or straight back, and go on from there.

        Where it has bumped into something there is what its lasers do not see: it stays where it is.
        """
        if self._bumps:
            go_on()
            return
        self._draw(away(self._body, self._people(), DRAW_BACK_M), self._ending(go_on, go_on, go_on))

    def _return(self) -> None:
        """Drive a little to where it has come from: what it has bumped into is where its lasers do not see it."""
        back = Way.FORWARD if self._way is Way.BACKWARD else Way.BACKWARD
        people = self._people()
        length_m = min(room_m(self._body, people, back), DRAW_BACK_M)
        step = (back, length_m) if self._way and length_m > 0.0 else away(self._body, people, DRAW_BACK_M)
        self._draw(step, self._returned)

    def _returned(self, outcome: Outcome) -> None:
        """Do what was to follow; who drove elsewhere meanwhile has drawn back as well."""
        if outcome is Outcome.BUMPED:
            self._bumped(_nothing)
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
        """Return what is to happen when a command of the body ends; nothing when it was stopped.

        Args:
            arrived: when it was done.
            blocked: when something has been in the way for long.
            drawn_back: when it has bumped into something, and has drawn back from it.
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
        """Stand for a moment, draw back, and go on."""
        self._bumps += 1
        if self._bumps > MOST_BUMPS:
            self._recovered = None
            self._task.finish("bumped")
            return
        if self._recovered is None:
            self._recovered = go_on
        self._clock.call_at(self._clock.now_s() + SETTLE_S, self._return)

    # What is known

    def _containers(self) -> list[Point]:
        return containers_m(self._knowledge.snapshot())

    def _people(self) -> list[Point]:
        return people_m(self._knowledge.snapshot())


def _nothing() -> None:
    """Be done: nothing is to follow."""
