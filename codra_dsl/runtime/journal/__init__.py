"""The journal of a run: its events in order, such as changes of variables, starts and stops, jobs and decisions."""

from __future__ import annotations

from codra_dsl.runtime.journal.event_log import EventLog, EventWriter
from codra_dsl.runtime.journal.events import Event, Kind

__all__ = ["Event", "EventLog", "EventWriter", "Kind"]
