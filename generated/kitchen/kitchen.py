"""Observers of specs/kitchen.yaml.

Made by codra from specs/kitchen.yaml; edits are lost. Renew: codra compile specs/kitchen.yaml
"""

from py_trees.behaviour import Behaviour
from py_trees.composites import Selector, Sequence

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
    PreviewCondition,
    SkillModel,
    VariableModel,
    age,
    boolean,
    first_of,
    known,
    maximum,
    member,
    real,
    value,
)

FIND_KETTLE = Algorithm(
    name="find_kettle",
    call="examples.kitchen.perception:find_kettle",
    handles=("kitchen",),
    returns={"bearing": real(-3.2, 3.2, unit="rad")},
)

ASK_DOCK = Algorithm(
    name="ask_dock",
    call="examples.kitchen.perception:ask_dock",
    handles=("kitchen",),
    returns={"contact": boolean()},
    min_interval_s=2.0,
)

LOOK_AT_KETTLE = Algorithm(
    name="look_at_kettle",
    call="examples.kitchen.perception:look_at_kettle",
    handles=("kitchen",),
    slots=("vision",),
    returns={
        "water": real(0, 2, unit="kg", optional=True),
        "steam": real(0, 100, unit="percent"),
        "warmth": real(0, 120),
        "sharpness": real(0, 1),
    },
    timeout_s=4.0,
)

WEIGH_KETTLE = Algorithm(
    name="weigh_kettle",
    call="examples.kitchen.perception:weigh_kettle",
    handles=("kitchen",),
    returns={"weight": real(unit="N")},
)

LOOK_AT_HOB = Algorithm(
    name="look_at_hob",
    call="examples.kitchen.perception:look_at_hob",
    handles=("kitchen",),
    slots=("vision",),
    returns={"lamp": member("off", "low", "high"), "power": real(unit="W"), "pot": boolean()},
)

LOOK_INTO_POT = Algorithm(
    name="look_into_pot",
    call="examples.kitchen.perception:look_into_pot",
    handles=("kitchen",),
    slots=("vision",),
    given=("hob_power",),
    returns={"fill": real(unit="percent")},
)


def find_kettle(observer: Observer) -> Behaviour:
    """Identify kettle_in_view (P1, Figure 4)."""
    perception = observer.branch(FIND_KETTLE)
    return Sequence(
        name="find_kettle",
        memory=False,
        children=[
            ControlFlag(observer),
            Precondition(
                'robot_is_localized and robot_place == "counter"',
                value("robot_is_localized") & (value("robot_place") == "counter"),
                perception,
            ),
            DueOrRunning(perception),
            Perceive(perception),
            Identify("kettle_in_view", abs(value("bearing")) < 0.5235987755982988, perception),
        ],
    )


def ask_dock(observer: Observer) -> Behaviour:
    """Identify kettle_docked (P1, Figure 4)."""
    perception = observer.branch(ASK_DOCK)
    return Sequence(
        name="ask_dock",
        memory=False,
        children=[
            ControlFlag(observer),
            Precondition("robot_is_localized", value("robot_is_localized"), perception),
            DueOrRunning(perception),
            Perceive(perception),
            Identify("kettle_docked", value("contact"), perception),
        ],
    )


def kettle_watch(observer: Observer) -> Behaviour:
    """Identify kettle_water and kettle_state (P1, Figure 4)."""
    look_at_kettle = observer.branch(LOOK_AT_KETTLE)
    weigh_kettle = observer.branch(WEIGH_KETTLE)
    return Sequence(
        name="kettle_watch",
        memory=False,
        children=[
            ControlFlag(observer),
            Selector(
                name="alternatives",
                memory=False,
                children=[
                    Sequence(
                        name="look_at_kettle",
                        memory=False,
                        children=[
                            Precondition("kettle_in_view", value("kettle_in_view"), look_at_kettle),
                            Precondition("light_is_on", value("light_is_on"), look_at_kettle),
                            DueOrRunning(look_at_kettle),
                            Perceive(look_at_kettle),
                            Accept("sharpness >= 0.5", value("sharpness") >= 0.5, look_at_kettle),
                            Identify("kettle_water", value("water"), look_at_kettle),
                            Identify(
                                "kettle_state",
                                first_of(
                                    ("empty", value("water") < 0.05),
                                    ("boiling", value("steam") > 60),
                                    ("hot", value("warmth") >= 60),
                                    ("cold", value("warmth") < 60),
                                ),
                                look_at_kettle,
                            ),
                        ],
                    ),
                    Sequence(
                        name="weigh_kettle",
                        memory=False,
                        children=[
                            Precondition("kettle_docked", value("kettle_docked"), weigh_kettle),
                            DueOrRunning(weigh_kettle),
                            Perceive(weigh_kettle),
                            Identify("kettle_water", maximum(0, value("weight") / 9.81 * 1 - 0.9), weigh_kettle),
                        ],
                    ),
                ],
            ),
        ],
    )


