"""A run in the shop: one robot, its knowledge graph, and the people who order on the shop's web page."""

from __future__ import annotations

import math
from collections import Counter
from collections.abc import Callable, Mapping
from contextlib import ExitStack, suppress
from dataclasses import dataclass, field
from pathlib import Path
from types import ModuleType
from typing import Any

from codra_dsl.runtime import ContextManager, EventLog, Journal, SimClock, WallClock
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.knowledge import Knowledge
from codra_dsl.runtime.loops import Mape
from codra_papers.experiments.interrupts import noted_interrupt
from codra_papers.experiments.limited_time import LimitedClock, TimeIsUp
from codra_papers.experiments.pacing import Beat, Pace
from codra_papers.store.agents import start_agents
from codra_papers.store.body import Body
from codra_papers.store.mission.agent import Mission
from codra_papers.store.mission.orders import SequentialMission
from codra_papers.store.mission.picking import Picking
from codra_papers.store.processes.event_clock import EventClock
from codra_papers.store.processes.supervisor import AgentProcesses
from codra_papers.store.simulator.situations import StoreSettings
from codra_papers.store.simulator.store import Store
from codra_papers.store.simulator.truth import Score

Start = Callable[..., ContextManager[Any, Any]]
Loops = Callable[..., Mape]


@dataclass(frozen=True, slots=True, kw_only=True)
class PageSettings:
    """The settings of the picker's page in a run.

    Attributes:
        port: the port of the page; 0 for a free port.
        on_opened: a function that is called with the URL of the page when the page is open.
    """

    port: int = 0
    on_opened: Callable[[str], None] = lambda _: None


@dataclass(frozen=True, slots=True, kw_only=True)
class ProcessSettings:
    """The settings of a run in which each agent of the robot's body is a process of its own.

    Attributes:
        report: a function that is called with a text when a process has ended and is started again.
        on_started: a function that is called with the processes when they have been started.
    """

    report: Callable[[str], None] = lambda _: None
    on_started: Callable[[AgentProcesses], None] = lambda _: None


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreRunSettings:
    """The settings of a run.

    Attributes:
        shop: the situation and the seed of the shop.
        duration_s: how long the run lasts; infinite for a run that lasts until it is interrupted.
        progress: a function that is called repeatedly with the present instant.
        journal: the file of the journal; None for no journal.
        record: the event log of a run without a journal; None for one that keeps the latest events.
        page: the settings of the picker's page; None for no page.
        processes: the settings of the processes of agents, which run in real time; None for agents in this process.
        on_opened: a function that is called with the shop before anything happens there, e.g. to observe the shop or to
            schedule more events.
        is_over: a function that returns whether a run with loops ends now, before its duration is over.
    """

    shop: StoreSettings = field(default_factory=StoreSettings)
    duration_s: float = math.inf
    pace: Pace = Pace.FAST
    progress: Callable[[float], None] = lambda _: None
    journal: Path | None = None
    record: EventLog | None = None
    page: PageSettings | None = None
    processes: ProcessSettings | None = None
    on_opened: Callable[[Store], None] = lambda _: None
    is_over: Callable[[], bool] = lambda: False


@dataclass(frozen=True, slots=True, kw_only=True)
class StoreRun:
    """The result of a run.

    Attributes:
        orders: how many orders ended in each state.
        record: the events of the run; by default only the latest events of a very long run.
    """

    duration_s: float
    score: Score
    orders: Mapping[str, int]
    record: EventLog


@dataclass(frozen=True, slots=True, kw_only=True)
class CompiledSpec:
    """The compiled form of a spec with declarations for everything that the shop's agents write.

    Attributes:
        loops: a function that starts the loops; None if the spec has no loops, so that orders are served in the fixed
            sequence.
        folder: the folder of the generated package; None if the spec has no package.
    """

    start: Start
    loops: Loops | None = None
    folder: Path | None = None

    @classmethod
    def of(cls, package: ModuleType) -> CompiledSpec:
        """Return the compiled form of the spec of a generated package."""
        folder = None if package.__file__ is None else Path(package.__file__).parent
        return cls(start=package.start, loops=getattr(package, "loops", None), folder=folder)


