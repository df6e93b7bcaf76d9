"""The order of the messages of a link: each message has a number, so that losses and repetitions are noticed."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

GAP_TIMEOUT_S = 0.5
"""How long a missing message may take before the link counts as lost."""

_MAX_EARLY_MESSAGES = 10_000


class Numbering:
    """Numbers the messages of one direction of a link, from 1."""

    def __init__(self) -> None:
        self._count = 0

    def next(self) -> int:
        """Return the number of the next message."""
        self._count += 1
        return self._count


class Ordering:
    """Returns the messages of one direction in the order of their numbers, each of them once."""

    def __init__(self) -> None:
        self._next_number = 1
        self._early_messages: dict[int, Any] = {}

    @property
    def has_gap(self) -> bool:
        """Return whether a message is missing before one that has arrived."""
        return bool(self._early_messages)

    def add(self, number: int, message: Any) -> Iterator[Any]:
        """Add a message that has arrived; yield the messages that come next in the order."""
        if number >= self._next_number and len(self._early_messages) < _MAX_EARLY_MESSAGES:
            self._early_messages[number] = message
        while self._next_number in self._early_messages:
            self._next_number += 1
            yield self._early_messages.pop(self._next_number - 1)
