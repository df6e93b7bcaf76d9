"""The managers of the store: their decisions, the same shop for all of them, and the counts."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cache
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.integrations.inspection import SpecError
from codra_dsl.runtime import Reading, Reason, SimClock
from codra_dsl.runtime.loops import Plan, Planning, assess
from codra_dsl.runtime.loops.observations import Observation
from codra_dsl.runtime.values.conditions import Value
from codra_papers.experiments.campaign.seeds import reported_seeds
from codra_papers.experiments.campaign.statistics import quantile_interval
from codra_papers.experiments.store.run import StoreRunSettings, run_store
from codra_papers.experiments.studies.store_managers import trial
from codra_papers.experiments.studies.store_managers.answering import answers
from codra_papers.experiments.studies.store_managers.comparing import compare_managers, reactions
from codra_papers.experiments.studies.store_managers.loop_parameters import LoopParameters
from codra_papers.experiments.studies.store_managers.managers import (
    COURSE_ONLY,
    NONE,
    NORMAL_M_S,
    OURS,
    OURS_TUNED,
    SPEED_ONLY,
    THRESHOLD,
    Manager,
    managers,
)
from codra_papers.experiments.studies.store_managers.search import GRIDS, Design, best_cell, cells
from codra_papers.experiments.studies.store_managers.shift import (
    MAX_DURATION_S,
    MIN_DURATION_S,
    PlannedOrder,
    Shift,
    Staging,
    Visit,
    shift_of,
)
from codra_papers.experiments.studies.store_managers.thresholds import Thresholds
from codra_papers.experiments.studies.store_managers.trial import StoreOutcome, courses_of
from codra_papers.experiments.studies.store_managers.watching import Cause, CauseCall, Span, Watch, calls
from codra_papers.store.geometry import Point, Pose2D
from codra_papers.store.layout import AREAS
from codra_papers.store.simulator.situations import OrderKind
from codra_papers.store.simulator.state import Container, Load, RobotState, StoreState, Whereabouts
from codra_papers.store.simulator.store import Store
from generated import lab, store

SPEC = Path(__file__).parents[4] / "specs/store.yaml"
THRESHOLDS = Thresholds(distance_m=1.5, battery_percent=20.0, load="full")
THRESHOLD_MAPE = THRESHOLDS(store.MAPE)
MANAGERS = {
    manager.name: manager for manager in managers({THRESHOLD: THRESHOLDS, OURS_TUNED: LoopParameters(hold_s=8.0)})
}
SLOW_M_S = 0.3
CALM_VALUES: Mapping[str, Value | None] = {
    "bumped": False,
    "person_distance": 10.0,
    "strange_gap": 10.0,
    "people_at_container": 0,
    "pose_spread": 0.03,
    "picking_up": False,
    "order_open": True,
    "loaded": False,
    "container_load": "empty",
    "full_on_fork": False,
    "battery_level": 80.0,
    "battery_drain": 0.5,
    "charging": False,
    "crowded": False,
    "crowding": 0.0,
}


# Decisions of the managers


@dataclass
class WrittenContext:
    """A context that a test writes."""

    values: dict[str, Value | None] = field(default_factory=lambda: dict(CALM_VALUES))

    def readings(self, names: Iterable[str]) -> Mapping[str, Reading[Value]]:
        return {name: self._reading(name, self.values[name]) for name in names}

    def history(self, name: str) -> tuple[Reading[Value], ...]:
        return (self.readings([name])[name],)

    @staticmethod
    def _reading(name: str, value: Value | None) -> Reading[Value]:
        if value is None:
            return Reading(name=name, reason=Reason.NEVER_OBSERVED)
        return Reading(name=name, content=value, evidence_s=0.0)


def planning(manager: Manager) -> Planning:
    mission = next(loop for loop in store.MAPE.loops if loop.name == "mission")
    types = {variable.name: variable.type for variable in store.MODEL.variables}
    return Planning(manager.edited(store.MAPE), mission, types)


@cache
def plans(manager: Manager, cycles: int = 6) -> list[tuple[float, Plan]]:
    """Return the plans of a manager while a person is repeatedly close for 10 s and far away for 10 s."""
    context, planner = WrittenContext({**CALM_VALUES, "picking_up": True}), planning(manager)
    timed_plans = []
    for step in range(cycles * 200):
        is_close = bool(step // 100 % 2)
        context.values |= {"person_distance": 1.0 if is_close else 10.0, "crowded": is_close}
        timed_plans.append((step * 0.1, planner.plan(context, step * 0.1)))
    return timed_plans


def chosen_courses(timed_plans: list[tuple[float, Plan]]) -> list[tuple[float, str]]:
    return [(at_s, decision.action) for at_s, plan in timed_plans for decision in plan.decisions]


def speeds(timed_plans: list[tuple[float, Plan]]) -> list[Value]:
    return [setting.value for _, plan in timed_plans for setting in plan.settings]


def test_the_compared_managers_are_six() -> None:
    assert tuple(MANAGERS) == ("none", "speed only", "course only", "threshold", "ours", "ours tuned")


def test_ours_is_the_declared_loops() -> None:
    assert OURS.edited(store.MAPE) is store.MAPE
    assert [action for _, action in chosen_courses(plans(OURS))][:4] == ["pick", "start", "pick", "start"]
    assert speeds(plans(OURS))[:3] == [NORMAL_M_S, SLOW_M_S, NORMAL_M_S]


def test_no_adaptation_takes_the_nominal_course_and_speed_and_keeps_them() -> None:
    assert chosen_courses(plans(NONE)) == [(0.0, "pick")]
    assert speeds(plans(NONE)) == [NORMAL_M_S]


def test_the_speed_rule_alone_never_leaves_the_nominal_course() -> None:
    assert chosen_courses(plans(SPEED_ONLY)) == [(0.0, "pick")]
    assert speeds(plans(SPEED_ONLY))[:3] == [NORMAL_M_S, SLOW_M_S, NORMAL_M_S]


def test_the_course_alone_never_leaves_the_normal_speed() -> None:
    assert chosen_courses(plans(COURSE_ONLY)) == chosen_courses(plans(OURS))
    assert speeds(plans(COURSE_ONLY)) == [NORMAL_M_S]


def test_the_nominal_course_is_kept_with_an_empty_battery() -> None:
    context = WrittenContext({**CALM_VALUES, "battery_level": 5.0})
    first_actions = {
        manager.name: planning(manager).plan(context, 0.0).decisions[0].action for manager in (SPEED_ONLY, OURS)
    }

    assert first_actions == {"speed only": "pick", "ours": "dock"}


def test_every_manager_keeps_the_analysis_that_is_drawn() -> None:
    for manager in MANAGERS.values():
        written_names = {written_value.variable for written_value in plans(manager, cycles=1)[0][1].values_to_write}
        assert written_names >= {"safety", "weight_of_pick", "weight_of_dock"}


# The numbers of the loops


def loop_weights(parameters: LoopParameters, **changes: Value | None) -> dict[str, float | None]:
    scene = {name: Observation(variable=name, value=value) for name, value in {**CALM_VALUES, **changes}.items()}
    return assess(parameters(store.MAPE), scene).weights()


def test_moved_terms_weigh_a_value_as_the_spec_weighs_the_value_moved_back() -> None:
    crowding_changes = [{"picking_up": True, "people_at_container": 1, "crowding": step / 20} for step in range(5, 21)]
    battery_changes = [{"battery_level": float(step)} for step in range(40)]
    for parameters, variable, shift, changes in (
        (LoopParameters(crowding_shift=0.2), "crowding", 0.2, crowding_changes),
        (LoopParameters(battery_shift_percent=-5.0), "battery_level", -5.0, battery_changes),
    ):
        moved_weights = [loop_weights(parameters, **values) for values in changes]
        assert moved_weights == [
            loop_weights(LoopParameters(), **{**values, variable: values[variable] - shift}) for values in changes
        ]
        assert moved_weights != [loop_weights(LoopParameters(), **values) for values in changes]


def test_with_moved_terms_the_bounds_of_a_metric_contain_its_value() -> None:
    for parameters in GRIDS[OURS_TUNED]:
        mape = parameters(store.MAPE)
        scene = {name: Observation(variable=name, value=value) for name, value in CALM_VALUES.items()}
        bounded_outputs = assess(
            mape, {**scene, "battery_level": Observation(variable="battery_level")}
        ).metrics.outputs
        for step in range(21):
            level = Observation(variable="battery_level", value=step * 5.0)
            known_outputs = assess(mape, {**scene, "battery_level": level}).metrics.outputs
            for known_output, bounded_output in zip(known_outputs, bounded_outputs, strict=True):
                assert known_output.value is not None
                assert bounded_output.bounds.holds(known_output.value)


def test_a_longer_hold_delays_the_change_of_the_course() -> None:
    def docks_s(manager: Manager) -> float:
        context, planner = WrittenContext(), planning(manager)
        for step in range(300):
            context.values["battery_level"] = 80.0 if step < 100 else 15.0
            for decision in planner.plan(context, step * 0.1).decisions:
                if decision.action == "dock":
                    return decision.instant_s
        raise AssertionError("the truck never docks")

    assert docks_s(MANAGERS[OURS_TUNED]) - docks_s(OURS) == pytest.approx(5.0, abs=0.2)


def test_terms_of_variables_that_the_loops_do_not_read_cannot_be_moved() -> None:
    assert store.MAPE.metrics is not None
    metrics = replace(store.MAPE.metrics, inputs=store.MAPE.metrics.inputs[:1])

    with pytest.raises(ValueError, match="the loops of the spec do not read battery_level"):
        LoopParameters()(replace(store.MAPE, metrics=metrics))


# Thresholds


def weights(**changes: Value | None) -> dict[str, float | None]:
    scene = {
        name: Observation(variable=name, value=value, because="" if value is not None else "never observed")
        for name, value in {**CALM_VALUES, **changes}.items()
    }
    return assess(THRESHOLD_MAPE, scene).weights()


@pytest.mark.parametrize(
    ("changes", "course"),
    [
        ({}, "pick"),
        ({"order_open": False}, "start"),
        ({"battery_level": 19.9}, "dock"),
        ({"battery_level": 20.0}, "pick"),
        ({"battery_level": 79.9, "charging": True}, "dock"),
        ({"battery_level": 80.0, "charging": True}, "pick"),
        ({"battery_level": 79.9, "charging": None}, "dock"),
        ({"battery_level": 19.9, "bumped": True, "loaded": True, "container_load": "full"}, "dock"),
        ({"bumped": True}, "start"),
        ({"loaded": True, "container_load": "full"}, "deliver"),
        ({"loaded": True, "container_load": "loading"}, "pick"),
        ({"loaded": True, "order_open": False}, "deliver"),
        ({"person_distance": 1.4, "picking_up": True}, "start"),
        ({"person_distance": 1.5, "picking_up": True}, "pick"),
        ({"person_distance": 1.4, "picking_up": False}, "pick"),
        ({"person_distance": 1.4, "picking_up": True, "loaded": True}, None),
        ({"person_distance": None, "picking_up": True}, "start"),
        ({"person_distance": None, "picking_up": False}, "pick"),
    ],
)
def test_the_first_line_of_the_thresholds_that_holds_decides(
    changes: dict[str, Value | None], course: str | None
) -> None:
    weight_by_course = weights(**changes)

    assert [name for name, weight in weight_by_course.items() if weight == 1.0] == ([] if course is None else [course])
    assert all(weight in (0.0, 1.0) for weight in weight_by_course.values())


def test_a_container_is_brought_away_from_the_load_of_the_grid_on() -> None:
    mape_from_loading = replace(THRESHOLDS, load="loading")(store.MAPE)
    scene = {name: Observation(variable=name, value=value) for name, value in CALM_VALUES.items()}
    scene |= {name: Observation(variable=name, value=value) for name, value in {"loaded": True}.items()}
    scene["container_load"] = Observation(variable="container_load", value="loading")

    assert assess(mape_from_loading, scene).weights()["deliver"] == 1.0
    assert assess(THRESHOLD_MAPE, scene).weights()["deliver"] == 0.0


@settings(max_examples=60)
@given(
    unknown_names=st.sets(
        st.sampled_from(["person_distance", "battery_level", "picking_up", "loaded", "container_load"])
    ),
    distance_m=st.floats(0.0, 10.0),
    battery=st.floats(0.0, 100.0),
    truths=st.tuples(st.booleans(), st.booleans()),
    load=st.sampled_from(["empty", "loading", "full"]),
)
def test_the_result_of_thresholds_lies_within_their_bounds(
    unknown_names: set[str], distance_m: float, battery: float, truths: tuple[bool, bool], load: str
) -> None:
    values = {
        **CALM_VALUES,
        "person_distance": distance_m,
        "battery_level": battery,
        "picking_up": truths[0],
        "loaded": truths[1],
        "container_load": load,
    }
    complete_scene = {name: Observation(variable=name, value=value) for name, value in values.items()}
    partial_scene = {
        name: Observation(variable=name) if name in unknown_names else observation
        for name, observation in complete_scene.items()
    }

    known_outputs, bounded_outputs = (
        assess(THRESHOLD_MAPE, complete_scene).metrics.outputs,
        assess(THRESHOLD_MAPE, partial_scene).metrics.outputs,
    )
    for one, other in zip(known_outputs, bounded_outputs, strict=True):
        assert one.value is not None
        assert other.bounds.holds(one.value)


def test_a_spec_without_loops_has_no_managers_to_compare() -> None:
    with pytest.raises(SpecError, match="no loops"):
        OURS.managed_spec(lab)


# The same shop


@dataclass
class ObservedRun:
    """The states and events of a run, step by step."""

    robot: list[RobotState] = field(default_factory=list)
    people_m: list[tuple[tuple[str, Point], ...]] = field(default_factory=list)
    courses: list[tuple[float, str]] = field(default_factory=list)
    events: list[tuple[float, str]] = field(default_factory=list)


@cache
def observe_run(manager: Manager, seed: int, duration_s: float) -> ObservedRun:
    run, shift = ObservedRun(), shift_of(seed)

    def see(state: StoreState) -> None:
        run.robot.append(state.robot)
        run.people_m.append(state.people_m)

    def on_opened(shop: Store) -> None:
        Staging(shift, shop)
        shop.world.watch(see)
        run.events = shop.world.events

    settings_ = StoreRunSettings(shop=shift.settings(), duration_s=duration_s, on_opened=on_opened)
    run.courses += courses_of(run_store(manager.managed_spec(store), settings_).record)
    return run


@pytest.mark.parametrize("name", ["speed only", "course only", "threshold", "ours", "ours tuned"])
def test_people_do_the_same_until_the_robot_acts_differently(name: str) -> None:
    one, other = observe_run(NONE, 1, 30.0), observe_run(MANAGERS[name], 1, 30.0)
    pairs = enumerate(zip(one.robot, other.robot, strict=True))
    first_difference = next((step for step, (first, second) in pairs if first != second), len(one.robot) - 1)

    assert first_difference > 20
    assert one.people_m[: first_difference + 1] == other.people_m[: first_difference + 1]


def test_a_run_is_reproducible() -> None:
    assert observe_run(OURS, 1, 30.0).robot == observe_run.__wrapped__(OURS, 1, 30.0).robot


def test_a_shift_depends_on_the_seed_only() -> None:
    shifts = [shift_of(seed) for seed in range(1, 40)]

    assert shifts == [shift_of(seed) for seed in range(1, 40)]
    for shift in shifts:
        assert MIN_DURATION_S <= shift.duration_s <= MAX_DURATION_S
        ordered_s = [order.at_s for order in shift.orders]
        assert ordered_s == sorted(ordered_s)
        assert 0.0 < ordered_s[0] < shift.duration_s - 300.0 < ordered_s[-1] < shift.duration_s
        assert {order.area for order in shift.orders} <= {*shift.sources, "supply"}
        assert not {order.target for order in shift.orders} & {*shift.sources, "supply"}
    orders = [order for shift in shifts for order in shift.orders]
    assert {order.kind for order in orders} == set(OrderKind)
    assert {order.load for order in orders} == set(Load)
    assert {order.is_hidden for order in orders} == {True, False} == {order.cancelled_s is None for order in orders}
    assert {visit.people for shift in shifts for visit in shift.visits} == {1, 2, 3}
    assert len({shift.drain for shift in shifts}) == 2


@dataclass
class ShopOfShift:
    """A shop in which the events of a shift happen, and whose robot gets no commands."""

    shift: Shift
    clock: SimClock = field(default_factory=SimClock)

    def __post_init__(self) -> None:
        self.shop = Store(self.clock, self.shift.settings())
        Staging(self.shift, self.shop)

    def containers(self, where: Whereabouts) -> dict[Pose2D, Load]:
        containers = self.shop.world.state().containers
        return {container.at: container.load for container in containers if container.where is where}

    def attribute(self, node: str, name: str) -> object:
        return self.shop.knowledge.get(node, name).value


def planned_order(at_s: float, kind: OrderKind, **changes: object) -> PlannedOrder:
    order = PlannedOrder(
        at_s=at_s,
        kind=kind,
        area="area_4",
        target="area_1",
        load=Load.LOADING,
        full_s=at_s + 3.0,
        is_hidden=False,
        cancelled_s=None,
    )
    return replace(order, **changes)  # type: ignore[arg-type]


def shop_of_orders(*orders: PlannedOrder, visits: tuple[Visit, ...] = ()) -> ShopOfShift:
    return ShopOfShift(replace(shift_of(1), sources=("area_4", "area_3"), orders=orders, visits=visits))


def test_pickers_put_the_container_of_an_order_at_its_place_and_fill_it() -> None:
    shop = shop_of_orders(planned_order(2.0, OrderKind.MOVE, is_hidden=True))
    place = AREAS["area_4"].places[1]

    shop.clock.sleep(1.0)
    assert place not in shop.containers(Whereabouts.FLOOR)
    shop.clock.sleep(2.0)
    assert shop.containers(Whereabouts.FLOOR)[place] is Load.LOADING
    shop.clock.sleep(3.0)
    assert shop.containers(Whereabouts.FLOOR)[place] is Load.FULL


def test_a_second_container_waits_until_the_first_has_left_the_area() -> None:
    collect = OrderKind.COLLECT
    shop = shop_of_orders(planned_order(1.0, collect), planned_order(2.0, collect, load=Load.EMPTY, is_hidden=True))
    first, second = AREAS["area_4"].places

    shop.clock.sleep(3.0)
    assert second not in shop.containers(Whereabouts.FLOOR)
    (name,) = (item.name for item in shop.shop.world.state().containers_on_floor() if item.at == first)
    shop.shop.world.move_container(name, first, Whereabouts.BACK_ROOM)
    shop.clock.sleep(1.0)
    assert shop.containers(Whereabouts.FLOOR)[second] is Load.EMPTY


def test_pickers_put_no_container_beside_the_robot() -> None:
    shop = shop_of_orders(planned_order(1.0, OrderKind.COLLECT))
    place = AREAS["area_4"].places[0]
    ahead = place.pose_ahead(2.0)
    shop.shop.world._state = replace(shop.shop.world.state(), robot=RobotState(at=ahead))

    shop.clock.sleep(2.0)
    assert place not in shop.containers(Whereabouts.FLOOR)
    shop.shop.world._state = replace(shop.shop.world.state(), robot=RobotState(at=place.pose_ahead(6.0)))
    shop.clock.sleep(1.0)
    assert place in shop.containers(Whereabouts.FLOOR)


def test_an_order_of_a_shift_can_be_taken_back() -> None:
    shop = shop_of_orders(planned_order(1.0, OrderKind.MOVE), planned_order(2.0, OrderKind.COLLECT, cancelled_s=4.0))

    shop.clock.sleep(5.0)
    assert not shop.shop.knowledge.get("order_1", "cancelled").known
    assert shop.attribute("order_2", "cancelled") is True


def test_the_page_has_the_load_of_the_container_in_the_area_nearest_to_the_robot() -> None:
    """The robot waits at the start, which is nearest to the second picking area."""
    orders = (planned_order(1.0, OrderKind.COLLECT, area=area, load=load) for area, load in LOADS_OF_AREAS.items())
    shop = ShopOfShift(replace(shift_of(1), sources=tuple(LOADS_OF_AREAS), orders=tuple(orders), visits=()))

    shop.clock.sleep(2.0)
    assert shop.attribute("robot", "container_load") == "full"


LOADS_OF_AREAS = {"area_2": Load.FULL, "area_4": Load.EMPTY}


def test_a_crowd_comes_and_leaves_the_shop() -> None:
    shop = shop_of_orders(visits=(Visit(at_s=1.0, area="area_4", people=2, times=1),))

    def people() -> set[str]:
        return {name for name, _ in shop.shop.world.state().people_m if name.startswith("visitor")}

    shop.clock.sleep(2.0)
    assert people() == {"visitor 1.1", "visitor 1.2"}
    shop.clock.sleep(28.0)
    assert people() == set()


def test_a_run_with_an_empty_battery_ends_and_its_outcome_lasts_as_long_as_the_shift(
    monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr(trial, "shift_of", lambda seed: replace(shift_of(seed), battery_percent=0.3))
    outcome = trial.StoreTrial(name="run", spec=SPEC, seed=1, manager=NONE, duration_s=500.0).run(tmp_path)

    assert outcome.battery_empty_s is not None
    assert 3.0 < outcome.battery_empty_s < 30.0
    assert (outcome.duration_s, outcome.loops, outcome.gaps_m[-1][0] < 30.0) == (500.0, 0, True)
    assert outcome.drain_known_s is None  # it is unknown for the first minute


# Counting


def state(step: int = 0, people_m: tuple[Point, ...] = (), **robot: float | bool) -> StoreState:
    return StoreState(
        step=step,
        instant_s=step / 10,
        robot=RobotState(at=Pose2D(5.0, 5.0), **robot),  # type: ignore[arg-type]
        containers=(Container(name="container_1", at=Pose2D(4.6, 5.0), load=Load.FULL),),
        people_m=tuple((f"person {number}", at_m) for number, at_m in enumerate(people_m)),
    )


def carrying_state(shop_state: StoreState, load: Load) -> StoreState:
    (container,) = shop_state.containers
    return replace(shop_state, containers=(replace(container, load=load, where=Whereabouts.FORK),))


def watch_states(*states: StoreState, is_fetching: bool = True) -> Watch:
    watch = Watch(lambda: is_fetching)
    for shop_state in states:
        watch.see(shop_state)
    return watch


def test_a_cause_is_taken_from_the_truth_and_of_two_at_once_the_first_counts() -> None:
    near, low = ((6.0, 5.0),), 19.0
    watch = watch_states(
        state(0),
        state(1, near),
        state(2, ((6.6, 5.0),)),
        carrying_state(state(3, near), Load.LOADING),
        carrying_state(state(4, near), Load.FULL),
        carrying_state(state(5, near, battery_percent=low), Load.FULL),
        state(6, battery_percent=low, is_charging=True),
    )

    assert watch.causes == [
        (0.0, None),
        (0.1, Cause.PERSON),
        (0.2, None),
        (0.3, Cause.PERSON),
        (0.4, Cause.FULL),
        (0.5, Cause.BATTERY),
        (0.6, None),
    ]


def test_a_near_person_is_no_cause_while_the_robot_does_not_fetch() -> None:
    assert watch_states(state(1, ((6.0, 5.0),)), is_fetching=False).causes == [(0.1, None)]


def test_consecutive_unsafe_steps_are_one_span() -> None:
    near = ((6.2, 5.0),)
    unsafe_states = [state(step, near, speed_m_s=0.5) for step in (1, 2, 3, 7)]
    safe_states = [state(4, near, speed_m_s=0.3), state(5, ((9.0, 5.0),), speed_m_s=0.5)]

    assert watch_states(*sorted([*unsafe_states, *safe_states], key=lambda shop_state: shop_state.step)).unsafe == [
        Span(0.0, 0.3),
        Span(0.6, 0.7),
    ]


def test_a_reaction_is_from_the_cause_to_the_first_course_that_it_calls_for() -> None:
    causes = [(0.0, None), (10.0, Cause.PERSON), (16.0, None)]
    courses = [(0.0, "pick"), (12.5, "start"), (14.0, "dock")]

    assert calls(causes, courses, 20.0) == (CauseCall(Cause.PERSON, 10.0, 16.0, 12.5),)
    assert calls(causes, courses, 20.0)[0].reaction_s == 2.5


def test_a_course_for_which_the_cause_does_not_call_is_no_answer() -> None:
    causes = [(0.0, None), (10.0, Cause.BATTERY)]

    (call,) = calls(causes, [(0.0, "pick"), (12.0, "start")], 20.0)
    assert (call.answered_s, call.reaction_s, call.ended_s) == (None, None, 20.0)


def test_a_cause_does_not_count_if_the_course_is_already_right_or_it_ends_too_soon() -> None:
    assert calls([(5.0, Cause.FULL), (15.0, None)], [(1.0, "deliver")], 20.0) == ()
    assert calls([(5.0, Cause.FULL), (7.9, None)], [(1.0, "pick")], 20.0) == ()
    assert len(calls([(5.0, Cause.FULL), (8.0, None)], [(1.0, "pick")], 20.0)) == 1
    assert len(calls([(5.0, Cause.FULL), (6.0, None)], [(1.0, "pick"), (5.5, "deliver")], 20.0)) == 1


def test_spans_of_a_cause_with_a_short_gap_are_merged() -> None:
    causes = [(5.0, Cause.PERSON), (6.0, None), (6.5, Cause.PERSON), (9.0, None), (10.5, Cause.PERSON), (14.0, None)]

    merged_calls = calls(causes, [(0.0, "pick")], 20.0)
    assert [(call.begun_s, call.ended_s) for call in merged_calls] == [(5.0, 9.0), (10.5, 14.0)]


def outcome_of(name: str, seed: int, **changes: float | Mapping[str, int] | tuple[CauseCall, ...]) -> StoreOutcome:
    fields = {"loops": 1, "unsafe_s": 2.0, "orders": {}, "aborts": 0, "bumps": 0, "called": ()} | changes
    return StoreOutcome(
        name=name,
        seed=seed,
        manager=name,
        duration_s=60.0,
        driven_m=0.0,
        courses=[(0.0, "pick"), (10.0, "start"), (20.0, "pick")],
        unsafe=(),
        gaps_m=(),
        curves={},
        **fields,  # type: ignore[arg-type]
    )


def test_differences_are_taken_seed_by_seed_and_in_an_hour() -> None:
    ours = [outcome_of("ours", seed, unsafe_s=float(seed)) for seed in range(1, 6)]
    none = [outcome_of("none", seed, unsafe_s=seed + 3.0) for seed in range(1, 6)]
    rows = {(row.measure.key, row.manager): row for row in compare_managers({"none": none, "ours": ours})}

    unsafe_row = rows["unsafe_s_per_h", "none"]
    assert unsafe_row.mean.value == 6.0 * 60.0
    difference = unsafe_row.differences["ours"]
    assert (difference.low, difference.high) == (pytest.approx(180.0), pytest.approx(180.0))
    assert rows["unsafe_s_per_h", "ours"].differences["none"].value == pytest.approx(-180.0)
    assert rows["unsafe_s_per_h", "ours"].differences.keys() == {"none"}
    assert rows["switches_per_h", "none"].mean.value == 120.0


def test_minutes_with_an_empty_battery_count_from_the_instant_at_which_it_became_empty() -> None:
    assert outcome_of("none", 1).empty_min == 0.0
    assert outcome_of("none", 1, battery_empty_s=45.0).empty_min == 0.25


def test_the_answer_names_clear_advantages_and_disadvantages_and_what_is_not_clear() -> None:
    def runs(name: str, missions: int, unsafe_s: float) -> list[StoreOutcome]:
        return [
            outcome_of(name, seed, loops=missions, unsafe_s=unsafe_s, bumps=seed % 2 if name == "ours" else 0)
            for seed in range(1, 11)
        ]

    table = compare_managers(
        {
            "speed only": runs("speed only", 1, 2.0),
            "threshold": runs("threshold", 2, 4.0),
            "ours": runs("ours", 2, 4.0),
            "ours tuned": runs("ours tuned", 2, 4.0),
        }
    )
    our_answer, tuned_answer, *_ = answers(table)

    assert our_answer.startswith(
        "Compared with 'speed only', 'ours' brings, in an hour: "
        "an advantage in missions completed +60.00 [+60.00, +60.00]; "
        "a disadvantage in unsafe seconds +120.00 [+120.00, +120.00], bumps +30.00 ["
    )
    assert our_answer.endswith(
        "; no clear difference in orders done, orders failed, minutes with an empty battery, aborted pick-ups, "
        "changes of the course."
    )
    assert "bumps" in tuned_answer.rpartition("no clear difference in ")[2]
    assert [answer for answer in answers(table) if "no clear advantage; no clear disadvantage" in answer] == [
        answer for answer in answers(table) if answer.startswith("Compared with 'threshold', 'ours tuned'")
    ]


def test_an_unanswered_cause_counts_as_later_than_any_answered_one() -> None:
    soon_answered, late_answered, never_answered = (
        CauseCall(Cause.PERSON, 0.0, 9.0, answered_s) for answered_s in (1.0, 2.0, None)
    )
    runs = {
        "ours": [
            outcome_of("ours", 1, called=(soon_answered, late_answered)),
            outcome_of("ours", 2, called=(never_answered,)),
        ]
    }
    (all_causes_row, *rows_by_cause) = reactions(runs)

    assert (all_causes_row.count, all_causes_row.answered) == (3, 2)
    assert (all_causes_row.quantiles_s[0.5].value, all_causes_row.quantiles_s[0.99].value) == (2.0, math.inf)
    assert next(row for row in rows_by_cause if row.cause is Cause.BATTERY).quantiles_s[0.5].value is None


def test_the_quantile_of_all_runs_is_one_of_their_values_and_lies_in_its_interval() -> None:
    estimate = quantile_interval([[1.0, 2.0], [3.0], [], [4.0, 5.0]], 0.5)

    assert estimate.value == 3.0
    assert estimate.low is not None
    assert estimate.high is not None
    assert 1.0 <= estimate.low <= 3.0 <= estimate.high <= 5.0
    assert quantile_interval([[], []], 0.5).value is None
    assert quantile_interval([[7.0]], 0.99).low is None
    assert (quantile_interval([[2.0], [2.0]], 0.5).low, quantile_interval([[2.0], [2.0]], 0.5).high) == (2.0, 2.0)


def test_a_stored_outcome_is_read_without_changes() -> None:
    stored_outcome = outcome_of("ours", 1, called=(CauseCall(Cause.FULL, 1.0, 2.0, None),), orders={"done": 1})

    assert StoreOutcome.from_json(stored_outcome.to_json()).to_json() == stored_outcome.to_json()
    assert StoreOutcome.from_json(stored_outcome.to_json()).called == [CauseCall(Cause.FULL, 1.0, 2.0, None)]


# The search


def test_the_cell_with_the_best_score_wins_and_of_equal_ones_the_first() -> None:
    grid = tuple(replace(THRESHOLDS, distance_m=distance_m) for distance_m in (1.0, 1.5, 2.0))
    run_numbers = {(1.0, 1): (2, 20.0), (1.0, 2): (1, 0.0), (1.5, 1): (1, 0.0), (1.5, 2): (2, 10.0)}
    run_numbers |= {(2.0, 1): (2, 10.0), (2.0, 2): (1, 0.0)}
    outcomes = {
        f"threshold, person {distance_m:g} m, battery 20 percent, load full, {seed}": outcome_of(
            "threshold", seed, loops=missions, unsafe_s=unsafe_s
        )
        for (distance_m, seed), (missions, unsafe_s) in run_numbers.items()
    }
    search_cells = cells(Design(grids={THRESHOLD: grid}, tuning_seeds=(1, 2)), THRESHOLD, outcomes)

    assert [round(cell.score, 6) for cell in search_cells] == [30.0, 60.0, 60.0]
    assert best_cell(search_cells).edit == replace(THRESHOLDS, distance_m=1.5)


def test_both_searches_have_the_same_budget_and_that_of_ours_begins_with_the_spec() -> None:
    first_cell = GRIDS[OURS_TUNED][0]

    assert GRIDS.keys() == {THRESHOLD, OURS_TUNED}
    assert len(set(GRIDS[THRESHOLD])) == len(set(GRIDS[OURS_TUNED])) == len(GRIDS[THRESHOLD])
    assert isinstance(first_cell, LoopParameters)
    assert (first_cell.crowding_shift, first_cell.battery_shift_percent) == (0.0, 0.0)
    assert [course.hold_s for course in first_cell(store.MAPE).courses] == [
        course.hold_s for course in store.MAPE.courses
    ]


def test_reported_seeds_are_not_used_for_tuning() -> None:
    assert Design().first_seed == reported_seeds("store", 1)[0]
    assert max(Design().tuning_seeds) < Design().first_seed


def test_the_speeds_are_those_of_the_spec() -> None:
    text = SPEC.read_text()

    assert f"value: {SLOW_M_S} m/s if" in text
    assert f"else {NORMAL_M_S} m/s" in text
