"""The runtime that robots import: time, context and observers. It needs no compiler, YAML or command line."""

from __future__ import annotations

from codra_dsl.logic import Value
from codra_dsl.runtime.callbacks import Subscription
from codra_dsl.runtime.clock import Clock, SimClock, WallClock
from codra_dsl.runtime.context.agents import Agent
from codra_dsl.runtime.context.context import ContextManager, NotDeclaredError, Skill, UnknownNameError
from codra_dsl.runtime.context.model import ContextModel
from codra_dsl.runtime.context.pending_decision import DecisionState, PendingDecision
from codra_dsl.runtime.context.shadow import ShadowReport
from codra_dsl.runtime.errors import NotASourceError
from codra_dsl.runtime.journal import Event, EventLog, Kind
from codra_dsl.runtime.journal.journal import Journal
from codra_dsl.runtime.observers.expectations import Outcome, Verdict, Verification
from codra_dsl.runtime.perception import CallError, Cost, Job
from codra_dsl.runtime.values.cell import Reading, Reason, UnknownValueError
from codra_dsl.runtime.values.declarations import MAIN
from codra_dsl.runtime.values.model import (
    NotOfTypeError,
    ValueType,
    VariableModel,
    boolean,
    integer,
    member,
    real,
    text,
)
from codra_dsl.runtime.why import Why

__all__ = [
    "MAIN",
    "Agent",
    "CallError",
    "Clock",
    "ContextManager",
    "ContextModel",
    "Cost",
    "DecisionState",
    "Event",
    "EventLog",
    "Job",
    "Journal",
    "Kind",
    "NotASourceError",
    "NotDeclaredError",
    "NotOfTypeError",
    "Outcome",
    "PendingDecision",
    "Reading",
    "Reason",
    "ShadowReport",
    "SimClock",
    "Skill",
    "Subscription",
    "UnknownNameError",
    "UnknownValueError",
    "Value",
    "ValueType",
    "VariableModel",
    "Verdict",
    "Verification",
    "WallClock",
    "Why",
    "boolean",
    "integer",
    "member",
    "real",
    "text",
]
