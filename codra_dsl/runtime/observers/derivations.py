"""Keeps the readings of derived variables up to date.

A derived variable is derived again in the step in which an input changes, at the end of an age that its expression
compares, and when an input expires. Readings that are written together count as one change.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from graphlib import TopologicalSorter

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
        self._readers: dict[str, list[str]] = {}
        for cell in self._cells:
            for name in cell.inputs:
                self._readers.setdefault(name, []).append(cell.reading.name)
        self._clock = clock
        self._write = write
        self._due_names: set[str] = set()
        self._timers: dict[str, Timer] = {}
        self._writer_count = 0

    def start(self) -> None:
        """Derive all variables."""
        self._due_names.update(cell.reading.name for cell in self._cells)
        self._derive_due_variables()

    def note_change(self, name: str) -> None:
        """Derive the variables that read a changed variable, or note them while readings are written together."""
        readers = self._readers.get(name)
        if readers:
            self._due_names.update(readers)
            if not self._writer_count:
                self._derive_due_variables()

    @contextmanager
    def together(self) -> Iterator[None]:
        """Treat all readings that are written within the statement as one change."""
        self._writer_count += 1
        try:
            yield
        finally:
            self._writer_count -= 1
            if not self._writer_count:
                self._derive_due_variables()

    def _derive_due_variables(self) -> None:
        """Derive in the order in which derived variables read each other, so that each of them is derived once."""
        self._writer_count += 1
        try:
            for cell in self._cells if self._due_names else ():
                if cell.reading.name in self._due_names:
                    self._due_names.discard(cell.reading.name)
                    self._derive(cell)
        finally:
            self._writer_count -= 1

    def _derive(self, cell: DerivedCell) -> None:
        reading = cell.derive(self._clock.now_s())
        if _is_news(cell.observed, reading):
            self._write(reading)
        else:
            cell.replace_observed(replace(cell.observed, expires_s=reading.expires_s))
        if reads_ages(cell.term):
            self._schedule(cell.observed)

    def _schedule(self, reading: Reading[Value]) -> None:
        """Derive a variable again when an age may have passed a limit."""
        timer = self._timers.get(reading.name)
        if reading.expires_s == FOREVER_S or (timer is not None and timer.instant_s <= reading.expires_s):
            return
        if timer is not None:
            timer.cancel()
        self._timers[reading.name] = self._clock.call_at(reading.expires_s, lambda: self._derive_again(reading.name))

    def _derive_again(self, name: str) -> None:
        del self._timers[name]
        self._due_names.add(name)
        self._derive_due_variables()


def _is_news(before: Reading[Value], reading: Reading[Value]) -> bool:
    """Return whether a reading says something new about the variable, apart from when it must be derived again."""
    return (before.content, before.reason, before.detail, before.evidence_s, before.start_s) != (
        reading.content,
        reading.reason,
        reading.detail,
        reading.evidence_s,
        reading.start_s,
    )
