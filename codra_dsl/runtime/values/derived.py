"""Derived variables: their values, evidence and reasons follow from other variables, their inputs.

A derived variable has no observer and no writer. Its present reading is computed again whenever an input
changes. Its past follows from the histories of its inputs: evidence is taken at different instants, so the readings of
a derived variable in the order of their evidence would not show the past.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Any

from codra_dsl.logic import Choice, Conjunction, Disjunction, Operand, Scope, Term, Value, literal
from codra_dsl.runtime.values.cell import BEFORE_ALL_S, FOREVER_S, Cell, Override, Reading, Reason, known_reading
from codra_dsl.runtime.values.declarations import DERIVED
from codra_dsl.runtime.values.model import NotOfTypeError, ValueType

Evidence = tuple[float, float]
"""The instants at which the taking of evidence ended and began."""

_NO_EVIDENCE: Evidence = (math.inf, math.inf)


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Fallback(Term):
    """The value of `term` while it is known, otherwise the value of `otherwise`."""

    term: Term
    otherwise: Term

    def parts(self) -> tuple[Term, ...]:
        """Return both operands."""
        return (self.term, self.otherwise)

    def evaluate(self, scope: Scope) -> Value | None:
        """Return the first known value; None if both are unknown."""
        current_value = self.term.evaluate(scope)
        return self.otherwise.evaluate(scope) if current_value is None else current_value

    def __repr__(self) -> str:
        return f"first_known({self.term!r}, {self.otherwise!r})"


def first_known(term: Operand, otherwise: Operand) -> Term:
    """Return `term` while it is known, and `otherwise` while it is unknown."""
    operands = (operand if isinstance(operand, Term) else literal(operand) for operand in (term, otherwise))
    return Fallback(*operands)


class DerivedCell(Cell):
    """The cell of a derived variable.

    Attributes:
        term: the expression.
        inputs: the variables that the expression reads, in the order of the expression.
    """

    __slots__ = ("_cells", "_type", "inputs", "term")

    def __init__(self, name: str, history: int, term: Term, value_type: ValueType, cells: Mapping[str, Cell]) -> None:
        """Create a cell that is unknown until `derive` is called.

        Args:
            name: the variable.
            history: the largest number of readings that `history` returns.
            term: the expression.
            value_type: the type of the variable.
            cells: the cells of all variables; it may be filled later.
        """
        super().__init__(name, history)
        self.term = term
        self.inputs = tuple(dict.fromkeys(_names_in(term)))
        self._type = value_type
        self._cells = cells

    def write(self, reading: Reading[Value]) -> bool:
        """Add a reading, which is now the present one, even if its evidence is older than that of the last one."""
        self._append(reading)
        self.replace_observed(reading)
        return True

    def _append(self, reading: Reading[Value]) -> None:
        """Add a reading to the history, which has the order of the derivations: each holds until the next one."""
        self._readings.append(replace(reading, expires_s=FOREVER_S))
        del self._readings[: -self._max_readings]

    def now(self, now_s: float) -> Reading[Value]:
        """Return the reading at the present instant, even if its inputs have just expired."""
        return self.reading if now_s < self.reading.expires_s else self.derive(now_s)

    def observed_at(self, instant_s: float) -> Reading[Value]:
        """Return the reading without overrides at an instant, as far as the inputs are known today."""
        return self.derive_in(ContextAt(self._cells, instant_s))

    def between(self, start_s: float, end_s: float) -> tuple[Reading[Value], ...]:  # noqa: ARG002
        """Return no readings: the past follows from the inputs."""
        return ()

    @property
    def complete_from_s(self) -> float:
        """Return the instant since which all overrides are known; the histories of the inputs state the rest."""
        return self._overrides_complete_from_s

    def derive(self, now_s: float) -> Reading[Value]:
        """Return the reading that follows from the present readings of the inputs."""
        return self.derive_now(_PresentContext(self._cells, now_s))

    def derive_now(self, context: ContextAt) -> Reading[Value]:
        """Return the reading that follows from the present context. It keeps the instant since which it is unknown."""
        reading, before = self.derive_in(context), self.observed
        if reading.reason is not None and before.reason is not None and before.evidence_s > BEFORE_ALL_S:
            return replace(reading, evidence_s=before.evidence_s, start_s=before.start_s)
        return reading

    def derive_in(self, context: ContextAt) -> Reading[Value]:
        """Return the reading that follows from the context at an instant.

        The evidence is that of the oldest input that decides the value. The reading expires when it must be derived
        again although no input has new evidence.
        """
        now_s, raw_value = context.instant_s, self.term.evaluate(context)
        try:
            content = None if raw_value is None else self._type.convert(raw_value)
        except NotOfTypeError as error:
            return self._unknown_reading(Reason.FAILED, str(error), context)
        if content is None:
            unknown_readings = [context.reading(name) for name in unknown_inputs(self.term, context)]
            reason = next((reading.reason for reading in unknown_readings), None) or Reason.REJECTED
            detail = ", ".join(f"{reading.name} is unknown ({reading.reason})" for reading in unknown_readings)
            return self._unknown_reading(reason, detail or "the expression has no value", context)
        evidence_s, start_s = _oldest([_deciding_evidence(self.term, context), (now_s, now_s)])
        expires_s = self._next_change_s(context)
        return known_reading(
            self.reading.name, content, evidence_s, min(start_s, evidence_s), now_s, expires_s, DERIVED
        )

    def _unknown_reading(self, reason: Reason, detail: str, context: ContextAt) -> Reading[Value]:
        return Reading(
            name=self.reading.name,
            reason=reason,
            detail=detail,
            evidence_s=context.instant_s,
            start_s=context.instant_s,
            identified_s=context.instant_s,
            expires_s=self._next_change_s(context),
            source=DERIVED,
        )

    def _next_change_s(self, context: ContextAt) -> float:
        """Return when the reading can next change although no input has new evidence; infinite if never."""
        expiries_s = [context.reading(name).expires_s for name in self.inputs]
        wait_s = self.term.flips_s(context)
        return min([*expiries_s, math.inf if wait_s is None else context.instant_s + wait_s])


class ContextAt:
    """The context as it was at an instant, as far as known today. Each variable is derived only once.

    Attributes:
        cells: the cells of all variables.
    """

    __slots__ = ("_readings", "cells", "instant_s")

    def __init__(
        self, cells: Mapping[str, Cell], instant_s: float, substitute_reading: Reading[Value] | None = None
    ) -> None:
        """Read the context at an instant.

        Args:
            cells: the cells of all variables.
            instant_s: the instant.
            substitute_reading: one of several readings that a variable received at the instant, to be used instead of
                the last one; None to use the last readings.
        """
        self.cells = cells
        self.instant_s = instant_s
        self._readings = {} if substitute_reading is None else {substitute_reading.name: substitute_reading}

    def value(self, name: str) -> Value | None:
        """Return the value of a variable at the instant, or None if it was unknown."""
        return self.reading(name).content

    def age_s(self, name: str) -> float | None:
        """Return the age of a variable's evidence at the instant, or None if the variable was unknown."""
        reading = self.reading(name)
        return reading.age_s(self.instant_s) if reading.known else None

    def reading(self, name: str) -> Reading[Value]:
        """Return the reading of a variable at the instant.

        Inputs are read before the variables that are derived from them, so a long chain needs no deep recursion.
        """
        readings = self._readings
        pending_names = [] if name in readings else [name]
        while pending_names:
            cell = self.cells[pending_names[-1]]
            if not isinstance(cell, DerivedCell) or self._is_stored(cell):
                readings[pending_names.pop()] = self._read(cell)
            elif missing_names := [other for other in cell.inputs if other not in readings]:
                pending_names.extend(missing_names)
            else:
                readings[pending_names.pop()] = self._derive(cell)
        return readings[name]

    def _is_stored(self, cell: DerivedCell) -> bool:
        return cell.override_at(self.instant_s) is not None

    def _read(self, cell: Cell) -> Reading[Value]:
        return cell.at(self.instant_s)

    def _derive(self, cell: DerivedCell) -> Reading[Value]:
        return cell.derive_in(self)


