"""The calls that the main execution of the laboratory makes to its context, which any object can answer."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, Protocol


class ActingSkill(Protocol):
    """A running skill."""

    def acting(self) -> AbstractContextManager[None]:
        """Act until the `with` statement ends. While it runs, the variables that the skill changes may change."""
        ...


class Context(Protocol):
    """The calls of the main execution, to a context manager or to a replacement that lets the robot look by itself."""

    def skill(self, name: str) -> AbstractContextManager[ActingSkill]:
        """Begin a skill, which ends when the `with` statement ends."""
        ...

    def expect(self, *skills: str) -> None:
        """Announce the skills that come next."""
        ...

    def set(self, name: str, value: Any) -> None:
        """Set the value of a variable that the main execution knows by itself."""
        ...

    def decide(
        self, name: str, otherwise: Callable[[], Any], *, since_s: float = ..., wait_up_to_s: float = ...
    ) -> Any:
        """Return the value for a decision, from context or from `otherwise`."""
        ...

    def slot(self, *resources: str) -> AbstractContextManager[None]:
        """Hold a slot of each resource until the `with` statement ends. This request precedes those of observers."""
        ...
