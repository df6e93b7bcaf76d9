"""Observers of 'fridge' (template 'appliance').

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

MEASURE_FRIDGE = Algorithm(
    name="measure_fridge",
    call="examples.kitchen.perception:measure_distance",
    parameters={"target": "fridge", "offset": 0.12},
    handles=("kitchen",),
    returns={"distance": real(0, 20, unit="m")},
)

LOOK_AT_FRIDGE = Algorithm(
    name="look_at_fridge",
    call="examples.kitchen.perception:look_at_door",
    parameters={"door": "fridge"},
    handles=("kitchen",),
    slots=("vision",),
    returns={"angle": real(unit="rad", optional=True), "edges": integer(0, 50)},
    timeout_s=3.0,
)


def measure_fridge(observer: Observer) -> Behaviour:
    """Identify fridge_in_reach (P1, Figure 4)."""
    perception = observer.branch(MEASURE_FRIDGE)
    return Sequence(
        name="measure_fridge",
        memory=False,
        children=[
            ControlFlag(observer),
            Precondition("robot_is_localized", value("robot_is_localized"), perception),
            DueOrRunning(perception),
            Perceive(perception),
            Identify("fridge_in_reach", value("distance") < 0.9, perception),
        ],
    )


def look_at_fridge(observer: Observer) -> Behaviour:
    """Identify fridge_open and fridge_angle (P1, Figure 4)."""
    perception = observer.branch(LOOK_AT_FRIDGE)
    return Sequence(
        name="look_at_fridge",
        memory=False,
        children=[
            ControlFlag(observer),
            Precondition("fridge_in_reach", value("fridge_in_reach"), perception),
            Precondition("light_is_on", value("light_is_on"), perception),
            DueOrRunning(perception),
            Perceive(perception),
            Accept("edges >= 2", value("edges") >= 2, perception),
            Identify("fridge_open", value("angle") > 0.3490658503988659, perception),
            Identify("fridge_angle", value("angle"), perception),
        ],
    )


VARIABLES: tuple[VariableModel, ...] = (
    VariableModel(name="fridge_in_reach", type=boolean(), when_unobservable="forget"),
    VariableModel(name="fridge_open", type=boolean(), label="Fridge open", valid_for_s=120.0),
    VariableModel(name="fridge_angle", type=real(0, 2, unit="rad"), valid_for_s=120.0),
)

OBSERVERS: tuple[ObserverModel, ...] = (
    ObserverModel(name="measure_fridge", identifies=("fridge_in_reach",), build=measure_fridge),
    ObserverModel(name="look_at_fridge", identifies=("fridge_open", "fridge_angle"), build=look_at_fridge),
)

SKILLS: tuple[SkillModel, ...] = (
    SkillModel(
        name="open_fridge",
        preview=("fridge_open", "fridge_in_reach"),
        monitor=("fridge_open",),
        changes=("fridge_open", "fridge_angle"),
        expects=(
            ExpectationModel(
                text="fridge_open becomes true within 20 s",
                condition=value("fridge_open"),
                within_s=20.0,
            ),
        ),
    ),
)
