"""Perception outside the tick: jobs, their results, and where they run."""

from __future__ import annotations

from codra_dsl.isolation.error_text import described
from codra_dsl.runtime.perception.cost import Cost, CostMeter
from codra_dsl.runtime.perception.functions import CallError, Function, check_handles, imported
from codra_dsl.runtime.perception.job import Interval, Job
from codra_dsl.runtime.perception.job_run import JobRun, State
from codra_dsl.runtime.perception.outcome import Failure, Result, checked
from codra_dsl.runtime.perception.perception import Perception

__all__ = [
    "CallError",
    "Cost",
    "CostMeter",
    "Failure",
    "Function",
    "Interval",
    "Job",
    "JobRun",
    "Perception",
    "Result",
    "State",
    "check_handles",
    "checked",
    "described",
    "imported",
]
