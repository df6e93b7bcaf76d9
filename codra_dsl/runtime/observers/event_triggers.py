"""What the skills under way mean for observers: when to look on events, and what an action may be changing now."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from codra_dsl.logic import Value
from codra_dsl.runtime.values.cell import BEFORE_ALL_S, Reading


class EventTriggers:
    """What skills monitor and, while they act, change, and when one last ended to act. It is changed under the lock."""

    def __init__(self) -> None:
        self._monitored: Counter[str] = Counter()
        self._changing: dict[int, frozenset[str]] = {}
        self._acted_s = BEFORE_ALL_S

    def begin(self, monitored: Iterable[str]) -> None:
        """Begin a skill that monitors some variables."""
        self._monitored.update(monitored)

    def finish(self, number: int, monitored: Iterable[str]) -> None:
        """End a skill that monitored some variables, and its acting."""
        self._monitored.subtract(monitored)
        self._changing.pop(number, None)

    def act(self, number: int, changes: Iterable[str]) -> None:
        """Note that a skill acts, which changes some variables."""
        self._changing[number] = frozenset(changes)

    def acted(self, number: int, now_s: float) -> None:
        """Note that acting ends: the world may be another one."""
        self._changing.pop(number, None)
        self._acted_s = now_s

    def may_be_changing(self, variable: str) -> bool:
        """Return whether a skill acts that changes a variable: then what is not seen any more is not known any more."""
        return any(variable in changes for changes in self._changing.values())

    @property
    def acted_s(self) -> float:
        """Return when a skill last ended to act."""
        return self._acted_s

    def is_due(self, reading: Reading[Value]) -> bool:
        """Return whether to look on events.

        What a skill monitors is always looked at. Of what an action changes meanwhile any value would soon be out of
        date: it is looked at when it has acted. Else what is unknown is, and what is known from before acting ended.
        """
        if self._monitored[reading.name] > 0:
            return True
        if self.may_be_changing(reading.name):
            return False
        return not reading.known or reading.start_s < self._acted_s
