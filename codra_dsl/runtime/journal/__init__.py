"""The journal of a run: every change of a variable, every start and stop, every job and decision, in order."""

from __future__ import annotations

from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.record import Record, Scribe

__all__ = ["Event", "Kind", "Record", "Scribe"]
