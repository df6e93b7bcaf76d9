"""Functions that return whether a condition over the context held. They use the histories of variables, not the ticks.

Evidence counts only if every precondition held, without a break, while the evidence was taken. This is checked with the
histories when the result of the job has arrived. So a precondition that failed and held again between two ticks voids
the evidence. A failure that becomes known only after its instant has the same effect.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from itertools import pairwise

from codra_dsl.logic import Term, Value, reads_ages
from codra_dsl.runtime.values.cell import BEFORE_ALL_S, Cell, Override, Reading
from codra_dsl.runtime.values.derived import ContextAt, DerivedCell, derived_cells_among, with_inputs


class ContextNow:
    """The context as it is now.

    Each tick creates one, so this is no frozen dataclass, which sets its fields by calls.
    """

    __slots__ = ("cells", "now_s")

    def __init__(self, cells: Mapping[str, Cell], now_s: float) -> None:
        self.cells = cells
        self.now_s = now_s

    def value(self, name: str) -> Value | None:
        """Return the present value of a variable, or None if it is unknown."""
        reading = self.cells[name].reading
        if self.now_s >= reading.expires_s:
            return self.cells[name].now(self.now_s).content
        return reading.content  # every condition reads values here

    def age_s(self, name: str) -> float | None:
        """Return the age of a variable's evidence, or None if the variable is unknown."""
        reading = self.cells[name].now(self.now_s)
        return reading.age_s(self.now_s) if reading.known else None


def has_held(term: Term, cells: Mapping[str, Cell], start_s: float, end_s: float) -> bool:
    """Return whether a condition held without a break from `start_s` to `end_s`, both included.

    If the histories no longer cover all of this time, the condition counts as broken, so the evidence does not count.
    """
    return complete_from_s(term, cells) <= start_s and first_loss_s(term, cells, start_s, end_s) is None


def _reads(term: Term, cells: Mapping[str, Cell]) -> tuple[frozenset[str], bool]:
    """Return the variables whose readings determine a condition, and whether the condition depends on an age.

    The inputs of derived variables take the place of these variables, because histories have only evidence. A derived
    variable that was overridden is returned as well.
    """
    names, has_ages = term.reads
    for name in names:
        if isinstance(cells[name], DerivedCell):
            break
    else:  # most conditions
        return names, has_ages
    derived_cells = derived_cells_among(names, cells)
    derived_names = {cell.reading.name for cell in derived_cells if not cell.was_overridden}
    has_ages = has_ages or any(reads_ages(cell.term) for cell in derived_cells)
    return with_inputs(names, cells) - derived_names, has_ages


def _flips_s(term: Term, context: ContextAt) -> float | None:
    """Return in how many seconds a comparison with an age next changes, also in derived variables; None if never."""
    terms = (term, *(cell.term for cell in derived_cells_among(term.variables(), context.cells)))
    waits_s = (part.flips_s(context) for part in terms)
    return min((wait_s for wait_s in waits_s if wait_s is not None), default=None)


def _covers_interval(cell: Cell, start_s: float, end_s: float) -> bool:
    """Return whether the present reading was the variable's reading at every instant from `start_s` to `end_s`.

    Return false for a stale reading: it keeps the instant of its evidence, but the variable was known until the reading
    expired.
    """
    reading = cell.reading
    is_valid = reading.reason is None and reading.evidence_s <= start_s <= end_s < reading.expires_s
    return is_valid and cell.overridden_until_s <= start_s


def first_loss_s(
    term: Term, cells: Mapping[str, Cell], start_s: float, end_s: float, has_held_before: bool = True
) -> float | None:
    """Return the first instant from `start_s` to `end_s` at which a condition stopped holding; None if there is none.

    `has_held_before` states whether the condition is assumed to hold just before `start_s`.
    """
    names, has_ages = _reads(term, cells)
    if not has_ages and all(_covers_interval(cells[name], start_s, end_s) for name in names):
        return start_s if has_held_before and not term.holds(ContextNow(cells, end_s)) else None
    for context in _contexts_of_changes(term, cells, start_s, end_s):
        is_held = term.holds(context)
        if has_held_before and not is_held:
            return context.instant_s
        has_held_before = is_held
    return None


def complete_from_s(term: Term, cells: Mapping[str, Cell]) -> float:
    """Return the instant since which the histories of all variables that a condition reads are complete."""
    return max((cells[name].complete_from_s for name in _reads(term, cells)[0]), default=BEFORE_ALL_S)


