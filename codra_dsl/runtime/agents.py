"""Writers beside the observers and the main execution: devices, people and programs that report what they know."""

from __future__ import annotations

from collections.abc import Callable
from typing import Generic, TypeVar

VariableName = TypeVar("VariableName", bound=str)


class NotASourceError(PermissionError):
    """An agent wrote a variable that does not name it as `source`."""


class Agent(Generic[VariableName]):
    """The handle of one agent; what it writes carries its name.

    Attributes:
        name: of the agent.
    """

    __slots__ = ("_write", "name")

    def __init__(self, name: str, write: Callable[[str, object, str, float | None], None]) -> None:
        self.name = name
        self._write = write

    def set(self, name: VariableName, value: object, *, evidence_s: float | None = None) -> None:
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
        self._write(name, value, self.name, evidence_s)
