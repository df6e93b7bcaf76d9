"""Measure the time of each stage of a command, with a clock that is passed as an argument."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager


class Timings:
    """The time that each stage takes; nothing is measured without a clock."""

    def __init__(self, clock_s: Callable[[], float] | None = None) -> None:
        """Start to measure; `clock_s` returns the time in seconds."""
        self._clock_s = clock_s
        self._start_s = 0.0 if clock_s is None else clock_s()
        self._stages_s: dict[str, float] = {}

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        """Measure a stage; times of stages with the same name are added up."""
        if self._clock_s is None:
            yield
            return
        start_s = self._clock_s()
        try:
            yield
        finally:
            self._stages_s[name] = self._stages_s.get(name, 0.0) + self._clock_s() - start_s

    def table(self) -> str:
        """Return a table: the stages in the order of their first measurement, the rest, and the total until now."""
        if self._clock_s is None:
            return ""
        total_s = self._clock_s() - self._start_s
        rest_s = total_s - sum(self._stages_s.values())
        rows = [*self._stages_s.items(), ("rest", rest_s), ("total", total_s)]
        percent_per_s = 100 / total_s if total_s > 0 else 0.0
        return "\n".join(f"{name:8} {stage_s:8.3f} s {stage_s * percent_per_s:5.1f} %" for name, stage_s in rows)


UNTIMED = Timings()
"""Timings that measure nothing."""
