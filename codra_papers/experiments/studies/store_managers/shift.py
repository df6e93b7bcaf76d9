"""The events of a shift. They are drawn from the seed before the run begins, and do not depend on the run."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass
from functools import partial
from random import Random

from codra_papers.store.layout import AREAS, BACK_Y_M, DELIVERY, FRONT_Y_M, PICKING_AREAS, SUPPLY
from codra_papers.store.simulator.people import new_visitor
from codra_papers.store.simulator.situations import (
    Clearing,
    OrderKind,
    Situation,
    StoreSettings,
    container_at,
)
from codra_papers.store.simulator.state import Container, Load, StoreState, Whereabouts
from codra_papers.store.simulator.store import Store

MIN_DURATION_S, MAX_DURATION_S = 1800.0, 2400.0
"""The limits of the duration of a shift: P2 states no duration."""

BATTERY_FACTOR = 10.0
"""The battery has a tenth of the usual capacity: it empties and charges ten times as fast. So 30 to 40 minutes need as
many charges as 5 to 7 hours with the usual battery, and a full battery does not last for a shift of work."""

OLD_BATTERY_FACTOR = 2.0
"""An old battery empties this many times as fast as a new one (P2, section 5.2: a quickly decreasing autonomy)."""

SPARE_CONTAINERS = 8
KEEP_AWAY_M = 3.0
"""Pickers put a container only at places that are farther away from the robot than this."""


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedOrder:
    """An order, and the container that it concerns.

    Attributes:
        at_s: when the order is given.
        full_s: when a container that is being loaded is full.
        is_hidden: whether the container is at a place that the first observation pose does not show.
        cancelled_s: when the order is taken back; None if it is not.
    """

    at_s: float
    kind: OrderKind
    area: str
    target: str
    load: Load
    full_s: float
    is_hidden: bool
    cancelled_s: float | None


@dataclass(frozen=True, slots=True, kw_only=True)
class Visit:
    """People who walk back and forth before a container (P2, Figures 3 and 10).

    Attributes:
        area: the area with the container.
        people: how many people come.
        times: how often each of them walks past the container.
    """

    at_s: float
    area: str
    people: int
    times: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Shift:
    """The planned events of a run.

    Attributes:
        duration_s: the duration of the run.
        sources: the areas from which containers are fetched. Other areas receive containers.
        drain: a factor on the battery's consumption.
    """

    seed: int
    duration_s: float
    sources: tuple[str, ...]
    orders: tuple[PlannedOrder, ...]
    visits: tuple[Visit, ...]
    battery_percent: float
    drain: float

    def settings(self) -> StoreSettings:
        """Return the settings of the shop for this shift."""
        return StoreSettings(
            seed=self.seed,
            situation=Situation.QUIET,
            area=self.sources[0],
            battery_percent=self.battery_percent,
            drain=self.drain,
            charge=BATTERY_FACTOR,
            spare_containers=SPARE_CONTAINERS,
        )


def shift_of(seed: int) -> Shift:
    """Return the events of the run of a seed."""
    random = Random(f"{seed} shift")
    duration_s = random.uniform(MIN_DURATION_S, MAX_DURATION_S)
    areas = random.sample(sorted(PICKING_AREAS), len(PICKING_AREAS))
    orders = tuple(_orders(random, duration_s, areas[:2], areas[2:]))
    return Shift(
        seed=seed,
        duration_s=duration_s,
        sources=tuple(areas[:2]),
        orders=orders,
        visits=tuple(_visits(random, [order for order in orders if order.kind is not OrderKind.PROVIDE])),
        battery_percent=random.uniform(40.0, 100.0),
        drain=BATTERY_FACTOR * (OLD_BATTERY_FACTOR if random.random() < 1 / 3 else 1.0),
    )


def _orders(
    random: Random, duration_s: float, sources: Sequence[str], receivers: Sequence[str]
) -> Iterator[PlannedOrder]:
    at_s = random.uniform(2.0, 6.0)
    while at_s < duration_s:
        (kind,) = random.choices((OrderKind.MOVE, OrderKind.COLLECT, OrderKind.PROVIDE), (2, 2, 1))
        source, receiver, is_full = random.choice(sources), random.choice(receivers), random.random() < 0.75
        full_s, is_hidden = at_s + random.uniform(40.0, 240.0), random.random() < 1 / 3
        is_cancelled, cancelled_s = random.random() < 0.1, at_s + random.uniform(20.0, 120.0)
        collected_load = Load.FULL if is_full else Load.EMPTY
        yield PlannedOrder(
            at_s=at_s,
            kind=kind,
            area=SUPPLY.name if kind is OrderKind.PROVIDE else source,
            target=DELIVERY.name if kind is OrderKind.COLLECT else receiver,
            load={OrderKind.MOVE: Load.LOADING, OrderKind.COLLECT: collected_load}.get(kind, Load.EMPTY),
            full_s=full_s,
            is_hidden=is_hidden,
            cancelled_s=cancelled_s if is_cancelled else None,
        )
        at_s += random.uniform(120.0, 240.0)


def _visits(random: Random, orders: Sequence[PlannedOrder]) -> Iterator[Visit]:
    for order in orders:
        at_s, chance = order.at_s + random.uniform(15.0, 40.0), random.random()
        passer_by = Visit(at_s=at_s, area=order.area, people=1, times=random.randint(3, 6))
        crowd = Visit(at_s=at_s, area=order.area, people=random.randint(2, 3), times=random.randint(20, 60))
        if chance < 0.7:
            yield passer_by if chance < 0.45 else crowd


class Staging:
    """Carries out the events of a shift in a shop.

    The instants of orders and visits are those of the shift. Pickers put the container of an order at its place as soon
    as the area has no other container and the robot is not near. They take away the containers that were brought to
    them, and keep the load at the page up to date.
    """

    def __init__(self, shift: Shift, store: Store) -> None:
        """Begin with empty picking areas, and watch the shop, so that each event happens at its instant."""
        self._world, self._page = store.world, store.page
        self._pending_actions = deque(sorted(self._schedule(shift), key=lambda action: action[0]))
        self._containers_to_put: dict[str, deque[PlannedOrder]] = {area: deque() for area in shift.sources}
        self._full_s: dict[str, float] = {}
        self._served: tuple[str, Load] | None = None
        for container in store.world.state().containers_on_floor():
            if container.at != SUPPLY.places[0]:
                store.world.move_container(container.name, container.at, Whereabouts.BACK_ROOM)
        receivers = PICKING_AREAS.keys() - set(shift.sources)
        clearings = [Clearing(store.world, PICKING_AREAS[area].places[0]).see for area in sorted(receivers)]
        for callback in (self._carry_out_due_actions, self._put_containers, self._fill, *clearings, self._report_load):
            store.world.watch(callback)

    def _schedule(self, shift: Shift) -> Iterator[tuple[float, Callable[[], object]]]:
        for number, order in enumerate(shift.orders, 1):
            yield order.at_s, partial(self._give_order, order)
            if order.cancelled_s is not None:
                yield order.cancelled_s, partial(self._page.cancel, f"order_{number}")
        for number, visit in enumerate(shift.visits, 1):
            yield visit.at_s, partial(self._add_visitors, number, visit)

    def _carry_out_due_actions(self, state: StoreState) -> None:
        while self._pending_actions and state.instant_s >= self._pending_actions[0][0]:
            _, action = self._pending_actions.popleft()
            action()

    def _give_order(self, order: PlannedOrder) -> None:
        self._page.order(order.kind, order.area, order.target)
        if order.area in self._containers_to_put:
            self._containers_to_put[order.area].append(order)

    def _add_visitors(self, number: int, visit: Visit) -> None:
        area = AREAS[visit.area]
        x_m, y_m = area.recess.corridor_x_m - 0.6, area.places[0].y_m
        for person in range(visit.people):
            ends_m = [(x_m, y_m + offset_m) for offset_m in ((0.8, -0.8) if person % 2 == 0 else (-0.8, 0.8))]
            at_m, exits_m = (x_m, y_m + 3.0 + person), ((x_m, BACK_Y_M - 0.5), (x_m, FRONT_Y_M + 1.0))
            visitor = new_visitor(at_m, ends_m, visit.times, exits_m[0], other_exit_m=exits_m[1])
            visitor.name = f"visitor {number}.{person + 1}"
            self._world.add_person(visitor)

    def _put_containers(self, state: StoreState) -> None:
        for area, orders in self._containers_to_put.items():
            spare_containers = [container for container in state.containers if container.where is Whereabouts.BACK_ROOM]
            if not orders or not spare_containers or _container_in(area, state) is not None:
                continue
            place = AREAS[area].places[1 if orders[0].is_hidden else 0]
            if state.robot.at.distance_m(place) > KEEP_AWAY_M:
                order, name = orders.popleft(), spare_containers[-1].name
                self._world.move_container(name, place, Whereabouts.FLOOR)
                self._world.set_load(name, order.load)
                self._full_s[name] = order.full_s
                return  # the next container in the next step, because the state has changed

    def _fill(self, state: StoreState) -> None:
        for container in state.containers:
            if container.load is Load.LOADING and state.instant_s >= self._full_s[container.name]:
                self._world.set_load(container.name, Load.FULL)

    def _report_load(self, state: StoreState) -> None:
        """Write the load of the container on the fork, or else of the one in the area nearest to the robot."""
        nearest_area = min(AREAS, key=lambda name: state.robot.at.distance_m(AREAS[name].observation_poses[0]))
        container = state.carried_container() or _container_in(nearest_area, state)
        served = None if container is None else (container.name, container.load)
        if served not in (None, self._served):
            self._page.set_load(served[1])
        self._served = served


def _container_in(area: str, state: StoreState) -> Container | None:
    """Return the container on the floor of an area; None if there is none."""
    containers = (container_at(state, place) for place in AREAS[area].places)
    return next((container for container in containers if container is not None), None)
