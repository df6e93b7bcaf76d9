"""What a spec says of MAPE-K loops, as frozen values that generated code fills with literals and functions.

P2, sections 3.3 and 5.2: a first fuzzy stage turns context into metrics, a second one turns metrics into weights of
actions, and what weighs most is the course that the mission's tree takes. All that these values name are
context-variables: rates, metrics, weights, the course and the parameters are readings like any other, with an agent
that writes them.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import StrEnum

from codra_dsl.logic import Term
from codra_dsl.runtime.behavior_trees import Node
from codra_dsl.runtime.loops.fuzzy.bounds import BoundedInference, Bounds, End
from codra_dsl.runtime.loops.fuzzy.outputs import Inference

Membership = Callable[[float], float]
"""The degree with which a number is a term."""


Infer = Callable[..., Inference]
"""The function `infer` of a compiled engine: of as many numbers as it has inputs."""

InferBounds = Callable[..., BoundedInference]
"""The function `infer_bounds` of a compiled engine: of as many bounds as it has inputs."""


@dataclass(frozen=True, slots=True, kw_only=True)
class RateModel:
    """How fast a variable changes, as a variable of its own.

    The slope of the line that fits the known readings of the last `over_s` seconds best. It is unknown while these
    span less than half of that time, and when the variable is unknown now. A value outside the range of the rate's
    variable counts as the nearest end.

    Attributes:
        variable: the rate; a context-variable whose source is the analyst.
        of: the variable whose readings are looked at; its `history` must hold those of half of the time.
        over_s: the window.
        factor: what a change of 1 a second, in the units of `of`, is in the unit of the rate: 60 for units a minute,
            -60 where falling counts as positive.
    """

    variable: str
    of: str
    over_s: float
    factor: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class InputModel:
    """An input of a stage.

    Attributes:
        variable: a context-variable: a rate and, in the second stage, a metric are such too.
        range: all that it can be; what it counts as while it is unknown.
        members: of an enum, in the order in which the engine counts them from 0; of a bool `("false", "true")`. While
            it is unknown it is one of them, and nothing between.
        terms: the degree of each of its terms, for the chains of decisions.
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
        variable: the context-variable that holds it, a number from 0 to 1 whose source is the analyst; of a metric its
            name.
        worse: the end of the interval that counts when an input is unknown; of a metric also the side to which a
            change breaks a dwell.
    """

    name: str
    variable: str
    worse: End = End.LOW


@dataclass(frozen=True, slots=True, kw_only=True)
class StageRuleModel:
    """A rule of a stage.

    Attributes:
        text: as the engine's `RULES` has it.
        concludes: the names of the outputs about which it says something.
        reads: the variables of the inputs that it asks about: the evidence of an output is as old as the oldest of what
            its rules read.
        place: in the spec, as `file:line`.
    """

    text: str
    concludes: tuple[str, ...]
    reads: tuple[str, ...]
    place: str = ""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StageModel:
    """One fuzzy engine, bound to variables. It equals itself only, as its functions do.

    Attributes:
        infer: of numbers.
        infer_bounds: of bounds; it is asked when an input is unknown.
        inputs: in the engine's order (`INPUTS`).
        outputs: in the engine's order (`OUTPUTS`).
        rules: in the engine's order (`RULES`).
        pieces: into how many pieces each unknown input is cut, so that bounds are narrower (`refined`).
    """

    infer: Infer
    infer_bounds: InferBounds
    inputs: tuple[InputModel, ...]
    outputs: tuple[OutputModel, ...]
    rules: tuple[StageRuleModel, ...]
    pieces: int = 8


@dataclass(frozen=True, slots=True, kw_only=True)
class HardRuleModel:
    """While a condition certainly holds, an action is the course, whatever the weights are.

    Attributes:
        condition: over context-variables.
        action: one that the course chooses from.
        text: the condition, as the spec says it.
    """

    condition: Term
    action: str
    text: str
    place: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class CourseModel:
    """A choice among actions by their weights, and the filter that keeps it from flapping.

    Attributes:
        name: of the adaptation.
        choose: the actions; of equal weights the first wins.
        otherwise: the action while no weight is known.
        variable: an enum that holds the action chosen, whose source is the adapter; empty if there is none.
        smooth_s: the time constant of the weights' exponential smoothing; 0 is none.
        lead: by how much a weight must exceed that of the action that runs.
        hold_s: how long it must do so without a break.
        dwell_s: how long an action runs at least. A hard rule breaks that, and a metric that became worse.
        cooldown_s: how long an action that was left is not chosen again, but for the same two.
        abort_s: how long the branch that is left may take to end.
        always: hard rules; the first that holds decides.
    """

    name: str
    choose: tuple[str, ...]
    otherwise: str
    variable: str = ""
    smooth_s: float = 0.0
    lead: float = 0.0
    hold_s: float = 0.0
    dwell_s: float = 0.0
    cooldown_s: float = 0.0
    abort_s: float = 2.0
    always: tuple[HardRuleModel, ...] = ()
    place: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ParameterModel:
    """A context-variable that is set by a condition over context and metrics.

    Attributes:
        name: of the adaptation.
        variable: that is set; its source is the adapter.
        value: what it is to be, in the variable's unit; where it is unknown, the last value stays.
        text: `value`, as the spec says it.
        dwell_s: how long a value stands at least. A metric that became worse breaks that.
    """

    name: str
    variable: str
    value: Term
    text: str
    dwell_s: float = 0.0
    place: str = ""


class Repeat(StrEnum):
    """What becomes of a tree whose root has completed."""

    ALWAYS = "always"
    """It begins anew with its next tick."""

    ON_SWITCH = "on_switch"
    """It is idle until another course is chosen."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TreeModel:
    """A tree of the mission, and which of its branches is which action.

    The tree has guarded branches: each asks an entry of its blackboard (`_while="course == 'deliver'"`, or a
    `Switch` with `variable="{course}"`). A course is chosen by writing the entry.

    Attributes:
        build: makes the root; a function of the compiled module's `TREES`.
        course: the adaptation that chooses its branch; empty if none does.
        entry: of the blackboard, that says which branch is to run.
        branches: of each action what the entry becomes.
        tasks: tasks of the knowledge graph that its leaves hand over; a branch has ended when none is open that it
            has asked for.
        agent: who asks for these tasks.
        period_s: the time between two ticks.
        repeat: what becomes of it when its root has completed.
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
    """A loop: what it analyses, adapts and executes.

    Attributes:
        name: of the loop.
        rates: variables of the rates that it works out; each belongs to one loop.
        analyse: metrics that it works out; each belongs to one loop.
        adapt: courses and parameters; the weights of a course's actions are worked out with it.
        execute: trees that it ticks.
        period_s: how long after the last analysis there is another one though no input has changed.
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
        metrics: the first stage; None if there is none.
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
