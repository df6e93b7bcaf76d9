"""The two ways in which agents work: periodically, or when a task is requested (P2, section 3.2)."""

from __future__ import annotations

from collections.abc import Callable

from codra_dsl.runtime.clock import Clock, Timer
from codra_dsl.runtime.knowledge import AgentHandle, ConflictError, Knowledge, Request, Snapshot, Stage, path


def last_number(snapshot: Snapshot, type_name: str) -> int:
    """Return the highest number in the names of a type's nodes, such as `person_3`; an earlier agent inserted them."""
    return max((int(node.name.rpartition("_")[2]) for node in snapshot.nodes(type_name)), default=0)


class PeriodicCalls:
    """Calls a callback periodically until `stop` is called."""

    def __init__(self, clock: Clock, period_s: float, callback: Callable[[], None]) -> None:
        """Begin with a call now."""
        self._clock = clock
        self._period_s = period_s
        self._callback = callback
        self._start_s = clock.now_s()
        self._call_count = 0
        self._timer: Timer | None = clock.call_at(self._start_s, self._round)

    def stop(self) -> None:
        """Stop the calls."""
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None

    def _round(self) -> None:
        self._call_count += 1
        self._timer = self._clock.call_at(self._start_s + self._call_count * self._period_s, self._round)
        self._callback()


class Executor:
    """The executor of one task. It acknowledges a request, begins the work, and stops when the request is aborted."""

    def __init__(
        self,
        knowledge: Knowledge,
        handle: AgentHandle,
        task: str,
        begin: Callable[[Snapshot], None],
        stop: Callable[[], None],
    ) -> None:
        """Wait for requests.

        Args:
            knowledge: the graph with the requests.
            handle: the handle of the agent that executes the task.
            task: the name of the task.
            begin: called with a snapshot of the graph when a request was acknowledged.
            stop: called when the current request was aborted, by its requester or by a deadline.
        """
        self._knowledge = knowledge
        self._handle = handle
        self._task = task
        self._begin = begin
        self._stop = stop
        self._request: Request | None = None
        self._subscriptions = (
            knowledge.subscribe(lambda _: self._look(), path("robot", Stage.WANTS, task)),
            knowledge.subscribe(lambda _: self._look(), path("robot", Stage.ABORTED, task)),
            knowledge.follow(task, "request", lambda _: self._look()),
        )

    def finish(self, result: str) -> None:
        """End the current request with a result. If the request has already ended, do nothing."""
        request, self._request = self._request, None
        if request is not None:
            try:
                self._handle.finish(request, result)
            except ConflictError:
                return  # the deadline of the request passed at the same instant

    def _look(self) -> None:
        handover = self._knowledge.snapshot().handover(self._task)
        is_mine = handover.request == self._request and handover.stage is Stage.IS
        if self._request is not None and not is_mine:
            self._request = None
            self._stop()
        if handover.stage is Stage.WANTS:
            try:
                self._handle.acknowledge(handover.request)
            except ConflictError:
                return  # the request was taken back at the same instant
            self._request = handover.request
            self._begin(self._knowledge.snapshot())
