"""Perception outside the tick: jobs, what they bring, and where they run."""

from __future__ import annotations

from codra_dsl.isolation.messages import described
from codra_dsl.runtime.perception.attempt import Attempt, State
from codra_dsl.runtime.perception.calls import CallError, Function, check_handles, imported
from codra_dsl.runtime.perception.job import Interval, Job
from codra_dsl.runtime.perception.outcome import Failure, Result, checked
from codra_dsl.runtime.perception.perception import Perception
from codra_dsl.runtime.perception.spending import Account, Spent

__all__ = [
    "Account",
    "Attempt",
    "CallError",
    "Failure",
    "Function",
    "Interval",
    "Job",
    "Perception",
    "Result",
    "Spent",
    "State",
    "check_handles",
    "checked",
    "described",
    "imported",
]
