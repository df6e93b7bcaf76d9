"""Leaves that hand a task over to another agent, by the handshake of the knowledge graph (P2, section 3.2)."""

from __future__ import annotations

from collections.abc import Collection

from codra_dsl.runtime.behavior_trees.leaves import Action, Ports
from codra_dsl.runtime.behavior_trees.result import Result
from codra_dsl.runtime.knowledge import AgentHandle, ConflictError, Knowledge, Request, Stage

UNSEEN = "unseen"
"""The reason that is written for a task that ended and was requested again between two ticks: its result is lost."""


class Task(Action):
    """An action that requests a task of the graph and runs until the task has ended; halting it aborts the task.

    If the task is already requested, the action waits until that request has ended. The action fails
    if its own task was aborted, by the requester or by a deadline. If the task has finished, the action succeeds or
    fails depending on the result. The result is written to the output port `result`, and the reason of an abortion to
    the output port `reason`.
    """

    def __init__(
        self,
        task: str,
        agent: AgentHandle,
        knowledge: Knowledge,
        *,
        succeeds_with: Collection[str] | None = None,
        values: Collection[str] = (),
    ) -> None:
        """Prepare the handover of a task.

        Args:
            task: the name of the task in the graph.
            agent: the handle of the agent that executes the tree; it must be one of the task's requesters.
            knowledge: the graph.
            succeeds_with: the results with which the action succeeds; None means all results.
            values: input ports that are written to the attributes of the same names when the task is requested.
        """
        self._task = task
        self._agent = agent
        self._knowledge = knowledge
        self._succeeds_with = succeeds_with
        self._values = tuple(values)
        self._request: Request | None = None

    def start(self, ports: Ports) -> Result:
        """Request the task, or wait until it can be requested."""
        if self._knowledge.snapshot().handover(self._task).is_open:
            return Result.RUNNING
        values = {name: ports.value(name) for name in self._values if name in ports}
        try:
            self._request = self._agent.request(self._task, **values)
        except ConflictError:  # another agent was quicker
            return Result.RUNNING
        return Result.RUNNING

    def go_on(self, ports: Ports) -> Result:
        """Return the result of the task, or RUNNING."""
        if self._request is None:
            return self.start(ports)
        handover = self._knowledge.snapshot().handover(self._task)
        if handover.request != self._request:  # the task has ended, and a newer request hides the result
            self._request = None
            ports.set("reason", UNSEEN)
            return Result.FAILURE
        if handover.is_open:
            return Result.RUNNING
        self._request = None
        if handover.stage is Stage.ABORTED:
            ports.set("reason", handover.reason)
            return Result.FAILURE
        ports.set("result", handover.result)
        is_success = self._succeeds_with is None or handover.result in self._succeeds_with
        return Result.SUCCESS if is_success else Result.FAILURE

    def halt(self, ports: Ports) -> None:  # noqa: ARG002
        """Abort the task, unless it has already ended."""
        request, self._request = self._request, None
        if request is None:
            return
        try:
            self._agent.abort(request)
        except ConflictError:  # the task has ended meanwhile; its result is not needed
            return
