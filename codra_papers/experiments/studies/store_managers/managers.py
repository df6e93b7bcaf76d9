"""The compared managers, which decide on the course and the speed (docs/papers/store-experiment.md).

All managers use the same trees, agents and handshakes. Each manager replaces only the planner of the spec's loops.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from random import Random
from typing import Protocol

from codra_dsl.runtime import ValueType
from codra_dsl.runtime.loops import (
    Context,
    Counterfactual,
    CourseModel,
    CourseState,
    Decision,
    LoopModel,
    MapeModel,
    ParameterModel,
    Plan,
    Planner,
    Planners,
    Planning,
    Setting,
    SwitchReason,
)
from codra_dsl.runtime.values.conditions import Value
from codra_papers.experiments.studies.store_managers.thresholds import Thresholds, with_thresholds

NOMINAL_COURSE = "pick"
"""P2's nominal course: pick up, deliver, back to the start (section 5.1)."""

SLOW_M_S, NORMAL_M_S = 0.3, 1.2
"""The maximum speeds of the spec."""

VariableTypes = Mapping[str, ValueType]
PlanEdit = Callable[[Plan], Plan]


class Manager(Protocol):
    """Decides on the course and the speed."""

    @property
    def name(self) -> str:
        """Return the name of the manager in tables."""
        ...

    def planners(self, seed: int) -> Planners:
        """Return the factory of the manager's planners for a run with a seed."""
        ...


@dataclass(frozen=True, slots=True)
class LoopsManager:
    """Manages with the loops of the spec."""

    name: str = "ours"

    def planners(self, seed: int) -> Planners:
        """Return the factory of the planners. These planners use no random numbers."""
        del seed
        return lambda model, loop, types: _OverruledPlanner(Planning(model, loop, types), _keep_plan)


@dataclass(frozen=True, slots=True)
class ThresholdManager:
    """Manages with comparisons with thresholds, which replace both fuzzy stages."""

    thresholds: Thresholds
    name: str = "threshold"

    def planners(self, seed: int) -> Planners:
        """Return the factory of the planners. These planners use no random numbers."""
        del seed

        def make(model: MapeModel, loop: LoopModel, types: VariableTypes) -> Planner:
            return _OverruledPlanner(Planning(with_thresholds(model, self.thresholds), loop, types), _keep_plan)

        return make


@dataclass(frozen=True, slots=True)
class RandomManager:
    """Chooses a random course at each instant at which the spec's loops would change their course."""

    name: str = "random"

    def planners(self, seed: int) -> Planners:
        """Return the factory of the planners, which draw from the seed of the run."""

        def make(model: MapeModel, loop: LoopModel, types: VariableTypes) -> Planner:
            overrule = _RandomReplacement(Random(f"{seed} manager {loop.name}"), model.courses)
            return _OverruledPlanner(Planning(model, loop, types), overrule)

        return make


@dataclass(frozen=True, slots=True)
class NominalManager:
    """Always chooses the nominal course, at the normal speed."""

    name: str = "none"

    def planners(self, seed: int) -> Planners:
        """Return the factory of the planners. These planners use no random numbers."""
        del seed
        return lambda model, loop, types: _OverruledPlanner(
            Planning(model, loop, types), _NominalReplacement(model.parameters)
        )


class _OverruledPlanner:
    """A planner whose decisions can be replaced by a function.

    The planner does not explain its decisions, because explanations take long and have no influence on decisions.
    """

    def __init__(self, planning: Planning, overrule: PlanEdit) -> None:
        self._planning = planning
        self._overrule = overrule
        self.model = planning.model
        self.courses: Mapping[str, CourseModel] = planning.courses
        self.decisions: Mapping[str, Sequence[Decision]] = {name: [] for name in planning.courses}

    def resume(self) -> None:
        self._planning.resume()

    def course_state(self, course: str) -> CourseState:
        return self._planning.course_state(course)

    def watches(self) -> tuple[str, ...]:
        return self._planning.watches()

    def plan(self, context: Context, now_s: float) -> Plan:
        plan = self._overrule(self._planning.plan(context, now_s))
        for decision in plan.decisions:
            self.decisions = {**self.decisions, decision.course: [*self.decisions[decision.course], decision]}
        return plan

    def kept_by(self, decision: Decision) -> tuple[Counterfactual, ...]:
        del decision
        return ()


def _keep_plan(plan: Plan) -> Plan:
    return plan


class _NominalReplacement:
    """Replaces the first decision by one for the nominal course and the normal speed, and drops all later decisions."""

    def __init__(self, parameters: Sequence[ParameterModel]) -> None:
        self._parameters = parameters
        self._has_begun = False

    def __call__(self, plan: Plan) -> Plan:
        if self._has_begun or not plan.decisions:
            return replace(plan, decisions=(), settings=())
        self._has_begun = True
        (first,) = plan.decisions
        settings = tuple(_first_setting(parameter, NORMAL_M_S, first) for parameter in self._parameters)
        return replace(plan, decisions=(_replace_decision(first, NOMINAL_COURSE, ""),), settings=settings)


class _RandomReplacement:
    """Replaces each decision by a random course or speed."""

    def __init__(self, random: Random, courses: Sequence[CourseModel]) -> None:
        self._random = random
        self._choices = {course.name: course.choose for course in courses}
        self._actions: dict[str, str] = {}
        self._values: dict[str, Value] = {}

    def __call__(self, plan: Plan) -> Plan:
        decisions = map(self._decision, plan.decisions)
        settings = map(self._setting, plan.settings)
        return replace(
            plan,
            decisions=tuple(decision for decision in decisions if decision is not None),
            settings=tuple(setting for setting in settings if setting is not None),
        )

    def _decision(self, decision: Decision) -> Decision | None:
        before = self._actions.get(decision.course, "")
        action = self._actions[decision.course] = self._random.choice(self._choices[decision.course])
        return None if action == before else _replace_decision(decision, action, before)

    def _setting(self, setting: Setting) -> Setting | None:
        before = self._values.get(setting.parameter.name)
        value = self._values[setting.parameter.name] = self._random.choice((SLOW_M_S, NORMAL_M_S))
        return None if value == before else replace(setting, value=value, before=before)


def _replace_decision(decision: Decision, action: str, before: str) -> Decision:
    return replace(decision, action=action, before=before, because=SwitchReason.PLANNER, rule=None)


def _first_setting(parameter: ParameterModel, value: Value, decision: Decision) -> Setting:
    return Setting(
        instant_s=decision.instant_s,
        parameter=parameter,
        value=value,
        before=None,
        since_s=-math.inf,
        is_urgent=False,
        assessment=decision.assessment,
    )