class _PresentContext(ContextAt):
    """The context as it is now, also for variables whose inputs have just expired."""

    __slots__ = ()

    def _is_stored(self, cell: DerivedCell) -> bool:
        return self.instant_s < cell.reading.expires_s

    def _read(self, cell: Cell) -> Reading[Value]:
        return cell.now(self.instant_s)

    def _derive(self, cell: DerivedCell) -> Reading[Value]:
        return cell.derive_now(self)


class _ContextSince(_PresentContext):
    """The context as it is now. Variables are unknown if the taking of their evidence began before their instants.

    Overrides are not evidence, so they do not hide derived variables that follow from limited variables.
    """

    __slots__ = ("_since_s",)

    def __init__(self, cells: Mapping[str, Cell], instant_s: float, since_s: Mapping[str, float]) -> None:
        super().__init__(cells, instant_s)
        self._since_s = since_s

    def _is_stored(self, cell: DerivedCell) -> bool:
        return isinstance(cell.now(self.instant_s), Override) and not self.limits(cell.reading.name)

    def limits(self, name: str) -> bool:
        """Return whether an instant limits the evidence of a variable, or of one of its inputs."""
        return not with_inputs((name,), self.cells).isdisjoint(self._since_s)

    def _read(self, cell: Cell) -> Reading[Value]:
        return self._limited(cell.now(self.instant_s))

    def _derive(self, cell: DerivedCell) -> Reading[Value]:
        return self._limited(cell.derive_in(self))

    def _limited(self, reading: Reading[Value]) -> Reading[Value]:
        if reading.start_s >= self._since_s.get(reading.name, BEFORE_ALL_S):
            return reading
        return Reading(name=reading.name, reason=Reason.STALE, evidence_s=reading.evidence_s)


