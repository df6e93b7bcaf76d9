"""Single agents: their results from sensor values, and their reaction to an abort."""

from __future__ import annotations

from collections.abc import Callable
from math import hypot, pi

import pytest

from codra_dsl.runtime import NotASourceError, SimClock
from codra_dsl.runtime.knowledge import AgentHandle, Handover, Knowledge, Stage
from codra_papers.store.agents import start_agents
from codra_papers.store.agents.wheel_check import container_behind
from codra_papers.store.body import Side, Way
from codra_papers.store.geometry import Point, Pose2D
from codra_papers.store.knowledge import floor_pose_of, pose_of, store_knowledge
from codra_papers.store.layout import AREAS, ROW_WIDTH_M, ROWS_WEST_M, START, approach_to, robot_at
from codra_papers.store.simulator.people import new_visitor
from codra_papers.store.simulator.state import Container
from codra_papers.store.simulator.world import Beginning, StoreWorld

AREA = AREAS["area_1"]
PLACE = AREA.places[0]
SHELF_X_M = ROWS_WEST_M[AREA.recess.row] + ROW_WIDTH_M
POSE_BESIDE_SHELF = Pose2D(4.6, AREA.recess.north_m - 0.25)
"""A pose before a recess, so near to its end that the fork fits in beside the shelf, but the body does not fit."""


class Bench:
    """A shop with one robot, its agents, and a requester."""

    def __init__(self, at: Pose2D, *, containers: tuple[Container, ...] = (), seed: int = 1) -> None:
        self.clock = SimClock()
        self.world = StoreWorld(self.clock, Beginning(seed=seed, containers=containers, robot=at))
        self.knowledge = Knowledge(store_knowledge(), clock=self.clock)
        self.agents = start_agents(self.knowledge, self.world.body, self.clock)
        self.picking: AgentHandle = self.knowledge.as_agent("picking")
        self.clock.sleep(1.0)

    def aim(self, goal: Pose2D, way: Way = Way.FORWARD) -> None:
        self.picking.place("world", "goal_pose", "goal", pose_of(goal))
        self.picking.set("goal", "goal_way", way)

    def perform(self, task: str) -> Handover:
        self.picking.request(task)
        self.clock.wait_until(lambda: not self.knowledge.snapshot().handover(task).is_open, 400.0)
        return self.knowledge.snapshot().handover(task)

    def add_visitor(self, at_m: Point) -> None:
        self.world.add_person(new_visitor(at_m, [at_m], 1, at_m))

    def pose_on_floor(self, name: str) -> Pose2D:
        return floor_pose_of(self.knowledge.transform("world", name).pose)


def box(at: Pose2D = PLACE) -> Container:
    return Container(name="box", at=at)


def test_the_pose_in_the_graph_is_the_believed_one_and_near_the_true_one() -> None:
    bench = Bench(START)
    bench.world.body.drive([(8.2, 8.0)], Way.FORWARD, lambda _: None)
    bench.clock.sleep(5.0)
    spread_m = bench.knowledge.get("robot", "pose_spread").value

    assert bench.pose_on_floor("robot").distance_m(bench.world.body.believed_pose()) < 0.12
    assert bench.pose_on_floor("robot").distance_m(bench.world.state().robot.at) < 4 * spread_m + 0.12


def test_the_graph_has_battery_gaps_speed_and_bumps() -> None:
    bench = Bench(Pose2D(8.2, 6.0, pi / 2))
    bench.add_visitor((8.2, 8.0))
    bench.clock.sleep(1.0)
    snapshot = bench.knowledge.snapshot()

    assert snapshot.get("battery", "battery_level").value == pytest.approx(100.0, abs=0.2)
    assert snapshot.get("battery", "charging").value is False
    assert snapshot.get("robot", "speed").value == 0.0
    assert snapshot.get("robot", "bumped").value is False
    assert snapshot.get("robot", "front_gap").value == pytest.approx(0.65, abs=0.05)  # the shelf beside its corner


