"""The runtime that robots import: time, context and observers. It needs no compiler, YAML or command line."""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from codra_dsl.logic import Value
    from codra_dsl.runtime.callbacks import Subscription
    from codra_dsl.runtime.clock import Clock, SimClock, WallClock
    from codra_dsl.runtime.context.agents import Agent
    from codra_dsl.runtime.context.context import ContextManager, NotDeclaredError, Skill, UnknownNameError
    from codra_dsl.runtime.context.model import ContextModel
    from codra_dsl.runtime.context.pending_decision import DecisionState, PendingDecision, PendingPreview
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
    from codra_dsl.runtime.values.previews import PreviewAnswer, PreviewOutcome, UnknownVariable
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
    "PendingPreview",
    "PreviewAnswer",
    "PreviewOutcome",
    "Reading",
    "Reason",
    "ShadowReport",
    "SimClock",
    "Skill",
    "Subscription",
    "UnknownNameError",
    "UnknownValueError",
    "UnknownVariable",
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

_NAMES_BY_MODULE = {
    "codra_dsl.logic": "Value",
    "codra_dsl.runtime.callbacks": "Subscription",
    "codra_dsl.runtime.clock": "Clock SimClock WallClock",
    "codra_dsl.runtime.context.agents": "Agent",
    "codra_dsl.runtime.context.context": "ContextManager NotDeclaredError Skill UnknownNameError",
    "codra_dsl.runtime.context.model": "ContextModel",
    "codra_dsl.runtime.context.pending_decision": "DecisionState PendingDecision PendingPreview",
    "codra_dsl.runtime.context.shadow": "ShadowReport",
    "codra_dsl.runtime.errors": "NotASourceError",
    "codra_dsl.runtime.journal": "Event EventLog Kind",
    "codra_dsl.runtime.journal.journal": "Journal",
    "codra_dsl.runtime.observers.expectations": "Outcome Verdict Verification",
    "codra_dsl.runtime.perception": "CallError Cost Job",
    "codra_dsl.runtime.values.cell": "Reading Reason UnknownValueError",
    "codra_dsl.runtime.values.declarations": "MAIN",
    "codra_dsl.runtime.values.model": "NotOfTypeError ValueType VariableModel boolean integer member real text",
    "codra_dsl.runtime.values.previews": "PreviewAnswer PreviewOutcome UnknownVariable",
    "codra_dsl.runtime.why": "Why",
}
_MODULES = {name: module for module, names in _NAMES_BY_MODULE.items() for name in names.split()}


if not TYPE_CHECKING:  # otherwise type checkers would accept every name

    def __getattr__(name: str) -> Any:
        """Import an object when it is first used: `codra why` reads journals without observers and behavior trees."""
        if name not in _MODULES:
            raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
        value = globals()[name] = getattr(import_module(_MODULES[name]), name)
        return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
