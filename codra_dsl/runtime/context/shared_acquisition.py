"""Acquire a shared resource while it has at least one user. Users can be in different threads."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Protocol

from codra_dsl.runtime.forks import new_lock

Callback = Callable[[], None]


class SharedAcquisition:
    """Calls `take` at the first `begin` and `give_back` at the last `end`.

    The calls are counted, so that an `end` before its `begin` leaves nothing acquired.
    """

    def __init__(self, take: Callback, give_back: Callback) -> None:
        self._take = take
        self._give_back = give_back
        self._lock = new_lock()
        self._user_count = 0

    def begin(self) -> None:
        """Add a user."""
        with self._lock:
            self._user_count += 1
            if self._user_count == 1:
                self._take()

    def end(self) -> None:
        """Remove a user."""
        with self._lock:
            self._user_count -= 1
            if self._user_count == 0:
                self._give_back()


class DeclaringCommands(Protocol):
    """The commands that declare variables for observation."""

    def declare(self, name: str, caller: str) -> None:
        """Add a variable to C_E(t)."""
        ...

    def leave(self, caller: str) -> None:
        """Withdraw all declarations of a caller."""
        ...


def shared_declaration(commands: DeclaringCommands, caller: str, names: Sequence[str]) -> SharedAcquisition:
    """Return the shared acquisition that declares variables for a caller while there are users (P1, Equation 4)."""

    def take() -> None:
        for name in names:
            commands.declare(name, caller)

    def give_back() -> None:
        if names:
            commands.leave(caller)

    return SharedAcquisition(take, give_back)
