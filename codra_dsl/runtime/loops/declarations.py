"""Declarations of MAPE-K loops: frozen values that generated code fills with literals and functions.

P2, sections 3.3 and 5.2: a first fuzzy stage turns context into metrics, and a second stage turns metrics into weights
of actions. The action with the highest weight becomes the course, and the mission's tree runs the branch of the course.

Rates, metrics, weights, courses and parameters are context-variables like any other, and an agent writes each of them.
So conditions, agents, the journal and `why` handle them without special code. A spec declares the variables of rates
and parameters; loading the spec adds those of metrics, weights and courses.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from codra_dsl.logic import Term
from codra_dsl.runtime.behavior_trees import Node
from codra_dsl.runtime.loops.fuzzy.bounds import BoundedInference, Bounds, End
from codra_dsl.runtime.loops.fuzzy.outputs import Inference
from codra_dsl.runtime.values.cell import FOREVER_S

Membership = Callable[[float], float]
"""Returns the degree of membership of a number in a term."""

Infer = Callable[..., Inference]
"""The function `infer` of a compiled engine; it takes one number for each input."""

InferBounds = Callable[..., BoundedInference]
"""The function `infer_bounds` of a compiled engine; it takes the bounds of each input."""


class RateKind(StrEnum):
    """The value that a loop computes from the history of a variable."""

    RATE = "rate"
    """The rate of change of a number."""

    SHARE = "share"
    """The share of time in which a bool is true."""

    HELD = "held"
    """Whether a bool has been true for some time, without interruption."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RateModel:
    """A rate of change, which is a variable of its own.

    Its value is the slope of the line that best fits the readings of `of` in the last `over_s` seconds; if `of` was
    unknown during this time, only later readings are used. The rate is unknown while these readings span less than
    half of `over_s`, and while `of` is unknown. If the slope lies outside the range of `variable`, the value is the
    nearest end of this range.

    For `RateKind.SHARE`, the value is instead the share of time in which the bool `of` was true, among the times of the
    window at which it was known. It is unknown while these times are shorter than half of `over_s`, and while `of` is
    unknown.

    For `RateKind.HELD`, the value is a bool: true if `of` was known to be true during all of the window, false if `of`
    was false at an instant of the window, and otherwise unknown. It is unknown while `of` is unknown.

    Attributes:
        variable: the rate; a context-variable whose source is the analyst.
        of: the variable whose readings are used; its `history` must cover at least half of the window, or all of it for
            a held bool.
        over_s: the length of the window.
        factor: converts from units of `of` per second to the unit of the rate: 60 for units per minute, -60 if
            the rate is positive while `of` falls.
        kind: the kind of the computed value.
        valid_for_s: how long the newest evidence of `of` counts.
    """

    variable: str
    of: str
    over_s: float
    factor: float = 1.0
    kind: RateKind = RateKind.RATE
    valid_for_s: float = FOREVER_S

    def __str__(self) -> str:
        """Return a description of the computed value, for explanations."""
        match self.kind:
            case RateKind.SHARE:
                return f"the share of time at which {self.of} was true, over {self.over_s:g} s"
            case RateKind.HELD:
                return f"whether {self.of} has been true for {self.over_s:g} s without interruption"
            case RateKind.RATE:
                return f"the rate of change of {self.of} over {self.over_s:g} s"


@dataclass(frozen=True, slots=True, kw_only=True)
class InputModel:
    """An input of a stage.

    Attributes:
        variable: a context-variable; this can be a rate and, in the second stage, a metric.
        range: all possible values; they are used while the variable is unknown.
        members: the members of an enum, which the engine numbers from 0 in this order; `("false", "true")` for a bool.
            An unknown value is one of the members, never a number between them.
        terms: the membership function of each term. `why` shows these degrees of membership when it explains a metric
            or a decision.
    """

    variable: str
    range: Bounds
    members: tuple[str, ...] = ()
    terms: Mapping[str, Membership] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class OutputModel:
    """A metric or the weight of an action.

    Attributes:
        name: the metric, or the action.
        variable: the context-variable that holds the value, a number from 0 to 1. Its source is the analyst. The
            variable of a metric has the name of the metric.
        worse: which end of the range is worse. If an input is unknown, the output is an interval of possible values,
            and its worse end is used as the value. If a metric changes towards its worse end, the change can break a
            dwell.
    """

    name: str
    variable: str
    worse: End = End.LOW


