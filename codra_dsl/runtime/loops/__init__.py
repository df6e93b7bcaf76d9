"""MAPE-K loops at run time: they analyse knowledge, plan, and execute behavior trees.

`Planning` decides by the rules of the spec. To decide by other rules, give `Mape` another `planner`: a function of the
type `Planners` that returns a `Planner`.
"""

from __future__ import annotations

from codra_dsl.runtime.loops.analysis import assess
from codra_dsl.runtime.loops.counterfactual import Counterfactual
from codra_dsl.runtime.loops.course_filters import SwitchReason
from codra_dsl.runtime.loops.courses import CourseState, Decision
from codra_dsl.runtime.loops.declarations import (
    CourseModel,
    HardRuleModel,
    InputModel,
    LoopModel,
    MapeModel,
    OutputModel,
    ParameterModel,
    RateKind,
    RateModel,
    Repeat,
    StageModel,
    StageRuleModel,
    TreeModel,
)
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
    "RateKind",
    "RateModel",
    "Repeat",
    "Setting",
    "StageModel",
    "StageRuleModel",
    "SwitchReason",
    "TreeModel",
    "assess",
]