@pytest.mark.parametrize(("at_m", "is_near"), [((8.2, 7.2), True), ((8.2, 9.0), False)])
def test_a_person_in_view_has_a_node_a_pose_and_is_near_or_not(at_m: Point, is_near: bool) -> None:
    bench = Bench(Pose2D(8.2, 6.0, pi / 2))
    bench.add_visitor(at_m)
    bench.clock.sleep(4.0)
    snapshot = bench.knowledge.snapshot()
    (person,) = snapshot.nodes("person")

    assert bench.pose_on_floor(person.name).distance_m(Pose2D(*at_m)) < 0.2
    assert snapshot.has_edge(person.name, "near", "robot") is is_near
    assert snapshot.get("robot", "person_distance").value == pytest.approx(at_m[1] - 6.0, abs=0.2)


def test_a_person_who_has_gone_is_forgotten() -> None:
    bench = Bench(Pose2D(8.2, 6.0, pi / 2))
    bench.world.add_person(new_visitor((8.2, 8.0), [(8.2, 8.0)], 3, (8.2, 13.9)))
    bench.clock.sleep(2.0)
    assert len(bench.knowledge.snapshot().nodes("person")) == 1
    bench.world.body.turn(pi, lambda _: None)
    bench.clock.sleep(10.0)

    assert bench.knowledge.snapshot().nodes("person") == ()
    assert bench.knowledge.get("robot", "person_distance").value == 10.0


@pytest.mark.parametrize("beside_m", [(7.5, 6.2), (8.9, 6.2), (8.7, 4.6)], ids=["left", "right", "behind"])
def test_a_person_outside_the_cameras_view_is_followed_by_lasers_until_gone(
    beside_m: Point,
) -> None:
    bench = Bench(Pose2D(8.2, 6.0, pi / 2))
    aside_m = (beside_m[0], 5.0)
    bench.world.add_person(new_visitor((beside_m[0], 8.0), [beside_m, beside_m, beside_m, beside_m], 4, aside_m))
    distances_m: list[float] = []
    bench.knowledge.follow("robot", "person_distance", lambda r: distances_m.append(r.value) if r.known else None)
    bench.clock.sleep(4.5)
    assert bench.world.body.look().sightings == ()
    assert distances_m[-1] == pytest.approx(hypot(beside_m[0] - 8.2, beside_m[1] - 6.0), abs=0.35)
    bench.world._people.clear()
    bench.clock.sleep(6.0)

    assert distances_m[-1] == 10.0


def test_a_person_behind_a_shelf_is_not_seen() -> None:
    bench = Bench(Pose2D(8.2, 6.0, pi / 2))
    bench.add_visitor((11.8, 8.0))
    bench.clock.sleep(3.0)

    assert bench.knowledge.snapshot().nodes("person") == ()


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_container_in_sight_is_detected_at_its_place(seed: int) -> None:
    bench = Bench(AREA.observation_poses[0], containers=(box(),), seed=seed)
    assert bench.perform("detecting").result == "found"
    (node,) = bench.knowledge.snapshot().nodes("roll_container")

    assert bench.pose_on_floor(node.name).distance_m(PLACE) < 0.2
    assert bench.perform("detecting").result == "found"
    assert [container.name for container in bench.knowledge.snapshot().nodes("roll_container")] == [node.name]


def test_a_hidden_container_is_detected_from_the_second_pose_only() -> None:
    hidden_container = box(AREA.places[1])

    assert Bench(AREA.observation_poses[0], containers=(hidden_container,)).perform("detecting").result == "lost"
    assert Bench(AREA.observation_poses[1], containers=(hidden_container,)).perform("detecting").result == "found"


def test_a_container_that_was_taken_away_is_forgotten_at_the_next_look() -> None:
    bench = Bench(approach_to(PLACE).turned(pi), containers=(box(),))
    assert bench.perform("detecting").result == "found"
    bench.world.move_container("box", AREAS["area_4"].places[0], box().where)

    assert bench.perform("detecting").result == "lost"
    assert bench.knowledge.snapshot().nodes("roll_container") == ()


