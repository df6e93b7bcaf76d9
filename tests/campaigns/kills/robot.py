"""A robot in the kitchen, in real time and with the compiled package.

Run it with `python -m tests.campaigns.kills.robot JOURNAL SEED`.

After each action, it prints the instant before the action.
"""

from __future__ import annotations

import sys
from random import Random
from types import SimpleNamespace
from typing import Any

from codra_dsl.runtime import Journal, WallClock
from generated import kitchen

ROOM: dict[str, Any] = {
    "robot_m": 0.0,
    "place_m": {"fridge": 0.5, "dishwasher": 3.0},
    "angle_rad": {"fridge": 0.0, "dishwasher": 1.0},
    "edges": 10,
    "kettle_bearing_rad": 0.0,
    "kettle_docked": True,
    "kettle_work_s": 0.05,
    "water_kg": 1.2,
    "steam": 0.0,
    "warmth": 20.0,
    "sharpness": 0.9,
    "lamp": "high",
    "power_w": 500.0,
    "pot_on_hob": True,
    "fill": 40.0,
}


def main(path: str, seed: int) -> None:
    """Work until killed."""
    chance, room = Random(seed), SimpleNamespace(**ROOM)
    with (
        WallClock() as clock,
        kitchen.start(clock=clock, resources={"kitchen": room}, record=Journal(path), seed=seed) as codra,
    ):
        codra.set("robot_is_localized", True)
        while True:
            before_s = clock.now_s()
            room.robot_m, room.water_kg, room.edges = chance.uniform(0, 3), chance.uniform(0, 2), chance.choice([0, 10])
            codra.set("robot_place", chance.choice(["counter", "stove"]))
            codra.agent("wall_switch").set("light_is_on", chance.random() < 0.8)
            with codra.skill(chance.choice(["boil_water", "cook", "open_fridge", "pour_water"])) as skill:
                codra.decide("kettle_water", lambda: 1.0, wait_up_to_s=0.02)
                with skill.acting():
                    clock.sleep(chance.random() * 0.05)
                codra.decide("fridge_open", lambda: False)
            codra.expect("cook", "open_dishwasher")
            print(repr(before_s), flush=True)


if __name__ == "__main__":
    main(sys.argv[1], int(sys.argv[2]))
