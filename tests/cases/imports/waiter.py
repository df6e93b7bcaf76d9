"""A robot that serves tables: a main execution in plain Python, without context."""

import time

import vision
from gripper import is_holding as holding_something


class Waiter:
    def __init__(self, base, arm, battery):
        self._base = base
        self._arm = arm
        self._battery = battery

    def serve(self):
        for table in ("window", "door"):
            self._visit(table)

    def _visit(self, table):
        self._require(self._battery.level() > 20, "the battery is low")
        while not self._base.is_at(table):
            self._base.step()
        if vision.is_occupied(table):
            return
        cup = vision.detect("cup", timeout=3)
        if cup is None:
            self._arm.look_around()
        elif cup.distance < 0.4 and not holding_something():
            self._arm.grasp(cup)
        if not self.door_is_open() and isinstance(cup, vision.Cup):
            time.sleep(3)

    def _require(self, holds, message):
        if not holds:
            raise RuntimeError(message)

    def door_is_open(self):
        image = self._arm.capture()
        if image is None:
            return None
        return image.gap > 0.4


def clean(robot, surface):
    match robot.mode():
        case "dry" | "wet":
            robot.wipe(surface, wait=3 if len(surface) > 2 else 5)


if __name__ == "__main__":
    Waiter(None, None, None).serve()
