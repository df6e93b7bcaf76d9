"""What robots and generated code import: time, context and observers. It needs no compiler, YAML or command line."""

from __future__ import annotations

from codra_dsl.runtime.cell import Reading, Reason, UnknownValueError
from codra_dsl.runtime.clock import Clock, SimClock, WallClock
from codra_dsl.runtime.context import ContextManager, NotDeclaredError, Skill, UnknownNameError
from codra_dsl.runtime.journal import Record
from codra_dsl.runtime.model import ContextModel, NotOfTypeError
from codra_dsl.runtime.perception import CallError, Job

__all__ = [
    "CallError",
    "Clock",
    "ContextManager",
    "ContextModel",
    "Job",
    "NotDeclaredError",
    "NotOfTypeError",
    "Reading",
    "Reason",
    "Record",
    "SimClock",
    "Skill",
    "UnknownNameError",
    "UnknownValueError",
    "WallClock",
]
