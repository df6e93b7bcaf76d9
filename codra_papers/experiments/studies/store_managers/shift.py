"""The events of a run. They are drawn from the seed before the run begins, and do not depend on the run."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import partial
from random import Random

from codra_papers.store.layout import AREAS, DELIVERY, PICKING_AREAS, SUPPLY
from codra_papers.store.simulator.people import new_visitor
from codra_papers.store.simulator.situations import OrderKind, Situation, StoreSettings
from codra_papers.store.simulator.state import Load, StoreState, Whereabouts
from codra_papers.store.simulator.store import Store

MIN_DURATION_S, MAX_DURATION_S = 1800.0, 3600.0
"""The limits of the duration of a shift: P2 states no duration."""

DRAIN_FACTOR = 4.0
"""The factor by which the battery is drained faster than usual."""

_SPARE_CONTAINER = "container_3"
"""A container that is in the back room at first. It is put at the place from which the robot will collect it."""

_FIRST_CONTAINER = "container_1"


@dataclass(frozen=True, slots=True, kw_only=True)
class Visit:
    """A person who walks back and forth before a container.

    Attributes:
        area: the area with the container.
        times: how often the person walks past the container.
    """

    at_s: float
    area: str
    times: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Shift:
    """The planned events of a run.

    Attributes:
        duration_s: the duration of the run.
        areas: one container is moved from the first area to the second, one is collected from the third, and one is
            provided to the fourth.
        move_s: when the order to move a container is given.
        full_s: when the container that is moved is full.
        is_hidden: whether the container of the third area is at a place that the first observation pose does not show.
    """

    seed: int
    duration_s: float
    areas: tuple[str, ...]
    move_s: float
    full_s: float
    collect_s: float
    provide_s: float
    is_hidden: bool
    visits: tuple[Visit, ...]
    battery_percent: float

    def settings(self) -> StoreSettings:
        """Return the settings of the shop for this shift."""
        return StoreSettings(
            seed=self.seed,
            situation=Situation.QUIET,
            area=self.areas[0],
            battery_percent=self.battery_percent,
            drain=DRAIN_FACTOR,
        )


def shift_of(seed: int) -> Shift:
    """Return the events of the run of a seed."""
    random = Random(f"{seed} shift")
    areas = tuple(random.sample(sorted(PICKING_AREAS), len(PICKING_AREAS)))
    move_s, collect_s = random.uniform(2.0, 6.0), random.uniform(80.0, 100.0)
    return Shift(
        seed=seed,
        duration_s=Random(f"{seed} shift duration").uniform(MIN_DURATION_S, MAX_DURATION_S),
        areas=areas,
        move_s=move_s,
        full_s=move_s + random.uniform(35.0, 70.0),
        collect_s=collect_s,
        provide_s=random.uniform(150.0, 170.0),
        is_hidden=random.random() < 1 / 3,
        visits=tuple(_visits(random, ((move_s, areas[0]), (collect_s, areas[2])))),
        battery_percent=random.uniform(21.0, 30.0) if random.random() < 1 / 3 else random.uniform(60.0, 100.0),
    )


def _visits(random: Random, orders: tuple[tuple[float, str], ...]) -> Iterator[Visit]:
    for ordered_s, area in orders:
        has_visitor, delay_s, times = random.random() < 0.7, random.uniform(15.0, 40.0), random.randint(3, 6)
        if has_visitor:
            yield Visit(at_s=ordered_s + delay_s, area=area, times=times)


class Staging:
    """Carries out the events of a shift in a shop."""

    def __init__(self, shift: Shift, store: Store) -> None:
        """Set up the containers, and watch the shop, so that each event happens at its instant.

        The container that will be collected is put at its place and is full. The container that will be moved gets its
        first load.
        """
        self._shift = shift
        self._store = store
        self._pending_actions = sorted(self._schedule(), key=lambda action: action[0])
        place = AREAS[shift.areas[2]].places[1 if shift.is_hidden else 0]
        store.world.move_container(_SPARE_CONTAINER, place, Whereabouts.FLOOR)
        store.world.set_load(_SPARE_CONTAINER, Load.FULL)
        self._set_load(Load.LOADING)
        store.world.watch(self._carry_out_due_actions)

    def _schedule(self) -> Iterator[tuple[float, Callable[[], object]]]:
        shift, order = self._shift, self._store.page.order
        source_area, target_area, collect_area, provide_area = shift.areas
        yield shift.move_s, lambda: order(OrderKind.MOVE, source_area, target_area)
        yield shift.full_s, lambda: self._set_load(Load.FULL)
        yield shift.collect_s, lambda: self._collect(collect_area)
        yield shift.provide_s, lambda: order(OrderKind.PROVIDE, SUPPLY.name, provide_area)
        for number, visit in enumerate(shift.visits, 1):
            yield visit.at_s, partial(self._add_visitor, number, visit)

    def _carry_out_due_actions(self, state: StoreState) -> None:
        while self._pending_actions and state.instant_s >= self._pending_actions[0][0]:
            _, action = self._pending_actions.pop(0)
            action()

    def _set_load(self, load: Load) -> None:
        self._store.world.set_load(_FIRST_CONTAINER, load)
        self._store.page.set_load(load)

    def _collect(self, area: str) -> None:
        self._store.page.set_load(Load.FULL)
        self._store.page.order(OrderKind.COLLECT, area, DELIVERY.name)

    def _add_visitor(self, number: int, visit: Visit) -> None:
        area = AREAS[visit.area]
        x_m, y_m = area.recess.corridor_x_m - 0.6, area.places[0].y_m
        ends_m = ((x_m, y_m + 0.8), (x_m, y_m - 0.8))
        visitor = new_visitor((x_m, y_m + 3.0), ends_m, visit.times, (x_m, 13.5))
        visitor.name = f"visitor {number}"
        self._store.world.add_person(visitor)
