"""A small shop with a loop that is declared in Python: people, a battery, a container, and a truck with its courses."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace
from functools import partial
from types import ModuleType
from typing import Any

from codra_dsl.language.fuzzy import compile_engine, read_fll
from codra_dsl.runtime import Clock, ContextManager, ContextModel, Event, EventLog, Kind, SimClock
from codra_dsl.runtime.behavior_trees import Conditions, Leaf, Node, Robot, Task, reactive_fallback
from codra_dsl.runtime.knowledge import KnowledgeModel, Stage
from codra_dsl.runtime.knowledge.declarations import AgentModel, NodeModel, NodeTypeModel, TaskModel
from codra_dsl.runtime.loops.declarations import (
    CourseModel,
    HardRuleModel,
    InputModel,
    LoopModel,
    MapeModel,
    OutputModel,
    ParameterModel,
    RateModel,
    StageModel,
    StageRuleModel,
    TreeModel,
)
from codra_dsl.runtime.loops.fuzzy.terms import ramp
from codra_dsl.runtime.loops.loop import Mape
from codra_dsl.runtime.loops.planning import Planners, Planning
from codra_dsl.runtime.values.conditions import choose, value
from codra_dsl.runtime.values.model import VariableModel, boolean, member, real

_DEGREE = """  range: 0.0 1.0
  defuzzifier: Centroid 100
  aggregation: Maximum
  term: low Ramp 0.6 0.2
  term: medium Triangle 0.2 0.5 0.8
  term: high Ramp 0.4 0.8
"""
_BLOCK = """  conjunction: Minimum
  disjunction: Maximum
  implication: Minimum
  activation: General
"""

METRICS = f"""Engine: metrics
InputVariable: person_distance
  range: 0.0 10.0
  term: close Ramp 2.5 1.5
InputVariable: battery_level
  range: 0.0 100.0
  term: empty Ramp 30.0 10.0
InputVariable: battery_drain
  range: 0.0 5.0
  term: fast Ramp 1.0 2.0
OutputVariable: safety
{_DEGREE}OutputVariable: power_autonomy
{_DEGREE}RuleBlock: safety
{_BLOCK}  rule: if person_distance is close then safety is medium
  rule: if person_distance is not close then safety is high
RuleBlock: power_autonomy
{_BLOCK}  rule: if battery_level is empty then power_autonomy is low
  rule: if battery_level is not empty and battery_drain is fast then power_autonomy is medium
  rule: if battery_level is not empty and battery_drain is not fast then power_autonomy is high
"""

ACTIONS = f"""Engine: actions
InputVariable: safety
{_DEGREE.replace("  defuzzifier: Centroid 100", "").replace("  aggregation: Maximum", "")}InputVariable: power_autonomy
{_DEGREE.replace("  defuzzifier: Centroid 100", "").replace("  aggregation: Maximum", "")}InputVariable: container_load
  range: 0.0 2.0
  term: empty Rectangle -0.5 0.5
  term: loading Rectangle 0.5 1.5
  term: full Rectangle 1.5 2.5
OutputVariable: deliver
{_DEGREE}OutputVariable: start
{_DEGREE}OutputVariable: dock
{_DEGREE}RuleBlock: deliver
{_BLOCK}  rule: if safety is high and power_autonomy is not low and container_load is not full then deliver is high
  rule: if safety is medium or power_autonomy is low or container_load is full then deliver is low
RuleBlock: start
{_BLOCK}  rule: if safety is medium then start is high
  rule: if safety is not medium then start is low
RuleBlock: dock
{_BLOCK}  rule: if power_autonomy is low then dock is high
  rule: if power_autonomy is not low then dock is low