@dataclass(frozen=True, slots=True, kw_only=True)
class StageRuleModel:
    """A rule of a stage.

    Attributes:
        text: the text of the rule in the engine's `RULES`.
        concludes: the names of the outputs that the rule has conclusions for.
        reads: the variables of the inputs that the rule reads. The evidence of an output is as old as the oldest
            evidence that the rules of the output read.
        place: the place of the rule in the spec, as `file:line`.
    """

    text: str
    concludes: tuple[str, ...]
    reads: tuple[str, ...]
    place: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StageModel:
    """One fuzzy engine, bound to variables. Stages are compared by identity, as their functions are.

    Attributes:
        infer: the inference with numbers.
        infer_bounds: the inference with bounds; it is used when an input is unknown.
        inputs: the inputs, in the engine's order (`INPUTS`).
        outputs: the outputs, in the engine's order (`OUTPUTS`).
        rules: the rules, in the engine's order (`RULES`).
        pieces: the number of pieces into which each unknown input is cut, for narrower bounds (`refined`).
    """

    infer: Infer
    infer_bounds: InferBounds
    inputs: tuple[InputModel, ...]
    outputs: tuple[OutputModel, ...]
    rules: tuple[StageRuleModel, ...]
    pieces: int = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class HardRuleModel:
    """A rule that sets the course to an action while a condition certainly holds, regardless of the weights.

    Attributes:
        condition: a condition over context-variables.
        action: one of the actions that the course chooses from.
        text: the condition as it is written in the spec.
        for_s: how long the condition must have held without interruption before the rule decides.
    """

    condition: Term
    action: str
    text: str
    for_s: float = 0.0
    place: str = ""

    def __str__(self) -> str:
        """Return the rule as it is written in the spec."""
        for_text = f" for {self.for_s:g} s" if self.for_s else ""
        return f"{self.text}{for_text} then {self.action}"


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseModel:
    """A choice among actions by their weights, and the filter that prevents flapping.

    Attributes:
        name: the name of the course in the spec section `adaptation`.
        choose: the actions; among actions with equal weights, the first one wins.
        otherwise: the action while no weight is known.
        variable: an enum variable that holds the chosen action. Its source is the adapter. Empty without such a
            variable.
        smooth_s: the time constant of the exponential smoothing of weights; 0 for no smoothing.
        lead: the lead of an action's weight over the weight of the running action that a switch needs.
        hold_s: how long an action must have this lead without a break.
        holds_s: the same for single actions, instead of `hold_s`.
        dwell_s: the shortest time for which an action runs. There are three exceptions: a hard rule, a metric that
            became worse, and weights that are all unknown (for `hold_s`).
        cooldown_s: how long an action is not chosen again after it was left. The exceptions are the same as for the
            dwell.
        abort_s: how long a branch may take to end after the course has left it.
        always: hard rules; the first one that holds decides.
        filtered_weights: for each action, the variable that holds its filtered weight, a number from 0 to 1. Its source
            is the analyst. Empty without such variables.
    """

    name: str
    choose: tuple[str, ...]
    otherwise: str
    variable: str = ""
    smooth_s: float = 0.0
    lead: float = 0.0
    hold_s: float = 0.0
    holds_s: Mapping[str, float] = field(default_factory=dict)
    dwell_s: float = 0.0
    cooldown_s: float = 0.0
    abort_s: float = 2.0
    always: tuple[HardRuleModel, ...] = ()
    filtered_weights: Mapping[str, str] = field(default_factory=dict)
    place: str = ""

    def hold_of_s(self, action: str) -> float:
        """Return how long an action must lead before it is chosen."""
        return self.holds_s.get(action, self.hold_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterModel:
    """A parameter: a context-variable that is set to the value of an expression over context and metrics.

    Attributes:
        name: the name of the parameter in the spec section `adaptation`.
        variable: the variable that is set; its source is the adapter.
        value: computes the new value, in the variable's unit.
        text: `value` as it is written in the spec.
        otherwise: computes the constant that is set while `value` is unknown. If it is None, the last value then stays
            until it is no longer valid.
        dwell_s: the shortest time for which a value is kept. A metric that became worse ends this time early, and so
            does a value that becomes unknown.
    """

    name: str
    variable: str
    value: Term
    text: str
    otherwise: Term | None = None
    dwell_s: float = 0.0
    place: str = ""


class Repeat(StrEnum):
    """What happens to a tree after its root has completed."""

    ALWAYS = "always"
    """The tree starts again with its next tick."""

    ON_SWITCH = "on_switch"
    """The tree is idle until another course is chosen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TreeModel:
    """A behavior tree of the mission, and its branch for each action.

    The tree has guarded branches: each reads an entry of the tree's blackboard (`_while="course == 'deliver'"`, or a
    `Switch` with `variable="{course}"`). The loop writes the entry to select the branch of the course.

    Attributes:
        build: makes the root of the tree; a function in `TREES` of the compiled module.
        course: the course that selects the tree's branch; empty if no course does.
        entry: the entry of the blackboard that selects the branch to run.
        branches: the value of the entry for each action.
        tasks: the tasks of the knowledge graph that the tree's leaves hand over. A branch that was left has ended when
            `agent` has no open request for one of these tasks.
        agent: the agent that requests these tasks.
        period_s: the time between two ticks.
        repeat: what happens after the root of the tree has completed.
    """

    name: str
    build: Callable[[], Node]
    course: str = ""
    entry: str = "course"
    branches: Mapping[str, str] = field(default_factory=dict)
    tasks: tuple[str, ...] = ()
    agent: str = ""
    period_s: float = 0.1
    repeat: Repeat = Repeat.ALWAYS


@dataclass(frozen=True, slots=True, kw_only=True)
class LoopModel:
    """A loop, with the elements that it analyses, adapts and executes.

    Attributes:
        name: the name of the loop.
        rates: the variables of the rates that the loop computes; each rate belongs to one loop.
        analyse: the metrics that the loop computes; each metric belongs to one loop.
        adapt: courses and parameters; the loop also computes the weights of the actions of these courses.
        execute: the trees that the loop ticks.
        period_s: the longest time between two analyses; the loop then analyses even if no input has changed.
    """

    name: str
    rates: tuple[str, ...] = ()
    analyse: tuple[str, ...] = ()
    adapt: tuple[str, ...] = ()
    execute: tuple[str, ...] = ()
    period_s: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class MapeModel:
    """All loops of a spec.

    Attributes:
        metrics: the first stage; None without metrics.
        actions: the second stage.
        analyst: the agent that writes rates, metrics and weights.
        adapter: the agent that writes courses and parameters.
    """

    loops: tuple[LoopModel, ...]
    metrics: StageModel | None = None
    actions: StageModel | None = None
    rates: tuple[RateModel, ...] = ()
    courses: tuple[CourseModel, ...] = ()
    parameters: tuple[ParameterModel, ...] = ()
    trees: tuple[TreeModel, ...] = ()
    analyst: str = "analysis"
    adapter: str = "adaptation"
