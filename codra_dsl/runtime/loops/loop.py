"""MAPE-K at run time: loops that analyse knowledge, choose courses, set parameters and execute trees (P2, Figure 3).

A loop is an agent beside the others. It analyses at its period, when an input changes, and when its filters ask for
it; it ticks its trees at their periods. A round of it runs as a piece of work of the clock: at once in simulated time,
in a thread of its own in real time, so that an action that hangs hangs its loop and nothing else.
"""

from __future__ import annotations

import logging
import math
import threading
from collections import Counter
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Self

from codra_dsl.runtime.behavior_trees import Robot
from codra_dsl.runtime.behavior_trees.node import Leaves
from codra_dsl.runtime.callbacks import Subscription
from codra_dsl.runtime.clock import Clock, Timer, Work
from codra_dsl.runtime.context.agents import Agent
from codra_dsl.runtime.context.context import ContextManager
from codra_dsl.runtime.context.package_files import package_folder, places_in
from codra_dsl.runtime.context.shared_acquisition import SharedAcquisition, declaring
from codra_dsl.runtime.errors import unknown
from codra_dsl.runtime.loops.courses import CourseState, Decision
from codra_dsl.runtime.loops.declarations import LoopModel, MapeModel, TreeModel
from codra_dsl.runtime.loops.event_details import analysis_of, chain_of, evidence_of, kept_by, plain
from codra_dsl.runtime.loops.execution import Execution
from codra_dsl.runtime.loops.places import placed
from codra_dsl.runtime.loops.planning import Plan, Planner, Planners, Planning, Setting, Written
from codra_dsl.runtime.values.cell import BEFORE_ALL_S

_LOGGER = logging.getLogger(__name__)

Manager = ContextManager[Any, Any]

MOST_AT_ONCE = 10
"""How often an adaptation may change at one instant before a loop takes it to go round in circles."""


class Mape:
    """All loops of a spec. Use it as a Python context manager, so that all trees are halted in the end.

    Attributes:
        model: what the spec says of them, with places.
    """

    def __init__(
        self,
        codra: Manager,
        model: MapeModel,
        *,
        clock: Clock,
        robot: Leaves | Mapping[str, Leaves] | None = None,
        planner: Planners = Planning,
    ) -> None:
        """Make the loops; nothing runs before `start`.

        Args:
            codra: the context that they read and write.
            model: what the spec says of them.
            clock: the one of `codra`.
            robot: gives each leaf of the trees its action, or by the name of each tree what does, where leaves of one
                name are different actions in different trees; may be left out where there are no trees.
            planner: makes what analyses and decides for each loop.

        Raises:
            TreeError: if the robot lacks an action.
            UnknownNameError: if a loop names what is not declared.
            ValueError: if a tree lacks the branch of an action that its course chooses from, or the course.
            AgentTakenError: if somebody has the handle of the analyst or of the adapter.
        """
        self.model = model = placed(model, places_in(package_folder(codra), codra.model.name))
        self._writers = _AgentWriters(codra, model)
        leaves = _by_tree(model, Robot() if robot is None else robot)
        types = {each.name: each.type for each in codra.model.variables}
        self._loops = {
            each.name: Loop(codra, model, each, clock, leaves, self._writers, planner(model, each, types))
            for each in model.loops
        }

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def start(self) -> None:
        """Let all loops run; one that runs goes on."""
        for loop in self._loops.values():
            loop.start()

    def stop(self) -> None:
        """Let no loop run, and halt all trees; `start` goes on with the courses as they are."""
        for loop in self._loops.values():
            loop.stop()

    def close(self) -> None:
        """Stop, and give the handles of the analyst and of the adapter back."""
        self.stop()
        self._writers.close()

    def loop(self, name: str) -> Loop:
        """Return one loop.

        Raises:
            UnknownNameError: if there is none of this name.
        """
        if name not in self._loops:
            raise unknown("loop", name, self._loops)
        return self._loops[name]

    def decisions(self, course: str) -> tuple[Decision, ...]:
        """Return the newest decisions of a course, each with its chain."""
        return tuple(self._of(course).planning.decisions[course])

    def course_state(self, course: str) -> CourseState:
        """Return how a course stands: the action, the filter, and the metrics that it was chosen with."""
        return self._of(course).planning.course_state(course)

    def _of(self, course: str) -> Loop:
        for loop in self._loops.values():
            if course in loop.planning.courses:
                return loop
        raise unknown("course", course, [each.name for each in self.model.courses])


