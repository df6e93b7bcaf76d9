"""How skills affect observers: when variables with `refresh: on_event` are due, and which variables may be changing."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from codra_dsl.logic import Value
from codra_dsl.runtime.values.cell import BEFORE_ALL_S, Reading


class EventTriggers:
    """The variables that running skills monitor, the variables that acting skills change, and the last end of acting.

    Callers that change this object hold the context manager's lock.
    """

    def __init__(self) -> None:
        self._monitor_counts: Counter[str] = Counter()
        self._changed_variables: dict[int, frozenset[str]] = {}
        self._last_acting_end_s = BEFORE_ALL_S

    def begin(self, variables: Iterable[str]) -> None:
        """Begin a skill that monitors some variables."""
        self._monitor_counts.update(variables)

    def finish(self, number: int, variables: Iterable[str]) -> None:
        """End a skill that monitored some variables. If the skill acts, its acting ends as well."""
        self._monitor_counts.subtract(variables)
        self._changed_variables.pop(number, None)

    def act(self, number: int, changes: Iterable[str]) -> None:
        """Note that a skill starts to act and changes some variables."""
        self._changed_variables[number] = frozenset(changes)

    def acted(self, number: int, now_s: float) -> None:
        """Note that acting ends: the world may have changed."""
        self._changed_variables.pop(number, None)
        self._last_acting_end_s = now_s

    def may_be_changing(self, variable: str) -> bool:
        """Return whether an acting skill changes a variable. Then its value is lost when it cannot be observed."""
        if not self._changed_variables:  # in most ticks, no skill acts
            return False
        return any(variable in changes for changes in self._changed_variables.values())

    @property
    def last_acting_end_s(self) -> float:
        """Return the last end of acting of any skill."""
        return self._last_acting_end_s

    def is_due(self, reading: Reading[Value]) -> bool:
        """Return whether the variable of a reading is due to be observed because of events.

        A variable that a skill monitors is always observed. A variable that an action is changing is observed after the
        action, because a value would soon be out of date. Any other variable is observed if it is unknown, or if its
        evidence is from before the last end of acting.
        """
        if self._monitor_counts[reading.name] > 0:
            return True
        if self.may_be_changing(reading.name):
            return False
        return not reading.known or reading.start_s < self._last_acting_end_s
