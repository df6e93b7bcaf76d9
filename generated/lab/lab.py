"""Observers of specs/lab.yaml.

Made by codra from specs/lab.yaml; edits are lost. Renew: codra compile specs/lab.yaml
"""

from py_trees.behaviour import Behaviour
from py_trees.composites import Sequence

from codra_dsl.runtime.generated_api import (
    Accept,
    Algorithm,
    ControlFlag,
    DueOrRunning,
    Identify,
    Observer,
    ObserverModel,
    Perceive,
    Precondition,
    PreviewCondition,
    SkillModel,
    VariableModel,
    boolean,
    integer,
    real,
    value,
)

LOCALIZE_CENTRIFUGE_ROTOR = Algorithm(
    name="localize_centrifuge_rotor",
    call="codra_papers.lab.perception.functions:localize_rotor",
    parameters={"machine": "centrifuge"},
    handles=("camera",),
    slots=("vision",),
    returns={"markers": integer(0, 12), "rotor_angle": real(unit="rad", optional=True)},
    timeout_s=6.0,
)


def centrifuge_rotor(observer: Observer) -> Behaviour:
    """Identify centrifuge_rotor_in_pos_1 and centrifuge_rotor_in_pos_2 (P1, Figure 4)."""
    perception = observer.branch(LOCALIZE_CENTRIFUGE_ROTOR)
    return Sequence(
        name="centrifuge_rotor",
        memory=False,
        children=[
            ControlFlag(observer),
            Precondition("centrifuge_in_observable_distance", value("centrifuge_in_observable_distance"), perception),
            Precondition("centrifuge_base_in_FOV", value("centrifuge_base_in_FOV"), perception),
            Precondition("centrifuge_open", value("centrifuge_open"), perception),
            DueOrRunning(perception),
            Perceive(perception),
            Accept("markers >= 1", value("markers") >= 1, perception),
            Identify("centrifuge_rotor_in_pos_1", abs(value("rotor_angle")) < 0.2, perception),
            Identify("centrifuge_rotor_in_pos_2", abs(value("rotor_angle") - 3.141592653589793) < 0.2, perception),
        ],
    )


VARIABLES: tuple[VariableModel, ...] = (
    VariableModel(name="robot_is_localized", type=boolean(), sources=("main_execution",)),
    VariableModel(name="centrifuge_rotor_in_pos_1", type=boolean(), refresh="on_event"),
    VariableModel(name="centrifuge_rotor_in_pos_2", type=boolean(), refresh="on_event"),
)

OBSERVERS: tuple[ObserverModel, ...] = (
    ObserverModel(
        name="centrifuge_rotor",
        identifies=("centrifuge_rotor_in_pos_1", "centrifuge_rotor_in_pos_2"),
        build=centrifuge_rotor,
        period_s=8.0,
        priority=5,
    ),
)

SKILLS: tuple[SkillModel, ...] = (
    SkillModel(
        name="turn_centrifuge_rotor",
        preview=("centrifuge_open", "centrifuge_rotor_in_pos_1", "centrifuge_rotor_in_pos_2"),
        preview_conditions=(PreviewCondition(text="centrifuge_open == true", condition=value("centrifuge_open")),),
        changes=("centrifuge_rotor_in_pos_1", "centrifuge_rotor_in_pos_2"),
    ),
    SkillModel(
        name="take_samples_from_centrifuge",
        preview=("centrifuge_open", "centrifuge_rotor_in_pos_1"),
        preview_conditions=(
            PreviewCondition(text="centrifuge_open == true", condition=value("centrifuge_open")),
            PreviewCondition(text="centrifuge_rotor_in_pos_1 == true", condition=value("centrifuge_rotor_in_pos_1")),
        ),
    ),
    SkillModel(
        name="bring_samples_to_centrifuge",
        preview=("centrifuge_open", "centrifuge_rotor_in_pos_2"),
        preview_conditions=(
            PreviewCondition(text="centrifuge_open == true", condition=value("centrifuge_open")),
            PreviewCondition(text="centrifuge_rotor_in_pos_2 == true", condition=value("centrifuge_rotor_in_pos_2")),
        ),
    ),
)
