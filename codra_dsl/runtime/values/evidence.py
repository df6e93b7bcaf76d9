"""Whether a condition over the context held, judged from the histories of the variables, not from what ticks saw.

Evidence counts only if every precondition held, without a break, while it was taken. A precondition that fails and
holds again between two ticks still voids it, and so does one of which it becomes known only later that it had failed.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from itertools import pairwise

from codra_dsl.logic import Term, Value, reads_ages
from codra_dsl.runtime.values.cell import BEFORE_ALL_S, Cell, Reading


@dataclass(frozen=True, slots=True)
class ContextNow:
    """The context as it is now."""

    cells: Mapping[str, Cell]
    now_s: float

    def value(self, name: str) -> Value | None:
        """Return the present value of a variable, or None."""
        return self.cells[name].reading.at(self.now_s).content

    def age_s(self, name: str) -> float | None:
        """Return the age of a variable's evidence, or None."""
        reading = self.cells[name].reading.at(self.now_s)
        return reading.age_s(self.now_s) if reading.known else None


@dataclass(frozen=True, slots=True)
class ContextAt:
    """The context as it was at an instant, by all that is known today.

    Attributes:
        instead: a reading that stood at that instant for a moment, to be taken in place of the last one.
    """

    cells: Mapping[str, Cell]
    instant_s: float
    instead: Reading[Value] | None = None

    def _reading(self, name: str) -> Reading[Value]:
        if self.instead is not None and self.instead.name == name:
            return self.instead
        return self.cells[name].at(self.instant_s)

    def value(self, name: str) -> Value | None:
        """Return the value that a variable had, or None."""
        return self._reading(name).content

    def age_s(self, name: str) -> float | None:
        """Return the age that a variable's evidence had, or None."""
        reading = self._reading(name)
        return reading.age_s(self.instant_s) if reading.known else None


def held(term: Term, cells: Mapping[str, Cell], start_s: float, end_s: float) -> bool:
    """Return whether a condition held without a break from `start_s` to `end_s`, both included.

    What the histories no longer tell counts as a break.
    """
    return told_from_s(term, cells) <= start_s and first_loss(term, cells, start_s, end_s) is None


def _lasts(reading: Reading[Value], start_s: float, end_s: float) -> bool:
    """Return whether a present reading was the one at every instant from `start_s` to `end_s`.

    One that is stale was not: it keeps the instant of its evidence, and was known until it expired.
    """
    return reading.reason is None and reading.evidence_s <= start_s <= end_s < reading.expires_s


def first_loss(
    term: Term, cells: Mapping[str, Cell], start_s: float, end_s: float, held_before: bool = True
) -> float | None:
    """Return the first instant from `start_s` to `end_s` at which a condition no longer held, having held before.

    `held_before` says whether it is taken to have held just before `start_s`.
    """
    names, is_aging = term.reads
    if not is_aging and all(_lasts(cells[name].reading, start_s, end_s) for name in names):
        return start_s if held_before and not term.holds(ContextNow(cells, end_s)) else None
    for past in _moments(term, cells, start_s, end_s):
        holds = term.holds(past)
        if held_before and not holds:
            return past.instant_s
        held_before = holds
    return None


def told_from_s(term: Term, cells: Mapping[str, Cell]) -> float:
    """Return the instant from which on the histories tell all that a condition reads."""
    return max((cells[name].told_from_s for name in term.variables()), default=BEFORE_ALL_S)


def _moments(term: Term, cells: Mapping[str, Cell], start_s: float, end_s: float) -> Iterator[ContextAt]:
    """Yield the moments, in order, between which the value of a condition cannot change."""
    aging = reads_ages(term)
    names = sorted(term.variables())
    turns = [turn for name in names for turn in _turns(cells[name], start_s, end_s, every=aging)]
    readings: dict[float, list[Reading[Value]]] = {start_s: [], end_s: []}
    for instant_s, reading in turns:
        readings.setdefault(instant_s, []).extend(() if reading is None else (reading,))
    instants = sorted(readings)
    for instant_s, next_s in pairwise([*instants, end_s]):
        yield from (ContextAt(cells, instant_s, instead=reading) for reading in readings[instant_s])
        yield ContextAt(cells, instant_s)
        if aging:
            yield from _flips(term, cells, instant_s, next_s)


def _turns(cell: Cell, start_s: float, end_s: float, *, every: bool) -> Iterator[tuple[float, Reading[Value] | None]]:
    """Yield when a variable got another value after `start_s`, with the reading, or None where its validity ended.

    With `every`, evidence for the value that it had already is yielded too: it makes the variable younger.
    """
    before = cell.at(start_s)
    for reading in cell.between(start_s, end_s):
        if before.expires_s < reading.evidence_s:
            yield before.expires_s, None
        if every or reading.content != before.at(reading.evidence_s).content:
            yield reading.evidence_s, reading
        before = reading
    if before.expires_s <= end_s:
        yield before.expires_s, None


def _flips(term: Term, cells: Mapping[str, Cell], start_s: float, end_s: float) -> Iterator[ContextAt]:
    """Yield the moments between two instants at which a comparison with an age changes."""
    at_s = start_s
    while (wait_s := term.flips_s(ContextAt(cells, at_s))) is not None and at_s + wait_s < end_s:
        at_s += wait_s
        yield ContextAt(cells, at_s)


class Watch:
    """Follows whether a condition under which a variable can be observed has been lost since its evidence was taken."""

    def __init__(self, term: Term) -> None:
        self._term = term
        self._names = sorted(term.variables())
        self._evidence: tuple[float, str, int] | None = None
        self._seen_s = BEFORE_ALL_S
        self._held = False

    def loss_s(self, cells: Mapping[str, Cell], reading: Reading[Value], *, is_own: bool, now_s: float) -> float | None:
        """Return since when the present value of the variable is out of sight, or None.

        Args:
            cells: all variables.
            reading: the present reading of the variable.
            is_own: whether it was observed under the condition: then the condition is taken to have held. What somebody
                else wrote without it is lost only once the condition has held and fails.
            now_s: the present instant.
        """
        evidence = (reading.evidence_s, reading.source, sum(cells[name].late for name in self._names))
        if (
            self._evidence != evidence
        ):  # also when the past has changed: what is lost does not depend on who looked when
            self._evidence = evidence
            self._seen_s, self._held = reading.evidence_s, is_own
        start_s = max(self._seen_s, told_from_s(self._term, cells))
        loss_s = first_loss(self._term, cells, start_s, now_s, self._held)
        self._seen_s, self._held = now_s, self._term.holds(ContextNow(cells, now_s))
        return loss_s