def _contexts_of_changes(term: Term, cells: Mapping[str, Cell], start_s: float, end_s: float) -> Iterator[ContextAt]:
    """Yield, in order, the context at each instant at which the value of a condition can change."""
    read_names, has_ages = _reads(term, cells)
    names = sorted(read_names)
    changes = [
        change
        for name in names
        for change in _value_changes(cells[name], start_s, end_s, includes_new_evidence=has_ages)
    ]
    readings: dict[float, list[Reading[Value]]] = {start_s: [], end_s: []}
    for instant_s, reading in changes:
        readings.setdefault(instant_s, []).extend(() if reading is None else (reading,))
    instants = sorted(readings)
    for instant_s, next_instant_s in pairwise([*instants, end_s]):
        yield from (ContextAt(cells, instant_s, substitute_reading=reading) for reading in readings[instant_s])
        yield ContextAt(cells, instant_s)
        if has_ages:
            yield from _contexts_of_age_changes(term, cells, instant_s, next_instant_s)


def _value_changes(
    cell: Cell, start_s: float, end_s: float, *, includes_new_evidence: bool
) -> Iterator[tuple[float, Reading[Value] | None]]:
    """Yield each instant after `start_s` at which a variable got another value, with the reading that has this value.

    For the instant at which the validity of a value ends, None is yielded instead of a reading. If
    `includes_new_evidence`, instants with new evidence for the same value are yielded as well, because new evidence
    changes the age of the variable.
    """
    previous_reading = cell.at(start_s)
    for instant_s, reading in cell.changes(start_s, end_s):
        if previous_reading.expires_s < instant_s:
            yield previous_reading.expires_s, None
        is_end_of_override = isinstance(previous_reading, Override)
        if includes_new_evidence or is_end_of_override or reading.content != previous_reading.at(instant_s).content:
            yield instant_s, reading
        previous_reading = reading
    if previous_reading.expires_s <= end_s:
        yield previous_reading.expires_s, None


def _contexts_of_age_changes(
    term: Term, cells: Mapping[str, Cell], start_s: float, end_s: float
) -> Iterator[ContextAt]:
    """Yield the context whenever, between two instants, the result of a comparison with an age changes."""
    instant_s = start_s
    while (wait_s := _flips_s(term, ContextAt(cells, instant_s))) is not None and instant_s + wait_s < end_s:
        instant_s += wait_s
        yield ContextAt(cells, instant_s)


class ObservabilityMonitor:
    """Tracks whether the condition under which a variable can be observed has failed since the evidence was taken.

    The instant of the failure follows from the histories, not from the instants at which the tree was ticked.
    """

    def __init__(self, term: Term) -> None:
        self._term = term
        self._plain_cells: list[Cell] | None = None  # the cells that the condition reads, if none of them is derived
        self._checked_evidence: tuple[float, str, int] | None = None
        self._checked_until_s = BEFORE_ALL_S
        self._has_held_at_check = False

    def loss_s(self, cells: Mapping[str, Cell], reading: Reading[Value], *, is_own: bool, now_s: float) -> float | None:
        """Return the instant since which the variable can no longer be observed; None if it can still be observed.

        Args:
            cells: the cells of all variables.
            reading: the present reading of the variable.
            is_own: whether the value was observed under the condition. Then the condition is assumed to have held. A
                value from another writer is lost only if the condition has held and then fails.
            now_s: the present instant.
        """
        read_cells, has_ages = self._reads(cells)
        evidence = (reading.evidence_s, reading.source, sum([cell.late_reading_count for cell in read_cells]))
        # late readings change the past, so their number is a part of this key: when it changes, the time since the
        # evidence is checked again, so that the result does not depend on the instants of the checks
        if self._checked_evidence != evidence:
            self._checked_evidence = evidence
            self._checked_until_s, self._has_held_at_check = reading.evidence_s, is_own
        start_s = max(self._checked_until_s, *[cell.complete_from_s for cell in read_cells])
        had_held, is_held = self._has_held_at_check, self._term.holds(ContextNow(cells, now_s))
        self._checked_until_s, self._has_held_at_check = now_s, is_held
        if not has_ages and all(_covers_interval(cell, start_s, now_s) for cell in read_cells):
            return start_s if had_held and not is_held else None
        return first_loss_s(self._term, cells, start_s, now_s, had_held)

    def _reads(self, cells: Mapping[str, Cell]) -> tuple[list[Cell], bool]:
        """Return the cells that determine the condition, and whether it depends on an age."""
        if self._plain_cells is not None:
            return self._plain_cells, self._term.reads[1]
        names, has_ages = _reads(self._term, cells)
        read_cells = [cells[name] for name in names]
        if not any(isinstance(cells[name], DerivedCell) for name in self._term.variables()):
            self._plain_cells = read_cells
        return read_cells, has_ages
