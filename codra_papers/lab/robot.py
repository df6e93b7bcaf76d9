"""The robot's body: it drives, looks and manipulates. Every action takes time and moves the camera.

An action changes only the parts that the hand really moves: if the robot pulls at a locked lid, the lid stays closed.
Sometimes a lever or a lid slips from the hand. The robot gets no report of success or failure, so it has to look.
"""

from __future__ import annotations

from enum import Enum, StrEnum
from math import atan2, hypot, pi, remainder
from random import Random
from typing import Protocol

from codra_papers.lab.gaze import (
    DECK_GAZE,
    Gaze,
    gaze_in_frame,
    grip_gaze,
    observation_gaze,
    ready_gaze,
    stand_off_gaze,
    tray_gaze,
)
from codra_papers.lab.perception.layout import Machine, Part
from codra_papers.lab.perception.poses import Pose
from codra_papers.lab.simulator.durations import Phase, Spread
from codra_papers.lab.simulator.world import (
    HOME,
    TRAVEL_GAZE,
    Channel,
    JointKey,
    LabWorld,
    Move,
    Path,
    Quantity,
    Values,
    straight_path,
)


class Clock(Protocol):
    """The clock of the robot's actions."""

    def now_s(self) -> float:
        """Return the current time in seconds."""
        ...

    def sleep(self, duration_s: float) -> None:
        """Let time pass."""
        ...


class Station(StrEnum):
    """The stations that the robot can drive to."""

    CENTRIFUGE = "centrifuge"
    PCR_CYCLER = "pcr_cycler"
    HOME = "home"


class RotorPosition(Enum):
    """The indexed positions of the centrifuge's rotor, by its angle."""

    FIRST = 0.0
    SECOND = pi


class OutOfReachError(Exception):
    """The robot is too far from a machine to touch it or to look at it closely."""


class LostError(Exception):
    """The robot has lost its localisation and therefore does not drive."""


SLIP_CHANCE = 0.03
"""Probability that a lever or a lid slips from the hand."""

SLIP_SHARE = 0.3
"""A part that slips stops after this share of its path."""

LOSS_CHANCE = 0.05
"""Probability that the robot loses its localisation on a drive."""

STATION_DISTANCE_M = 0.85
"""Distance of the robot from a machine's middle while it tends the machine."""

_AISLE_M = (2.05, 2.3)
_ARRIVAL_TOLERANCE_M = 0.05
_REACH_M = 0.95
_DRIVE_M_PER_S = 0.28
_TURN_RAD_PER_S = 0.45
_GRIPPING_GAP_M = 0.022
_OPEN_GAP_M = 0.08
_GAZE_DEVIATION_M = 0.01
_LOOKING_PHASES = frozenset({Phase.PLAN_LOOK, Phase.MOVE_CAMERA, Phase.SETTLE})


class Localization:
    """The handle that perception functions get as `base`: the localisation of the mobile base. It moves nothing."""

    def __init__(self, world: LabWorld, clock: Clock) -> None:
        self._world = world
        self._clock = clock

    def believed_map_from_base(self) -> Pose:
        """Return where the robot currently believes its base to be."""
        return self._world.believed_map_from_robot(self._clock.now_s())


