"""The shop over time: people walk, the robot drives, containers rest or are carried.

Time passes in steps of a tenth of a second, which are events of the clock. Reading a state or a sensor changes nothing:
the state of a step is a frozen value, a sensor value is a function of the seed and of the state, and every purpose has
its own random source.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import partial
from math import cos, hypot, pi, remainder, sin

from codra_dsl.runtime.clock import Clock
from codra_papers.store.body import EndCallback, Lift, Outcome, Picture, Scan, Side, StopFunction, Way
from codra_papers.store.geometry import Point, Pose2D, wrapped
from codra_papers.store.layout import DOCK, FIXED_BOXES, FORK_M, REACH_M, START
from codra_papers.store.simulator import sensors
from codra_papers.store.simulator.driving import STEP_S, STEPS_PER_S, Drive, Driving, Raise, Senses, Turn, Wish
from codra_papers.store.simulator.people import PERSON_RADIUS_M, Person
from codra_papers.store.simulator.state import (
    Container,
    Load,
    RobotState,
    StoreState,
    Whereabouts,
    footprint,
)

LIFT_TOLERANCE_M, LIFT_TOLERANCE_RAD = 0.1, 0.15
"""Largest errors of the fork's pose under a container with which the fork still lifts the container."""

DOCK_TOLERANCE_M = 0.15
"""Largest distance from the dock at which the robot still charges."""

BUMP_MEMORY_S = 2.0

IDLE_PERCENT_PER_MIN = 0.1
DRIVE_PERCENT_PER_M = 0.012
TURN_PERCENT_PER_RAD = 0.004
LOADED_FACTOR = 1.5
LIFT_PERCENT = 0.05
CHARGE_PERCENT_PER_MIN = 2.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Beginning:
    """The state of the shop when it opens.

    Attributes:
        seed: the seed of everything random.
        drain: a factor on the battery's consumption.
        charge: a factor on the speed of charging.
    """

    seed: int
    containers: tuple[Container, ...]
    people: tuple[Person, ...] = ()
    robot: Pose2D = START
    battery_percent: float = 100.0
    drain: float = 1.0
    charge: float = 1.0


