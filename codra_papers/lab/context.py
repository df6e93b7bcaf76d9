"""What the main execution of the laboratory asks of context, whoever answers."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from typing import Any, Protocol


class ActingSkill(Protocol):
    """A skill under way."""

    def acting(self) -> AbstractContextManager[None]:
        """Act: what the skill changes may change from here on."""
        ...


class Context(Protocol):
    """What the main execution tells and asks: a context manager, or whoever lets the robot look for itself."""

    def skill(self, name: str) -> AbstractContextManager[ActingSkill]:
        """Begin a skill, and end it at the end of the `with` statement."""
        ...

    def expect(self, *skills: str) -> None:
        """Say which skills come next."""
        ...

    def set(self, name: str, value: Any) -> None:
        """Tell what the main execution knows itself."""
        ...

    def decide(
        self, name: str, otherwise: Callable[[], Any], *, since_s: float = ..., wait_up_to_s: float = ...
    ) -> Any:
        """Answer a decision, from context or by `otherwise`."""
        ...

    def slot(self, *resources: str) -> AbstractContextManager[None]:
        """Hold a slot of each resource, before observers, to the end of the `with` statement."""
        ...
