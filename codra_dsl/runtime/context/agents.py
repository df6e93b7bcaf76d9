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
"""The end of the error message for a spec without a knowledge graph."""


class Agent(Generic[VariableName_contra, GraphT_co]):
    """The handle of one agent, which is the source of every value that is written with the handle.

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
            write: writes a variable; called with the name of the variable, the value, the writer, and the instant at
                which the evidence was taken, or None.
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

        No other handle of the agent can be opened until the subscription or this handle is closed, even if this object
        is no longer referenced. While the subscription lasts, the observed variables in the `wakes` patterns of the
        agent are declared; the holder of these declarations is `agent NAME`.

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
        """Close the handle; with a knowledge graph, another handle of the agent can then be opened."""
        if self._handle is not None:
            self._handle.close()

    def set(self, name: VariableName_contra, value: object, *, evidence_s: float | None = None) -> None:
        """Write a variable of which this agent is a source. The variable need not be declared.

        Args:
            name: the variable.
            value: its value.
            evidence_s: when the evidence was taken; now, if None. If the variable has a value from newer evidence, the
                variable keeps this value.

        Raises:
            NotASourceError: if the variable does not list the agent under `source`.
            NotOfTypeError: if the value does not have the declared type.
            ValueError: if the evidence lies in the future.
        """
        if self._handle is not None:
            self._handle.check_open()
        self._write(name, value, self.name, evidence_s)
