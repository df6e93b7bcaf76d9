"""The shop under arbitrary commands: no collisions, no lost containers, and reproducible runs."""

from __future__ import annotations

from itertools import pairwise
from math import pi

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_dsl.runtime import SimClock
from codra_papers.store.body import Lift, Outcome, Side, Way
from codra_papers.store.geometry import Disc, Point, Pose2D
from codra_papers.store.layout import AREAS, DOCK, FIXED_BOXES, START, robot_at
from codra_papers.store.simulator.people import Person, new_shopper, new_visitor
from codra_papers.store.simulator.situations import Situation, StoreSettings, beginning
from codra_papers.store.simulator.state import Container, StoreState, Whereabouts
from codra_papers.store.simulator.truth import Judge, Score, is_unsafe, nearest_person_m
from codra_papers.store.simulator.world import Beginning, StoreWorld

PLACE = AREAS["area_1"].places[0]


def open_shop(
    *, at: Pose2D = START, containers: tuple[Container, ...] = (), people: tuple[Person, ...] = (), level: float = 100.0
) -> tuple[SimClock, StoreWorld, list[StoreState]]:
    clock = SimClock()
    initial_shop = Beginning(seed=1, containers=containers, people=people, robot=at, battery_percent=level)
    world, states = StoreWorld(clock, initial_shop), list[StoreState]()
    world.watch(states.append)
    return clock, world, states


def resting_person(at_m: Point) -> Person:
    return new_visitor(at_m, [at_m], 1, at_m)


drives = st.tuples(
    st.just("drive"),
    st.lists(st.tuples(st.floats(0, 20), st.floats(0, 15)), min_size=1, max_size=2),
    st.sampled_from(Way),
)
turns = st.tuples(st.just("turn"), st.floats(-pi, pi))
lifts = st.tuples(st.just("lift"), st.sampled_from(Lift))


@settings(max_examples=12, deadline=None)
@given(st.lists(st.tuples(st.one_of(drives, turns, lifts), st.floats(0.5, 20)), min_size=2, max_size=5))
def test_under_all_commands_the_robot_hits_no_body_and_no_container_is_lost(commands: list) -> None:  # type: ignore[type-arg]
    initial_shop = beginning(StoreSettings(seed=2, shoppers=2))
    clock = SimClock()
    world, states = StoreWorld(clock, initial_shop), list[StoreState]()
    world.watch(states.append)
    for (name, *values), wait_s in commands:
        getattr(world.body, name)(*values, lambda _: None)
        clock.sleep(wait_s)

    for state in states:
        assert not any(part.overlaps(box) for part in state.footprint() for box in FIXED_BOXES)
        assert sorted(container.name for container in state.containers) == sorted(
            container.name for container in initial_shop.containers
        )
        assert sum(container.where is Whereabouts.FORK for container in state.containers) <= 1


@settings(max_examples=8, deadline=None)
@given(st.lists(st.sampled_from(["start", "area_2", "area_3"]), min_size=1, max_size=2))
def test_the_battery_only_falls_while_the_robot_drives(names: list[str]) -> None:
    clock, world, states = open_shop(level=50.0)
    for name in names:
        goal = START if name == "start" else AREAS[name].observation_poses[0]
        world.body.drive([goal.point_m], Way.FORWARD, lambda _: None)
        clock.sleep(12)
    levels = [state.robot.battery_percent for state in states]

    assert all(later < earlier for earlier, later in pairwise(levels))


def test_at_the_dock_the_battery_is_charged_and_never_above_full() -> None:
    clock, world, _ = open_shop(at=DOCK, level=99.0)
    clock.sleep(60)

    assert world.body.is_charging()
    assert world.state().robot.battery_percent == 100.0


def test_the_factor_of_charging_shortens_a_charge() -> None:
    clock = SimClock()
    world = StoreWorld(clock, Beginning(seed=1, containers=(), robot=DOCK, battery_percent=40.0, charge=12.0))
    clock.sleep(60)

    assert world.state().robot.battery_percent == pytest.approx(64.0, abs=0.1)


def test_with_an_empty_battery_the_robot_stays_where_it_is_and_its_command_does_not_end() -> None:
    clock, world, states = open_shop(level=0.02)
    outcomes: list[Outcome] = []
    world.body.drive([(8.2, 11.0)], Way.FORWARD, outcomes.append)
    clock.sleep(10)
    empty_states = [state for state in states if state.robot.battery_percent == 0.0]

    assert START.distance_m(empty_states[0].robot.at) > 0.5
    assert {state.robot.at for state in empty_states[1:]} == {empty_states[1].robot.at}
    assert (empty_states[-1].robot.speed_m_s, world.body.battery_percent(), outcomes) == (0.0, 0.0, [])


