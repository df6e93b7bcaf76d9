"""Events in the shop that the robot does not cause: P2's situations, and the staff (P2, section 6)."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from enum import StrEnum
from typing import Protocol

from codra_papers.store.geometry import Pose2D
from codra_papers.store.layout import AREAS, DELIVERY, PICKING_AREAS, SUPPLY
from codra_papers.store.simulator.people import new_shopper, new_visitor
from codra_papers.store.simulator.state import Container, Load, StoreState, Whereabouts
from codra_papers.store.simulator.world import Beginning, StoreWorld


class Situation(StrEnum):
    """The situation of a run."""

    ORDINARY = "ordinary"
    """A picker orders to collect a full container from the first picking area. The container is in sight
    from the first observation pose."""

    SECOND_ORDER = "second order"
    """P2's first situation: a container is provided. While people fill it, they order it to another area. It is full on
    the way to that area."""

    PEOPLE_CLOSE = "people close"
    """P2's second situation: a person crosses in front of the empty container while the robot is about to fetch it."""

    HIDDEN = "hidden"
    """P2's third situation: the container cannot be seen from the first observation pose."""

    ABSENT = "absent"
    """The area has no container to collect."""

    QUIET = "quiet"
    """Orders come only from people at the page. The area has an empty container."""


class OrderKind(StrEnum):
    """The kinds of orders."""

    PROVIDE = "provide"
    COLLECT = "collect"
    MOVE = "move"


