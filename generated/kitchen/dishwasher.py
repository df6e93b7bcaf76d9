"""Observers of 'dishwasher' (template 'appliance').

Made by codra from specs/kitchen.yaml; edits are lost. Renew: codra compile specs/kitchen.yaml
"""

from py_trees.behaviour import Behaviour
from py_trees.composites import Sequence

from codra_dsl.runtime.generated_api import (
    Accept,
    Algorithm,
    ControlFlag,
    DueOrRunning,
    ExpectationModel,
    Identify,
    Observer,
    ObserverModel,
    Perceive,
    Precondition,
    SkillModel,
    VariableModel,
    boolean,
    integer,
    real,
    value,
)

MEASURE_DISHWASHER = Algorithm(
    name="measure_dishwasher",
    call="examples.kitchen.perception:measure_distance",
    parameters={"target": "dishwasher", "offset": 0.12},
    handles=("kitchen",),
    returns={"distance": real(0, 20, unit="m")},
)

LOOK_AT_DISHWASHER = Algorithm(
    name="look_at_dishwasher",
    call="examples.kitchen.perception:look_at_door",
    parameters={"door": "dishwasher"},
    handles=("kitchen",),
    slots=("vision",),
    returns={"angle": real(unit="rad", optional=True), "edges": integer(0, 50)},
    timeout_s=3.0,
)


def measure_dishwasher(observer: Observer) -> Behaviour:
    """Identify dishwasher_in_reach (P1, Figure 4)."""
    perception = observer.branch(MEASURE_DISHWASHER)
    return Sequence(
        name="measure_dishwasher",
        memory=False,
        children=[
            ControlFlag(observer),
            Precondition("robot_is_localized", value("robot_is_localized"), perception),
            DueOrRunning(perception),
            Perceive(perception),
            Identify("dishwasher_in_reach", value("distance") < 0.7, perception),
        ],
    )


def look_at_dishwasher(observer: Observer) -> Behaviour:
    """Identify dishwasher_open and dishwasher_angle (P1, Figure 4)."""
    perception = observer.branch(LOOK_AT_DISHWASHER)
    return Sequence(
        name="look_at_dishwasher",
        memory=False,
        children=[
            ControlFlag(observer),
            Precondition("dishwasher_in_reach", value("dishwasher_in_reach"), perception),
            Precondition("light_is_on", value("light_is_on"), perception),
            DueOrRunning(perception),
            Perceive(perception),
            Accept("edges >= 2", value("edges") >= 2, perception),
            Identify("dishwasher_open", value("angle") > 0.3490658503988659, perception),
            Identify("dishwasher_angle", value("angle"), perception),
        ],
    )


VARIABLES: tuple[VariableModel, ...] = (
    VariableModel(name="dishwasher_in_reach", type=boolean(), when_unobservable="forget"),
    VariableModel(name="dishwasher_open", type=boolean(), label="Dishwasher open", valid_for_s=120.0),
    VariableModel(name="dishwasher_angle", type=real(0, 2, unit="rad"), valid_for_s=120.0),
)

OBSERVERS: tuple[ObserverModel, ...] = (
    ObserverModel(name="measure_dishwasher", identifies=("dishwasher_in_reach",), build=measure_dishwasher),
    ObserverModel(
        name="look_at_dishwasher",
        identifies=("dishwasher_open", "dishwasher_angle"),
        build=look_at_dishwasher,
    ),
)

SKILLS: tuple[SkillModel, ...] = (
    SkillModel(
        name="open_dishwasher",
        preview=("dishwasher_open", "dishwasher_in_reach"),
        monitor=("dishwasher_open",),
        changes=("dishwasher_open", "dishwasher_angle"),
        expects=(
            ExpectationModel(
                text="dishwasher_open becomes true within 20 s",
                condition=value("dishwasher_open"),
                within_s=20.0,
            ),
        ),
    ),
)
