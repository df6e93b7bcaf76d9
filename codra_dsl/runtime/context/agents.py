"""Writers beside the observers and the main execution: devices, people and programs that report what they know."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING, Generic, TypeVar, cast

if TYPE_CHECKING:
    from codra_dsl.runtime.callbacks import Subscription
    from codra_dsl.runtime.context.shared_acquisition import SharedAcquisition
    from codra_dsl.runtime.knowledge import AgentHandle, Change, Knowledge

VariableName_contra = TypeVar("VariableName_contra", bound=str, contravariant=True)
GraphT_co = TypeVar("GraphT_co", covariant=True)

NO_KNOWLEDGE = "says nothing of knowledge: declare `knowledge` in it, and compile it"
"""What the error tells where there is no graph."""


class Agent(Generic[VariableName_contra, GraphT_co]):
    """The handle of one agent; what it writes carries its name.

    Attributes:
        name: of the agent.
    """

    __slots__ = ("_handle", "_knowledge", "_shared", "_write", "name")

    def __init__(
        self,
        name: str,
        write: Callable[[str, object, str, float | None], None],
        knowledge: Knowledge | None = None,
        shared: SharedAcquisition | None = None,
    ) -> None:
        """Write as one agent.

        Args:
            name: of the agent.
            write: writes a variable: its name, the value, the writer, and when its evidence was taken.
            knowledge: the graph that the agent writes as well, if there is one.
            shared: declares what wakes the agent and observers identify.

        Raises:
            UnknownNameError: if the graph has no such agent.
            AgentTakenError: if a handle of the agent is open.
        """
        self.name = name
        self._write = write
        self._knowledge = knowledge
        self._shared = shared
        self._handle = None if knowledge is None else knowledge.as_agent(name)

    @property
    def graph(self) -> GraphT_co:
        """Return the handle by which the agent writes the knowledge graph.

        Raises:
            LookupError: if the spec says nothing of knowledge.
        """
        if self._handle is None:
            raise LookupError(f"the spec {NO_KNOWLEDGE}")
        return cast("GraphT_co", self._handle)

    def on_wake(self, callback: Callable[[Change], object]) -> Subscription:
        """Call back when what wakes the agent comes to hold in the knowledge graph; see `AgentHandle.on_wake`.

        The agent is taken until that is unsubscribed or its handle closed, also if nobody holds this object any more.
        Until then, what of it observers identify is declared, as `agent NAME`.

        Raises:
            LookupError: if the spec says nothing of knowledge.
        """
        handle = cast("AgentHandle", self.graph)
        subscription = handle.on_wake(callback)
        if self._shared is not None:
            self._shared.begin()
            subscription.and_then(self._shared.end)
        return subscription

    def close(self) -> None:
        """Write no more with this handle; where there is a knowledge graph, the agent can be taken again."""
        if self._handle is not None:
            self._handle.close()

    def set(self, name: VariableName_contra, value: object, *, evidence_s: float | None = None) -> None:
        """Write a variable of which this agent is a source; whether it is declared does not matter.

        Args:
            name: the variable.
            value: what the agent knows of it.
            evidence_s: when the evidence was taken; now, if None. A value with newer evidence stays.

        Raises:
            NotASourceError: if the variable does not name the agent as `source`.
            NotOfTypeError: if the value is not what the spec declares.
            ValueError: if the evidence lies in the future.
        """
        if self._handle is not None:
            self._handle.check_open()
        self._write(name, value, self.name, evidence_s)
