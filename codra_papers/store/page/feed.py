"""Views of the graph for all browsers, triggered by subscriptions.

Only the newest view is kept. A view is made from a snapshot, at most ten times a second. There is no queue, so a slow
browser gets fewer views than others, and delays neither the simulation nor other browsers.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from contextlib import ExitStack

from codra_dsl.runtime.knowledge import Knowledge, KnowledgeModel, Path, Stage, anything, path, some
from codra_dsl.runtime.values.conditions import value
from codra_papers.store.page.view import ShownAttribute, View, view_of

PERIOD_S = 0.1
"""The shortest time between two views. Changes in between appear in the next view."""


class Feed:
    """The newest view, as text.

    The thread of the simulation creates and closes the feed, because subscriptions begin and end there. An event loop
    reads the feed.
    """

    def __init__(self, knowledge: Knowledge, shown_attributes: tuple[ShownAttribute, ...]) -> None:
        """Subscribe to everything that the page shows."""
        self._knowledge = knowledge
        self._shown_attributes = shown_attributes
        self._view_number = 0
        self._view_text = ""
        self._loop: asyncio.AbstractEventLoop | None = None
        self._is_notified = False
        self._change_event = asyncio.Event()
        self._view_condition = asyncio.Condition()
        self._subscriptions = ExitStack()
        for attribute in shown_attributes:
            self._subscriptions.enter_context(
                knowledge.follow(attribute.node, attribute.name, self._request_publishing)
            )
        for pattern in _patterns(knowledge.model):
            self._subscriptions.enter_context(knowledge.subscribe(self._request_publishing, pattern))
        for state in _order_states(knowledge.model):
            order = path(some("order", called="order"), "of_area", anything())
            state_condition = value("order.state") == state
            self._subscriptions.enter_context(knowledge.subscribe(self._request_publishing, order, state_condition))

    def close(self) -> None:
        """End the subscriptions, in the thread in which they began."""
        self._subscriptions.close()

    def view(self) -> View:
        """Return the current view."""
        return view_of(self._knowledge, self._shown_attributes)

    async def publish(self) -> None:
        """Publish a new view after changes, until cancelled."""
        self._loop = asyncio.get_running_loop()
        while True:
            self._change_event.clear()
            self._is_notified = False
            text = json.dumps(self.view(), allow_nan=False, separators=(",", ":"))
            async with self._view_condition:
                self._view_number, self._view_text = self._view_number + 1, text
                self._view_condition.notify_all()
            await asyncio.sleep(PERIOD_S)
            await self._change_event.wait()

    async def wait_for_newer(self, number: int) -> tuple[int, str]:
        """Wait for a view that is newer than the view with a number, and return the newer view's number and text."""
        async with self._view_condition:
            await self._view_condition.wait_for(lambda: self._view_number > number)
            return self._view_number, self._view_text

    def _request_publishing(self, _: object) -> None:
        loop = self._loop
        if not self._is_notified and loop is not None and not loop.is_closed():
            self._is_notified = True
            _call_in_loop(loop, self._change_event.set)


def _call_in_loop(loop: asyncio.AbstractEventLoop, call: Callable[[], None]) -> None:
    try:
        loop.call_soon_threadsafe(call)
    except RuntimeError:
        return  # the loop was closed at the same time


def _patterns(model: KnowledgeModel) -> list[Path]:
    """Return the patterns that match when nodes or edges appear or disappear, or when a task changes its stage."""
    tasks = [path(task.origin, stage, task.name) for task in model.tasks for stage in Stage]
    initial_nodes = {node.name for node in model.nodes}
    changing_edge_types = [
        edge_type
        for edge_type in model.edge_types
        if not (edge_type.targets and initial_nodes.issuperset(edge_type.targets))
    ]
    return [*tasks, *(path(anything(), edge_type.name, anything()) for edge_type in changing_edge_types)]


def _order_states(model: KnowledgeModel) -> tuple[str, ...]:
    orders = (node_type for node_type in model.node_types if node_type.name == "order")
    return tuple(
        state
        for order in orders
        for attribute in order.attributes
        if attribute.name == "state"
        for state in attribute.type.members
    )
