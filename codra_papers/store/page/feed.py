"""Views of the graph for all browsers: told by subscriptions, made once, and never kept waiting.

However often the graph changes, there is one newest view and no queue: a browser that is slow gets fewer views.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from contextlib import ExitStack

from codra_dsl.runtime.knowledge import Knowledge, KnowledgeModel, Path, Stage, anything, path, some
from codra_dsl.runtime.values.conditions import value
from codra_papers.store.page.view import Shown, View, view_of

PERIOD_S = 0.1
"""Views are not made more often than this; what changes meanwhile is in the next one."""


class Feed:
    """The newest view, as text.

    It is made by the thread of the simulation, in which subscriptions begin and end, and used in an event loop.
    """

    def __init__(self, knowledge: Knowledge, shown: tuple[Shown, ...]) -> None:
        """Subscribe to all that the page shows."""
        self._knowledge = knowledge
        self._shown = shown
        self._number = 0
        self._text = ""
        self._loop: asyncio.AbstractEventLoop | None = None
        self._is_told = False
        self._dirty = asyncio.Event()
        self._fresh = asyncio.Condition()
        self._subscriptions = ExitStack()
        for each in shown:
            self._subscriptions.enter_context(knowledge.follow(each.node, each.name, self._tell))
        for pattern in _patterns(knowledge.model):
            self._subscriptions.enter_context(knowledge.subscribe(self._tell, pattern))
        for state in _states(knowledge.model):
            order = path(some("order", called="order"), "of_area", anything())
            stands = value("order.state") == state
            self._subscriptions.enter_context(knowledge.subscribe(self._tell, order, stands))

    def close(self) -> None:
        """End the subscriptions, in the thread in which they began."""
        self._subscriptions.close()

    def view(self) -> View:
        """Return the present."""
        return view_of(self._knowledge, self._shown)

    async def publish(self) -> None:
        """Make views of what changes, for ever."""
        self._loop = asyncio.get_running_loop()
        while True:
            self._dirty.clear()
            self._is_told = False
            text = json.dumps(self.view(), allow_nan=False, separators=(",", ":"))
            async with self._fresh:
                self._number, self._text = self._number + 1, text
                self._fresh.notify_all()
            await asyncio.sleep(PERIOD_S)
            await self._dirty.wait()

    async def after(self, number: int) -> tuple[int, str]:
        """Wait for a newer view than the one with a number; return its number and its text."""
        async with self._fresh:
            await self._fresh.wait_for(lambda: self._number > number)
            return self._number, self._text

    def _tell(self, _: object) -> None:
        loop = self._loop
        if not self._is_told and loop is not None and not loop.is_closed():
            self._is_told = True
            _call(loop, self._dirty.set)


def _call(loop: asyncio.AbstractEventLoop, act: Callable[[], None]) -> None:
    try:
        loop.call_soon_threadsafe(act)
    except RuntimeError:
        return  # the loop was closed in this very instant


def _patterns(model: KnowledgeModel) -> list[Path]:
    """Return what shows that a node or an edge has come or gone, or that a task has gone on."""
    tasks = [path(task.origin, stage, task.name) for task in model.tasks for stage in Stage]
    starting = {node.name for node in model.nodes}
    moving = [each for each in model.edge_types if not (each.targets and starting.issuperset(each.targets))]
    return [*tasks, *(path(anything(), each.name, anything()) for each in moving)]


def _states(model: KnowledgeModel) -> tuple[str, ...]:
    orders = (each for each in model.node_types if each.name == "order")
    return tuple(
        state
        for order in orders
        for attribute in order.attributes
        if attribute.name == "state"
        for state in attribute.type.members
    )
