"""P2's pick-up and its situations as complete runs, step by step as in sections 3.2 and 6, with seeds."""

from __future__ import annotations

from collections.abc import Callable
from functools import cache
from pathlib import Path

import pytest

from codra_dsl.runtime import SimClock
from codra_dsl.runtime.knowledge import Change, path, some
from codra_papers.store.geometry import Point
from codra_papers.store.layout import AREAS, DELIVERY, START
from codra_papers.store.mission.trip import AbortedError, Trip
from codra_papers.store.simulator.drawing import draw_store
from codra_papers.store.simulator.situations import Situation, StoreSettings
from codra_papers.store.simulator.state import Load, Whereabouts
from codra_papers.store.simulator.store import Store

PICK_UP = [
    "navigating 1 finished arrived",
    "detecting 1 finished found",
    "navigating 2 finished arrived",
    "detecting 2 finished found",
    "rotating 1 finished turned",
    "checking 1 finished found",
    "navigating 3 finished arrived",
    "lifting 1 finished lifted",
]
"""P2, section 3.2, t to t + 7: drive, look, approach, look again, turn, check the wheels, back up, lift."""


class Run:
    """One run of the shop with a nominal trip."""

    def __init__(self, situation: Situation, seed: int, watch: Callable[[Store], None] = lambda _: None) -> None:
        self.clock = SimClock()
        self.store = Store(self.clock, StoreSettings(seed=seed, situation=situation))
        self.trip = Trip(self.store.knowledge, self.clock)
        self.path: list[Point] = []
        self.store.world.watch(lambda state: self.path.append(state.robot.at.point_m))
        watch(self.store)
        self.clock.sleep(2.0)

    def finished_tasks(self) -> list[str]:
        """The ended tasks in the record, in order."""
        lines = [line.split(" ", 1)[1] for line in self.store.record().splitlines() if " finished " in line]
        return [line for line in lines if not line.startswith(("Store", "Score"))]


@cache
def run_of_trip(situation: Situation, seed: int) -> Run:
    run = Run(situation, seed)
    if run.trip.pick_up("area_1"):
        run.trip.deliver("delivery")
    run.trip.go_to("start")
    run.clock.sleep(1.0)
    return run


def test_a_container_in_sight_is_fetched_from_the_first_pose_and_delivered() -> None:
    check_ordinary_trip(3)


def check_ordinary_trip(seed: int) -> None:
    run = run_of_trip(Situation.ORDINARY, seed)

    assert [line for line in run.finished_tasks() if line in PICK_UP] == PICK_UP
    assert run.store.judge.score.deliveries == ("delivery",)
    assert run.store.judge.score.bumps == 0
    assert run.store.world.state().robot.at.distance_m(START) < 0.1
    assert run.store.knowledge.refusals() == ()


def test_a_hidden_container_is_detected_from_the_second_pose_and_lifted() -> None:
    run = Run(Situation.HIDDEN, 3)

    assert run.trip.pick_up("area_1")
    assert_was_hidden(run)
    assert run.store.world.body.has_load()


def check_hidden_trip(seed: int) -> None:
    run = run_of_trip(Situation.HIDDEN, seed)

    assert_was_hidden(run)
    assert run.store.judge.score.deliveries == ("delivery",)


def assert_was_hidden(run: Run) -> None:
    detections = [line for line in run.finished_tasks() if line.startswith("detecting")]

    assert detections[:3] == ["detecting 1 finished lost", "detecting 2 finished found", "detecting 3 finished found"]


def test_without_a_container_the_base_gets_a_notice_and_the_robot_returns() -> None:
    run = run_of_trip(Situation.ABSENT, 3)
    detections = [line for line in run.finished_tasks() if line.startswith("detecting")]

    assert detections == ["detecting 1 finished lost", "detecting 2 finished lost"]
    assert run.store.knowledge.get("base", "base_notice").value == "container_not_found"
    assert run.store.judge.score.missions == 0
    assert run.store.world.state().robot.at.distance_m(START) < 0.1


def check_trip_of_second_order(seed: int) -> None:
    """P2's first situation. The check itself changes the course; `make stores` runs it."""
    run = Run(Situation.SECOND_ORDER, seed)
    trip, knowledge = run.trip, run.store.knowledge
    subscription = knowledge.follow(
        "robot", "container_load", lambda r: trip.abort() if r.known and r.value == "full" else None
    )
    (first,) = knowledge.snapshot().match(path(some("order", called="order"), "to_area", "area_1"))
    trip.pick_up("supply")
    trip.deliver("area_1")
    trip.go_to("start")
    assert knowledge.get("robot", "container_load").value == "loading"
    assert knowledge.wait_for(path(some("order"), "to_area", "area_2"), timeout_s=100.0)
    trip.pick_up("area_1")
    with pytest.raises(AbortedError, match="navigating was aborted: requester"):
        trip.deliver("area_2")
    subscription.unsubscribe()
    trip.close()
    Trip(knowledge, run.clock).deliver("delivery")
    (container,) = [container for container in run.store.world.state().containers if container.load is Load.FULL]

    assert first.node("order") == "order_1"
    assert container.at.distance_m(DELIVERY.places[0]) < 0.3
    assert run.store.judge.score.deliveries == ("area_1", "delivery")


