"""Place the robot at rest in poses that a test chooses."""

from __future__ import annotations

from math import atan2
from random import Random

from codra_papers.lab.gaze import Gaze, gaze_in_frame
from codra_papers.lab.perception.layout import Part, machine_named
from codra_papers.lab.perception.poses import Pose
from codra_papers.lab.simulator.world import JointKey, LabWorld, Quantity, Values


class SteadyHand(Random):
    """Random numbers with which nothing slips, the localisation is never lost, and all durations are mean durations."""

    def random(self) -> float:
        return 0.5

    def gauss(self, mu: float = 0.0, sigma: float = 1.0) -> float:  # noqa: ARG002
        return mu


def put(world: LabWorld, channel: Quantity | JointKey, *values: float, at_s: float = 0.0) -> None:
    """Let a channel jump to other values right after an instant."""
    target_values: Values = values
    world.schedule(at_s, [world.moves_to(at_s, channel, target_values, 0.0)])


def place_robot_before(
    world: LabWorld, machine: str, gaze: Gaze, *, distance_m: float = 0.85, aside_m: float = 0.0, at_s: float = 0.0
) -> None:
    """Put the robot in front of a machine, facing it. The gaze of the camera is given in the machine's base frame."""
    map_from_machine = machine_named(machine).map_from_base
    x_axis = map_from_machine.rotation[:, 0]
    spot_m = map_from_machine.translation_m + distance_m * x_axis + aside_m * map_from_machine.rotation[:, 1]
    base = (float(spot_m[0]), float(spot_m[1]), atan2(-x_axis[1], -x_axis[0]))
    robot_from_machine = Pose.planar(*base).inverse() @ map_from_machine
    put(world, Quantity.BASE, *base, at_s=at_s)
    put(world, Quantity.GAZE, *gaze_in_frame(gaze, robot_from_machine), at_s=at_s)


def set_joint(world: LabWorld, machine: str, part: Part, angle_rad: float, *, at_s: float = 0.0) -> None:
    """Turn a machine's part at once."""
    put(world, JointKey(machine, part), angle_rad, at_s=at_s)