class Robot:
    """A mobile manipulator. Call its methods from one thread. A method returns when its action is done.

    Attributes:
        laboratory: the laboratory in which the robot works.
        is_carrying: whether a sample tray lies on the robot's deck.
    """

    def __init__(self, world: LabWorld, clock: Clock, random: Random) -> None:
        """Create the robot of a world.

        Args:
            world: the world of the robot.
            clock: the clock with which the robot's actions wait.
            random: the source of durations, slips and losses of localisation. Nothing else draws from this source, so
                observers do not change the actions. Durations of looks have another source, so the number of looks does
                not change the other actions.
        """
        self._world = world
        self._clock = clock
        self._random = random
        self._looking_random = Random(random.random())
        self.laboratory = world.laboratory
        self.is_carrying = False

    # Localisation

    def is_localized(self) -> bool:
        """Return whether the robot is localised."""
        return self._world.state(self._clock.now_s()).is_localized

    def believed_map_from_base(self) -> Pose:
        """Return where the robot currently believes its base to be."""
        return self._world.believed_map_from_robot(self._clock.now_s())

    # Driving

    def drive_to(self, station: str) -> None:
        """Stow the arm, drive to a station, and raise the arm if the station is a machine.

        The drive takes about a minute. At both ends of the drive, the robot turns on the spot. The localisation may be
        lost on the way. The robot then finishes the drive without localisation, by its wheels alone.

        Args:
            station: `home`, or the name of a machine.

        Raises:
            LostError: the localisation was lost before the drive.
            ValueError: the laboratory has no such machine.
        """
        if not self.is_localized():
            raise LostError("the robot has lost its localisation; call relocalize() before drive_to()")
        self._wait(Phase.PLAN_DRIVE)
        self._move_cameras(TRAVEL_GAZE, TRAVEL_GAZE[3:], Phase.STOW_ARM)
        goal = self._goal(station)
        is_lost_on_the_way = self._random.random() < LOSS_CHANCE
        *corners, end = self._waypoints(goal)
        for corner in corners:
            self._drive_straight_to(*corner)
        if is_lost_on_the_way:
            self._schedule(self._new_move(Quantity.LOCALIZED, (0.0,), 0.0))
        self._drive_straight_to(*end)
        self._turn(goal[2])
        if station != Station.HOME:
            shape = self._machine(station).shape
            middle = self._gaze_in_robot_frame(station, observation_gaze(shape, Part.LID))[3:]
            self._move_cameras(self._gaze_in_robot_frame(station, ready_gaze(shape)), middle, Phase.RAISE_ARM)

    def relocalize(self) -> None:
        """Look around until the robot is localised again."""
        duration_s = self._draw(Phase.LOOK_AROUND)
        self._clock.sleep(0.9 * duration_s)
        self._schedule(self._new_move(Quantity.LOCALIZED, (1.0,), 0.0))
        self._clock.sleep(0.1 * duration_s)

    def _goal(self, station: str) -> tuple[float, float, float]:
        """Return the true end of the drive: the station, displaced by the localisation error at the start."""
        wanted_pose = Pose.planar(*HOME) if station == Station.HOME else _station_pose(self._machine(station))
        state = self._world.state(self._clock.now_s())
        believed_pose = self._world.believed_map_from_robot(state.t_s)
        goal = wanted_pose @ believed_pose.inverse() @ state.map_from_robot()
        return (*goal.translation_m[:2].tolist(), atan2(goal.rotation[1, 0], goal.rotation[0, 0]))

    def _waypoints(self, goal: tuple[float, float, float]) -> list[tuple[float, float]]:
        """Return the points to drive through. They lead past the table of the PCR-cycler in the middle of the room."""
        _, y_m, _ = self._world.state(self._clock.now_s()).base
        table_y_m = self._machine(Station.PCR_CYCLER).map_from_base.translation_m[1]
        passes_table = (y_m < table_y_m) != (goal[1] < table_y_m)
        return [_AISLE_M, goal[:2]] if passes_table else [goal[:2]]

    def _drive_straight_to(self, x_m: float, y_m: float) -> None:
        from_x_m, from_y_m, heading_rad = self._world.state(self._clock.now_s()).base
        length_m = hypot(x_m - from_x_m, y_m - from_y_m)
        if length_m < _ARRIVAL_TOLERANCE_M:
            return
        drive_heading_rad = _nearest_heading(heading_rad, atan2(y_m - from_y_m, x_m - from_x_m))
        self._turn(drive_heading_rad)
        duration_s = self._varied_duration_s(2.0 + length_m / _DRIVE_M_PER_S)
        self._schedule(self._new_move(Quantity.BASE, (x_m, y_m, drive_heading_rad), duration_s))
        self._clock.sleep(duration_s)

    def _turn(self, heading_rad: float) -> None:
        x_m, y_m, before_rad = self._world.state(self._clock.now_s()).base
        after_rad = _nearest_heading(before_rad, heading_rad)
        duration_s = self._varied_duration_s(1.5 + abs(after_rad - before_rad) / _TURN_RAD_PER_S)
        self._schedule(self._new_move(Quantity.BASE, (x_m, y_m, after_rad), duration_s))
        self._clock.sleep(duration_s)

    # Looking

    def look_at(self, machine: str, part: Part) -> None:
        """Plan a look, move the camera to a pose that shows a part well, and wait until the camera is still.

        A look takes about 16 s. The robot uses its believed position. From look to look, the camera's position varies
        by about a centimetre.

        Raises:
            OutOfReachError: the machine is too far away for a close look.
            ValueError: the laboratory has no such machine.
        """
        self._check_reach(machine)
        believed_pose = self._world.believed_map_from_robot(self._clock.now_s())
        target_machine = self._machine(machine)
        gaze = gaze_in_frame(
            observation_gaze(target_machine.shape, part), believed_pose.inverse() @ target_machine.map_from_base
        )
        eye_m = tuple(number_m + self._looking_random.gauss(0.0, _GAZE_DEVIATION_M) for number_m in gaze[:3])
        self._wait(Phase.PLAN_LOOK)
        self._move_camera(eye_m + gaze[3:], Phase.MOVE_CAMERA)
        self._wait(Phase.SETTLE)

    # Manipulating

    def unlock(self, machine: str) -> None:
        """Turn a machine's latch lever to unlocked, in about two minutes. The arm then waits in front of the machine.

        Raises:
            OutOfReachError: the machine is out of the arm's reach. All manipulating methods raise this error.
            ValueError: the laboratory has no such machine. All manipulating methods raise this error.
        """
        self._move_part(machine, Part.LATCH, self._end_rad(machine, Part.LATCH), (Phase.PLAN_UNLOCK, Phase.TURN_LEVER))

    def lock(self, machine: str) -> None:
        """Turn a machine's latch lever to locked, in about a minute and a half."""
        self._move_part(machine, Part.LATCH, 0.0, (Phase.PLAN_LOCK, Phase.TURN_LEVER))

    def open_lid(self, machine: str) -> None:
        """Pull a machine's lid open, in about two and a half minutes. A locked lid does not follow the hand."""
        self._move_part(machine, Part.LID, self._end_rad(machine, Part.LID), (Phase.PLAN_OPEN, Phase.LIFT_LID))

    def close_lid(self, machine: str) -> None:
        """Lower a machine's lid, in about two minutes."""
        self._move_part(machine, Part.LID, 0.0, (Phase.PLAN_CLOSE, Phase.LOWER_LID))

    def turn_rotor(self, position: RotorPosition) -> None:
        """Turn the centrifuge's rotor to a position, in about a minute. It does not turn if the lid is closed."""
        machine = Station.CENTRIFUGE.value
        self._check_reach(machine)
        grip = self._grip_at(machine, Part.ROTOR, 0.0)
        self._wait(Phase.PLAN_ROTOR)
        self._reach(stand_off_gaze(grip))
        if self._lid_is_open(machine):
            self._grip(grip)
            key = JointKey(machine, Part.ROTOR)
            duration_s = self._draw(Phase.TURN_ROTOR)
            self._schedule(self._new_move(key, (position.value,), duration_s))
            self._clock.sleep(duration_s)
            self._let_go(stand_off_gaze(grip))
        self.draw_back(machine)

    def take_samples(self, machine: str) -> None:
        """Take the sample tray out of a machine and lay it on the deck, in about a minute.

        If the lid is closed, the robot takes no tray and `is_carrying` stays False.
        """
        self._check_reach(machine)
        tray = self._gaze_in_robot_frame(machine, tray_gaze(self._machine(machine).shape))
        self._wait(Phase.PLAN_TRAY)
        self._reach(stand_off_gaze(tray))
        if self._lid_is_open(machine):
            self._grip(tray)
            self._schedule(self._new_move(Quantity.HOLDING, (1.0,), 0.0))
            self._move_camera(stand_off_gaze(tray), Phase.CARRY_TRAY)
            self._move_camera(DECK_GAZE, Phase.CARRY_TRAY)
            self._lay_down(DECK_GAZE)
            self.is_carrying = True
        self.draw_back(machine)

    def bring_samples(self, machine: str) -> None:
        """Take the sample tray from the deck and put it into a machine, in about a minute.

        If the lid is closed, the robot puts the tray back on the deck and `is_carrying` stays True.

        Raises:
            RuntimeError: there is no tray on the deck.
        """
        if not self.is_carrying:
            raise RuntimeError("the robot carries no sample tray; call take_samples() before bring_samples()")
        self._check_reach(machine)
        self._wait(Phase.PLAN_TRAY)
        self._reach(stand_off_gaze(DECK_GAZE))
        self._grip(DECK_GAZE)
        self._schedule(self._new_move(Quantity.HOLDING, (1.0,), 0.0))
        tray = self._gaze_in_robot_frame(machine, tray_gaze(self._machine(machine).shape))
        self._move_camera(stand_off_gaze(tray), Phase.CARRY_TRAY)
        lid_is_open = self._lid_is_open(machine)
        place = tray if lid_is_open else DECK_GAZE
        self._move_camera(place, Phase.CARRY_TRAY)
        self._lay_down(place)
        self.is_carrying = not lid_is_open
        self.draw_back(machine)

    def _move_part(self, machine: str, part: Part, to_rad: float, phases: tuple[Phase, Phase]) -> None:
        """Grip a part, move it with the hand, let go and retreat.

        Args:
            machine: the name of the machine.
            part: the part to move.
            to_rad: the angle to which the part is moved.
            phases: the phase of planning, and the phase of moving.
        """
        self._check_reach(machine)
        key = JointKey(machine, part)
        self._wait(phases[0])
        self._reach(stand_off_gaze(self._grip_at(machine, part, self._angle_rad(key))))
        from_rad = self._angle_rad(key)  # a person may have moved the part in the meantime
        grip = self._grip_at(machine, part, from_rad)
        self._grip(grip)
        self._wait(Phase.REPLAN)
        duration_s, slips = self._draw(phases[1]), self._random.random() < SLIP_CHANCE
        if self._follows_hand(machine, part):
            self._schedule(
                Move(channel=key, path=_angle_path(from_rad, to_rad, slips=slips), duration_s=duration_s),
                Move(channel=Quantity.GAZE, path=self._gaze_path(key, from_rad, to_rad), duration_s=duration_s),
            )
            grip = self._grip_at(machine, part, to_rad)
        self._clock.sleep(duration_s)
        self._let_go(stand_off_gaze(grip))
        self.draw_back(machine)

    def _follows_hand(self, machine: str, part: Part) -> bool:
        """Return whether a part follows the hand. A closed lid follows only if the latch is at least half unlocked."""
        angles_rad = self._world.state(self._clock.now_s()).joints_rad
        lid_is_shut = angles_rad[JointKey(machine, Part.LID)] < 0.05
        latch_holds = angles_rad[JointKey(machine, Part.LATCH)] < self._end_rad(machine, Part.LATCH) / 2
        return not (part is Part.LID and lid_is_shut and latch_holds)

    def _lid_is_open(self, machine: str) -> bool:
        """Return whether the lid is open far enough for the hand."""
        angle_rad = self._world.state(self._clock.now_s()).joints_rad[JointKey(machine, Part.LID)]
        return angle_rad > self._end_rad(machine, Part.LID) / 2

    def _gaze_path(self, key: JointKey, from_rad: float, to_rad: float) -> Path:
        """Return the path of the gaze while the hand moves a part from one angle to another."""
        machine, robot_from_machine = self._machine(key.machine), self._robot_from_machine(key.machine)

        def path(progress: float) -> Gaze:
            angle_rad = from_rad + (to_rad - from_rad) * progress
            return gaze_in_frame(grip_gaze(machine, key.part, angle_rad), robot_from_machine)

        return path

    # Parts of actions

    def _reach(self, gaze: Gaze) -> None:
        """Move the open hand in front of a part."""
        duration_s = self._draw(Phase.REACH)
        self._schedule(
            self._new_move(Quantity.GAZE, gaze, duration_s),
            self._new_move(Quantity.REACH, (1.0,), duration_s),
            self._new_move(Quantity.OPENING, (_OPEN_GAP_M,), duration_s),
        )
        self._clock.sleep(duration_s)

    def _grip(self, gaze: Gaze) -> None:
        """Move the hand around a part, then close the fingers."""
        duration_s = self._draw(Phase.GRIP)
        self._schedule(
            self._new_move(Quantity.GAZE, gaze, duration_s * 0.6),
            self._new_move(Quantity.OPENING, (_GRIPPING_GAP_M,), duration_s * 0.4, delay_s=duration_s * 0.6),
        )
        self._clock.sleep(duration_s)

    def _let_go(self, gaze: Gaze) -> None:
        """Open the fingers, then draw the hand back."""
        duration_s = self._draw(Phase.LET_GO)
        self._schedule(
            self._new_move(Quantity.OPENING, (_OPEN_GAP_M,), duration_s * 0.4),
            self._new_move(Quantity.GAZE, gaze, duration_s * 0.6, delay_s=duration_s * 0.4),
        )
        self._clock.sleep(duration_s)

    def _lay_down(self, gaze: Gaze) -> None:
        self._schedule(self._new_move(Quantity.HOLDING, (0.0,), 0.0))
        self._let_go(stand_off_gaze(gaze))

    def draw_back(self, machine: str) -> None:
        """Draw the hand back out of sight, and move the camera to the pose in which it sees the machine."""
        duration_s = self._draw(Phase.RETREAT)
        self._schedule(
            self._new_move(
                Quantity.GAZE, self._gaze_in_robot_frame(machine, ready_gaze(self._machine(machine).shape)), duration_s
            ),
            self._new_move(Quantity.REACH, (0.0,), duration_s),
        )
        self._clock.sleep(duration_s)

    def _move_cameras(self, gaze: Gaze, mast_target_m: Values, phase: Phase) -> None:
        """Move the arm's camera, and in the same time point the camera on the mast at a point."""
        duration_s = self._draw(phase)
        self._schedule(
            self._new_move(Quantity.GAZE, gaze, duration_s), self._new_move(Quantity.MAST, mast_target_m, duration_s)
        )
        self._clock.sleep(duration_s)

    def _move_camera(self, gaze: Gaze, phase: Phase) -> None:
        duration_s = self._draw(phase)
        self._schedule(self._new_move(Quantity.GAZE, gaze, duration_s))
        self._clock.sleep(duration_s)

    def _wait(self, phase: Phase) -> None:
        self._clock.sleep(self._draw(phase))

    def _draw(self, phase: Phase) -> float:
        return self.laboratory.duration(phase).draw(self._looking_random if phase in _LOOKING_PHASES else self._random)

    def _varied_duration_s(self, duration_s: float) -> float:
        return Spread(duration_s, 0.15 * duration_s).draw(self._random)

    def _schedule(self, *moves: Move) -> None:
        self._world.schedule(self._clock.now_s(), moves)

    def _new_move(self, channel: Channel, values: Values, duration_s: float, *, delay_s: float = 0.0) -> Move:
        return self._world.moves_to(self._clock.now_s(), channel, values, duration_s, delay_s=delay_s)

    def _gaze_in_robot_frame(self, machine: str, gaze: Gaze) -> Gaze:
        """Transform a gaze from a machine's base frame to the robot's frame.

        The true pose of the robot is used, because the hand works by touch, without the localisation error.
        """
        return gaze_in_frame(gaze, self._robot_from_machine(machine))

    def _grip_at(self, machine: str, part: Part, angle_rad: float) -> Gaze:
        """Return the gaze while the fingers hold a part whose joint is at an angle, in the robot's frame."""
        return self._gaze_in_robot_frame(machine, grip_gaze(self._machine(machine), part, angle_rad))

    def _machine(self, name: str) -> Machine:
        return self.laboratory.machine(name)

    def _angle_rad(self, key: JointKey) -> float:
        return self._world.state(self._clock.now_s()).joints_rad[key]

    def _end_rad(self, machine: str, part: Part) -> float:
        """Return the upper end of the range of a part's joint, where a lid is open or a latch is unlocked."""
        return self._machine(machine).joint(part).range_rad[1]

    def _robot_from_machine(self, machine: str) -> Pose:
        map_from_robot = self._world.state(self._clock.now_s()).map_from_robot()
        return map_from_robot.inverse() @ self._machine(machine).map_from_base

    def _check_reach(self, machine: str) -> None:
        distance_m = self._machine(machine).distance_m(self._world.state(self._clock.now_s()).map_from_robot())
        if distance_m > _REACH_M:
            raise OutOfReachError(
                f"the robot is {distance_m:.2f} m from the {machine}, and its arm reaches {_REACH_M:g} m;"
                " drive there first"
            )


def _station_pose(machine: Machine) -> Pose:
    """Return the base pose for tending a machine: in front of the machine, facing it."""
    x_axis = machine.map_from_base.rotation[:, 0]
    x_m, y_m, _ = machine.map_from_base.translation_m + STATION_DISTANCE_M * x_axis
    return Pose.planar(x_m, y_m, atan2(-x_axis[1], -x_axis[0]))


def _angle_path(from_rad: float, to_rad: float, *, slips: bool) -> Path:
    """Return the path of a part's angle. A part that slips stops after `SLIP_SHARE` of the path."""
    full_path = straight_path((from_rad,), (to_rad,))
    return (lambda progress: full_path(min(progress, SLIP_SHARE))) if slips else full_path


def _nearest_heading(before_rad: float, heading_rad: float) -> float:
    """Return the angle nearest to `before_rad` that differs from `heading_rad` only by full turns."""
    return before_rad + remainder(heading_rad - before_rad, 2 * pi)
