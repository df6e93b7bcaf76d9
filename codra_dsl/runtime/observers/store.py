"""The central data structure of P1, section 3.3: it holds all context-variables, and makes all changes to them."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import replace

from codra_dsl.logic import Value
from codra_dsl.runtime.clock import Clock, Timer
from codra_dsl.runtime.journal import EventWriter, Kind
from codra_dsl.runtime.observers.derivations import Derivations
from codra_dsl.runtime.values.cell import FOREVER_S, Cell, Override, Reading, Reason
from codra_dsl.runtime.values.declarations import DERIVED, MAIN, OPERATOR
from codra_dsl.runtime.values.derived import DerivedCell, has_evidence_since
from codra_dsl.runtime.values.model import VariableModel


class Store:
    """Holds the cells, expires them in time, and notifies their readers. Writers hold the lock.

    Attributes:
        mirror: called with each reading before it is stored, for variables that are attributes in the knowledge graph.
        mirror_override: called, for these variables, with each change of an override or of the reading beneath it, and
            with None at its end.
        derivations: keeps the derived variables up to date.
    """

    def __init__(
        self,
        variables: Sequence[VariableModel],
        clock: Clock,
        event_writer: EventWriter,
        on_change: Callable[[str, bool], None],
    ) -> None:
        """Create the cells of all variables, which are unknown at first.

        Args:
            variables: C_M.
            clock: real or simulated time.
            event_writer: records every change.
            on_change: called when the present reading or the history of a variable has changed. The arguments are the
                name of the variable, and whether the variable only has newer evidence for the same value.
        """
        self.variables: Mapping[str, VariableModel] = {variable.name: variable for variable in variables}
        self.cells: dict[str, Cell] = {}
        self.cells |= {name: _create_cell(model, self.cells) for name, model in self.variables.items()}
        self.derivations = Derivations(self.cells, clock, self.write)
        self._clock = clock
        self._event_writer = event_writer
        self._on_change = on_change
        self._expiring_names: set[str] = set()
        self.mirror: Callable[[Reading[Value]], None] | None = None
        self.mirror_override: Callable[[str, Override | None], None] | None = None
        self._override_timers: dict[str, Timer] = {}

    def reading(self, name: str) -> Reading[Value]:
        """Return the reading of a variable now. Any thread may call this, without the lock."""
        return self.cells[name].now(self._clock.now_s())

    def has_evidence_since(self, reading: Reading[Value], since_s: Mapping[str, float]) -> bool:
        """Return whether the value of a present reading follows from evidence since some instants, by variable.

        For a derived variable, the instants of its inputs count as well. Any thread may call this, without the lock.
        """
        return has_evidence_since(self.cells, reading.name, since_s, self._clock.now_s(), reading.content)

    def write_all(self, readings: Iterable[Reading[Value]]) -> None:
        """Store readings that are identified together."""
        with self.derivations.deferred():
            for reading in readings:
                self.write(reading)

    def history(self, name: str) -> tuple[Reading[Value], ...]:
        """Return the readings of a variable; while it lasts, an override is the last one.

        They are ordered by their evidence; those of a derived variable are ordered by their derivation.
        """
        reading, readings = self.reading(name), self.cells[name].history()
        if not isinstance(reading, Override):
            return readings
        return (*(earlier for earlier in readings if earlier.holds_from_s < reading.evidence_s), reading)

    def write(self, reading: Reading[Value]) -> None:
        """Store a reading that is identified now.

        If the present reading has newer evidence, the stored reading becomes a part of the history only. Otherwise it
        becomes the present reading.
        """
        name = reading.name
        if reading.expires_s == FOREVER_S and reading.reason is None:
            expires_s = reading.evidence_s + self.variables[name].valid_for_s
            reading = reading if expires_s == FOREVER_S else replace(reading, expires_s=expires_s)
        if self.mirror is not None and self.variables[name].pose_condition is None:
            # a derived variable is not stale when its reading expires: it is derived again, and may stay the same
            self.mirror(replace(reading, expires_s=FOREVER_S) if reading.source == DERIVED else reading)
        cell = self.cells[name]
        before = cell.reading
        is_present = cell.write(reading)
        if isinstance(before, Override):
            before = before.beneath
            self._mirror_override(name)
        self._event_writer.write_reading(reading.identified_s, reading, is_present)
        if is_present and reading.expires_s != FOREVER_S and name not in self._expiring_names:
            self._watch_expiry(reading)
        self._on_change(name, is_present and before.content == reading.content and _is_same_state(before, reading))
        self.derivations.note_change(name)

    def make_unknown(self, name: str, reason: Reason, detail: str, source: str) -> None:
        """Make a variable unknown from now on."""
        now_s = self._clock.now_s()
        self.write(
            Reading(name=name, reason=reason, detail=detail, evidence_s=now_s, identified_s=now_s, source=source)
        )

    def invalidate(self, name: str, skill: str, source: str) -> None:
        """Make a variable unknown because a skill changes it; evidence that is being taken now will not count."""
        self.cells[name].invalidated_s = self._clock.now_s()
        self.make_unknown(name, Reason.INVALIDATED, skill, source)

    def forget(self, names: Iterable[str], observer: str) -> None:
        """Make variables of a stopping observer unknown, if they are known now and are declared with `forget`."""
        with self.derivations.deferred():
            for name in names:
                if self.variables[name].when_unobservable == "forget" and self._observed(name).known:
                    self.make_unknown(name, Reason.WITHDRAWN, observer, MAIN)

    # Overrides

    def begin_override(self, name: str, content: Value | None, detail: str, until_s: float) -> None:
        """Let the operator give a variable a value, or make it unknown if `content` is None, until an instant.

        The sources continue to write readings during the override.
        """
        now_s, cell = self._clock.now_s(), self.cells[name]
        reason = Reason.OVERRIDDEN if content is None else None
        override = Override(
            name=name,
            content=content,
            reason=reason,
            detail=detail,
            evidence_s=now_s,
            identified_s=now_s,
            expires_s=until_s,
            source=OPERATOR,
            beneath=cell.observed,
        )
        self._cancel_override_timer(name)
        cell.begin_override(override)
        self._mirror_override(name)
        override_details = {"value": content, "reason": reason, "detail": detail, "until_s": until_s}
        self._event_writer.write(Kind.OVERRIDE, name, "begun", **override_details)
        self._override_timers[name] = self._clock.call_at(until_s, lambda: self.end_override(name, "expired"))
        self._on_change(name, False)
        self.derivations.note_change(name)

    def end_override(self, name: str, what: str) -> None:
        """End the override of a variable, if there is one; the variable has the reading of its sources again.

        Args:
            name: the variable.
            what: `expired`, or `cleared` if the operator ends the override.
        """
        now_s, cell = self._clock.now_s(), self.cells[name]
        self._cancel_override_timer(name)
        if not cell.end_override(now_s):
            return
        self._mirror_override(name)
        reading = self.reading(name)
        reading_details = {"value": reading.content, "reason": reading.reason, "source": reading.source}
        self._event_writer.write(Kind.OVERRIDE, name, what, **reading_details)
        self._on_change(name, False)
        self.derivations.note_change(name)

    def _mirror_override(self, name: str) -> None:
        """Pass the override of a variable, or None, on to the knowledge graph."""
        if self.mirror_override is not None and self.variables[name].pose_condition is None:
            reading = self.cells[name].reading
            self.mirror_override(name, reading if isinstance(reading, Override) else None)

    def _cancel_override_timer(self, name: str) -> None:
        timer = self._override_timers.pop(name, None)
        if timer is not None:
            timer.cancel()

    # Internal

    def _observed(self, name: str) -> Reading[Value]:
        """Return the reading of the sources now."""
        return self.cells[name].observed.at(self._clock.now_s())

    def _watch_expiry(self, reading: Reading[Value]) -> None:
        is_derived = reading.source == DERIVED  # it is derived again when an input expires
        if reading.expires_s != FOREVER_S and reading.name not in self._expiring_names and not is_derived:
            self._expiring_names.add(reading.name)
            self._clock.call_at(reading.expires_s, lambda: self._expire(reading.name))

    def _expire(self, name: str) -> None:
        """Make a variable unknown at the end of its validity, unless newer evidence has extended the validity."""
        self._expiring_names.discard(name)
        cell = self.cells[name]
        if cell.expire(self._clock.now_s()):
            if isinstance(cell.reading, Override):
                self._mirror_override(name)
            self._event_writer.write_reading(self._clock.now_s(), cell.observed, True)
            self._on_change(name, False)
            self.derivations.note_change(name)
        else:
            self._watch_expiry(cell.observed)


def _create_cell(model: VariableModel, cells: Mapping[str, Cell]) -> Cell:
    if model.derived is None:
        return Cell(model.name, model.history)
    return DerivedCell(model.name, model.history, model.derived, model.type, cells)


def _is_same_state(before: Reading[Value], reading: Reading[Value]) -> bool:
    """Return whether, between two readings with the same content, the variable stayed known, or stayed unknown."""
    if before.reason is not None and reading.reason is not None:
        # evidence from before the last value became stale changes the history
        return before.reason is not Reason.STALE or before.identified_s <= reading.evidence_s
    if before.reason is not None or reading.reason is not None:
        return False
    # if the evidence began earlier than before, it may be from before the end of acting: then another look is due
    return before.expires_s > reading.identified_s and before.start_s <= reading.start_s