@pytest.mark.parametrize(("robot", "is_beyond"), [(START, True), (Pose2D(8.35, 9.0), False)])
def test_a_visitor_leaves_the_shop_by_the_exit_to_which_the_robot_is_not_in_the_way(
    robot: Pose2D, is_beyond: bool
) -> None:
    visitor = new_visitor((8.0, 7.0), [(8.0, 7.2)], 1, (8.0, 11.0), other_exit_m=(8.0, 4.0))
    clock, _, states = open_shop(at=robot, people=(visitor,))
    clock.sleep(30)
    last_m = next(state.people_m[0][1] for state in reversed(states) if state.people_m)

    assert states[-1].people_m == ()
    assert (last_m[1] > 9.0) == is_beyond


def test_before_a_person_in_its_lane_the_robot_stops_and_gives_up() -> None:
    clock, world, states = open_shop(people=(resting_person((8.2, 6.0)),))
    outcomes: list[Outcome] = []
    world.body.drive([(8.2, 11.0)], Way.FORWARD, outcomes.append)
    clock.sleep(30)

    assert outcomes == [Outcome.BLOCKED]
    assert 0.2 < nearest_person_m(states[-1]) < 0.6
    assert world.events == []


def test_a_bump_into_a_person_outside_all_laser_views_is_counted() -> None:
    """The motion layer always stops in front of a resting person, so the test puts a person under the turning fork."""
    clock, world, states = open_shop()
    judge = Judge(world.state())
    world.watch(judge.see)
    outcomes: list[Outcome] = []
    world.body.drive([(8.2, 9.0)], Way.FORWARD, outcomes.append)
    clock.sleep(5)
    x_m, y_m = world.state().robot.at.point_at(0.75)
    world.add_person(resting_person((x_m, y_m)))
    clock.sleep(2)

    assert outcomes == [Outcome.BUMPED]
    assert judge.score.bumps == 1
    assert world.body.is_bumped()
    assert "the robot bumped into visitor" in [what for _, what in world.events]
    assert states[-1].robot.speed_m_s == 0.0
    clock.sleep(3)
    assert not world.body.is_bumped()


@pytest.mark.parametrize("beside_m", [-0.5, 0.5])
@pytest.mark.parametrize(
    ("command", "values"),
    [("drive", ([(4.6, 6.0)], Way.BACKWARD)), ("drive", ([(2.0, 9.5)], Way.FORWARD)), ("turn", (pi,))],
)
def test_no_motion_touches_a_person_beside_the_fork_with_only_the_near_side_in_view(
    command: str, values: tuple[object, ...], beside_m: float
) -> None:
    """Backing up would move the body into the person; a curve or a turn would move the fork."""
    at = Pose2D(4.6, 8.6, pi / 2)
    clock, world, _ = open_shop(at=at, people=(resting_person(at.point_at(-0.29, beside_m)),))
    getattr(world.body, command)(*values, lambda _: None)
    clock.sleep(6)

    assert world.events == []


def test_people_stop_before_the_robot_and_finally_turn_back() -> None:
    walker = new_visitor((8.2, 6.0), [(8.2, 0.5)], 1, (8.2, 0.5))
    clock, _, states = open_shop(people=(walker,))
    clock.sleep(30)

    assert min(nearest_person_m(state) for state in states) > 0.0
    assert min(state.people_m[0][1][1] for state in states) > 2.4


def test_one_more_person_does_not_change_the_others() -> None:
    alone_clock, _, states_with_one = open_shop(people=(new_shopper(5, 0),))
    many_clock, _, states_with_many = open_shop(people=(new_shopper(5, 0), new_shopper(5, 1), new_shopper(5, 2)))
    alone_clock.sleep(60)
    many_clock.sleep(60)

    assert [state.people_m[0] for state in states_with_one] == [state.people_m[0] for state in states_with_many]
    assert len({state.people_m[0][1] for state in states_with_one}) > 100


def test_people_never_walk_through_shelves() -> None:
    clock, _, states = open_shop(at=DOCK, people=tuple(new_shopper(seed, seed) for seed in range(4)))
    clock.sleep(240)
    shelf_collisions = [
        (state.instant_s, name)
        for state in states
        for name, at_m in state.people_m
        if min(box.distance_m(at_m) for box in FIXED_BOXES) < 0.2
    ]

    assert shelf_collisions == []


def test_a_container_is_lifted_only_from_right_above_the_fork() -> None:
    for aside_m, is_lifted in ((0.0, True), (0.08, True), (0.12, False)):
        container = Container(name="box", at=PLACE)
        at = robot_at(Pose2D(PLACE.x_m, PLACE.y_m + aside_m))
        clock, world, _ = open_shop(at=at, containers=(container,))
        world.body.lift(Lift.UP, lambda _: None)
        clock.sleep(4)

        assert world.body.has_load() is is_lifted


def test_a_carried_container_moves_along_and_stays_where_it_is_set_down() -> None:
    clock, world, _ = open_shop(at=robot_at(PLACE), containers=(Container(name="box", at=PLACE),))
    world.body.lift(Lift.UP, lambda _: None)
    clock.sleep(4)
    world.body.drive([(4.6, PLACE.y_m)], Way.FORWARD, lambda _: None)
    clock.sleep(8)
    world.body.lift(Lift.DOWN, lambda _: None)
    clock.sleep(4)
    (box,) = world.state().containers

    assert box.where is Whereabouts.FLOOR
    assert box.at.distance_m(world.state().robot.at.pose_ahead(-0.4)) < 1e-6
    assert box.at.x_m > PLACE.x_m + 1.4


