"""Writers other than observers and the main execution: devices, people and programs that report values."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Generic, TypeVar, cast

if TYPE_CHECKING:
    from codra_dsl.runtime.callbacks import Subscription
    from codra_dsl.runtime.context.shared_acquisition import SharedAcquisition
    from codra_dsl.runtime.knowledge import AgentHandle, Change, Knowledge

VariableName_contra = TypeVar("VariableName_contra", bound=str, contravariant=True)
GraphT_co = TypeVar("GraphT_co", covariant=True)

NO_KNOWLEDGE = "declares no knowledge graph: add `knowledge` to it, and compile it"
"""The message of the error when there is no graph."""


class Agent(Generic[VariableName_contra, GraphT_co]):
    """The handle of one agent, which is the source of what it writes.

    Attributes:
        name: the name of the agent.
    """

    __slots__ = ("_acquisition", "_handle", "_knowledge", "_write", "name")

    def __init__(
        self,
        name: str,
        write: Callable[[str, object, str, float | None], None],
        knowledge: Knowledge | None = None,
        acquisition: SharedAcquisition | None = None,
    ) -> None:
        """Open the handle of an agent.

        Args:
            name: the name of the agent.
            write: writes a variable; called with its name, the value, the writer, and when its evidence was taken.
            knowledge: the graph, which the agent writes as well, if there is one.
            acquisition: declares the observed variables in the `wakes` patterns of the agent.

        Raises:
            UnknownNameError: if the graph has no such agent.
            AgentTakenError: if a handle of the agent is open.
        """
        self.name = name
        self._write = write
        self._knowledge = knowledge
        self._acquisition = acquisition
        self._handle = None if knowledge is None else knowledge.as_agent(name)

    @property
    def graph(self) -> GraphT_co:
        """Return the handle by which the agent writes the knowledge graph.

        Raises:
            LookupError: if the spec declares no knowledge graph.
        """
        if self._handle is None:
            raise LookupError(f"the spec {NO_KNOWLEDGE}")
        return cast("GraphT_co", self._handle)

    def on_wake(self, callback: Callable[[Change], object]) -> Subscription:
        """Call back when a `wakes` pattern of the agent becomes true in the knowledge graph; see `AgentHandle.on_wake`.

        The agent stays taken until the subscription or the handle is closed, even if this object is no longer
        referenced. While the agent waits, the observed variables in its `wakes` patterns are declared, as `agent NAME`.

        Raises:
            LookupError: if the spec declares no knowledge graph.
        """
        handle = cast("AgentHandle", self.graph)
        subscription = handle.on_wake(callback)
        if self._acquisition is not None:
            self._acquisition.begin()
            subscription.and_then(self._acquisition.end)
        return subscription

    def close(self) -> None:
        """Close the handle; with a knowledge graph, the agent can be taken again."""
        if self._handle is not None:
            self._handle.close()

    def set(self, name: VariableName_contra, value: object, *, evidence_s: float | None = None) -> None:
        """Write a variable of which this agent is a source, declared or not.

        Args:
            name: the variable.
            value: its value.
            evidence_s: when the evidence was taken; now, if None. A value that the variable has from
                newer evidence is kept.

        Raises:
            NotASourceError: if the variable does not name the agent as `source`.
            NotOfTypeError: if the value does not have the declared type.
            ValueError: if the evidence lies in the future.
        """
        if self._handle is not None:
            self._handle.check_open()
        self._write(name, value, self.name, evidence_s)