def has_evidence_since(
    cells: Mapping[str, Cell], name: str, since_s: Mapping[str, float], instant_s: float, content: Value | None
) -> bool:
    """Return whether a variable has a value now even without the evidence from before some instants.

    Args:
        cells: the cells of all variables.
        name: the variable.
        since_s: for some variables, the instant at or after which the taking of evidence must have begun. For a derived
            variable, the instants of its inputs count as well.
        instant_s: the present instant.
        content: the value.
    """
    context = _ContextSince(cells, instant_s, since_s)
    return not context.limits(name) or context.value(name) == content


def derived_cells_among(names: Iterable[str], cells: Mapping[str, Cell]) -> list[DerivedCell]:
    """Return the cells of the derived variables among some variables and their inputs, without repetitions."""
    found_cells: dict[str, DerivedCell] = {}
    pending_names = list(names)
    while pending_names:
        name = pending_names.pop()
        cell = cells.get(name)
        if isinstance(cell, DerivedCell) and name not in found_cells:
            found_cells[name] = cell
            pending_names.extend(cell.inputs)
    return list(found_cells.values())


def with_inputs(names: Iterable[str], cells: Mapping[str, Cell]) -> frozenset[str]:
    """Return some variables, with all inputs of those that are derived."""
    all_names = frozenset(names)
    return all_names.union(*(cell.inputs for cell in derived_cells_among(all_names, cells)))


def _names_in(term: Term) -> Iterator[str]:
    """Yield the names that a term reads, in the order of the term."""
    for part in term.walk():
        if not part.parts():
            yield from part.variables()


def unknown_inputs(term: Term, scope: Scope) -> tuple[str, ...]:
    """Return the inputs that make a term unknown, in the order of the term."""
    if term.evaluate(scope) is not None:
        return ()
    parts = term.parts()
    if not parts:
        return tuple(term.variables())
    if isinstance(term, Choice) and (truth := term.condition.evaluate(scope)) is not None:
        parts = (term.then if truth else term.otherwise,)
    return tuple(dict.fromkeys(name for part in parts for name in unknown_inputs(part, scope)))


def _deciding_evidence(term: Term, context: ContextAt) -> Evidence:
    """Return the oldest evidence among the inputs that decide the value of a term; infinite if no input decides it.

    If each of several operands alone decides the value, the operand with the newest evidence decides it.
    """
    parts = term.parts()
    match term:
        case Conjunction(terms=terms) | Disjunction(terms=terms):
            decisive = isinstance(term, Disjunction)
            decisive_terms = [operand for operand in terms if operand.evaluate(context) is decisive]
            if decisive_terms:
                return max(_deciding_evidence(operand, context) for operand in decisive_terms)
        case Choice(then=then, condition=condition, otherwise=otherwise):
            truth = condition.evaluate(context)
            parts = (then, otherwise) if truth is None else (condition, then if truth else otherwise)
        case Fallback(term=value) if value.evaluate(context) is not None:
            parts = (value,)
    if parts:
        return _oldest(_deciding_evidence(part, context) for part in parts)
    return _oldest(_evidence(context.reading(name)) for name in term.variables())


def _oldest(evidence: Iterable[Evidence]) -> Evidence:
    ends_s, starts_s = zip(*evidence, _NO_EVIDENCE, strict=True)
    return min(ends_s), min(starts_s)


def _evidence(reading: Reading[Any]) -> Evidence:
    """Return the evidence of an input; for an unknown input, the instant since which it is unknown.

    This instant is infinite if the input was unknown from the beginning of the run. The evidence of an override by the
    operator began before all instants, because an override is not evidence.
    """
    if reading.known:
        return reading.evidence_s, reading.start_s
    since_s = reading.evidence_s if reading.source == DERIVED else reading.identified_s
    since_s = since_s if since_s > BEFORE_ALL_S else math.inf
    return since_s, BEFORE_ALL_S if reading.reason is Reason.OVERRIDDEN else since_s
