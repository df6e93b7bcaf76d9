"""Keeps the readings of derived variables up to date.

A derived variable is derived again in the step in which an input changes, at the end of an age that its expression
compares, and when an input expires. Readings that are written together count as one change.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from graphlib import TopologicalSorter
from heapq import heappop, heappush

from codra_dsl.logic import Value, reads_ages
from codra_dsl.runtime.clock import Clock, Timer
from codra_dsl.runtime.values.cell import FOREVER_S, Cell, Reading
from codra_dsl.runtime.values.derived import DerivedCell


class Derivations:
    """Derives variables again when their inputs change. Callers hold the context manager's lock."""

    def __init__(self, cells: Mapping[str, Cell], clock: Clock, write: Callable[[Reading[Value]], None]) -> None:
        """Find the derived variables; `start` derives them for the first time.

        Args:
            cells: the cells of all variables.
            clock: real or simulated time.
            write: stores a reading and notifies its readers, also this object.
        """
        derived_cells = {name: cell for name, cell in cells.items() if isinstance(cell, DerivedCell)}
        inputs = {
            name: [other for other in cell.inputs if other in derived_cells] for name, cell in derived_cells.items()
        }
        self._cells = [derived_cells[name] for name in TopologicalSorter(inputs).static_order()]
        self._readers: dict[str, list[int]] = {}
        for position, cell in enumerate(self._cells):
            for name in cell.inputs:
                self._readers.setdefault(name, []).append(position)
        self._clock = clock
        self._write = write
        self._due_positions: list[int] = []
        self._timers: dict[int, Timer] = {}
        self._writer_count = 0

    def start(self) -> None:
        """Derive all variables."""
        self._derive_all(range(len(self._cells)))

    def note_change(self, name: str) -> None:
        """Derive the variables that read a changed variable, or note them while readings are written together."""
        readers = self._readers.get(name)
        if readers:
            self._derive_all(readers)

    @contextmanager
    def deferred(self) -> Iterator[None]:
        """Treat all readings that are written within the statement as one change."""
        self._writer_count += 1
        try:
            yield
        finally:
            self._writer_count -= 1
            self._derive_all(())

    def _derive_all(self, positions: Iterable[int]) -> None:
        """Derive variables, or note that they are due while readings are written together.

        They are derived in the order in which they read each other, so that each of them is derived once.
        """
        for position in positions:
            heappush(self._due_positions, position)
        if self._writer_count:
            return
        self._writer_count += 1
        try:
            while self._due_positions:
                position = heappop(self._due_positions)
                if position not in self._due_positions[:1]:  # a variable can be noted several times
                    self._derive(position)
        finally:
            self._writer_count -= 1

    def _derive(self, position: int) -> None:
        cell = self._cells[position]
        reading = cell.derive(self._clock.now_s())
        if _is_news(cell.observed, reading):
            self._write(reading)
        else:
            cell.replace_observed(replace(cell.observed, expires_s=reading.expires_s))
        if reads_ages(cell.term):
            self._schedule(position, cell.observed.expires_s)

    def _schedule(self, position: int, instant_s: float) -> None:
        """Derive a variable again when an age may have passed a limit."""
        timer = self._timers.get(position)
        if instant_s == FOREVER_S or (timer is not None and timer.instant_s <= instant_s):
            return
        if timer is not None:
            timer.cancel()
        self._timers[position] = self._clock.call_at(instant_s, lambda: self._derive_again(position))

    def _derive_again(self, position: int) -> None:
        del self._timers[position]
        self._derive_all((position,))


def _is_news(before: Reading[Value], reading: Reading[Value]) -> bool:
    """Return whether a reading has new content for the variable, apart from when it must be derived again."""
    return replace(reading, identified_s=before.identified_s, expires_s=before.expires_s) != before