def hob_watch(observer: Observer) -> Behaviour:
    """Identify hob_level, hob_power and pot_on_hob (P1, Figure 4)."""
    perception = observer.branch(LOOK_AT_HOB)
    return Sequence(
        name="hob_watch",
        memory=False,
        children=[
            ControlFlag(observer),
            Precondition('robot_place == "stove"', value("robot_place") == "stove", perception),
            DueOrRunning(perception),
            Perceive(perception),
            Identify("hob_level", value("lamp"), perception),
            Identify("hob_power", value("power"), perception),
            Identify("pot_on_hob", value("pot"), perception),
        ],
    )


def look_into_pot(observer: Observer) -> Behaviour:
    """Identify pot_fill (P1, Figure 4)."""
    perception = observer.branch(LOOK_INTO_POT)
    return Sequence(
        name="look_into_pot",
        memory=False,
        children=[
            ControlFlag(observer),
            Precondition("pot_on_hob", value("pot_on_hob"), perception),
            Precondition(
                "known(hob_power) and age(hob_power) < 10 s",
                known("hob_power") & (age("hob_power") < 10),
                perception,
            ),
            Precondition("known(hob_power)", known("hob_power"), perception),
            DueOrRunning(perception),
            Perceive(perception),
            Identify("pot_fill", value("fill"), perception),
        ],
    )


VARIABLES: tuple[VariableModel, ...] = (
    VariableModel(
        name="robot_is_localized",
        type=boolean(),
        label="Robot knows where it is",
        sources=("main_execution",),
        valid_for_s=600.0,
    ),
    VariableModel(
        name="robot_place",
        type=member("hall", "counter", "stove"),
        sources=("main_execution",),
        valid_for_s=300.0,
    ),
    VariableModel(name="light_is_on", type=boolean(), sources=("main_execution", "wall_switch"), valid_for_s=3600.0),
    VariableModel(name="kettle_in_view", type=boolean(), when_unobservable="forget"),
    VariableModel(name="kettle_docked", type=boolean(), valid_for_s=30.0, when_unobservable="forget"),
    VariableModel(
        name="kettle_state",
        type=member("empty", "cold", "hot", "boiling"),
        label="Kettle",
        valid_for_s=60.0,
    ),
    VariableModel(name="kettle_water", type=real(0, 2, unit="kg"), label="Water in the kettle"),
    VariableModel(name="hob_level", type=member("off", "low", "high"), valid_for_s=20.0),
    VariableModel(name="hob_power", type=real(0, 3000, unit="W"), valid_for_s=20.0),
    VariableModel(name="pot_on_hob", type=boolean(), valid_for_s=20.0),
    VariableModel(name="pot_fill", type=real(0, 100, unit="percent"), history=20),
)

OBSERVERS: tuple[ObserverModel, ...] = (
    ObserverModel(name="find_kettle", identifies=("kettle_in_view",), build=find_kettle),
    ObserverModel(name="ask_dock", identifies=("kettle_docked",), build=ask_dock),
    ObserverModel(
        name="kettle_watch",
        identifies=("kettle_water", "kettle_state"),
        build=kettle_watch,
        period_s=2.0,
        priority=2,
    ),
    ObserverModel(name="hob_watch", identifies=("hob_level", "hob_power", "pot_on_hob"), build=hob_watch, priority=5),
    ObserverModel(name="look_into_pot", identifies=("pot_fill",), build=look_into_pot),
)

SKILLS: tuple[SkillModel, ...] = (
    SkillModel(
        name="boil_water",
        preview=("kettle_water", "kettle_docked"),
        preview_conditions=(
            PreviewCondition(text="kettle_water > 300 g", condition=value("kettle_water") > 0.3),
            PreviewCondition(text="kettle_docked == true", condition=value("kettle_docked")),
        ),
        monitor=("kettle_state", "kettle_docked"),
        changes=("kettle_state",),
        expects=(
            ExpectationModel(
                text='kettle_state becomes "boiling" within 300 s',
                condition=value("kettle_state") == "boiling",
                within_s=300.0,
            ),
            ExpectationModel(text="kettle_docked stays true", condition=value("kettle_docked")),
        ),
    ),
    SkillModel(
        name="pour_water",
        preview=("kettle_state", "kettle_water"),
        monitor=("kettle_water",),
        changes=("kettle_water",),
        expects=(
            ExpectationModel(
                text="kettle_water becomes < 0.2 kg within 60 s",
                condition=value("kettle_water") < 0.2,
                within_s=60.0,
            ),
        ),
    ),
    SkillModel(
        name="cook",
        preview=("hob_level", "pot_on_hob", "pot_fill"),
        monitor=("hob_level",),
        changes=("hob_level", "hob_power"),
        expects=(ExpectationModel(text='hob_level stays "high"', condition=value("hob_level") == "high"),),
    ),
)