"""


def module_of(fll: str) -> ModuleType:
    """Compile an engine."""
    read = read_fll("\n".join(line for line in fll.splitlines() if line.strip()).encode(), "engine.fll")
    assert read.engine is not None, read.findings
    module = ModuleType("engine")
    exec(compile_engine(read.engine), module.__dict__)
    return module


def stage(fll: str, terms: Mapping[str, Mapping[str, Any]], members: Mapping[str, tuple[str, ...]]) -> StageModel:
    """Bind an engine to the variables of its inputs and outputs."""
    module = module_of(fll)
    return StageModel(
        infer=module.infer,
        infer_bounds=module.infer_bounds,
        inputs=tuple(
            InputModel(variable=name, range=bounds, members=members.get(name, ()), terms=terms.get(name, {}))
            for name, bounds in zip(module.INPUTS, module.RANGES, strict=True)
        ),
        outputs=tuple(OutputModel(name=name, variable=_variable(name)) for name in module.OUTPUTS),
        rules=tuple(_rule(text, index, module.INPUTS) for index, text in enumerate(module.RULES)),
    )


def _variable(name: str) -> str:
    return name if name in ("safety", "power_autonomy") else f"weight_of_{name}"


def _rule(text: str, index: int, inputs: tuple[str, ...]) -> StageRuleModel:
    reasons, _, conclusion = text.partition(" then ")
    reads = tuple(name for name in inputs if re.search(rf"\b{name}\b", reasons))
    return StageRuleModel(
        text=text, concludes=(conclusion.split()[0],), reads=reads, place=f"specs/shop.yaml:{index + 1}"
    )


TERMS = {
    "person_distance": {"close": partial(ramp, start=2.5, end=1.5)},
    "battery_level": {"empty": partial(ramp, start=30.0, end=10.0)},
}
LOADS = ("empty", "loading", "full")
CHOICES = ("deliver", "start", "dock")
EMPTY = HardRuleModel(condition=value("battery_level") < 5.0, action="dock", text="battery_level < 5 percent")
BUMPED = HardRuleModel(condition=value("bumped"), action="start", text="bumped")

COURSE = CourseModel(
    name="course",
    choose=CHOICES,
    otherwise="start",
    variable="course_now",
    smooth_s=1.0,
    lead=0.1,
    hold_s=1.0,
    dwell_s=5.0,
    abort_s=2.0,
    always=(BUMPED, EMPTY),
    place="specs/shop.yaml:40",
)
SPEED = ParameterModel(
    name="speed",
    variable="max_speed",
    value=choose(0.3, value("safety") < 0.6, 1.2),
    text="0.3 m/s if safety < 0.6 else 1.2 m/s",
    dwell_s=3.0,
)


def branch(action: str) -> Node:
    """Return a branch that runs while the course is an action."""
    guard = Conditions(while_true=lambda scope: scope["course"] == action)
    return Node(action, Leaf(action), conditions=guard)


def mission() -> Node:
    """Return the mission: one guarded branch for each action."""
    return Node("mission", reactive_fallback(), *map(branch, CHOICES))


MISSION = TreeModel(
    name="mission", build=mission, course="course", branches={name: name for name in CHOICES}, agent="mission"
)


def degree(name: str) -> VariableModel:
    """Return the variable of a metric or weight."""
    return VariableModel(name=name, type=real(0.0, 1.0), sources=("analysis",))


MODEL = ContextModel(
    name="shop",
    variables=(
        VariableModel(name="person_distance", type=real(0, 10, unit="m"), sources=("people",), valid_for_s=2.0),
        VariableModel(name="battery_level", type=real(0, 100, unit="percent"), sources=("power",), valid_for_s=60.0),
        VariableModel(name="battery_drain", type=real(0, 5, unit="percent/min"), sources=("analysis",)),
        VariableModel(name="container_load", type=member(*LOADS), sources=("picker",)),
        VariableModel(name="bumped", type=boolean(), sources=("base",)),
        *map(degree, ("safety", "power_autonomy", *(f"weight_of_{name}" for name in CHOICES))),
        VariableModel(name="course_now", type=member(*CHOICES), sources=("adaptation",)),
        VariableModel(name="max_speed", type=real(0, 1.5, unit="m/s"), sources=("adaptation",)),
    ),
    observers=(),
)
DRAIN = RateModel(variable="battery_drain", of="battery_level", over_s=20.0, factor=-60.0)

KNOWLEDGE = KnowledgeModel(
    name="shop",
    node_types=(NodeTypeModel(name="robot"),),
    nodes=(NodeModel(name="robot", type="robot"),),
    agents=tuple(
        AgentModel(name=name)
        for name in ("people", "power", "picker", "base", "analysis", "adaptation", "mission", "driver")
    ),
    tasks=tuple(
        TaskModel(
            name=f"to_{name}", origin="robot", by="driver", requesters=("mission",), results=("there",), finish_s=60.0
        )
        for name in CHOICES
    ),
)


METRICS_STAGE = stage(METRICS, TERMS, {})
ACTIONS_STAGE = stage(ACTIONS, {}, {"container_load": LOADS})
LOOP = LoopModel(
    name="store",
    rates=("battery_drain",),
    analyse=("safety", "power_autonomy"),
    adapt=("course", "speed"),
    execute=("mission",),
)
MAPE = MapeModel(
    loops=(LOOP,),
    metrics=METRICS_STAGE,
    actions=ACTIONS_STAGE,
    rates=(DRAIN,),
    courses=(COURSE,),
    parameters=(SPEED,),
    trees=(MISSION,),
)
UNFILTERED = replace(COURSE, smooth_s=0.0, lead=0.0, hold_s=0.0, dwell_s=0.0)


class Shop:
    """The shop in simulated or real time; a test decides what its agents write."""

    def __init__(
        self,
        model: MapeModel = MAPE,
        *,
        clock: Clock | None = None,
        record: EventLog | None = None,
        robot: Robot | None = None,
        planner: Planners = Planning,
        context: ContextModel | None = None,
    ) -> None:
        self.clock = SimClock() if clock is None else clock
        self.codra: ContextManager[str, str] = ContextManager(
            context or MODEL, clock=self.clock, resources={}, record=record, knowledge=KNOWLEDGE
        )
        writers = ("people", "power", "picker", "base")
        self.agents = {name: self.codra.agent(name) for name in writers}
        self.mission = self.codra.knowledge.as_agent("mission")
        self.driver = self.codra.knowledge.as_agent("driver")
        if robot is None:
            robot = Robot()
            for name in CHOICES:
                robot.can(name, partial(Task, f"to_{name}", self.mission, self.codra.knowledge))
        self.mape = Mape(self.codra, model, clock=self.clock, robot=robot, planner=planner)

    def write(
        self,
        *,
        person: float | None = None,
        battery: float | None = None,
        load: str | None = None,
        bumped: bool | None = None,
    ) -> None:
        """Write the given values."""
        writes = (
            ("people", "person_distance", person),
            ("power", "battery_level", battery),
            ("picker", "container_load", load),
            ("base", "bumped", bumped),
        )
        for agent, name, value_ in writes:
            if value_ is not None:
                self.agents[agent].set(name, value_)

    def pass_s(self, duration_s: float, *, person: float = 6.0, battery: float = 80.0) -> None:
        """Let time pass in which the sensors repeat the same values, twice a second."""
        for _ in range(round(duration_s * 2)):
            self.write(person=person, battery=battery)
            self.clock.sleep(0.5)

    def begin(self) -> None:
        """Start the loop, in a calm shop with an empty container."""
        self.write(person=6.0, battery=80.0, load="empty", bumped=False)
        self.mape.start()
        self.pass_s(12.0)

    def course(self) -> str:
        """Return the action of the course."""
        return self.mape.course_state("course").state.action

    def events(self, *whats: str) -> list[Event]:
        """Return the events that the loop has recorded, given what happened in them."""
        return [event for event in self.codra.record.of(Kind.ADAPTATION) if event.what in whats]

    def stage(self, task: str) -> Stage | None:
        """Return the stage of a task."""
        return self.codra.knowledge.snapshot().handover(task).stage