class Page(Protocol):
    """The interface of pickers to the robot (P2's PickerWebInterface)."""

    def order(self, kind: OrderKind, area: str, to: str) -> str:
        """Order to bring a container from one area to another, and return the name of the order."""
        ...

    def set_load(self, load: Load) -> None:
        """Set the load of the container that the robot serves."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreSettings:
    """The settings of a shop.

    Attributes:
        seed: the seed of everything random.
        shoppers: how many people walk about.
        area: the picking area of the situation.
        second_area: the target of the container in the second order.
        battery_percent: the battery level when the shop opens.
        drain: a factor on the battery's consumption.
        charge: a factor on the speed of charging.
        spare_containers: how many containers are in the back room.
    """

    seed: int = 1
    situation: Situation = Situation.ORDINARY
    shoppers: int = 3
    area: str = "area_1"
    second_area: str = "area_2"
    battery_percent: float = 100.0
    drain: float = 1.0
    charge: float = 1.0
    spare_containers: int = 1


def beginning(settings: StoreSettings) -> Beginning:
    """Return the shop when it opens: with containers at the supply, in the back room and, mostly, in the area."""
    places = PICKING_AREAS[settings.area].places
    first_places = {
        Situation.ORDINARY: places[0],
        Situation.PEOPLE_CLOSE: places[0],
        Situation.HIDDEN: places[1],
        Situation.QUIET: places[0],
    }
    at = first_places.get(settings.situation)
    situation_containers = () if at is None else (Container(name="container_1", at=at, load=_first_load(settings)),)
    spare_containers = (
        Container(name=f"container_{number + 3}", at=SUPPLY.places[0], where=Whereabouts.BACK_ROOM)
        for number in range(settings.spare_containers)
    )
    return Beginning(
        seed=settings.seed,
        containers=(*situation_containers, Container(name="container_2", at=SUPPLY.places[0]), *spare_containers),
        people=tuple(new_shopper(settings.seed, number) for number in range(settings.shoppers)),
        battery_percent=settings.battery_percent,
        drain=settings.drain,
        charge=settings.charge,
    )


def _first_load(settings: StoreSettings) -> Load:
    """Return the load of the container in the area."""
    return Load.EMPTY if settings.situation in (Situation.QUIET, Situation.PEOPLE_CLOSE) else Load.FULL


STAFF_S = 60.0
"""The time until the staff take a delivered container away, or refill the empty supply."""


class Clearing:
    """Takes the containers that are set down at a place to the back room, where they are emptied."""

    def __init__(self, world: StoreWorld, place: Pose2D) -> None:
        """Begin the work at a place."""
        self._world = world
        self._place = place
        self._since_s: float | None = None

    def see(self, state: StoreState) -> None:
        """Do the work of this step."""
        container = container_at(state, self._place)
        self._since_s = _true_since_s(self._since_s, state, container is not None)
        if container is not None and _is_due(self._since_s, state):
            self._world.set_load(container.name, Load.EMPTY)
            self._world.move_container(container.name, container.at, Whereabouts.BACK_ROOM)


class Staff:
    """Takes delivered containers away, and empty ones from the back room to the supply."""

    def __init__(self, world: StoreWorld) -> None:
        """Begin the work."""
        self._world = world
        self._delivery = Clearing(world, DELIVERY.places[0])
        self._supply_free_since_s: float | None = None

    def see(self, state: StoreState) -> None:
        """Do the work of this step."""
        self._delivery.see(state)
        is_free = container_at(state, SUPPLY.places[0]) is None and state.robot.at.distance_m(SUPPLY.places[0]) > 3.0
        self._supply_free_since_s = _true_since_s(self._supply_free_since_s, state, is_free)
        spare_container = next(
            (container for container in state.containers if container.where is Whereabouts.BACK_ROOM), None
        )
        if spare_container is not None and _is_due(self._supply_free_since_s, state):
            self._world.move_container(spare_container.name, SUPPLY.places[0], Whereabouts.FLOOR)


class Pickers:
    """Produce a situation: people who order, load and walk, depending on the state of the shop."""

    def __init__(self, settings: StoreSettings, world: StoreWorld, page: Page) -> None:
        """Begin the situation."""
        self._settings = settings
        self._world = world
        self._page = page
        self._pending_actions: list[tuple[Callable[[StoreState], bool], float, Callable[[StoreState], None]]] = list(
            self._actions_of_situation()
        )
        self._since_s: float | None = None

    def see(self, state: StoreState) -> None:
        """Do the next action if its condition has been true for the delay of the action."""
        if not self._pending_actions:
            return
        is_met, delay_s, action = self._pending_actions[0]
        self._since_s = _true_since_s(self._since_s, state, is_met(state))
        if self._since_s is not None and state.instant_s - self._since_s >= delay_s:
            self._since_s = None
            self._pending_actions.pop(0)
            action(state)

    def _actions_of_situation(
        self,
    ) -> tuple[tuple[Callable[[StoreState], bool], float, Callable[[StoreState], None]], ...]:
        if self._settings.situation is Situation.QUIET:
            return ()
        if self._settings.situation is Situation.SECOND_ORDER:
            return (
                (_always, 1.0, lambda _: self._provide()),
                (self._has_container, 5.0, lambda state: self._set_load(state, Load.LOADING)),
                (self._has_container, 40.0, self._order_move),
                (_is_carrying, 12.0, lambda state: self._set_load(state, Load.FULL)),
            )
        collect = (_always, 1.0, lambda _: self._collect())
        if self._settings.situation is Situation.PEOPLE_CLOSE:
            return (collect, (self._robot_waits_here, 1.0, self._let_person_cross))
        return (collect,)

    def _provide(self) -> None:
        self._page.order(OrderKind.PROVIDE, SUPPLY.name, self._settings.area)

    def _collect(self) -> None:
        self._page.set_load(_first_load(self._settings))
        self._page.order(OrderKind.COLLECT, self._settings.area, DELIVERY.name)

    def _order_move(self, _: StoreState) -> None:
        self._page.order(OrderKind.MOVE, self._settings.area, self._settings.second_area)

    def _set_load(self, state: StoreState, load: Load) -> None:
        container = state.carried_container() or container_at(state, AREAS[self._settings.area].places[0])
        if container is not None:
            self._world.set_load(container.name, load)
            self._page.set_load(load)

    def _let_person_cross(self, _: StoreState) -> None:
        area = AREAS[self._settings.area]
        x_m, y_m = area.recess.corridor_x_m - 0.6, area.places[0].y_m
        ends = ((x_m, y_m + 0.8), (x_m, y_m - 0.8))
        self._world.add_person(new_visitor((x_m, y_m + 3.0), ends, 40, (x_m, 13.5)))

    def _has_container(self, state: StoreState) -> bool:
        return container_at(state, AREAS[self._settings.area].places[0]) is not None

    def _robot_waits_here(self, state: StoreState) -> bool:
        """Return whether the robot rests at the first observation pose of the area."""
        pose = AREAS[self._settings.area].observation_poses[0]
        return state.robot.at.distance_m(pose) < 0.3 and state.robot.surface_speed_m_s() == 0.0


def container_at(state: StoreState, place: Pose2D) -> Container | None:
    """Return the container at a place."""
    return next((container for container in state.containers_on_floor() if container.at.distance_m(place) < 0.4), None)


def _always(_: StoreState) -> bool:
    return True


def _is_carrying(state: StoreState) -> bool:
    return state.carried_container() is not None


def _is_due(since_s: float | None, state: StoreState) -> bool:
    return since_s is not None and state.instant_s - since_s >= STAFF_S


def _true_since_s(since_s: float | None, state: StoreState, is_true: bool) -> float | None:
    """Return the instant since which a condition has been true without a break; None if the condition is false."""
    if not is_true:
        return None
    return state.instant_s if since_s is None else since_s
