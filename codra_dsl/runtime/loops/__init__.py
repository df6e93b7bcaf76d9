"""MAPE-K at run time: loops that analyse knowledge and plan by it.

A program that decides otherwise than the spec's rules gives `Mape` another `planner`: a function of the type `Planners`
that returns a `Planner`. `Planning` is the planner of the spec's own rules.
"""

from __future__ import annotations

from codra_dsl.runtime.loops.analysis import assess
from codra_dsl.runtime.loops.counterfactual import Counterfactual
from codra_dsl.runtime.loops.courses import CourseState, Decision
from codra_dsl.runtime.loops.declarations import (
    CourseModel,
    HardRuleModel,
    InputModel,
    LoopModel,
    MapeModel,
    OutputModel,
    ParameterModel,
    RateModel,
    Repeat,
    StageModel,
    StageRuleModel,
    TreeModel,
)
from codra_dsl.runtime.loops.filters import SwitchReason
from codra_dsl.runtime.loops.loop import Mape
from codra_dsl.runtime.loops.planning import Context, Plan, Planner, Planners, Planning, Setting

__all__ = [
    "Context",
    "Counterfactual",
    "CourseModel",
    "CourseState",
    "Decision",
    "HardRuleModel",
    "InputModel",
    "LoopModel",
    "Mape",
    "MapeModel",
    "OutputModel",
    "ParameterModel",
    "Plan",
    "Planner",
    "Planners",
    "Planning",
    "RateModel",
    "Repeat",
    "Setting",
    "StageModel",
    "StageRuleModel",
    "SwitchReason",
    "TreeModel",
    "assess",
]
