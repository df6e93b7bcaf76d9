"""A robot in real time that writes its journal as fast as it can, with jobs in separate threads."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

from codra_dsl.logic import value
from codra_dsl.runtime import ContextManager, Journal, WallClock
from codra_dsl.runtime.context.model import ContextModel
from codra_dsl.runtime.values.model import SkillModel, integer
from tests.runtime.forests import World, forest, given, observer, seen, takes, variable

ACKNOWLEDGED_BYTES = 4


def model() -> ContextModel:
    return forest(
        [given("count", type=integer()), given("near"), variable("open", when_unobservable="forget"), variable("full")],
        observer("o", seen("eye", "open", when=[value("near")], slots=("vision",)), period_s=0.0),
        observer("p", seen("ear", "full", when=[value("open")], slots=("vision",), timeout_s=0.002), period_s=0.0),
        skills=[SkillModel(name="fill", preview=("open",), monitor=("full",), changes=("full",))],
        slots={"vision": 1},
    )


def write(path: Path, acknowledge: int, rounds: int) -> None:
    """Run for some rounds; after each write of `count`, send its number through a pipe."""
    finds: dict[str, Any] = {"eye": takes(0.001, {"seen": True}), "ear": takes(0.001, {"seen": False})}
    journal = Journal(path)
    with (
        WallClock() as clock,
        ContextManager[str, str](model(), clock=clock, resources={"world": World(finds)}, record=journal) as manager,
    ):
        os.write(acknowledge, (0).to_bytes(ACKNOWLEDGED_BYTES))
        for number in range(1, rounds + 1):
            manager.set("count", number)
            os.write(acknowledge, number.to_bytes(ACKNOWLEDGED_BYTES))
            manager.set("near", number % 7 != 0)
            with manager.skill("fill") as skill:
                manager.decide("open", lambda: None, wait_up_to_s=0.001)
                with skill.acting():
                    manager.decide("full", lambda: True)
