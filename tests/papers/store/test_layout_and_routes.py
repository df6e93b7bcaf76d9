"""The map: corridors of two metres, recesses hidden from the first pose, and routes that avoid the shelves."""

from __future__ import annotations

from itertools import pairwise
from math import hypot

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from codra_papers.store.geometry import Disc, Pose2D
from codra_papers.store.knowledge import named_floor_poses
from codra_papers.store.layout import AREAS, CORRIDORS_X_M, DEPTH_M, FIXED_BOXES, LENGTH_M, PICKING_AREAS, START
from codra_papers.store.routes import LANE_M, TURNING_ROOM_M, NoRouteError, clearance_m, has_room, route
from codra_papers.store.simulator.sensors import SMALLEST_VISIBLE_SHARE, visible_share
from codra_papers.store.simulator.state import Container, RobotState, StoreState

OPEN = sorted(name for name in named_floor_poses() if not name.endswith("_delivery"))


def test_the_shop_has_300_square_metres_and_corridors_of_two_metres() -> None:
    assert LENGTH_M * DEPTH_M == 300.0
    assert [clearance_m((x_m, 12.0)) for x_m in CORRIDORS_X_M] == pytest.approx([1.0] * len(CORRIDORS_X_M))


@pytest.mark.parametrize("name", PICKING_AREAS)
@pytest.mark.parametrize(("pose", "seen"), [(0, [True, False]), (1, [False, True])])
def test_from_each_observation_pose_one_of_the_places_is_in_sight(name: str, pose: int, seen: list[bool]) -> None:
    area = AREAS[name]
    shares = []
    for place in area.places:
        container = Container(name="box", at=place)
        robot = RobotState(at=area.observation_poses[pose])
        state = StoreState(step=0, instant_s=0.0, robot=robot, containers=(container,), people_m=())
        shares.append(visible_share(state, container.box()))

    assert [share >= SMALLEST_VISIBLE_SHARE for share in shares][pose] == seen[pose]
    assert shares[1] == 0.0 if pose == 0 else shares[1] > 0.5


@settings(max_examples=60, deadline=None)
@given(st.sampled_from(OPEN), st.sampled_from(OPEN))
def test_a_route_leads_there_and_leaves_room_to_turn_all_along(start: str, goal: str) -> None:
    poses = named_floor_poses()
    points = [poses[start].point_m, *route(poses[start], poses[goal])]

    assert points[-1] == poses[goal].point_m
    assert all(has_room(a, b, TURNING_ROOM_M - 0.05) for a, b in pairwise(points))


@pytest.mark.parametrize("name", AREAS)
def test_from_a_recess_the_route_first_leads_straight_out(name: str) -> None:
    delivery = AREAS[name].delivery
    points = route(delivery, START)

    assert delivery.relative_point(points[0])[0] > 0.3
    assert abs(delivery.relative_point(points[0])[1]) < 1e-9
    assert has_room(delivery.point_m, points[0], LANE_M)


def test_a_route_goes_around_places_to_avoid() -> None:
    goal = AREAS["area_2"].observation_poses[1]
    obstacle = Disc((8.2, 4.0), 0.3)
    points = [START.point_m, *route(START, goal, (obstacle,))]

    assert max(y_m for _, y_m in points) > 13.5  # by the way behind the shelves
    for a, b in pairwise(points):
        for share in range(21):
            x_m, y_m = a[0] + (b[0] - a[0]) * share / 20, a[1] + (b[1] - a[1]) * share / 20
            assert hypot(x_m - 8.2, y_m - 4.0) > 0.3 + TURNING_ROOM_M - 0.05


def test_without_a_route_an_error_is_raised() -> None:
    with pytest.raises(NoRouteError, match="no room to turn"):
        route(START, FIXED_BOXES[0].centre)
    with pytest.raises(NoRouteError, match="no route"):
        route(Pose2D(1.0, 1.0), START, (Disc((4.0, 2.0), 1.2), Disc((1.0, 9.0), 1.0)))
