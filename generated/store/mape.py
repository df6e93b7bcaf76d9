"""The loops of 'store': what they analyse, choose and execute.

Made by codra from specs/store.yaml; edits are lost. Renew: codra compile specs/store.yaml
"""

from codra_dsl.runtime.generated_api import (
    Bounds,
    CourseModel,
    HardRuleModel,
    InputModel,
    LoopModel,
    MapeModel,
    OutputModel,
    ParameterModel,
    RateKind,
    RateModel,
    StageModel,
    StageRuleModel,
    TreeModel,
    choose,
    literal,
    terms,
    value,
)

from . import action_engine, metric_engine, tree_mission, tree_picking

MAPE = MapeModel(
    loops=(
        LoopModel(
            name="mission",
            rates=("battery_drain", "crowding"),
            analyse=("safety", "mission_completion", "power_autonomy"),
            adapt=("course", "speed"),
            execute=("mission",),
        ),
        LoopModel(name="picking", execute=("picking",)),
    ),
    metrics=StageModel(
        infer=metric_engine.infer,
        infer_bounds=metric_engine.infer_bounds,
        inputs=(
            InputModel(
                variable="bumped",
                range=Bounds(0.0, 1.0),
                members=("false", "true"),
                terms={
                    "false": lambda x: terms.rectangle(x, -0.5, 0.5),
                    "true": lambda x: terms.rectangle(x, 0.5, 1.5),
                },
            ),
            InputModel(
                variable="picking_up",
                range=Bounds(0.0, 1.0),
                members=("false", "true"),
                terms={
                    "false": lambda x: terms.rectangle(x, -0.5, 0.5),
                    "true": lambda x: terms.rectangle(x, 0.5, 1.5),
                },
            ),
            InputModel(
                variable="people_at_container",
                range=Bounds(0.0, 20.0),
                terms={
                    "nobody": lambda x: terms.ramp(x, 1.0, 0.0),
                    "one": lambda x: terms.triangle(x, 0.0, 1.0, 2.0),
                    "several": lambda x: terms.ramp(x, 1.0, 2.0),
                },
            ),
            InputModel(
                variable="container_load",
                range=Bounds(0.0, 2.0),
                members=("empty", "loading", "full"),
                terms={
                    "empty": lambda x: terms.rectangle(x, -0.5, 0.5),
                    "loading": lambda x: terms.rectangle(x, 0.5, 1.5),
                    "full": lambda x: terms.rectangle(x, 1.5, 2.5),
                },
            ),
            InputModel(
                variable="person_distance",
                range=Bounds(0.0, 10.0),
                terms={"close": lambda x: terms.ramp(x, 2.5, 1.5)},
            ),
            InputModel(
                variable="order_open",
                range=Bounds(0.0, 1.0),
                members=("false", "true"),
                terms={
                    "false": lambda x: terms.rectangle(x, -0.5, 0.5),
                    "true": lambda x: terms.rectangle(x, 0.5, 1.5),
                },
            ),
            InputModel(
                variable="loaded",
                range=Bounds(0.0, 1.0),
                members=("false", "true"),
                terms={
                    "false": lambda x: terms.rectangle(x, -0.5, 0.5),
                    "true": lambda x: terms.rectangle(x, 0.5, 1.5),
                },
            ),
            InputModel(
                variable="battery_level",
                range=Bounds(0.0, 100.0),
                terms={
                    "empty": lambda x: terms.ramp(x, 30.0, 10.0),
                    "full": lambda x: terms.ramp(x, 10.0, 30.0),
                    "scarce": lambda x: terms.ramp(x, 45.0, 30.0),
                    "charged": lambda x: terms.ramp(x, 70.0, 95.0),
                },
            ),
            InputModel(
                variable="charging",
                range=Bounds(0.0, 1.0),
                members=("false", "true"),
                terms={
                    "false": lambda x: terms.rectangle(x, -0.5, 0.5),
                    "true": lambda x: terms.rectangle(x, 0.5, 1.5),
                },
            ),
            InputModel(
                variable="battery_drain",
                range=Bounds(0.0, 20.0),
                terms={"fast": lambda x: terms.ramp(x, 5.0, 7.0)},
            ),
        ),
        outputs=(
            OutputModel(name="safety", variable="safety"),
            OutputModel(name="mission_completion", variable="mission_completion"),
            OutputModel(name="power_autonomy", variable="power_autonomy"),
        ),
        rules=(
            StageRuleModel(text="if bumped is true then safety is low", concludes=("safety",), reads=("bumped",)),
            StageRuleModel(
                text="if picking_up is true and people_at_container is several then safety is low",
                concludes=("safety",),
                reads=("picking_up", "people_at_container"),
            ),
            StageRuleModel(
                text="if picking_up is true and people_at_container is one and container_load is not empty then safety is low with 0.5",
                concludes=("safety",),
                reads=("picking_up", "people_at_container", "container_load"),
            ),
            StageRuleModel(
                text="if bumped is false and picking_up is true and people_at_container is one then safety is medium",
                concludes=("safety",),
                reads=("bumped", "picking_up", "people_at_container"),
            ),
            StageRuleModel(
                text="if bumped is false and picking_up is true and people_at_container is nobody and person_distance is close then safety is medium",
                concludes=("safety",),
                reads=("bumped", "picking_up", "people_at_container", "person_distance"),
            ),
            StageRuleModel(
                text="if bumped is false and picking_up is true and people_at_container is nobody and person_distance is not close then safety is high",
                concludes=("safety",),
                reads=("bumped", "picking_up", "people_at_container", "person_distance"),
            ),
            StageRuleModel(
                text="if bumped is false and picking_up is false then safety is high",
                concludes=("safety",),
                reads=("bumped", "picking_up"),
            ),
            StageRuleModel(
                text="if order_open is false then mission_completion is high",
                concludes=("mission_completion",),
                reads=("order_open",),
            ),
            StageRuleModel(
                text="if order_open is true and loaded is true then mission_completion is medium",
                concludes=("mission_completion",),
                reads=("order_open", "loaded"),
            ),
            StageRuleModel(
                text="if order_open is true and loaded is false then mission_completion is low",
                concludes=("mission_completion",),
                reads=("order_open", "loaded"),
            ),
            StageRuleModel(
                text="if battery_level is empty then power_autonomy is low",
                concludes=("power_autonomy",),
                reads=("battery_level",),
            ),
            StageRuleModel(
                text="if charging is true and battery_level is not charged then power_autonomy is low",
                concludes=("power_autonomy",),
                reads=("charging", "battery_level"),
            ),
            StageRuleModel(
                text="if charging is false and battery_drain is fast and battery_level is scarce then power_autonomy is low",
                concludes=("power_autonomy",),
                reads=("charging", "battery_drain", "battery_level"),
            ),
            StageRuleModel(
                text="if battery_level is full and charging is false and battery_drain is fast and battery_level is not scarce then power_autonomy is medium",
                concludes=("power_autonomy",),
                reads=("battery_level", "charging", "battery_drain"),
            ),
            StageRuleModel(
                text="if battery_level is full and charging is false and battery_drain is not fast then power_autonomy is high",
                concludes=("power_autonomy",),
                reads=("battery_level", "charging", "battery_drain"),
            ),
            StageRuleModel(
                text="if charging is true and battery_level is charged then power_autonomy is high",
                concludes=("power_autonomy",),
                reads=("charging", "battery_level"),
            ),
        ),
    ),
    actions=StageModel(
        infer=action_engine.infer,
        infer_bounds=action_engine.infer_bounds,
        inputs=(
            InputModel(
                variable="mission_completion",
                range=Bounds(0.0, 1.0),
                terms={
                    "low": lambda x: terms.ramp(x, 0.5, 0.2),
                    "medium": lambda x: terms.triangle(x, 0.2, 0.5, 0.8),
                    "high": lambda x: terms.ramp(x, 0.5, 0.8),
                },
            ),
            InputModel(
                variable="safety",
                range=Bounds(0.0, 1.0),
                terms={
                    "low": lambda x: terms.ramp(x, 0.5, 0.2),
                    "medium": lambda x: terms.triangle(x, 0.2, 0.5, 0.8),
                    "high": lambda x: terms.ramp(x, 0.5, 0.8),
                },
            ),
            InputModel(
                variable="power_autonomy",
                range=Bounds(0.0, 1.0),
                terms={
                    "low": lambda x: terms.ramp(x, 0.5, 0.2),
                    "medium": lambda x: terms.triangle(x, 0.2, 0.5, 0.8),
                    "high": lambda x: terms.ramp(x, 0.5, 0.8),
                },
            ),
            InputModel(
                variable="full_on_fork",
                range=Bounds(0.0, 1.0),
                members=("false", "true"),
                terms={
                    "false": lambda x: terms.rectangle(x, -0.5, 0.5),
                    "true": lambda x: terms.rectangle(x, 0.5, 1.5),
                },
            ),
            InputModel(
                variable="crowding",
                range=Bounds(0.0, 1.0),
                terms={"persistent": lambda x: terms.ramp(x, 0.5, 0.7)},
            ),
            InputModel(
                variable="loaded",
                range=Bounds(0.0, 1.0),
                members=("false", "true"),
                terms={
                    "false": lambda x: terms.rectangle(x, -0.5, 0.5),
                    "true": lambda x: terms.rectangle(x, 0.5, 1.5),
                },
            ),
        ),
        outputs=(
            OutputModel(name="pick", variable="weight_of_pick"),
            OutputModel(name="deliver", variable="weight_of_deliver"),
            OutputModel(name="start", variable="weight_of_start"),
            OutputModel(name="dock", variable="weight_of_dock"),
        ),
        rules=(
            StageRuleModel(
                text="if mission_completion is not high and safety is high and power_autonomy is not low and full_on_fork is false then weight_of_pick is high",
                concludes=("pick",),
                reads=("mission_completion", "safety", "power_autonomy", "full_on_fork"),
            ),
            StageRuleModel(
                text="if mission_completion is not high and safety is medium and crowding is not persistent and power_autonomy is not low and full_on_fork is false then weight_of_pick is high",
                concludes=("pick",),
                reads=("mission_completion", "safety", "crowding", "power_autonomy", "full_on_fork"),
            ),
            StageRuleModel(
                text="if mission_completion is high or safety is low or power_autonomy is low or full_on_fork is true then weight_of_pick is low",
                concludes=("pick",),
                reads=("mission_completion", "safety", "power_autonomy", "full_on_fork"),
            ),
            StageRuleModel(
                text="if safety is medium and crowding is persistent then weight_of_pick is low",
                concludes=("pick",),
                reads=("safety", "crowding"),
            ),
            StageRuleModel(
                text="if full_on_fork is true and safety is not low and power_autonomy is not low then weight_of_deliver is high",
                concludes=("deliver",),
                reads=("full_on_fork", "safety", "power_autonomy"),
            ),
            StageRuleModel(
                text="if loaded is true and mission_completion is high and safety is not low and power_autonomy is not low then weight_of_deliver is high",
                concludes=("deliver",),
                reads=("loaded", "mission_completion", "safety", "power_autonomy"),
            ),
            StageRuleModel(
                text="if loaded is false or safety is low or power_autonomy is low then weight_of_deliver is low",
                concludes=("deliver",),
                reads=("loaded", "safety", "power_autonomy"),
            ),
            StageRuleModel(
                text="if full_on_fork is false and mission_completion is not high then weight_of_deliver is low",
                concludes=("deliver",),
                reads=("full_on_fork", "mission_completion"),
            ),
            StageRuleModel(
                text="if safety is low and loaded is false then weight_of_start is high",
                concludes=("start",),
                reads=("safety", "loaded"),
            ),
            StageRuleModel(
                text="if safety is medium and crowding is persistent and loaded is false then weight_of_start is high",
                concludes=("start",),
                reads=("safety", "crowding", "loaded"),
            ),
            StageRuleModel(
                text="if safety is medium and crowding is not persistent and mission_completion is not high and loaded is false then weight_of_start is low",
                concludes=("start",),
                reads=("safety", "crowding", "mission_completion", "loaded"),
            ),
            StageRuleModel(
                text="if safety is low and loaded is true then weight_of_start is medium",
                concludes=("start",),
                reads=("safety", "loaded"),
            ),
            StageRuleModel(
                text="if mission_completion is high and loaded is false then weight_of_start is medium",
                concludes=("start",),
                reads=("mission_completion", "loaded"),
            ),
            StageRuleModel(
                text="if safety is high and mission_completion is not high then weight_of_start is low",
                concludes=("start",),
                reads=("safety", "mission_completion"),
            ),
            StageRuleModel(
                text="if safety is not low and loaded is true then weight_of_start is low",
                concludes=("start",),
                reads=("safety", "loaded"),
            ),
            StageRuleModel(
                text="if power_autonomy is low then weight_of_dock is high",
                concludes=("dock",),
                reads=("power_autonomy",),
            ),
            StageRuleModel(
                text="if power_autonomy is not low then weight_of_dock is low",
                concludes=("dock",),
                reads=("power_autonomy",),
            ),
        ),
    ),
    rates=(
        RateModel(variable="battery_drain", of="battery_level", over_s=120.0, factor=-60.0),
        RateModel(variable="crowding", of="crowded", over_s=30.0, kind=RateKind.SHARE),
    ),
    courses=(
        CourseModel(
            name="course",
            choose=("pick", "deliver", "start", "dock"),
            otherwise="start",
            variable="course",
            smooth_s=1.0,
            lead=0.1,
            hold_s=3.0,
            dwell_s=5.0,
            always=(
                HardRuleModel(condition=value("battery_level") < 10, action="dock", text="battery_level < 10 percent"),
            ),
            filtered_weights={
                "pick": "filtered_weight_of_pick",
                "deliver": "filtered_weight_of_deliver",
                "start": "filtered_weight_of_start",
                "dock": "filtered_weight_of_dock",
            },
        ),
    ),
    parameters=(
        ParameterModel(
            name="speed",
            variable="max_speed",
            value=choose(
                0.3,
                (value("person_distance") < 1.5)
                | (value("strange_gap") < 1.5)
                | (value("pose_spread") > 0.2)
                | (value("safety") < 0.6),
                1.2,
            ),
            text="0.3 m/s if person_distance < 1.5 m or strange_gap < 1.5 m or pose_spread > 20 cm or safety < 0.6 else 1.2 m/s",
            otherwise=literal(0.3),
        ),
    ),
    trees=(
        TreeModel(
            name="mission",
            build=tree_mission.TREES["GlobalManagement"],
            course="course",
            branches={"pick": "pick", "deliver": "deliver", "start": "start", "dock": "dock"},
            tasks=("navigating", "fetching", "lowering"),
            agent="mission",
        ),
        TreeModel(
            name="picking",
            build=tree_picking.TREES["PickUpManagement"],
            tasks=("navigating", "detecting", "rotating", "checking", "lifting"),
            agent="picking",
        ),
    ),
)