class StoreWorld:
    """The shop. Steps run as events of its clock. Any thread may read states and sensor values.

    Attributes:
        events: the past events with their instants, in order.
    """

    def __init__(self, clock: Clock, beginning: Beginning) -> None:
        """Open the shop."""
        self.events: list[tuple[float, str]] = []
        self.body = Cary(self)
        self._clock = clock
        self._start_s = clock.now_s()
        self._seed, self._drain, self._charge = beginning.seed, beginning.drain, beginning.charge
        self._people = list(beginning.people)
        self._driving = Driving()
        self._load_pose: Pose2D | None = None
        self._watchers: list[Callable[[StoreState], None]] = []
        self._scans: dict[Side, Scan] = {}
        self._picture: Picture | None = None
        robot = RobotState(at=beginning.robot, battery_percent=beginning.battery_percent)
        self._state = self._refreshed_state(StoreState(
            step=0, instant_s=self._start_s, robot=robot, containers=beginning.containers, people_m=()))  # fmt: skip
        clock.call_at(self._start_s + STEP_S, self._step)

    # Truth

    def state(self) -> StoreState:
        """Return the truth of the latest step."""
        return self._state

    def watch(self, callback: Callable[[StoreState], None]) -> None:
        """Call a callback with every new state. Callbacks run in the order of registration. They must not wait."""
        self._watchers.append(callback)

    # Actions of people

    def add_person(self, person: Person) -> None:
        """Add a person to the shop."""
        self._people.append(person)

    def set_load(self, name: str, load: Load) -> None:
        """Change the load of a container."""
        self._change(name, load=load)
        self.events.append((self._state.instant_s, f"{name} is {load}"))

    def move_container(self, name: str, at: Pose2D, where: Whereabouts) -> None:
        """Let people move a container."""
        self._change(name, at=at, where=where)
        self.events.append((self._state.instant_s, f"{name} was moved: {where}"))

    # Interface for the body of the robot

    def driving(self) -> Driving:
        """Return the motion layer."""
        return self._driving

    def report_ended_commands(self) -> None:
        """Report the results of ended commands to their callers."""
        while self._driving.ended_commands:
            command, outcome = self._driving.ended_commands.pop(0)
            command.done(outcome)

    def scan(self, side: Side) -> Scan:
        """Return the latest scan of a laser. All callers get the same scan."""
        if side not in self._scans:
            self._scans[side] = sensors.scan(self._seed, self._state, side)
        return self._scans[side]

    def picture(self) -> Picture:
        """Return the latest picture of the camera. All callers get the same picture."""
        if self._picture is None:
            self._picture = sensors.picture(self._seed, self._state)
        return self._picture

    def believed_pose(self) -> Pose2D:
        """Return the believed pose of the robot."""
        return sensors.believed_pose(self._seed, self._state)

    # Steps

    def _step(self) -> None:
        self._walk()
        wish = self._driving.step(self._senses()) if self._is_moving() else Wish()
        robot, obstacle = self._next_robot(wish)
        if obstacle:
            robot = replace(robot, bumped_s=self._state.instant_s + STEP_S)
            self.events.append((self._state.instant_s + STEP_S, f"the robot bumped into {obstacle}"))
            self._driving.end(Outcome.BUMPED)
        step = self._state.step + 1
        self._advance(step, robot)
        self._finish_lifts()
        self._clock.call_at(self._start_s + (step + 1) / STEPS_PER_S, self._step)
        for watcher in tuple(self._watchers):
            watcher(self._state)
        self.report_ended_commands()

    def _is_moving(self) -> bool:
        """Return whether the motion layer has to decide. With an empty battery, the brakes hold the robot."""
        robot = self._state.robot
        return robot.battery_percent > 0.0 and (
            self._driving.is_at_work or robot.speed_m_s != 0.0 or robot.turn_rate_rad_s != 0.0
        )

    def _walk(self) -> None:
        boxes = self._state.footprint()
        for person in self._people:
            person.step(STEP_S, lambda point: min(box.distance_m(point) for box in boxes))
        self._people = [person for person in self._people if not person.has_left]
        self._state = self._refreshed_state(self._state)

    def _refreshed_state(self, state: StoreState) -> StoreState:
        self._scans, self._picture = {}, None
        return replace(state, people_m=tuple((person.name, person.at_m) for person in self._people))

    def _senses(self) -> Senses:
        robot = self._state.robot
        return Senses(
            believed_pose=self.believed_pose(),
            speed_m_s=robot.speed_m_s,
            turn_rate_rad_s=robot.turn_rate_rad_s,
            is_loaded=self._load_pose is not None,
            scan=self.scan,
        )

    def _next_robot(self, wish: Wish) -> tuple[RobotState, str]:
        """Return the robot after a step, and the name of what it bumped into, if anything. A bump keeps it in place."""
        robot = self._state.robot
        middle_rad = robot.at.heading_rad + wish.turn_rate_rad_s * STEP_S / 2
        length_m = wish.speed_m_s * STEP_S
        at = Pose2D(
            robot.at.x_m + length_m * cos(middle_rad),
            robot.at.y_m + length_m * sin(middle_rad),
            wrapped(robot.at.heading_rad + wish.turn_rate_rad_s * STEP_S),
        )
        moved_robot = replace(robot, at=at, speed_m_s=wish.speed_m_s, turn_rate_rad_s=wish.turn_rate_rad_s)
        obstacle = self._obstacle_hit(moved_robot) if at != robot.at else ""
        if obstacle:
            return replace(robot, speed_m_s=0.0, turn_rate_rad_s=0.0), obstacle
        return moved_robot, ""

    def _obstacle_hit(self, robot: RobotState) -> str:
        carried_container = self._state.carried_container()
        moved_container = (
            None
            if carried_container is None or self._load_pose is None
            else replace(carried_container, at=_pose_in_map(robot.at, self._load_pose))
        )
        boxes = footprint(robot, moved_container)
        solid_boxes = boxes if moved_container is not None else boxes[:1]  # an empty fork goes under containers
        for box in FIXED_BOXES:
            if box.distance_m(robot.at.point_m) < REACH_M + 0.1 and any(
                box_of_robot.overlaps(box) for box_of_robot in boxes
            ):
                return "a shelf"
        for container in self._state.containers_on_floor():
            if any(box_of_robot.overlaps(container.box()) for box_of_robot in solid_boxes):
                return container.name
        for name, at_m in self._state.people_m:
            if any(box_of_robot.distance_m(at_m) < PERSON_RADIUS_M for box_of_robot in boxes):
                return name
        return ""

    def _advance(self, step: int, robot: RobotState) -> None:
        is_docked = robot.at.distance_m(DOCK) < DOCK_TOLERANCE_M and robot.surface_speed_m_s() == 0.0
        robot = replace(robot, is_charging=is_docked, battery_percent=self._next_battery_percent(robot, is_docked))
        containers = self._state.containers
        if self._load_pose is not None:
            at = _pose_in_map(robot.at, self._load_pose)
            containers = tuple(
                replace(container, at=at) if container.where is Whereabouts.FORK else container
                for container in containers
            )
        instant_s = self._start_s + step / STEPS_PER_S
        self._state = self._refreshed_state(
            replace(self._state, step=step, instant_s=instant_s, robot=robot, containers=containers)
        )

    def _next_battery_percent(self, robot: RobotState, is_docked: bool) -> float:
        if is_docked:
            return min(100.0, robot.battery_percent + CHARGE_PERCENT_PER_MIN * self._charge / 60 * STEP_S)
        motion_percent = abs(robot.speed_m_s) * DRIVE_PERCENT_PER_M + abs(robot.turn_rate_rad_s) * TURN_PERCENT_PER_RAD
        used_percent = IDLE_PERCENT_PER_MIN / 60 + motion_percent * (
            LOADED_FACTOR if self._load_pose is not None else 1.0
        )
        return max(0.0, robot.battery_percent - used_percent * self._drain * STEP_S)

    def _finish_lifts(self) -> None:
        for command, outcome in self._driving.ended_commands:
            if isinstance(command, Raise) and outcome is Outcome.DONE:
                self._raise() if command.lift is Lift.UP else self._lower()

    def _raise(self) -> None:
        robot = self._state.robot
        container_above = next(
            (container for container in self._state.containers_on_floor() if _is_under(robot.at, container)), None
        )
        if container_above is not None and not robot.is_fork_up:
            self._load_pose = _relative_pose(robot.at, container_above.at)
            self._change(container_above.name, where=Whereabouts.FORK)
            self.events.append((self._state.instant_s, f"{container_above.name} is on the fork"))
        self._finish_lift(is_up=True)

    def _lower(self) -> None:
        carried_container = self._state.carried_container()
        if carried_container is not None:
            self._load_pose = None
            self._change(carried_container.name, where=Whereabouts.FLOOR)
            self.events.append((self._state.instant_s, f"{carried_container.name} is on the floor"))
        self._finish_lift(is_up=False)

    def _finish_lift(self, *, is_up: bool) -> None:
        robot = self._state.robot
        battery_percent = max(0.0, robot.battery_percent - LIFT_PERCENT * self._drain)
        self._state = self._refreshed_state(
            replace(self._state, robot=replace(robot, is_fork_up=is_up, battery_percent=battery_percent))
        )

    def _change(self, name: str, **values: object) -> None:
        changed_containers = tuple(
            replace(container, **values) if container.name == name else container  # type: ignore[arg-type]
            for container in self._state.containers
        )
        self._state = self._refreshed_state(replace(self._state, containers=changed_containers))


