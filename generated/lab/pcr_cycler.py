"""Observers of 'pcr_cycler' (template 'tended_machine').

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

MEASURE_PCR_CYCLER_DISTANCE = Algorithm(
    name="measure_pcr_cycler_distance",
    call="codra_papers.lab.perception.functions:measure_distance",
    parameters={"machine": "pcr_cycler"},
    handles=("base",),
    returns={"distance": real(0, 50, unit="m")},
    timeout_s=1.0,
)

FIND_PCR_CYCLER_IN_VIEW = Algorithm(
    name="find_pcr_cycler_in_view",
    call="codra_papers.lab.perception.functions:find_in_view",
    parameters={"machine": "pcr_cycler"},
    handles=("camera",),
    slots=("vision",),
    returns={
        "base_share": real(0, 100, unit="percent"),
        "lid_share": real(0, 100, unit="percent"),
        "sharpness": real(0, 1),
    },
    timeout_s=3.0,
)

LOCALIZE_PCR_CYCLER_LID = Algorithm(
    name="localize_pcr_cycler_lid",
    call="codra_papers.lab.perception.functions:localize_lid",
    parameters={"machine": "pcr_cycler"},
    handles=("camera",),
    slots=("vision",),
    returns={
        "markers": integer(0, 12),
        "lid_angle": real(unit="rad", optional=True),
        "latched": boolean(optional=True),
    },
    timeout_s=8.0,
)


def pcr_cycler_distance(observer: Observer) -> Behaviour:
    """Identify pcr_cycler_in_observable_distance and pcr_cycler_in_manipulation_distance (P1, Figure 4)."""
    perception = observer.branch(MEASURE_PCR_CYCLER_DISTANCE)
    return Sequence(
        name="pcr_cycler_distance",
        memory=False,
        children=[
            ControlFlag(observer),
            Precondition("robot_is_localized", value("robot_is_localized"), perception),
            DueOrRunning(perception),
            Perceive(perception),
            Identify("pcr_cycler_in_observable_distance", value("distance") < 1.6, perception),
            Identify("pcr_cycler_in_manipulation_distance", value("distance") < 0.95, perception),
        ],
    )


def pcr_cycler_view_frame(observer: Observer) -> Behaviour:
    """Identify pcr_cycler_base_in_FOV and pcr_cycler_lid_in_FOV (P1, Figure 4)."""
    perception = observer.branch(FIND_PCR_CYCLER_IN_VIEW)
    return Sequence(
        name="pcr_cycler_view_frame",
        memory=False,
        children=[
            ControlFlag(observer),
            Precondition("pcr_cycler_in_observable_distance", value("pcr_cycler_in_observable_distance"), perception),
            DueOrRunning(perception),
            Perceive(perception),
            Accept("sharpness >= 0.5", value("sharpness") >= 0.5, perception),
            Identify("pcr_cycler_base_in_FOV", value("base_share") >= 50, perception),
            Identify("pcr_cycler_lid_in_FOV", value("lid_share") >= 50, perception),
        ],
    )


def pcr_cycler_lid(observer: Observer) -> Behaviour:
    """Identify pcr_cycler_open and pcr_cycler_locked (P1, Figure 4)."""
    perception = observer.branch(LOCALIZE_PCR_CYCLER_LID)
    return Sequence(
        name="pcr_cycler_lid",
        memory=False,
        children=[
            ControlFlag(observer),
            Precondition("pcr_cycler_in_observable_distance", value("pcr_cycler_in_observable_distance"), perception),
            Precondition("pcr_cycler_base_in_FOV", value("pcr_cycler_base_in_FOV"), perception),
            Precondition("pcr_cycler_lid_in_FOV", value("pcr_cycler_lid_in_FOV"), perception),
            DueOrRunning(perception),
            Perceive(perception),
            Accept("markers >= 2", value("markers") >= 2, perception),
            Identify("pcr_cycler_open", value("lid_angle") > 0.6, perception),
            Identify("pcr_cycler_locked", value("latched"), perception),
        ],
    )


VARIABLES: tuple[VariableModel, ...] = (
    VariableModel(
        name="pcr_cycler_in_observable_distance",
        type=boolean(),
        label="PCR-cycler_in_observable_distance",
        when_unobservable="forget",
        refresh="on_event",
    ),
    VariableModel(
        name="pcr_cycler_in_manipulation_distance",
        type=boolean(),
        label="PCR-cycler_in_manipulation_distance",
        when_unobservable="forget",
        refresh="on_event",
    ),
    VariableModel(
        name="pcr_cycler_base_in_FOV",
        type=boolean(),
        label="PCR-cycler_base_in_FOV",
        valid_for_s=10.0,
        when_unobservable="forget",
        refresh="on_event",
    ),
    VariableModel(
        name="pcr_cycler_lid_in_FOV",
        type=boolean(),
        label="PCR-cycler_lid_in_FOV",
        valid_for_s=10.0,
        when_unobservable="forget",
        refresh="on_event",
    ),
    VariableModel(name="pcr_cycler_open", type=boolean(), label="PCR-cycler_open", refresh="on_event"),
    VariableModel(name="pcr_cycler_locked", type=boolean(), label="PCR-cycler_locked", refresh="on_event"),
)

OBSERVERS: tuple[ObserverModel, ...] = (
    ObserverModel(
        name="pcr_cycler_distance",
        identifies=("pcr_cycler_in_observable_distance", "pcr_cycler_in_manipulation_distance"),
        build=pcr_cycler_distance,
    ),
    ObserverModel(
        name="pcr_cycler_view_frame",
        identifies=("pcr_cycler_base_in_FOV", "pcr_cycler_lid_in_FOV"),
        build=pcr_cycler_view_frame,
        period_s=5.0,
        priority=10,
    ),
    ObserverModel(
        name="pcr_cycler_lid",
        identifies=("pcr_cycler_open", "pcr_cycler_locked"),
        build=pcr_cycler_lid,
        priority=5,
    ),
)

SKILLS: tuple[SkillModel, ...] = (
    SkillModel(
        name="drive_to_pcr_cycler",
        preview=("robot_is_localized",),
        monitor=("pcr_cycler_in_observable_distance",),
    ),
    SkillModel(
        name="unlock_pcr_cycler",
        preview=("pcr_cycler_locked", "pcr_cycler_in_manipulation_distance"),
        preview_conditions=(
            PreviewCondition(
                text="pcr_cycler_in_manipulation_distance == true",
                condition=value("pcr_cycler_in_manipulation_distance"),
            ),
        ),
        changes=("pcr_cycler_locked",),
    ),
    SkillModel(
        name="lock_pcr_cycler",
        preview=("pcr_cycler_open", "pcr_cycler_locked", "pcr_cycler_in_manipulation_distance"),
        preview_conditions=(
            PreviewCondition(text="pcr_cycler_open == false", condition=~value("pcr_cycler_open")),
            PreviewCondition(
                text="pcr_cycler_in_manipulation_distance == true",
                condition=value("pcr_cycler_in_manipulation_distance"),
            ),
        ),
        changes=("pcr_cycler_locked",),
    ),
    SkillModel(
        name="open_pcr_cycler",
        preview=("pcr_cycler_locked", "pcr_cycler_open", "pcr_cycler_in_manipulation_distance"),
        preview_conditions=(
            PreviewCondition(
                text="pcr_cycler_in_manipulation_distance == true",
                condition=value("pcr_cycler_in_manipulation_distance"),
            ),
        ),
        changes=("pcr_cycler_open",),
    ),
    SkillModel(
        name="close_pcr_cycler",
        preview=("pcr_cycler_open", "pcr_cycler_in_manipulation_distance"),
        preview_conditions=(
            PreviewCondition(
                text="pcr_cycler_in_manipulation_distance == true",
                condition=value("pcr_cycler_in_manipulation_distance"),
            ),
        ),
        changes=("pcr_cycler_open",),
    ),
)
