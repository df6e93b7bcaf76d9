"""What is taken for as long as somebody follows something, from whatever threads that begins and ends."""

from __future__ import annotations

import threading
from collections.abc import Callable, Sequence
from typing import Protocol

Act = Callable[[], None]


class SharedAcquisition:
    """Takes something at the first beginning and gives it back at the last end.

    Beginnings and ends are counted, so that an end that overtakes its beginning leaves nothing taken.
    """

    def __init__(self, take: Act, give_back: Act) -> None:
        self._take = take
        self._give_back = give_back
        self._lock = threading.RLock()
        self._count = 0

    def begin(self) -> None:
        """Begin once more."""
        with self._lock:
            self._count += 1
            if self._count == 1:
                self._take()

    def end(self) -> None:
        """End what has begun once."""
        with self._lock:
            self._count -= 1
            if self._count == 0:
                self._give_back()


class Declaring(Protocol):
    """Where is declared what observers are to look at."""

    def declare(self, name: str, party: str) -> None:
        """Take a variable into C_E(t)."""
        ...

    def leave(self, party: str) -> None:
        """Withdraw all that a party declares."""
        ...


def declaring(commands: Declaring, party: str, names: Sequence[str]) -> SharedAcquisition:
    """Return what declares some variables for a party while it follows them (P1, Equation 4)."""

    def take() -> None:
        for name in names:
            commands.declare(name, party)

    def give_back() -> None:
        if names:
            commands.leave(party)

    return SharedAcquisition(take, give_back)