class Cary:
    """The robot's hardware as a `Body`."""

    def __init__(self, world: StoreWorld) -> None:
        """Create the body in a shop."""
        self._world = world

    def believed_pose(self) -> Pose2D:
        """Return the pose from the localisation."""
        return self._world.believed_pose()

    def localisation_spread_m(self) -> float:
        """Return the uncertainty that the localisation reports."""
        return 2 * sensors.LOCALISATION_WAVE_M

    def scan(self, side: Side) -> Scan:
        """Return the latest scan of a laser."""
        return self._world.scan(side)

    def look(self) -> Picture:
        """Return the latest picture."""
        return self._world.picture()

    def battery_percent(self) -> float:
        """Return the level of the battery, to a tenth."""
        return round(self._world.state().robot.battery_percent, 1)

    def is_charging(self) -> bool:
        """Return whether the robot is at the dock and charges."""
        return self._world.state().robot.is_charging

    def has_load(self) -> bool:
        """Return whether the fork carries a load, measured by the weight on the fork."""
        return self._world.state().carried_container() is not None

    def is_bumped(self) -> bool:
        """Return whether a bumper was touched within the last two seconds."""
        state = self._world.state()
        return state.instant_s - state.robot.bumped_s < BUMP_MEMORY_S

    def speed_m_s(self) -> float:
        """Return the speed of the robot: negative when it drives backwards."""
        return self._world.state().robot.speed_m_s

    def set_max_speed(self, speed_m_s: float) -> None:
        """Drive no faster than this from now on."""
        self._world.driving().max_speed_m_s = speed_m_s

    def drive(self, points_m: Sequence[Point], way: Way, done: EndCallback) -> StopFunction:
        """Drive from point to point by the believed pose."""
        return self._begin(Drive(points_m, way, done))

    def turn(self, angle_rad: float, done: EndCallback) -> StopFunction:
        """Turn on the spot."""
        return self._begin(Turn(angle_rad, done))

    def lift(self, lift: Lift, done: EndCallback) -> StopFunction:
        """Raise or lower the fork."""
        return self._begin(Raise(lift, done))

    def _begin(self, command: Drive | Turn | Raise) -> StopFunction:
        self._world.driving().begin(command)
        return partial(self._stop, command)

    def _stop(self, command: Drive | Turn | Raise) -> None:
        self._world.driving().stop(command)
        self._world.report_ended_commands()


def _pose_in_map(frame: Pose2D, inner: Pose2D) -> Pose2D:
    return Pose2D(*frame.point_at(inner.x_m, inner.y_m), wrapped(frame.heading_rad + inner.heading_rad))


def _relative_pose(frame: Pose2D, outer: Pose2D) -> Pose2D:
    return Pose2D(*frame.relative_point(outer.point_m), wrapped(outer.heading_rad - frame.heading_rad))


def _is_under(robot: Pose2D, container: Container) -> bool:
    """Return whether the fork, from any side of a container, is well enough under the container to lift it."""
    fork = robot.pose_ahead(-FORK_M)
    aside_rad = abs(remainder(container.at.heading_rad - robot.heading_rad, pi / 2))
    return (
        hypot(fork.x_m - container.at.x_m, fork.y_m - container.at.y_m) < LIFT_TOLERANCE_M
        and aside_rad < LIFT_TOLERANCE_RAD
    )
