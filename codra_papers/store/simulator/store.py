"""A complete run of the shop: the world, the robot's knowledge and agents, and the judge that computes the score."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from functools import partial

from codra_dsl.runtime import Reading
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.knowledge import Change, Knowledge, Stage, path
from codra_papers.store.agents import start_agents
from codra_papers.store.body import Body
from codra_papers.store.knowledge import store_knowledge
from codra_papers.store.simulator.situations import OrderKind, Pickers, Staff, StoreSettings, beginning
from codra_papers.store.simulator.state import Load
from codra_papers.store.simulator.truth import Judge
from codra_papers.store.simulator.world import StoreWorld


class PickerPage:
    """The agent `picker_page`: it writes the requests of pickers into the graph (P2's PickerWebInterface)."""

    def __init__(self, knowledge: Knowledge) -> None:
        """Open the handle of the agent `picker_page`; the graph has no orders yet."""
        self._knowledge = knowledge
        self._handle = knowledge.as_agent("picker_page")
        self._order_count = 0

    def order(self, kind: OrderKind, area: str, to: str) -> str:
        """Insert an order to bring a container from one area to another, and return the name of the order."""
        self._order_count += 1
        name = f"order_{self._order_count}"
        with self._handle.transaction() as change:
            change.insert_node(name, "order", kind=kind)
            change.insert_edge(name, "of_area", area)
            change.insert_edge(name, "to_area", to)
        if kind is OrderKind.PROVIDE:  # a provided container is empty, whatever was on the fork before
            self._knowledge.follow(name, "state", self._on_state)
        return name

    def _on_state(self, state: Reading[str]) -> None:
        if state.known and state.value == "open":
            self.set_load(Load.EMPTY)

    def cancel(self, order: str) -> None:
        """Take an order back. A closed order stays unchanged.

        Raises:
            UnknownNameError: the graph has no order of this name.
        """
        self._handle.set(order, "cancelled", True)

    def set_load(self, load: Load) -> None:
        """Write the load of the container that the robot serves."""
        self._handle.set("robot", "container_load", load)


class Store:
    """The open shop with its robot.

    Attributes:
        world: the world with the ground truth.
        knowledge: the knowledge of the robot.
        judge: the judge with the score so far.
        page: the page for orders of pickers.
        agents: the agents of the robot's body.
    """

    def __init__(
        self,
        clock: Clock,
        settings: StoreSettings,
        knowledge: Knowledge | None = None,
        start: Callable[[Knowledge, Body, Clock], object] = start_agents,
    ) -> None:
        """Open the shop.

        Args:
            clock: the clock of the run.
            settings: the situation of the run.
            knowledge: the graph of a context manager from a compiled spec; by default the shop creates one.
            start: starts the agents of the robot's body.
        """
        self.world = StoreWorld(clock, beginning(settings))
        self.knowledge = Knowledge(store_knowledge(), clock=clock) if knowledge is None else knowledge
        self.page = PickerPage(self.knowledge)
        self.judge = Judge(self.world.state())
        self._clock = clock
        self._handovers: list[tuple[float, str]] = []
        self._samples: list[str] = []
        self.agents = start(self.knowledge, self.world.body, clock)
        for callback in (self.judge.see, Staff(self.world).see, Pickers(settings, self.world, self.page).see):
            self.world.watch(callback)
        self.world.watch(lambda _: self._sample())
        for task in self.knowledge.model.tasks:
            for stage in Stage:
                on_stage = partial(self._on_stage, task.name, stage)
                self.knowledge.subscribe(on_stage, path("robot", stage, task.name))

    def record(self) -> str:
        """Return the true states once a second, the events, and the stages of tasks, as lines of text."""
        lines = [*self._lines(self.world.events), *self._lines(self._handovers)]
        return "\n".join((*self._samples, *lines, repr(self.judge.score))) + "\n"

    def _on_stage(self, task: str, stage: Stage, change: Change) -> None:
        handover = change.snapshot.handover(task)
        if handover.stage is stage:
            line = f"{task} {handover.number} {stage} {handover.result or handover.reason}".rstrip()
            self._handovers.append((self._clock.now_s(), line))

    def _sample(self) -> None:
        state = self.world.state()
        if state.step % 10 == 0:
            self._samples.append(repr(state))

    @staticmethod
    def _lines(events: list[tuple[float, str]]) -> Iterator[str]:
        return (f"{instant_s:.3f} {text}" for instant_s, text in events)
