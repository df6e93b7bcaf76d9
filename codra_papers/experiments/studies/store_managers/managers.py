"""The managers that are compared: who decides on the course and speed (docs/papers/store-experiment.md).

All have the same trees, agents and handshakes: each is a planner in the place of the spec's.
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

NOMINAL = "pick"
"""P2's nominal course: pick up, deliver, back to the start (section 5.1)."""

SLOW_M_S, NORMAL_M_S = 0.3, 1.2
"""The maximum speeds of the spec."""

Types = Mapping[str, ValueType]
Overrule = Callable[[Plan], Plan]


class Manager(Protocol):
    """Who decides."""

    @property
    def name(self) -> str:
        """Return what people read in tables."""
        ...

    def planners(self, seed: int) -> Planners:
        """Return what makes its planners for a run with a seed."""
        ...


@dataclass(frozen=True, slots=True)
class Ours:
    """The spec's loops."""

    name: str = "ours"

    def planners(self, seed: int) -> Planners:
        """Return what makes its planners: no chance is in them."""
        del seed
        return lambda model, loop, types: _Overruled(Planning(model, loop, types), _as_it_is)


@dataclass(frozen=True, slots=True)
class Tuned:
    """Comparisons in place of both fuzzy stages."""

    thresholds: Thresholds
    name: str = "threshold"

    def planners(self, seed: int) -> Planners:
        """Return what makes its planners: no chance is in them."""
        del seed

        def make(model: MapeModel, loop: LoopModel, types: Types) -> Planner:
            return _Overruled(Planning(with_thresholds(model, self.thresholds), loop, types), _as_it_is)

        return make


@dataclass(frozen=True, slots=True)
class Chance:
    """A course drawn at each instant at which the spec's loops would change theirs."""

    name: str = "random"

    def planners(self, seed: int) -> Planners:
        """Return what makes its planners."""

        def make(model: MapeModel, loop: LoopModel, types: Types) -> Planner:
            drawing = _Drawing(Random(f"{seed} manager {loop.name}"), model.courses)
            return _Overruled(Planning(model, loop, types), drawing)

        return make


@dataclass(frozen=True, slots=True)
class Nobody:
    """The nominal course, always, at the normal speed."""

    name: str = "none"

    def planners(self, seed: int) -> Planners:
        """Return what makes its planners: no chance is in them."""
        del seed
        return lambda model, loop, types: _Overruled(Planning(model, loop, types), _Staying(model.parameters))


class _Overruled:
    """A planner whose decisions another one sees first.

    It explains nothing: that takes long and changes nothing.
    """

    def __init__(self, planning: Planning, overrule: Overrule) -> None:
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
        for each in plan.decisions:
            self.decisions = {**self.decisions, each.course: [*self.decisions[each.course], each]}
        return plan

    def kept_by(self, decision: Decision) -> tuple[Counterfactual, ...]:
        del decision
        return ()


def _as_it_is(plan: Plan) -> Plan:
    return plan


class _Staying:
    """Takes the first decision for the nominal course and normal speed, and no other."""

    def __init__(self, parameters: Sequence[ParameterModel]) -> None:
        self._parameters = parameters
        self._has_begun = False

    def __call__(self, plan: Plan) -> Plan:
        if self._has_begun or not plan.decisions:
            return replace(plan, decisions=(), settings=())
        self._has_begun = True
        (first,) = plan.decisions
        settings = tuple(_first(each, NORMAL_M_S, first) for each in self._parameters)
        return replace(plan, decisions=(_instead(first, NOMINAL, ""),), settings=settings)


class _Drawing:
    """Draws another course or speed wherever one is decided on."""

    def __init__(self, random: Random, courses: Sequence[CourseModel]) -> None:
        self._random = random
        self._choices = {each.name: each.choose for each in courses}
        self._actions: dict[str, str] = {}
        self._values: dict[str, Value] = {}

    def __call__(self, plan: Plan) -> Plan:
        decisions = map(self._decision, plan.decisions)
        settings = map(self._setting, plan.settings)
        return replace(
            plan,
            decisions=tuple(each for each in decisions if each is not None),
            settings=tuple(each for each in settings if each is not None),
        )

    def _decision(self, decision: Decision) -> Decision | None:
        before = self._actions.get(decision.course, "")
        action = self._actions[decision.course] = self._random.choice(self._choices[decision.course])
        return None if action == before else _instead(decision, action, before)

    def _setting(self, setting: Setting) -> Setting | None:
        before = self._values.get(setting.parameter.name)
        value = self._values[setting.parameter.name] = self._random.choice((SLOW_M_S, NORMAL_M_S))
        return None if value == before else replace(setting, value=value, before=before)


def _instead(decision: Decision, action: str, before: str) -> Decision:
    return replace(decision, action=action, before=before, because=SwitchReason.PLANNER, rule=None)


def _first(parameter: ParameterModel, value: Value, decision: Decision) -> Setting:
    return Setting(
        instant_s=decision.instant_s,
        parameter=parameter,
        value=value,
        before=None,
        since_s=-math.inf,
        is_urgent=False,
        assessment=decision.assessment,
    )
