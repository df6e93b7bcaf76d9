"""Observers of 'centrifuge' (template 'tended_machine').

Made by codra from specs/lab.yaml; edits are lost. Renew: codra compile specs/lab.yaml
"""

from py_trees.behaviour import Behaviour
from py_trees.composites import Selector, Sequence

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

MEASURE_CENTRIFUGE_DISTANCE = Algorithm(
    name="measure_centrifuge_distance",
    call="codra_papers.lab.perception.functions:measure_distance",
    parameters={"machine": "centrifuge"},
    handles=("base",),
    returns={"distance": real(0, 50, unit="m")},
    timeout_s=1.0,
)

FIND_CENTRIFUGE_IN_VIEW = Algorithm(
    name="find_centrifuge_in_view",
    call="codra_papers.lab.perception.functions:find_in_view",
    parameters={"machine": "centrifuge"},
    handles=("camera",),
    slots=("vision",),
    returns={
        "base_share": real(0, 100, unit="percent"),
        "lid_share": real(0, 100, unit="percent"),
        "sharpness": real(0, 1),
    },
    timeout_s=3.0,
)

LOCALIZE_CENTRIFUGE_LID = Algorithm(
    name="localize_centrifuge_lid",
    call="codra_papers.lab.perception.functions:localize_lid",
    parameters={"machine": "centrifuge"},
    handles=("camera",),
    slots=("vision",),
    returns={
        "markers": integer(0, 12),
        "lid_angle": real(unit="rad", optional=True),
        "latched": boolean(optional=True),
    },
    timeout_s=8.0,
)

SEE_CENTRIFUGE_ROTOR = Algorithm(
    name="see_centrifuge_rotor",
    call="codra_papers.lab.perception.functions:localize_rotor",
    parameters={"machine": "centrifuge"},
    handles=("camera",),
    slots=("vision",),
    returns={"markers": integer(0, 12), "rotor_angle": real(unit="rad", optional=True)},
    timeout_s=6.0,
)


def centrifuge_distance(observer: Observer) -> Behaviour:
    """Identify centrifuge_in_observable_distance and centrifuge_in_manipulation_distance (P1, Figure 4)."""
    perception = observer.branch(MEASURE_CENTRIFUGE_DISTANCE)
    return Sequence(
        name="centrifuge_distance",
        memory=False,
        children=[
            ControlFlag(observer),
            Precondition("robot_is_localized", value("robot_is_localized"), perception),
            DueOrRunning(perception),
            Perceive(perception),
            Identify("centrifuge_in_observable_distance", value("distance") < 1.6, perception),
            Identify("centrifuge_in_manipulation_distance", value("distance") < 0.95, perception),
        ],
    )


def centrifuge_view_frame(observer: Observer) -> Behaviour:
    """Identify centrifuge_base_in_FOV and centrifuge_lid_in_FOV (P1, Figure 4)."""
    perception = observer.branch(FIND_CENTRIFUGE_IN_VIEW)
    return Sequence(
        name="centrifuge_view_frame",
        memory=False,
        children=[
            ControlFlag(observer),
            Precondition("centrifuge_in_observable_distance", value("centrifuge_in_observable_distance"), perception),
            DueOrRunning(perception),
            Perceive(perception),
            Accept("sharpness >= 0.5", value("sharpness") >= 0.5, perception),
            Identify("centrifuge_base_in_FOV", value("base_share") >= 50, perception),
            Identify("centrifuge_lid_in_FOV", value("lid_share") >= 50, perception),
        ],
    )