def test_a_person_crosses_before_the_container_while_the_robot_is_about_to_fetch_it() -> None:
    """P2's second situation: the graph has `near` edges, and a subscription to them can abort."""
    run = Run(Situation.PEOPLE_CLOSE, 3)
    distances_m: list[float] = []
    someone = path(some("person"), "near", some("roll_container"))
    knowledge = run.store.knowledge
    knowledge.follow("robot", "person_distance", lambda r: distances_m.append(r.value) if r.known else None)
    knowledge.subscribe(lambda change: run.trip.abort() if change.new else None, someone)
    with pytest.raises(AbortedError, match="requester"):
        run.trip.pick_up("area_1")
    run.clock.sleep(1.0)

    assert min(distances_m) < 5.0
    assert dict(run.store.world.state().people_m).keys() >= {"visitor"}
    assert run.store.world.state().robot.surface_speed_m_s() == 0.0
    assert run.store.judge.score.bumps == 0


def test_the_staff_take_a_delivered_container_away_and_refill_the_supply() -> None:
    run = run_of_trip(Situation.ORDINARY, 3)
    run.clock.sleep(70.0)
    containers = {container.name: container for container in run.store.world.state().containers}

    assert len(containers) == 3
    assert containers["container_1"].where is Whereabouts.BACK_ROOM
    assert containers["container_1"].load is Load.EMPTY
    assert containers["container_2"].at == AREAS["supply"].places[0]


def quarter(seed: int, watch: Callable[[Store], None] = lambda _: None) -> str:
    run = Run(Situation.HIDDEN, seed, watch)
    run.trip.go_to("area_1_pose_1")
    run.clock.sleep(10.0)
    return run.store.record()


@pytest.fixture(scope="module")
def quarter_of_seed_3() -> str:
    return quarter(3)


def test_the_same_seed_gives_the_same_record_byte_for_byte(quarter_of_seed_3: str) -> None:
    assert quarter(3) == quarter_of_seed_3
    assert quarter(4) != quarter_of_seed_3


def read_everything(store: Store) -> None:
    knowledge, body = store.knowledge, store.world.body
    for variable in ("person_distance", "front_gap", "speed"):
        knowledge.follow("robot", variable, lambda _: None)
    knowledge.subscribe(lambda change: change.snapshot.nodes(), path(some("person"), "near", "robot"))
    store.world.watch(lambda _: (body.look(), body.believed_pose(), body.battery_percent()))


def test_more_readers_do_not_change_the_run(quarter_of_seed_3: str) -> None:
    assert quarter(3, read_everything) == quarter_of_seed_3


def test_the_map_is_drawn_the_same_twice(tmp_path: Path) -> None:
    run = run_of_trip(Situation.ORDINARY, 3)
    for name in ("one.svg", "two.svg"):
        draw_store(tmp_path / name, run.store.world.state(), run.path)
    picture = (tmp_path / "one.svg").read_bytes()

    assert picture == (tmp_path / "two.svg").read_bytes()
    assert picture.startswith(b"<?xml")
    assert len(picture) > 20_000


STEPS = ("navigating", "detecting", "rotating", "checking", "lifting")


def test_a_trip_that_is_aborted_at_any_step_leaves_a_robot_that_can_begin_again_and_go_home() -> None:
    run = Run(Situation.ORDINARY, 5)
    run.trip.close()
    knowledge = run.store.knowledge
    for step in STEPS:
        trip = Trip(knowledge, run.clock)
        subscription = knowledge.subscribe(_aborting(trip), path("robot", "is", step))
        with pytest.raises(AbortedError, match=f"{step} was aborted: requester"):
            trip.pick_up("area_1")
        subscription.unsubscribe()
        trip.close()
        run.clock.sleep(1.5)
        assert run.store.world.state().robot.surface_speed_m_s() == 0.0

    home = Trip(knowledge, run.clock)
    home.go_to("start")
    home.close()
    assert run.store.world.state().robot.at.distance_m(START) < 0.1
    assert run.store.judge.score.bumps == 0


def _aborting(trip: Trip) -> Callable[[Change], None]:
    return lambda change: trip.abort() if change.new else None