@pytest.mark.parametrize("aside_m", [-0.1, 0.0, 0.07])
def test_the_wheels_give_the_pose_of_a_container_to_three_centimetres(aside_m: float) -> None:
    start = approach_to(PLACE)
    bench = Bench(Pose2D(start.x_m, start.y_m + aside_m, 0.04), containers=(box(),))
    poses = [container_behind(bench.world.body.scan(Side.BACK))]
    for _ in range(9):
        bench.clock.sleep(0.2)
        poses.append(container_behind(bench.world.body.scan(Side.BACK)))
    robot = bench.world.state().robot.at
    errors_m = [
        hypot(x - PLACE.x_m, y - PLACE.y_m) for pose in poses if pose for x, y in [robot.point_at(pose.x_m, pose.y_m)]
    ]

    assert len(errors_m) >= 8
    assert sorted(errors_m)[len(errors_m) // 2] < 0.03


def test_without_wheels_behind_the_check_is_lost() -> None:
    bench = Bench(approach_to(PLACE))

    assert bench.perform("checking").result == "lost"


def test_turning_ends_with_the_fork_where_the_front_was() -> None:
    bench = Bench(START)
    assert bench.perform("rotating").result == "turned"

    assert abs(abs(START.turned(-bench.world.state().robot.at.heading_rad).heading_rad) - pi) < 0.05


def test_next_to_a_person_turning_is_refused() -> None:
    bench = Bench(START)
    bench.add_visitor(START.point_at(-0.3, 0.7))
    bench.clock.sleep(0.5)

    assert bench.perform("rotating").result == "blocked"
    assert bench.world.events == []


def test_navigation_arrives_with_the_heading_that_was_asked_for() -> None:
    bench = Bench(START)
    bench.aim(AREA.observation_poses[1])
    assert bench.perform("navigating").result == "arrived"
    robot = bench.world.state().robot.at

    assert robot.distance_m(AREA.observation_poses[1]) < 0.08
    assert abs(robot.turned(-AREA.observation_poses[1].heading_rad).heading_rad) < 0.06


def test_navigation_reports_an_unreachable_goal() -> None:
    bench = Bench(START)
    bench.aim(Pose2D(2.8, 5.0))

    assert bench.perform("navigating").result == "unreachable"


def test_navigation_goes_another_way_around_a_person_who_stays() -> None:
    bench = Bench(START)
    bench.add_visitor((8.2, 5.0))
    bench.aim(AREAS["area_2"].observation_poses[1])
    path: list[Point] = []
    bench.world.watch(lambda state: path.append(state.robot.at.point_m))

    assert bench.perform("navigating").result == "arrived"
    assert max(y_m for _, y_m in path) > 13.0
    assert bench.world.events == []


def test_navigation_gives_up_backwards_when_a_person_is_behind() -> None:
    bench = Bench(approach_to(PLACE), containers=(box(),))
    bench.add_visitor((PLACE.x_m + 0.7, PLACE.y_m))
    bench.aim(robot_at(PLACE), Way.BACKWARD)

    assert bench.perform("navigating").result == "blocked"
    assert bench.world.events == []


def test_navigation_leaves_a_place_where_a_person_is_too_near_to_turn() -> None:
    bench = Bench(START)
    bench.add_visitor(START.point_at(-0.3, 0.7))
    bench.aim(Pose2D(11.8, 2.0, 0.0))

    assert bench.perform("navigating").result == "arrived"
    assert bench.world.events == []


def test_after_a_bump_backwards_the_robot_draws_back_reports_it_and_can_drive_again() -> None:
    """Behind the robot, the lasers keep the lane of the fork free, but the body is broader than this lane."""
    bench = Bench(POSE_BESIDE_SHELF)
    bench.aim(POSE_BESIDE_SHELF.pose_ahead(-1.6), Way.BACKWARD)
    assert bench.perform("navigating").result == "bumped"
    ((_, event),) = bench.world.events
    assert event == "the robot bumped into a shelf"
    assert bench.world.state().robot.at.x_m > SHELF_X_M + 0.45
    bench.aim(AREA.observation_poses[1])

    assert bench.perform("navigating").result == "arrived"


def test_backwards_navigation_stops_before_obstacles_outside_of_container_places() -> None:
    """There may be a person or the frame of a container behind the wheels that the laser sees."""
    bench = Bench(Pose2D(8.2, 6.0, pi / 2), containers=(box(Pose2D(8.72, 4.2)),))
    bench.aim(Pose2D(8.2, 4.4), Way.BACKWARD)

    assert bench.perform("navigating").result == "blocked"
    assert bench.world.events == []


def bench_after_aborted_bump() -> Bench:
    bench = Bench(POSE_BESIDE_SHELF)
    bench.aim(POSE_BESIDE_SHELF.pose_ahead(-1.6), Way.BACKWARD)
    bench.picking.request("navigating")
    bench.clock.wait_until(bench.world.body.is_bumped, 60.0)
    request = bench.knowledge.snapshot().handover("navigating").request
    bench.picking.abort(request)
    return bench


def test_after_a_bump_the_robot_draws_back_even_if_the_task_is_aborted() -> None:
    bench = bench_after_aborted_bump()
    touching_m = bench.world.state().robot.at.x_m
    bench.clock.sleep(6.0)

    assert bench.world.state().robot.at.x_m > touching_m + 0.3
    assert bench.world.state().robot.surface_speed_m_s() == 0.0


def test_a_request_right_after_a_bump_draws_back_first_and_arrives() -> None:
    bench = bench_after_aborted_bump()
    bench.aim(AREA.observation_poses[1])

    assert bench.perform("navigating").result == "arrived"
    assert len(bench.world.events) == 1


def test_no_point_of_the_robot_goes_faster_than_the_maximum_speed_of_the_graph() -> None:
    bench = Bench(START)
    keep_max_speed(bench, 0.3)
    speeds_m_s: list[float] = []
    surface_speeds_m_s: list[float] = []
    bench.world.watch(lambda state: speeds_m_s.append(state.robot.speed_m_s))
    bench.world.watch(lambda state: surface_speeds_m_s.append(state.robot.surface_speed_m_s()))
    bench.aim(AREAS["area_2"].observation_poses[0])
    assert bench.perform("navigating").result == "arrived"

    assert max(speeds_m_s) == pytest.approx(0.3)
    assert max(surface_speeds_m_s) <= 0.3


def keep_max_speed(bench: Bench, speed_m_s: float) -> AgentHandle:
    adaptation = bench.knowledge.as_agent("adaptation")
    bench.world.watch(lambda _: adaptation.set("robot", "max_speed", speed_m_s))
    return adaptation


def test_the_robot_crawls_while_the_maximum_speed_is_no_longer_known() -> None:
    bench = Bench(START)
    speeds_m_s: list[tuple[float, float]] = []
    bench.world.watch(lambda state: speeds_m_s.append((bench.clock.now_s(), state.robot.speed_m_s)))
    bench.aim(AREAS["area_4"].observation_poses[0])
    bench.knowledge.as_agent("adaptation").set("robot", "max_speed", 1.2)
    stale_s = bench.clock.now_s() + 5.0
    assert bench.perform("navigating").result == "arrived"

    assert max(speed_m_s for at_s, speed_m_s in speeds_m_s if at_s < stale_s) > 0.6
    assert max(speed_m_s for at_s, speed_m_s in speeds_m_s if at_s > stale_s + 2.0) == pytest.approx(0.3)


@pytest.mark.parametrize(
    ("at_m", "gap_m"),
    [((8.2, 7.6), 0.9), ((8.2, 4.0), 1.0), ((7.4, 6.0), 0.2), ((8.2, 12.0), 10.0)],
    ids=["before it", "behind it", "beside it", "far away"],
)
def test_a_person_outside_all_camera_views_reduces_the_gap(at_m: Point, gap_m: float) -> None:
    bench = Bench(Pose2D(8.2, 6.0, pi / 2))
    bench.add_visitor(at_m)
    bench.clock.sleep(1.0)

    assert bench.knowledge.get("robot", "strange_gap").value == pytest.approx(gap_m, abs=0.08)


@pytest.mark.parametrize("name", [*AREAS, "start"])
def test_shelves_walls_and_containers_in_their_places_are_not_strange(name: str) -> None:
    poses = [*AREAS[name].observation_poses, AREAS[name].approach] if name in AREAS else [START]
    containers = [box(place) for place in AREAS[name].places[:1]] if name in AREAS else []
    for robot_pose in poses:
        bench = Bench(robot_pose, containers=tuple(containers))

        assert bench.knowledge.get("robot", "strange_gap").value == 10.0


def test_a_lifted_container_moves_with_the_robot_in_the_graph_until_it_is_set_down() -> None:
    bench = Bench(approach_to(PLACE).turned(pi), containers=(box(),))
    assert bench.perform("detecting").result == "found"
    bench.world.body.turn(pi, lambda _: None)
    bench.clock.sleep(8)
    bench.aim(robot_at(PLACE), Way.BACKWARD)
    assert bench.perform("navigating").result == "arrived"
    assert bench.perform("lifting").result == "lifted"
    (carried_container,) = bench.knowledge.snapshot().edges("carries", origin="robot")
    assert bench.knowledge.snapshot().parent(carried_container.target) == "robot"
    bench.aim(Pose2D(4.6, 11.0, pi / 2))
    assert bench.perform("navigating").result == "arrived"
    assert bench.perform("lowering").result == "lowered"
    snapshot = bench.knowledge.snapshot()

    assert snapshot.parent(carried_container.target) == "world"
    assert snapshot.edges("carries") == ()
    assert bench.pose_on_floor(carried_container.target).distance_m(bench.world.state().containers[0].at) < 0.25


def test_an_empty_lift_is_reported() -> None:
    bench = Bench(START)

    assert bench.perform("lifting").result == "empty"
    assert bench.knowledge.get("robot", "loaded").value is False


TASKS: dict[str, Callable[[], Bench]] = {
    "navigating": lambda: Bench(START),
    "rotating": lambda: Bench(START),
    "detecting": lambda: Bench(AREA.observation_poses[0], containers=(box(),)),
    "checking": lambda: Bench(approach_to(PLACE), containers=(box(),)),
    "lifting": lambda: Bench(robot_at(PLACE), containers=(box(),)),
    "lowering": lambda: Bench(robot_at(PLACE), containers=(box(),)),
}


@pytest.mark.parametrize("task", TASKS)
@pytest.mark.parametrize("after_s", [0.0, 0.05, 0.7])
def test_an_aborted_task_stops_and_can_be_requested_again(task: str, after_s: float) -> None:
    bench = TASKS[task]()
    bench.aim(AREAS["area_2"].observation_poses[0])
    request = bench.picking.request(task)
    bench.clock.sleep(after_s)
    bench.picking.abort(request)
    bench.clock.sleep(2.0)
    handover = bench.knowledge.snapshot().handover(task)
    robot = bench.world.state().robot
    bench.clock.sleep(5.0)

    assert (handover.stage, handover.reason, handover.result) == (Stage.ABORTED, "requester", None)
    assert bench.world.state().robot.at == robot.at
    assert bench.world.state().robot.is_fork_up is False
    assert bench.knowledge.snapshot().nodes("roll_container") == ()
    assert bench.perform(task).stage is Stage.FINISHED


def test_a_task_requested_again_in_the_instant_of_its_abort_is_executed_again() -> None:
    bench = Bench(START)
    request = bench.picking.request("rotating")
    bench.clock.sleep(1.0)
    bench.picking.abort(request)

    assert bench.perform("rotating").result == "turned"
    assert bench.knowledge.snapshot().handover("rotating").number == 2


def test_a_task_that_takes_too_long_is_aborted_and_the_robot_stops() -> None:
    bench = Bench(START)
    keep_max_speed(bench, 0.05)
    handover = bench.perform("rotating")
    turned_rad = bench.world.state().robot.at.heading_rad - START.heading_rad
    bench.clock.sleep(1.0)

    assert (handover.stage, handover.reason) == (Stage.ABORTED, "overdue")
    assert turned_rad != 0.0
    assert bench.world.state().robot.turn_rate_rad_s == 0.0


def test_an_agent_cannot_write_the_attribute_of_another_one() -> None:
    bench = Bench(START)
    with pytest.raises(NotASourceError, match="may be written by navigation"):
        bench.picking.set("battery", "battery_level", 100.0)

    assert [refusal.agent for refusal in bench.knowledge.refusals()] == ["picking"]