def centrifuge_lid(observer: Observer) -> Behaviour:
    """Identify centrifuge_open and centrifuge_locked (P1, Figure 4)."""
    localize_centrifuge_lid = observer.branch(LOCALIZE_CENTRIFUGE_LID)
    see_centrifuge_rotor = observer.branch(SEE_CENTRIFUGE_ROTOR)
    return Sequence(
        name="centrifuge_lid",
        memory=False,
        children=[
            ControlFlag(observer),
            Selector(
                name="alternatives",
                memory=False,
                children=[
                    Sequence(
                        name="localize_centrifuge_lid",
                        memory=False,
                        children=[
                            Precondition(
                                "centrifuge_in_observable_distance",
                                value("centrifuge_in_observable_distance"),
                                localize_centrifuge_lid,
                            ),
                            Precondition(
                                "centrifuge_base_in_FOV",
                                value("centrifuge_base_in_FOV"),
                                localize_centrifuge_lid,
                            ),
                            Precondition(
                                "centrifuge_lid_in_FOV",
                                value("centrifuge_lid_in_FOV"),
                                localize_centrifuge_lid,
                            ),
                            DueOrRunning(localize_centrifuge_lid),
                            Perceive(localize_centrifuge_lid),
                            Accept("markers >= 3", value("markers") >= 3, localize_centrifuge_lid),
                            Identify("centrifuge_open", value("lid_angle") > 0.6, localize_centrifuge_lid),
                            Identify("centrifuge_locked", value("latched"), localize_centrifuge_lid),
                        ],
                    ),
                    Sequence(
                        name="see_centrifuge_rotor",
                        memory=False,
                        children=[
                            Precondition(
                                "centrifuge_in_observable_distance",
                                value("centrifuge_in_observable_distance"),
                                see_centrifuge_rotor,
                            ),
                            Precondition(
                                "centrifuge_base_in_FOV",
                                value("centrifuge_base_in_FOV"),
                                see_centrifuge_rotor,
                            ),
                            Precondition(
                                "centrifuge_lid_in_FOV == false",
                                ~value("centrifuge_lid_in_FOV"),
                                see_centrifuge_rotor,
                            ),
                            DueOrRunning(see_centrifuge_rotor),
                            Perceive(see_centrifuge_rotor),
                            Accept("markers >= 1", value("markers") >= 1, see_centrifuge_rotor),
                            Identify("centrifuge_open", value("markers") >= 1, see_centrifuge_rotor),
                        ],
                    ),
                ],
            ),
        ],
    )


VARIABLES: tuple[VariableModel, ...] = (
    VariableModel(
        name="centrifuge_in_observable_distance",
        type=boolean(),
        when_unobservable="forget",
        refresh="on_event",
    ),
    VariableModel(
        name="centrifuge_in_manipulation_distance",
        type=boolean(),
        when_unobservable="forget",
        refresh="on_event",
    ),
    VariableModel(
        name="centrifuge_base_in_FOV",
        type=boolean(),
        valid_for_s=10.0,
        when_unobservable="forget",
        refresh="on_event",
    ),
    VariableModel(
        name="centrifuge_lid_in_FOV",
        type=boolean(),
        valid_for_s=10.0,
        when_unobservable="forget",
        refresh="on_event",
    ),
    VariableModel(name="centrifuge_open", type=boolean(), refresh="on_event"),
    VariableModel(name="centrifuge_locked", type=boolean(), refresh="on_event"),
)

OBSERVERS: tuple[ObserverModel, ...] = (
    ObserverModel(
        name="centrifuge_distance",
        identifies=("centrifuge_in_observable_distance", "centrifuge_in_manipulation_distance"),
        build=centrifuge_distance,
    ),
    ObserverModel(
        name="centrifuge_view_frame",
        identifies=("centrifuge_base_in_FOV", "centrifuge_lid_in_FOV"),
        build=centrifuge_view_frame,
        period_s=5.0,
        priority=10,
    ),
    ObserverModel(
        name="centrifuge_lid",
        identifies=("centrifuge_open", "centrifuge_locked"),
        build=centrifuge_lid,
        priority=5,
    ),
)

SKILLS: tuple[SkillModel, ...] = (
    SkillModel(
        name="drive_to_centrifuge",
        preview=("robot_is_localized",),
        monitor=("centrifuge_in_observable_distance",),
    ),
    SkillModel(
        name="unlock_centrifuge",
        preview=("centrifuge_locked", "centrifuge_in_manipulation_distance"),
        preview_conditions=(
            PreviewCondition(
                text="centrifuge_in_manipulation_distance == true",
                condition=value("centrifuge_in_manipulation_distance"),
            ),
        ),
        changes=("centrifuge_locked",),
    ),
    SkillModel(
        name="lock_centrifuge",
        preview=("centrifuge_open", "centrifuge_locked", "centrifuge_in_manipulation_distance"),
        preview_conditions=(
            PreviewCondition(text="centrifuge_open == false", condition=~value("centrifuge_open")),
            PreviewCondition(
                text="centrifuge_in_manipulation_distance == true",
                condition=value("centrifuge_in_manipulation_distance"),
            ),
        ),
        changes=("centrifuge_locked",),
    ),
    SkillModel(
        name="open_centrifuge",
        preview=("centrifuge_locked", "centrifuge_open", "centrifuge_in_manipulation_distance"),
        preview_conditions=(
            PreviewCondition(
                text="centrifuge_in_manipulation_distance == true",
                condition=value("centrifuge_in_manipulation_distance"),
            ),
        ),
        changes=("centrifuge_open",),
    ),
    SkillModel(
        name="close_centrifuge",
        preview=("centrifuge_open", "centrifuge_in_manipulation_distance"),
        preview_conditions=(
            PreviewCondition(
                text="centrifuge_in_manipulation_distance == true",
                condition=value("centrifuge_in_manipulation_distance"),
            ),
        ),
        changes=("centrifuge_open",),
    ),
)