class _AgentWriters:
    """The agents that write for the loops, each taken when it is first needed."""

    def __init__(self, codra: Manager, model: MapeModel) -> None:
        self._agents: dict[str, Agent[Any, Any]] = {}
        self._stamps_s: dict[str, float] = {}
        stages = [stage for stage in (model.metrics, model.actions) if stage is not None]
        if model.rates or any(stage.outputs for stage in stages):
            self._agents[model.analyst] = codra.agent(model.analyst)
        if model.parameters or any(course.variable for course in model.courses):
            self._agents[model.adapter] = codra.agent(model.adapter)

    def write(self, agent: str, written: Written, now_s: float) -> None:
        """Write a variable.

        The stamp never goes back, though an input with older evidence may have come in: newer evidence would stand.
        """
        known_s = now_s if written.evidence_s == BEFORE_ALL_S else written.evidence_s
        stamp_s = min(now_s, max(known_s, self._stamps_s.get(written.variable, -math.inf)))
        self._stamps_s[written.variable] = stamp_s
        value = math.nan if written.value is None else written.value  # what is not a number is unknown
        self._agents[agent].set(written.variable, value, evidence_s=stamp_s)

    def close(self) -> None:
        for agent in self._agents.values():
            agent.close()


class Loop:
    """One loop.

    Attributes:
        planning: what it analyses and decides.
        trees: what it executes, by name.
    """

    def __init__(  # noqa: PLR0917 - what Mape was given
        self,
        codra: Manager,
        model: MapeModel,
        loop: LoopModel,
        clock: Clock,
        leaves: Mapping[str, Leaves],
        writers: _AgentWriters,
        planning: Planner,
    ) -> None:
        """Make a loop that does not run yet; it raises what `Mape` does."""
        self._codra = codra
        self._model = model
        self._loop = loop
        self._clock = clock
        self._writers = writers
        _check_names(model, loop)
        self.planning = planning
        self.trees = {
            each.name: self._execution(each, leaves[each.name]) for each in model.trees if each.name in loop.execute
        }
        self._lock = threading.Lock()
        self._is_on = False
        self._is_busy = False
        self._has_changed = False
        self._analysis_due_s = -math.inf
        self._changed_s = -math.inf
        self._changes: Counter[str] = Counter()
        self._unexplained: list[Decision] = []
        self._is_explaining = False
        self._timer: Timer | None = None
        self._subscription: Subscription | None = None
        watched = planning.watches()
        identified = {name for each in codra.model.observers for name in each.identifies}
        declared = [name for name in watched if name in identified]  # a loop decides on it (P1, Equation 4)
        self._declaring = declaring(codra.commands, f"loop {loop.name}", declared)
        self._listening = SharedAcquisition(self._listen, self._listen_no_more)
        self._idle = threading.Event()
        self._idle.set()

    def _execution(self, model: TreeModel, leaves: Leaves) -> Execution:
        courses = [each for each in self._model.courses if each.name == model.course]
        missing = [action for each in courses for action in each.choose if action not in model.branches]
        if missing or (model.course and not courses):
            lacks = f"no branch for {', '.join(missing)}" if missing else f"no course {model.course!r} to follow"
            raise ValueError(f"the tree {model.name!r} has {lacks}")
        try:
            knowledge = self._codra.knowledge
        except LookupError:
            knowledge = None
        return Execution(
            model,
            leaves=leaves,
            clock=self._clock,
            knowledge=knowledge,
            abort_s=min((each.abort_s for each in courses), default=0.0),
            tell=self._tell,
        )

    @property
    def is_running(self) -> bool:
        """Return whether it has been started and not been stopped."""
        return self._is_on

    def start(self) -> None:
        """Analyse at once, and go on."""
        with self._lock:
            if self._is_on:
                return
            self._is_on, self._has_changed = True, True
        self.planning.resume()
        self._tell(self._loop.name, "started", {"adapts": list(self._loop.adapt)})
        self._declaring.begin()
        self._listening.begin()
        self._wake_at(self._clock.now_s())

    def stop(self) -> None:
        """Run no more and halt the trees; a round that is under way in another thread comes to its end first."""
        with self._lock:
            if not self._is_on:
                return
            self._is_on = False
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None
        self._listening.end()
        self._idle.wait(self._longest_abort_s())
        for tree in self.trees.values():
            tree.halt()
        self._declaring.end()
        self._tell(self._loop.name, "stopped", {})

    def _listen(self) -> None:
        watched = self.planning.watches()
        if watched:
            self._subscription = self._codra.subscribe(watched, lambda _: self._changed())

    def _listen_no_more(self) -> None:
        if self._subscription is not None:
            self._subscription.unsubscribe()

    def _longest_abort_s(self) -> float:
        return max((each.abort_s for each in self.planning.courses.values()), default=0.0)

    # When

    def _changed(self) -> None:
        with self._lock:
            self._has_changed = True
        self._wake_at(self._soonest_s())

    def _soonest_s(self) -> float:
        """Return when to analyse what has changed: now, or after a period where one thing changes on and on."""
        now_s = self._clock.now_s()
        is_circling = now_s == self._changed_s and max(self._changes.values(), default=0) >= MOST_AT_ONCE
        return now_s + self._loop.period_s if is_circling else now_s

    def _wake_at(self, instant_s: float) -> None:
        with self._lock:
            if not self._is_on or self._is_busy:
                return  # the round that is under way looks again at its end
            if self._timer is not None:
                if self._timer.instant_s <= instant_s:
                    return
                self._timer.cancel()
            self._timer = self._clock.call_at(instant_s, self._begin)

    def _begin(self) -> None:
        with self._lock:
            self._timer = None
            if not self._is_on or self._is_busy:
                return
            self._is_busy = True
            self._idle.clear()
        try:
            self._clock.start(self._round, _ignore)
        except RuntimeError:  # no thread could be started: the next period tries again
            _LOGGER.exception("the loop %r could not run", self._loop.name)
            self._end(self._clock.now_s() + self._loop.period_s)

    def _round(self, _: Work) -> None:
        due_s = self._clock.now_s() + self._loop.period_s
        try:
            due_s = self._run()
        finally:
            self._end(due_s)

    def _attempt(self, part: Callable[[], None]) -> None:
        """Do a part of a round; the others are done whatever happens in it."""
        try:
            part()
        except Exception as error:
            _LOGGER.exception("a part of the loop %r failed", self._loop.name)
            self._tell(self._loop.name, "failed", {"message": f"{type(error).__name__}: {error}"})

    def _end(self, due_s: float) -> None:
        with self._lock:
            self._is_busy = False
            self._idle.set()
            if self._has_changed:
                due_s = min(due_s, self._soonest_s())
        self._wake_at(due_s)

    # What

    def _run(self) -> float:
        """Run one round; return when the next one is due."""
        with self._lock:
            is_due = self._has_changed or self._clock.now_s() >= self._analysis_due_s
            self._has_changed = False
        if is_due:
            self._analysis_due_s = self._clock.now_s() + self._loop.period_s
            self._attempt(self._analyse)
        for tree in self.trees.values():
            if self._clock.now_s() >= tree.due_s:
                self._attempt(tree.tick)
        if self._unexplained and not self._is_explaining:
            self._attempt(self._explain_beside)
        return min([self._analysis_due_s, *(tree.due_s for tree in self.trees.values())])

    def _analyse(self) -> None:
        now_s = self._clock.now_s()
        plan = self.planning.plan(self._codra, now_s)
        self._analysis_due_s = min(now_s + self._loop.period_s, plan.due_s)
        for written in plan.analysed:
            self._attempt(partial(self._writers.write, self._model.analyst, written, now_s))
        if plan.changed:
            told = analysis_of(self.planning.model, plan.assessment, plan.changed)
            self._attempt(partial(self._tell, self._loop.name, "analysed", told))
        for decision in plan.decisions:
            self._attempt(partial(self._adapt, decision))
            if decision.before:
                self._unexplained.append(decision)
        for setting in plan.settings:
            self._attempt(partial(self._set, setting))
        for refused in plan.refused:
            about = {"variable": refused.parameter.variable, "message": refused.message}
            self._attempt(partial(self._tell, refused.parameter.name, "failed", about))
        self._count(plan, now_s)

    def _count(self, plan: Plan, now_s: float) -> None:
        """Count what changes at one instant, and tell of what follows from itself."""
        if now_s != self._changed_s:
            self._changed_s, self._changes = now_s, Counter()
        changed = [*(each.course for each in plan.decisions), *(each.parameter.name for each in plan.settings)]
        self._changes.update(changed)
        for name in changed:
            if self._changes[name] == MOST_AT_ONCE:
                message = (
                    f"'{name}' has changed {MOST_AT_ONCE} times at one instant: what it follows from follows from it"
                )
                self._tell(self._loop.name, "failed", {"message": message})

    def _adapt(self, decision: Decision) -> None:
        course = self.planning.courses[decision.course]
        now_s = decision.instant_s
        self._tell(course.name, "chosen", chain_of(self._loop.name, course, decision))
        for tree in self.trees.values():
            if tree.model.course == course.name:
                self._attempt(partial(tree.choose, decision.action))
        if course.variable:
            written = Written(variable=course.variable, value=decision.action, evidence_s=now_s)
            self._writers.write(self._model.adapter, written, now_s)

    def _explain_beside(self) -> None:
        """Tell what would have kept courses, beside the rounds: it may take long, and nobody waits for it."""
        left, self._unexplained = self._unexplained, []
        self._clock.start(lambda _: self._explain_all(left), _ignore)

    def _explain_all(self, left: Sequence[Decision]) -> None:
        self._is_explaining = True
        for decision in left:
            self._attempt(partial(self._explain, decision))
        self._is_explaining = False

    def _explain(self, decision: Decision) -> None:
        """Tell what would have kept a course, unless the loop has been stopped meanwhile."""
        course = self.planning.courses[decision.course]
        found = self.planning.kept_by(decision)
        about = {"variable": course.variable or None, "action": decision.action, "before": decision.before}
        if self._is_on:
            self._tell(course.name, "explained", {**about, "kept_by": kept_by(found)})

    def _set(self, setting: Setting) -> None:
        model = setting.parameter
        written = Written(variable=model.variable, value=setting.value, evidence_s=setting.instant_s)
        self._writers.write(self._model.adapter, written, setting.instant_s)
        stood = math.isfinite(setting.since_s)
        self._tell(
            model.name,
            "set",
            {
                "variable": model.variable,
                "value": setting.value,
                "rule": model.text,
                "place": model.place or None,
                "because": "worse" if setting.is_urgent else "changed" if stood else "first",
                "since_s": setting.since_s if stood else None,
                "dwell_until_s": setting.since_s + model.dwell_s if stood else None,
                **evidence_of(setting.assessment, model.value.variables()),
            },
        )

    def _tell(self, name: str, what: str, details: Mapping[str, object]) -> None:
        about = {"loop": self._loop.name, **details}
        course = self.planning.courses.get(str(details.get("course", "")))
        if course is not None:  # so that what becomes of its branch is found by the variable as well
            about["variable"] = course.variable or None
        self._codra.commands.adapt(self._model.adapter, name, what, plain(about))


def _by_tree(model: MapeModel, robot: Leaves | Mapping[str, Leaves]) -> Mapping[str, Leaves]:
    """Return what gives each tree its actions; a tree that is not named has none."""
    if isinstance(robot, Mapping):
        return {each.name: robot.get(each.name, Robot()) for each in model.trees}
    return {each.name: robot for each in model.trees}


def _ignore(_: object) -> None:
    pass


def _check_names(model: MapeModel, loop: LoopModel) -> None:
    """Refuse a loop that names what is not declared."""
    metrics = () if model.metrics is None else model.metrics.outputs
    declared = {
        "rate": (loop.rates, [each.variable for each in model.rates]),
        "metric": (loop.analyse, [each.name for each in metrics]),
        "course or parameter": (
            loop.adapt,
            [*(each.name for each in model.courses), *(each.name for each in model.parameters)],
        ),
        "tree": (loop.execute, [each.name for each in model.trees]),
    }
    for kind, (named, known) in declared.items():
        for name in named:
            if name not in known:
                raise unknown(kind, name, known)
