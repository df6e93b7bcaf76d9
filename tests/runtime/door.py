"""A small forest in the form of generated code, written by hand: is the door near, and is it open? (P1, Figure 4)."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from typing import Any

from py_trees.behaviour import Behaviour
from py_trees.composites import Sequence

from codra_dsl.runtime import ContextManager, ContextModel, SimClock
from codra_dsl.runtime.observers.behaviours import Accept, ControlFlag, DueOrRunning, Identify, Perceive, Precondition
from codra_dsl.runtime.observers.observer import Observer, ObserverModel
from codra_dsl.runtime.values.conditions import value
from codra_dsl.runtime.values.model import (
    Algorithm,
    ExpectationModel,
    ResourceModel,
    SkillModel,
    VariableModel,
    boolean,
    integer,
    real,
)


@dataclass
class Door:
    """The handle `door`: the results of perception, the duration of a look, and the instants of the calls.

    With `snapshot`, the evidence of `look` is taken at the first instant of the job, otherwise during the entire job.
    """

    distance_m: float = 1.0
    angle_rad: float | None = 0.0
    markers: int = 4
    duration_s: float = 0.5
    snapshot: bool = True
    instead: Callable[[Any], object] | None = None
    calls: list[tuple[str, float]] = field(default_factory=list)

    def asked_s(self, function_name: str) -> list[float]:
        return [at_s for name, at_s in self.calls if name == function_name]


def measure_distance(*, door: Door, job: Any) -> dict[str, object]:
    door.calls.append(("distance", job.now_s()))
    return {"distance": door.distance_m}


def look(*, door: Door, job: Any) -> object:
    door.calls.append(("look", job.now_s()))
    if door.instead is not None:
        return door.instead(job)
    look_result = {"angle": door.angle_rad, "markers": door.markers}
    if door.snapshot:
        job.evidence(job.now_s(), job.now_s())
    job.sleep(door.duration_s)
    return look_result


MEASURE_DISTANCE = Algorithm(
    name="measure_distance",
    call="tests.runtime.door:measure_distance",
    handles=("door",),
    returns={"distance": real(0.0, 100.0, unit="m")},
)
LOOK = Algorithm(
    name="look",
    call="tests.runtime.door:look",
    handles=("door",),
    slots=("vision",),
    returns={"angle": real(unit="rad", optional=True), "markers": integer(0, 12)},
    timeout_s=3.0,
)


def door_distance(observer: Observer) -> Behaviour:
    measure = observer.branch(MEASURE_DISTANCE)
    return Sequence(
        name="door_distance",
        memory=False,
        children=[
            ControlFlag(observer),
            Precondition("localized", value("localized"), measure),
            DueOrRunning(measure),
            Perceive(measure),
            Identify("near", value("distance") < 1.5, measure),
        ],
    )


def door_lid(observer: Observer) -> Behaviour:
    lid = observer.branch(LOOK)
    return Sequence(
        name="door_lid",
        memory=False,
        children=[
            ControlFlag(observer),
            Precondition("near", value("near"), lid),
            DueOrRunning(lid),
            Perceive(lid),
            Accept("markers >= 3", value("markers") >= 3, lid),
            Identify("open", value("angle") > 0.6, lid),
        ],
    )


OBSERVERS = (
    ObserverModel(name="door_distance", identifies=("near",), build=door_distance),
    ObserverModel(name="door_lid", identifies=("open",), build=door_lid, priority=5),
)
MODEL = ContextModel(
    name="door",
    variables=(
        VariableModel(name="localized", type=boolean(), sources=("main_execution",)),
        VariableModel(name="near", type=boolean(), when_unobservable="forget"),
        VariableModel(name="open", type=boolean()),
    ),
    observers=OBSERVERS,
    skills=(
        SkillModel(name="drive", preview=("near",)),
        SkillModel(
            name="open_door",
            preview=("open",),
            monitor=("open", "near"),
            changes=("open",),
            expects=(
                ExpectationModel(text="open becomes true within 5 s", condition=value("open"), within_s=5.0),
                ExpectationModel(text="near stays true", condition=value("near")),
            ),
        ),
    ),
    resources=(ResourceModel(name="door"), ResourceModel(name="vision", slots=1)),
)
GIVEN_NEAR = ContextModel(
    name="door",
    variables=(
        VariableModel(name="near", type=boolean(), sources=("main_execution",)),
        VariableModel(name="open", type=boolean()),
    ),
    observers=OBSERVERS[1:],
    skills=MODEL.skills,
    resources=MODEL.resources,
)
"""The same door, but the main execution writes `near`."""

Manager = ContextManager[str, str]


@contextmanager
def started(door: Door, model: ContextModel = MODEL, seed: int = 0) -> Iterator[tuple[Manager, SimClock]]:
    """Start the forest in simulated time; the robot is localized, or near."""
    clock = SimClock()
    with ContextManager[str, str](model, clock=clock, resources={"door": door}, seed=seed) as manager:
        manager.set("localized" if model is MODEL else "near", True)
        yield manager, clock
