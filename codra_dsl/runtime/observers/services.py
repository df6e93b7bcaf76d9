"""The part of the context manager that an observer uses."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.journal import EventWriter
from codra_dsl.runtime.observers.event_triggers import EventTriggers
from codra_dsl.runtime.perception import Perception
from codra_dsl.runtime.values.cell import Cell
from codra_dsl.runtime.values.model import VariableModel


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverServices:
    """The part of the context manager that an observer uses.

    Attributes:
        cells: all variables.
        variables: the declarations of all variables.
        perception: runs jobs.
        event_triggers: decides when variables with `refresh: on_event` are due.
        event_writer: writes to the event log.
        clock: real or simulated time.
        urgency: returns how urgently the variables of the observer with a given name are needed.
        is_asked_for: returns whether a variable is declared, or needed by an observer that is due to look.
    """

    cells: Mapping[str, Cell]
    variables: Mapping[str, VariableModel]
    perception: Perception
    event_triggers: EventTriggers
    event_writer: EventWriter
    clock: Clock
    urgency: Callable[[str], int]
    is_asked_for: Callable[[str], bool]

    def now_s(self) -> float:
        """Return the present instant."""
        return self.clock.now_s()