def run_store(compiled: CompiledSpec, settings: StoreRunSettings) -> StoreRun:
    """Let the robot serve orders until time is up, with the loops of its spec or in the fixed sequence.

    Args:
        compiled: the compiled spec.
        settings: the settings of the run.

    Raises:
        LookupError: if the spec does not declare an element that the shop's agents use.
        PermissionError: if, according to the spec, only other agents may write an element that the shop's agents write.
        OSError: if the page's port is in use.
    """
    with ExitStack() as stack:
        raise_interrupt = stack.enter_context(noted_interrupt())
        base_clock = SimClock() if settings.processes is None else stack.enter_context(EventClock(start_s=0.0))
        clock = LimitedClock(base_clock, math.inf, settings.progress, raise_interrupt)
        record = _event_log(settings)
        codra = stack.enter_context(compiled.start(clock=clock, resources={}, seed=settings.shop.seed, record=record))
        start = _start_function(compiled, codra, settings.processes, stack)
        store = Store(clock, settings.shop, codra.knowledge, start)
        if isinstance(store.agents, AgentProcesses):
            store.agents.wait_until_ready(raise_interrupt)
        begin_s = clock.now_s()
        clock.end_s = begin_s + settings.duration_s
        settings.on_opened(store)
        serve = _serve_function(compiled, codra, clock, stack, settings.is_over)
        act = _open_page(store, codra, settings.page, stack)
        is_paced = settings.pace is Pace.REAL and settings.processes is None
        real_clock = stack.enter_context(WallClock(start_s=0.0)) if is_paced else None
        Beat(clock, real_clock, lambda: _beat(act, settings.progress, clock))
        with suppress(TimeIsUp):
            serve()
        settings.progress(clock.now_s())
        return StoreRun(
            duration_s=clock.now_s() - begin_s, score=store.judge.score, orders=_order_counts(store), record=record
        )


def _start_function(
    compiled: CompiledSpec, codra: ContextManager[Any, Any], settings: ProcessSettings | None, stack: ExitStack
) -> Callable[[Knowledge, Body, Clock], object]:
    """Return a function that starts the agents of the robot's body, in this process or in processes of their own."""
    folder = compiled.folder
    if settings is None or folder is None:
        return start_agents

    def start_processes(_: Knowledge, body: Body, clock: Clock) -> AgentProcesses:
        processes = stack.enter_context(AgentProcesses(codra, body, clock, folder, settings.report))
        settings.on_started(processes)
        return processes

    return start_processes


def _event_log(settings: StoreRunSettings) -> EventLog:
    if settings.journal is not None:
        return Journal(settings.journal)
    return EventLog() if settings.record is None else settings.record


def _serve_function(
    compiled: CompiledSpec,
    codra: ContextManager[Any, Any],
    clock: Clock,
    stack: ExitStack,
    is_over: Callable[[], bool],
) -> Callable[[], object]:
    """Return a function that serves orders until the time of the clock is up, or the run is over."""
    if compiled.loops is None:
        return SequentialMission(codra.knowledge, clock).serve
    robot = {"mission": Mission(codra.knowledge).leaves(), "picking": Picking(codra.knowledge).leaves()}
    stack.enter_context(compiled.loops(codra, clock=clock, robot=robot))
    return lambda: clock.wait_until(is_over, math.inf)


def _open_page(
    store: Store, codra: ContextManager[Any, Any], settings: PageSettings | None, stack: ExitStack
) -> Callable[[], None]:
    """Open the page if there are settings for the page, and return a function that serves it."""
    if settings is None:
        return lambda: None
    from codra_papers.store.page.server import PageServer  # noqa: PLC0415 - its libraries are an optional extra

    server = stack.enter_context(PageServer(store, port=settings.port, variables=codra.model.variables))
    settings.on_opened(server.url)
    return server.desk.serve


def _beat(act: Callable[[], None], progress: Callable[[float], None], clock: LimitedClock) -> None:
    act()
    progress(clock.now_s())
    clock.notify()  # in real time, the main thread notices an interrupt


def _order_counts(store: Store) -> Mapping[str, int]:
    snapshot = store.knowledge.snapshot()
    states = (snapshot.get(node.name, "state") for node in snapshot.nodes("order"))
    return dict(sorted(Counter(state.value if state.known else "waiting" for state in states).items()))


def store_text(run: StoreRun) -> str:
    """Return the result of a run as lines of text."""
    score = run.score
    orders = ", ".join(f"{count} {state}" for state, count in run.orders.items()) or "none"
    return "\n".join(
        (
            f"{run.duration_s:.1f} s",
            f"orders              {orders}",
            f"missions completed  {score.missions} ({', '.join(score.deliveries) or 'no container was set down'})",
            f"unsafe seconds      {score.unsafe_s:.1f}",
            f"bumps               {score.bumps}",
            f"driven              {score.driven_m:.1f} m",
        )
    ) + "\n"  # fmt: skip
