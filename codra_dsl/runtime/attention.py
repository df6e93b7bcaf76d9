"""When a variable whose `refresh` is `on_event` is worth another look."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable

from codra_dsl.logic import Value
from codra_dsl.runtime.cell import BEFORE_ALL_S, Reading


class Attention:
    """What skills under way monitor, and when one last ended to act. Whoever changes it holds the lock."""

    def __init__(self) -> None:
        self._monitored: Counter[str] = Counter()
        self._acted_s = BEFORE_ALL_S

    def begin(self, monitored: Iterable[str]) -> None:
        """Begin a skill that monitors some variables."""
        self._monitored.update(monitored)

    def finish(self, monitored: Iterable[str]) -> None:
        """End a skill that monitored some variables."""
        self._monitored.subtract(monitored)

    def acted(self, now_s: float) -> None:
        """Note that acting ends: the world may be another one."""
        self._acted_s = now_s

    def is_due(self, reading: Reading[Value]) -> bool:
        """Return whether to look: it is unknown, it is monitored, or its evidence is from before the end of acting."""
        return not reading.known or self._monitored[reading.name] > 0 or reading.start_s < self._acted_s
