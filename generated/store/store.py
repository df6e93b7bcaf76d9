"""Context of specs/store.yaml.

Made by codra from specs/store.yaml; edits are lost. Renew: codra compile specs/store.yaml
"""

from codra_dsl.runtime.generated_api import (
    ObserverModel,
    SkillModel,
    VariableModel,
    boolean,
    integer,
    member,
    real,
    value,
)

VARIABLES: tuple[VariableModel, ...] = (
    VariableModel(
        name="battery_level",
        type=real(0, 100, unit="percent"),
        label="Battery",
        sources=("navigation",),
        valid_for_s=60.0,
        history=241,
    ),
    VariableModel(name="charging", type=boolean(), label="Charging", sources=("navigation",), valid_for_s=60.0),
    VariableModel(
        name="camera_steady",
        type=boolean(),
        label="Camera steady",
        sources=("camera_agent",),
        valid_for_s=2.0,
    ),
    VariableModel(
        name="person_distance",
        type=real(0, 10, unit="m"),
        label="Nearest person",
        sources=("person_detection",),
        valid_for_s=15.0,
    ),
    VariableModel(
        name="front_gap",
        type=real(0, 10, unit="m"),
        label="Nearest thing in front",
        sources=("lasers",),
        valid_for_s=2.0,
    ),
    VariableModel(
        name="back_gap",
        type=real(0, 10, unit="m"),
        label="Nearest thing behind",
        sources=("lasers",),
        valid_for_s=2.0,
    ),
    VariableModel(
        name="strange_gap",
        type=real(0, 10, unit="m"),
        label="Nearest thing around that is not on the map",
        sources=("lasers",),
        valid_for_s=2.0,
    ),
    VariableModel(name="bumped", type=boolean(), label="Bumped", sources=("navigation",), valid_for_s=5.0),
    VariableModel(
        name="speed",
        type=real(-1.5, 1.5, unit="m/s"),
        label="Speed",
        sources=("navigation",),
        valid_for_s=5.0,
    ),
    VariableModel(
        name="pose_spread",
        type=real(0, 10, unit="m"),
        label="Spread of the pose",
        sources=("localisation",),
        valid_for_s=5.0,
    ),
    VariableModel(name="loaded", type=boolean(), label="Something on the fork", sources=("fork",)),
    VariableModel(
        name="container_load",
        type=member("empty", "loading", "full"),
        label="Load of the container",
        sources=("picker_page",),
    ),
    VariableModel(
        name="max_speed",
        type=real(0, 1.5, unit="m/s"),
        label="Maximum speed",
        sources=("adaptation",),
        valid_for_s=5.0,
    ),
    VariableModel(
        name="goal_way",
        type=member("forward", "backward"),
        label="Way to the goal",
        sources=("mission", "picking"),
    ),
    VariableModel(
        name="base_notice",
        type=member("none", "container_not_found", "container_not_placed", "mission_aborted"),
        label="Notice to the base",
        sources=("mission", "picking"),
    ),
    VariableModel(
        name="battery_drain",
        type=real(0, 20, unit="percent/min"),
        label="Drain of the battery",
        sources=("analysis",),
    ),
    VariableModel(
        name="full_on_fork",
        type=boolean(),
        label="A full container on the fork",
        sources=("other context-variables",),
        derived=value("loaded") & (value("container_load") == "full"),
    ),
    VariableModel(
        name="people_at_container",
        type=integer(0, 20),
        label="People near a container",
        sources=("other context-variables",),
        derived=value("count(some person -near-> some roll_container)"),
    ),
    VariableModel(
        name="crowded",
        type=boolean(),
        label="Somebody at the pick-up",
        sources=("other context-variables",),
        history=300,
        derived=value("picking_up") & ((value("people_at_container") > 0) | (value("person_distance") < 2)),
    ),
    VariableModel(
        name="crowding",
        type=real(0, 1),
        label="Share of time with somebody at the pick-up",
        sources=("analysis",),
    ),
    VariableModel(name="order_open", type=boolean(), label="An order can be served now", sources=("mission",)),
    VariableModel(name="picking_up", type=boolean(), label="Picking up", sources=("picking",)),
    VariableModel(name="safety", type=real(0.0, 1.0), label="Safety", sources=("analysis",)),
    VariableModel(name="mission_completion", type=real(0.0, 1.0), label="Mission completion", sources=("analysis",)),
    VariableModel(name="power_autonomy", type=real(0.0, 1.0), label="Power autonomy", sources=("analysis",)),
    VariableModel(name="weight_of_pick", type=real(0.0, 1.0), label="Weight of Fetch and bring", sources=("analysis",)),
    VariableModel(
        name="weight_of_deliver",
        type=real(0.0, 1.0),
        label="Weight of Bring to the general delivery pose",
        sources=("analysis",),
    ),
    VariableModel(
        name="weight_of_start",
        type=real(0.0, 1.0),
        label="Weight of Return to the start",
        sources=("analysis",),
    ),
    VariableModel(name="weight_of_dock", type=real(0.0, 1.0), label="Weight of Go and charge", sources=("analysis",)),
    VariableModel(
        name="course",
        type=member("pick", "deliver", "start", "dock"),
        label="Course of the mission",
        sources=("adaptation",),
    ),
    VariableModel(
        name="filtered_weight_of_pick",
        type=real(0.0, 1.0),
        label="Filtered weight of Fetch and bring",
        sources=("analysis",),
    ),
    VariableModel(
        name="filtered_weight_of_deliver",
        type=real(0.0, 1.0),
        label="Filtered weight of Bring to the general delivery pose",
        sources=("analysis",),
    ),
    VariableModel(
        name="filtered_weight_of_start",
        type=real(0.0, 1.0),
        label="Filtered weight of Return to the start",
        sources=("analysis",),
    ),
    VariableModel(
        name="filtered_weight_of_dock",
        type=real(0.0, 1.0),
        label="Filtered weight of Go and charge",
        sources=("analysis",),
    ),
    VariableModel(
        name="count(some person -near-> some roll_container)",
        type=integer(),
        sources=("the knowledge graph",),
        pose_condition=value("count(some person -near-> some roll_container)"),
    ),
)

OBSERVERS: tuple[ObserverModel, ...] = ()

SKILLS: tuple[SkillModel, ...] = ()