@pytest.mark.parametrize("when_s", [0.05, 0.5, 1.5, 4.0])
def test_a_stopped_robot_rests_within_a_second(when_s: float) -> None:
    clock, world, _ = open_shop()
    outcomes: list[Outcome] = []
    stop = world.body.drive([(8.2, 11.0)], Way.FORWARD, outcomes.append)
    clock.sleep(when_s)
    stop()
    assert outcomes == [Outcome.STOPPED]
    clock.sleep(1.0)

    assert world.state().robot.surface_speed_m_s() == 0.0
    robot_pose = world.state().robot.at
    clock.sleep(5.0)
    assert world.state().robot.at == robot_pose


def test_stopping_a_replaced_command_does_not_stop_its_replacement() -> None:
    """The lift ends as stopped when another command is already running."""
    clock, world, _ = open_shop()
    outcomes: list[Outcome] = []
    stop = world.body.lift(Lift.UP, outcomes.append)
    clock.sleep(1.0)
    world.body.drive([(8.2, 7.0)], Way.FORWARD, outcomes.append)
    stop()
    clock.sleep(20.0)

    assert outcomes == [Outcome.STOPPED, Outcome.DONE]


def test_the_robot_drives_no_faster_than_its_maximum_speed() -> None:
    clock, world, states = open_shop()
    world.body.set_max_speed(0.4)
    world.body.drive([(8.2, 11.0)], Way.FORWARD, lambda _: None)
    clock.sleep(15)

    assert max(state.robot.speed_m_s for state in states) <= 0.4
    assert max(state.robot.surface_speed_m_s() for state in states) == pytest.approx(0.4)


def test_reading_sensors_does_not_change_their_values() -> None:
    read_clock, read_world, read_states = open_shop(
        people=(new_shopper(5, 0),), containers=(Container(name="box", at=PLACE),)
    )
    clock, world, states = open_shop(people=(new_shopper(5, 0),), containers=(Container(name="box", at=PLACE),))
    for shop in (read_world, world):
        shop.body.drive([(8.2, 9.0)], Way.FORWARD, lambda _: None)
    looks = []
    read_world.watch(lambda _: looks.append((read_world.body.look(), [read_world.body.scan(side) for side in Side])))
    read_clock.sleep(5)
    clock.sleep(5)

    assert len(looks) == 50
    assert read_states == states
    assert read_world.body.look() == world.body.look()
    assert (read_world.body.scan(Side.BACK).ranges_m == world.body.scan(Side.BACK).ranges_m).all()


def test_any_integer_is_a_seed_with_its_own_noise() -> None:
    scans = []
    for seed in (-2, -1, 0, 1, 2, -1):
        world = StoreWorld(SimClock(), beginning(StoreSettings(seed=seed, shoppers=0)))
        scans.append(world.body.scan(Side.BACK).ranges_m.tobytes())
    assert len(set(scans)) == 5
    assert scans[1] == scans[-1]


def test_the_lasers_measure_obstacles_to_a_few_centimetres() -> None:
    clock, world, _ = open_shop(people=(resting_person((8.2, 5.0)),))
    clock.sleep(1)
    points = world.body.scan(Side.FRONT_LEFT).points_m()
    forward_m = min(x for x, y in points.tolist() if abs(y) < 0.1)

    assert forward_m == pytest.approx(5.0 - 0.25 - START.y_m, abs=0.05)


def test_only_fast_motion_near_a_person_is_unsafe() -> None:
    clock, world, states = open_shop(people=(resting_person((9.3, 6.0)),))
    judge = Judge(world.state())
    world.watch(judge.see)
    world.body.drive([(8.2, 11.0)], Way.FORWARD, lambda _: None)
    clock.sleep(15)
    expected_states = [
        state
        for state in states
        if state.robot.speed_m_s > 0.3
        and min(box.distance_m(Disc((9.3, 6.0), 0.25).centre_m) for box in state.footprint()) - 0.25 < 1.0
    ]

    assert len(expected_states) > 10
    assert [state for state in states if is_unsafe(state)] == expected_states
    assert judge.score.unsafe_s == pytest.approx(len(expected_states) * 0.1)


def test_a_quiet_run_has_an_empty_score() -> None:
    clock, world, _ = open_shop()
    judge = Judge(world.state())
    world.watch(judge.see)
    clock.sleep(5)

    assert judge.score == Score()


def test_situations_begin_as_described() -> None:
    at = {situation: beginning(StoreSettings(situation=situation)).containers[0].at for situation in Situation}

    assert at[Situation.ORDINARY] == at[Situation.PEOPLE_CLOSE] == PLACE
    assert at[Situation.HIDDEN] == AREAS["area_1"].places[1]
    assert at[Situation.ABSENT] == at[Situation.SECOND_ORDER] == AREAS["supply"].places[0]
