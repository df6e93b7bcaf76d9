"""specs/kitchen.yaml, for another domain than the laboratory, with the perception functions of examples/kitchen."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from codra_dsl.runtime import Reason, SimClock
from generated import kitchen


@dataclass
class Kitchen:
    """A simulated kitchen: what a robot could see of it."""

    robot_m: float = 0.0
    place_m: dict[str, float] = field(default_factory=lambda: {"fridge": 0.5, "dishwasher": 3.0})
    angle_rad: dict[str, float | None] = field(default_factory=lambda: {"fridge": 0.0, "dishwasher": 0.0})
    edges: int = 10
    kettle_bearing_rad: float = 0.0
    kettle_docked: bool = True
    kettle_work_s: float = 0.5
    water_kg: float = 1.2
    steam: float = 0.0
    warmth: float = 20.0
    sharpness: float = 0.9
    lamp: str = "high"
    power_w: float = 500.0
    pot_on_hob: bool = True
    fill: float = 40.0


@contextmanager
def started(room: Kitchen, place: str = "counter") -> Iterator[tuple[kitchen.Kitchen, SimClock]]:
    clock = SimClock()
    with kitchen.start(clock=clock, resources={"kitchen": room}) as codra:
        codra.set("robot_is_localized", True)
        codra.set("robot_place", place)
        codra.set("light_is_on", True)
        yield codra, clock


def test_the_perception_functions_take_at_most_thirty_lines() -> None:
    text = (Path(__file__).parents[1] / "examples" / "kitchen" / "perception.py").read_text("utf-8")

    assert len([line for line in text.splitlines() if line.strip()]) <= 30


def test_a_door_in_reach_is_seen_and_one_out_of_reach_stays_unknown() -> None:
    with started(Kitchen()) as (codra, clock):
        codra.declare("fridge_open")
        codra.declare("dishwasher_open")
        clock.sleep(3.0)

        assert codra.get("fridge_open").value is False
        assert codra.get("dishwasher_in_reach").value is False
        assert codra.get("dishwasher_open").reason is Reason.NEVER_OBSERVED


def test_a_door_that_was_not_seen_for_two_minutes_is_unknown() -> None:
    room = Kitchen()
    with started(room) as (codra, clock):
        codra.declare("fridge_open")
        clock.sleep(3.0)
        room.robot_m = 9.0
        clock.sleep(100.0)
        assert codra.get("fridge_open").value is False
        clock.sleep(30.0)

        assert codra.get("fridge_open").reason is Reason.STALE


def test_an_expected_skill_finds_its_decision_in_the_context_and_an_unexpected_one_falls_back() -> None:
    looks: list[str] = []

    def look() -> bool:
        looks.append("looked")
        return False

    with started(Kitchen()) as (codra, _), codra.skill("open_fridge"):
        assert codra.decide("fridge_open", otherwise=look) is False
        assert looks == ["looked"]

    with started(Kitchen()) as (codra, clock):
        codra.expect("open_fridge")
        clock.sleep(3.0)
        with codra.skill("open_fridge"):
            assert codra.decide("fridge_open", otherwise=look) is False
            assert looks == ["looked"]


def test_acting_invalidates_what_the_skill_changes_until_newer_evidence_comes() -> None:
    room = Kitchen()
    with started(room) as (codra, clock), codra.skill("open_fridge") as skill:
        clock.sleep(3.0)
        with skill.acting():
            assert codra.get("fridge_open").reason is Reason.INVALIDATED
            room.angle_rad["fridge"] = 1.5
            clock.sleep(2.0)

        assert codra.get("fridge_open").value is True
        assert codra.get("fridge_angle").value == 1.5


def test_the_state_of_the_kettle_is_the_first_member_whose_condition_holds() -> None:
    room = Kitchen(warmth=80.0)
    with started(room) as (codra, clock):
        codra.declare("kettle_state")
        clock.sleep(2.0)
        assert codra.get("kettle_state").value == "hot"
        room.steam = 90.0
        clock.sleep(4.0)
        assert codra.get("kettle_state").value == "boiling"
        room.water_kg = 0.01
        clock.sleep(4.0)

        assert codra.get("kettle_state").value == "empty"


def test_the_kettle_is_weighed_where_it_cannot_be_seen() -> None:
    room = Kitchen()
    with started(room) as (codra, clock):
        codra.declare("kettle_water")
        clock.sleep(3.0)
        assert codra.get("kettle_water").source == "look_at_kettle"
        room.kettle_bearing_rad = 2.0
        room.water_kg = 0.8
        clock.sleep(6.0)

        assert codra.get("kettle_water").source == "weigh_kettle"
        assert abs(codra.get("kettle_water").value - 0.8) < 1e-9


def test_a_blurred_picture_is_rejected_and_the_kettle_stays_unknown() -> None:
    room = Kitchen(sharpness=0.2, kettle_docked=False)
    with started(room) as (codra, clock):
        codra.declare("kettle_state")
        clock.sleep(4.0)

        assert codra.get("kettle_state").reason is Reason.REJECTED


def test_the_pot_is_looked_into_with_the_power_of_the_hob_as_an_argument() -> None:
    with started(Kitchen(), place="stove") as (codra, clock):
        codra.declare("pot_fill")
        clock.sleep(4.0)

        assert codra.get("hob_level").value == "high"
        assert codra.get("pot_fill").value == 40.0
