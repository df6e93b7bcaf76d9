"""Orders served one after the other, and simulated time that waits for real time."""

from __future__ import annotations

from contextlib import suppress

import pytest

from codra_dsl.runtime import SimClock
from codra_papers.experiments.limited_time import LimitedClock, TimeIsUp
from codra_papers.experiments.pacing import BEAT_PERIOD_S, Beat
from codra_papers.store.mission.orders import SequentialMission
from codra_papers.store.simulator.situations import OrderKind, Situation, StoreSettings
from codra_papers.store.simulator.store import Store


class Served:
    """A shop in which orders are served for some time."""

    def __init__(self, situation: Situation, duration_s: float, *orders: tuple[OrderKind, str, str]) -> None:
        clock = LimitedClock(SimClock(), duration_s, lambda _: None)
        self.store = Store(clock, StoreSettings(situation=situation, shoppers=0))
        for order in orders:
            self.store.page.order(*order)
        mission = SequentialMission(self.store.knowledge, clock)
        with suppress(TimeIsUp):
            mission.serve()

    def states(self) -> list[object]:
        snapshot = self.store.knowledge.snapshot()
        readings = (snapshot.get(node.name, "state") for node in snapshot.nodes("order"))
        return [reading.value if reading.known else None for reading in readings]


def test_an_order_without_a_container_fails_the_next_one_is_served_and_then_the_robot_waits_at_the_start() -> None:
    served_shop = Served(
        Situation.QUIET,
        190.0,
        (OrderKind.COLLECT, "area_2", "delivery"),
        (OrderKind.PROVIDE, "supply", "area_3"),
    )

    assert served_shop.states() == ["failed", "done"]
    assert served_shop.store.judge.score.deliveries == ("area_3",)
    start = served_shop.store.world.state().robot.at
    assert (round(start.x_m), round(start.y_m)) == (8, 2)


def test_orders_not_begun_at_the_end_are_still_waiting() -> None:
    served_shop = Served(
        Situation.QUIET, 10.0, (OrderKind.PROVIDE, "supply", "area_3"), (OrderKind.COLLECT, "area_1", "delivery")
    )

    assert served_shop.states() == ["open", None]


@pytest.mark.parametrize("work_s", [0.0, 0.04])
def test_simulated_time_waits_for_real_time(work_s: float) -> None:
    clock, real_clock = SimClock(), SimClock(1000.0)
    Beat(clock, real_clock, lambda: real_clock.sleep(work_s))

    clock.sleep(10.0)

    assert real_clock.now_s() - 1000.0 == pytest.approx(10.0, abs=2 * BEAT_PERIOD_S)


def test_a_simulation_that_is_late_goes_on_from_where_it_is() -> None:
    clock, real_clock, beat_instants_s = SimClock(), SimClock(), []
    Beat(clock, real_clock, lambda: beat_instants_s.append(real_clock.now_s()))
    clock.sleep(1.0)
    real_clock.sleep(60.0)  # the program was stopped for a minute

    clock.sleep(2.0)

    after = [instant_s for instant_s in beat_instants_s if instant_s > 60.0]
    assert max(after) - min(after) > 1.5, "it does not hurry to catch up"


def test_without_real_time_the_simulation_does_not_wait() -> None:
    clock, beat_instants_s = SimClock(), []
    Beat(clock, None, lambda: beat_instants_s.append(clock.now_s()))

    clock.sleep(1.0)

    assert beat_instants_s == pytest.approx([0.1 * number for number in range(1, 11)])
