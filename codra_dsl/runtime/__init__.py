"""What robots and generated code import: time, context and observers. It needs no compiler, YAML or command line."""

from __future__ import annotations

from codra_dsl.runtime.agents import Agent, NotASourceError
from codra_dsl.runtime.cell import Reading, Reason, UnknownValueError
from codra_dsl.runtime.clock import Clock, SimClock, WallClock
from codra_dsl.runtime.context import ContextManager, NotDeclaredError, Skill, UnknownNameError
from codra_dsl.runtime.expectations import Outcome, Verdict, Verification
from codra_dsl.runtime.journal import Event, Kind, Record
from codra_dsl.runtime.journal.journal import Journal
from codra_dsl.runtime.model import ContextModel, NotOfTypeError
from codra_dsl.runtime.perception import CallError, Job, Spent
from codra_dsl.runtime.question import Question, Step
from codra_dsl.runtime.shadow import ShadowReport
from codra_dsl.runtime.subscriptions import Subscription
from codra_dsl.runtime.why import Why

__all__ = [
    "Agent",
    "CallError",
    "Clock",
    "ContextManager",
    "ContextModel",
    "Event",
    "Job",
    "Journal",
    "Kind",
    "NotASourceError",
    "NotDeclaredError",
    "NotOfTypeError",
    "Outcome",
    "Question",
    "Reading",
    "Reason",
    "Record",
    "ShadowReport",
    "SimClock",
    "Skill",
    "Spent",
    "Step",
    "Subscription",
    "UnknownNameError",
    "UnknownValueError",
    "Verdict",
    "Verification",
    "WallClock",
    "Why",
]
