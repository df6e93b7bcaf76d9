"""Orders stay open until they are delivered or taken back, or have no container: runs of specs/store.yaml."""

from __future__ import annotations

from contextlib import ExitStack
from types import TracebackType
from typing import Self

from codra_dsl.runtime import EventLog, SimClock
from codra_dsl.runtime.behavior_trees import Entry, Ports, Result, Scope
from codra_dsl.runtime.knowledge import Stage
from codra_papers.experiments.store.run import CompiledSpec
from codra_papers.store.layout import AREAS, DELIVERY, START
from codra_papers.store.mission.agent import Mission
from codra_papers.store.mission.picking import Picking
from codra_papers.store.simulator.situations import OrderKind, Situation, StoreSettings
from codra_papers.store.simulator.state import Whereabouts
from codra_papers.store.simulator.store import Store
from generated import store as spec


class Shop:
    """A quiet shop without shoppers, whose robot follows its loops."""

    def __init__(self) -> None:
        self.clock = SimClock()
        self._stack = ExitStack()

    def __enter__(self) -> Self:
        compiled = CompiledSpec.of(spec)
        assert compiled.loops is not None
        codra = self._stack.enter_context(compiled.start(clock=self.clock, resources={}, seed=1, record=EventLog()))
        self.store = Store(self.clock, StoreSettings(situation=Situation.QUIET, shoppers=0), codra.knowledge)
        robot = {"mission": Mission(codra.knowledge).leaves(), "picking": Picking(codra.knowledge).leaves()}
        self._stack.enter_context(compiled.loops(codra, clock=self.clock, robot=robot))
        self.clock.sleep(1.0)
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self._stack.close()

    def state(self, order: str) -> object:
        state = self.store.knowledge.get(order, "state")
        return state.value if state.known else "new"

    def waits_for(self, task: str, stage: Stage, timeout_s: float = 120.0) -> bool:
        handover = self.store.knowledge.snapshot
        return self.clock.wait_until(lambda: handover().handover(task).stage is stage, timeout_s)

    def waits_until_loaded(self, loaded: bool) -> bool:
        return self.clock.wait_until(lambda: self.store.world.body.has_load() is loaded, 240.0)


def test_an_order_that_is_taken_back_before_the_robot_is_there_is_closed_and_the_robot_returns() -> None:
    with Shop() as shop:
        order = shop.store.page.order(OrderKind.COLLECT, "area_1", DELIVERY.name)
        assert shop.waits_for("navigating", Stage.IS)
        shop.clock.sleep(5.0)
        shop.store.page.cancel(order)
        shop.clock.sleep(40.0)

        assert shop.state(order) == "cancelled"
        assert shop.store.world.state().robot.at.distance_m(START) < 0.3
        assert shop.store.knowledge.snapshot().handover("fetching").number == 0
        assert shop.store.judge.score.missions == 0


def test_a_container_on_the_fork_goes_to_the_general_delivery_pose_when_its_order_is_taken_back() -> None:
    with Shop() as shop:
        order = shop.store.page.order(OrderKind.MOVE, "area_1", "area_2")
        assert shop.waits_until_loaded(True)
        shop.clock.sleep(5.0)
        shop.store.page.cancel(order)
        assert shop.waits_until_loaded(False)

        assert shop.state(order) == "cancelled"
        assert shop.store.judge.score.deliveries == (DELIVERY.name,)


def test_an_order_that_waits_behind_another_can_be_taken_back() -> None:
    with Shop() as shop:
        first = shop.store.page.order(OrderKind.COLLECT, "area_1", DELIVERY.name)
        second = shop.store.page.order(OrderKind.MOVE, "area_1", "area_2")
        shop.clock.sleep(5.0)
        shop.store.page.cancel(second)
        shop.clock.sleep(1.0)

        assert (shop.state(first), shop.state(second)) == ("open", "cancelled")


def test_an_order_that_is_closed_is_not_taken_back_any_more() -> None:
    with Shop() as shop:
        order = shop.store.page.order(OrderKind.COLLECT, "area_3", DELIVERY.name)
        assert shop.clock.wait_until(lambda: shop.state(order) == "failed", 120.0)
        shop.store.page.cancel(order)
        shop.clock.sleep(2.0)

        assert shop.state(order) == "failed"


class Leaves:
    """The leaves of the mission's tree, called by hand."""

    def __init__(self, stack: ExitStack) -> None:
        clock = SimClock()
        codra = stack.enter_context(CompiledSpec.of(spec).start(clock=clock, resources={}, seed=1, record=EventLog()))
        self.knowledge = codra.knowledge
        settings = StoreSettings(situation=Situation.QUIET, shoppers=0)
        self.page = Store(clock, settings, self.knowledge).page
        self._robot = Mission(self.knowledge).leaves()
        self._scope = Scope()

    def call(self, leaf: str, **inputs: str) -> Result:
        outputs = {name: Entry(name) for name in ("observation_pose", "delivery_pose")}
        return self._robot.of(leaf).start(Ports(leaf, self._scope, inputs, outputs))

    def take_order(self) -> object:
        self.call("TakeOrder")
        return self._scope.get("observation_pose")


def test_an_order_that_was_left_waits_behind_those_that_were_left_less_often() -> None:
    with ExitStack() as stack:
        leaves = Leaves(stack)
        for area in ("area_1", "area_2"):
            leaves.page.order(OrderKind.COLLECT, area, DELIVERY.name)
        taken_poses = []
        for _ in range(4):
            taken_poses.append(leaves.take_order())
            leaves.call("SetOrderAside")
            leaves.call("ResumeOrders")

    assert taken_poses == ["area_1_pose_1", "area_2_pose_1", "area_1_pose_1", "area_2_pose_1"]


def test_an_order_that_has_failed_often_enough_is_closed_as_failed_and_the_next_is_served() -> None:
    with ExitStack() as stack:
        leaves = Leaves(stack)
        first, _ = (leaves.page.order(OrderKind.COLLECT, area, DELIVERY.name) for area in ("area_1", "area_2"))
        leaves.call("TakeOrder")
        results = [leaves.call("GiveOrderUp", tries="3") for _ in range(3)]

        assert results == [Result.FAILURE, Result.FAILURE, Result.SUCCESS]
        assert leaves.knowledge.get(first, "state").value == "failed"
        assert leaves.take_order() == "area_2_pose_1"


def test_the_base_gets_a_notice_of_a_container_that_was_seen_but_cannot_be_placed() -> None:
    with Shop() as shop:
        shop.store.page.order(OrderKind.COLLECT, "area_1", DELIVERY.name)
        assert shop.waits_for("detecting", Stage.FINISHED)
        shop.store.world.move_container("container_1", AREAS["area_4"].places[0], Whereabouts.FLOOR)
        assert shop.waits_for("fetching", Stage.FINISHED)
        shop.clock.sleep(1.0)

        assert shop.store.knowledge.snapshot().handover("fetching").result == "failed"
        assert shop.store.knowledge.get("base", "base_notice").value == "container_not_placed"
