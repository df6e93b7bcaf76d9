"""Durations of the robot's actions. They were declared before any observer was tuned."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum, auto
from random import Random
from types import MappingProxyType


class Phase(Enum):
    """The phases of actions. Each phase has a duration."""

    PLAN_LOOK = auto()
    MOVE_CAMERA = auto()
    SETTLE = auto()
    PLAN_UNLOCK = auto()
    PLAN_LOCK = auto()
    PLAN_OPEN = auto()
    PLAN_CLOSE = auto()
    PLAN_TRAY = auto()
    PLAN_ROTOR = auto()
    PLAN_DRIVE = auto()
    REACH = auto()
    GRIP = auto()
    REPLAN = auto()
    TURN_LEVER = auto()
    LIFT_LID = auto()
    LOWER_LID = auto()
    TURN_ROTOR = auto()
    LET_GO = auto()
    RETREAT = auto()
    CARRY_TRAY = auto()
    STOW_ARM = auto()
    RAISE_ARM = auto()
    LOOK_AROUND = auto()


@dataclass(frozen=True, slots=True)
class Spread:
    """A duration that varies. It is normally distributed, but never shorter than 0.4 times its mean."""

    mean_s: float
    deviation_s: float

    def draw(self, random: Random) -> float:
        """Return one duration in seconds."""
        return max(random.gauss(self.mean_s, self.deviation_s), 0.4 * self.mean_s)


DURATIONS: Mapping[Phase, Spread] = MappingProxyType(
    {
        Phase.PLAN_LOOK: Spread(3.5, 1.1),
        Phase.MOVE_CAMERA: Spread(8.5, 1.8),
        Phase.SETTLE: Spread(4.0, 0.7),
        Phase.PLAN_UNLOCK: Spread(35.0, 9.0),
        Phase.PLAN_LOCK: Spread(15.0, 5.0),
        Phase.PLAN_OPEN: Spread(46.0, 10.0),
        Phase.PLAN_CLOSE: Spread(12.0, 4.0),
        Phase.PLAN_TRAY: Spread(10.0, 3.0),
        Phase.PLAN_ROTOR: Spread(8.0, 2.0),
        Phase.PLAN_DRIVE: Spread(4.0, 1.0),
        Phase.REACH: Spread(12.0, 2.0),
        Phase.GRIP: Spread(6.0, 1.0),
        Phase.REPLAN: Spread(22.0, 6.0),
        Phase.TURN_LEVER: Spread(22.0, 3.0),
        Phase.LIFT_LID: Spread(50.0, 6.0),
        Phase.LOWER_LID: Spread(31.0, 5.0),
        Phase.TURN_ROTOR: Spread(10.0, 1.5),
        Phase.LET_GO: Spread(5.0, 1.0),
        Phase.RETREAT: Spread(14.0, 2.5),
        Phase.CARRY_TRAY: Spread(10.0, 2.0),
        Phase.STOW_ARM: Spread(6.0, 1.0),
        Phase.RAISE_ARM: Spread(8.0, 1.5),
        Phase.LOOK_AROUND: Spread(25.0, 6.0),
    }
)
"""Durations fitted to P1, section 4.2, without observers.

In P1, each of four perception tasks saves 15.8 s when the PCR-cycler is opened. This is 87 % of all perception and 18 %
of the total. So the total is 351 s, of which 73 s are perception. When the PCR-cycler is closed, each task saves 16.9
s, 89 % of perception and 24 % of the total: 282 s, of which 76 s are perception. Planning varies most, as in P1. See
`docs/papers/protocol.md`."""
