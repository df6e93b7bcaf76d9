"""MAPE-K loops: they analyse knowledge, choose courses, set parameters and execute trees (P2, Figure 3).

A loop is an agent like any other agent. It analyses at its period, when an input changes, and when its filters are due;
it ticks its trees at their periods. A round is the analysis, if one is due, and then the ticks of the trees that are
due. In simulated time a round runs at once. In real time each round runs in a separate thread, so an action that hangs
blocks only its own loop.

The events that a loop records are inputs of a replay, like the values that agents write: a replay reads them from the
journal and does not run the engines again.
"""

from __future__ import annotations

import logging
import math
import threading
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any, Self

from codra_dsl.isolation.error_text import described, loggable
from codra_dsl.runtime.behavior_trees import Robot
from codra_dsl.runtime.behavior_trees.node import Leaves
from codra_dsl.runtime.callbacks import Subscription
from codra_dsl.runtime.clock import Clock, Timer, Work, is_interrupt
from codra_dsl.runtime.context.package_files import package_folder, places_in
from codra_dsl.runtime.context.shared_acquisition import SharedAcquisition, shared_declaration
from codra_dsl.runtime.errors import unknown_name_error
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.loops.agent_writers import AgentWriters, Manager
from codra_dsl.runtime.loops.courses import CourseState, Decision
from codra_dsl.runtime.loops.declarations import LoopModel, MapeModel, TreeModel
from codra_dsl.runtime.loops.event_details import (
    analysis_of,
    chain_of,
    counterfactual_details,
    evidence_of,
    rate_details,
    without_none_values,
)
from codra_dsl.runtime.loops.execution import Execution
from codra_dsl.runtime.loops.never_known import NeverKnownInputs
from codra_dsl.runtime.loops.places import with_places
from codra_dsl.runtime.loops.planning import Plan, Planner, Planners, Planning, Setting, VariableWrite
from codra_dsl.runtime.loops.renewal import Renewals
from codra_dsl.runtime.loops.self_dependence import MAX_CHANGES_IN_A_ROW, SelfDependence, fed_back_inputs
from codra_dsl.runtime.values.cell import Reading

_LOGGER = logging.getLogger(__name__)


class Mape:
    """All loops of a spec. Use it as a Python context manager, so that all trees are halted at the end.

    Attributes:
        model: the model of the loops, with places.
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
            codra: the context that the loops read and write.
            model: the model of the loops.
            clock: the clock of `codra`.
            robot: provides the action of each leaf of the trees. Give a mapping from names of trees to robots if leaves
                of the same name are different actions in different trees. Not needed without trees.
            planner: makes the planner of each loop, which analyses and decides.

        Raises:
            TreeError: if the robot does not have the action of a leaf.
            UnknownNameError: if a loop uses a name that is not declared.
            ValueError: if the course of a tree does not exist, or the tree has no branch for one of its actions.
            AgentTakenError: if the handle of the analyst or of the adapter is already taken.
        """
        self.model = model = with_places(model, places_in(package_folder(codra), codra.model.name))
        self._writers = AgentWriters(codra, model)
        leaves = _robots_of_trees(model, Robot() if robot is None else robot)
        types = {variable.name: variable.type for variable in codra.model.variables}
        try:
            planners = {loop.name: planner(model, loop, types) for loop in model.loops}
            watches = {name: loop_planner.watches() for name, loop_planner in planners.items()}
            fed_back = fed_back_inputs(model, watches, codra.model.variables)
            shared = (codra, model, clock, leaves, self._writers)
            self._loops = {
                loop.name: Loop(loop, planners[loop.name], fed_back[loop.name], *shared) for loop in model.loops
            }
        except BaseException:
            self._writers.close()  # the exception can keep this object alive
            raise

    def __enter__(self) -> Self:
        self.start()
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def start(self) -> None:
        """Start all loops that do not run yet."""
        for loop in self._loops.values():
            loop.start()

    def stop(self) -> None:
        """Stop all loops and halt all trees; `start` continues with the present courses."""
        for loop in self._loops.values():
            loop.stop()

    def close(self) -> None:
        """Stop all loops, and close the handles of the analyst and of the adapter."""
        self.stop()
        self._writers.close()

    def loop(self, name: str) -> Loop:
        """Return one loop.

        Raises:
            UnknownNameError: if no loop has this name.
        """
        if name not in self._loops:
            raise unknown_name_error("loop", name, self._loops)
        return self._loops[name]

    def decisions(self, course: str) -> tuple[Decision, ...]:
        """Return the newest decisions of a course, each with the assessment that led to it."""
        return tuple(self._loop_of(course).planning.decisions[course])

    def course_state(self, course: str) -> CourseState:
        """Return the state of a course: the action, the filter, and the metrics at the time of its choice."""
        return self._loop_of(course).planning.course_state(course)

    def _loop_of(self, course: str) -> Loop:
        for loop in self._loops.values():
            if course in loop.planning.courses:
                return loop
        raise unknown_name_error("course", course, [course_model.name for course_model in self.model.courses])


class Loop:
    """One loop.

    Attributes:
        planning: the planner of the loop.
        trees: the trees that the loop executes, by name.
    """

    def __init__(  # noqa: PLR0917 - the arguments of Mape
        self,
        loop: LoopModel,
        planning: Planner,
        fed_back: frozenset[str],
        codra: Manager,
        model: MapeModel,
        clock: Clock,
        leaves: Mapping[str, Leaves],
        writers: AgentWriters,
    ) -> None:
        """Make a loop, or raise an error of `Mape`. Its own results can change the inputs in `fed_back`."""
        self._codra = codra
        self._model = model
        self._loop = loop
        self._clock = clock
        self._writers = writers
        _check_names(model, loop)
        self.planning = planning
        self.trees = {
            tree.name: self._create_execution(tree, leaves[tree.name])
            for tree in model.trees
            if tree.name in loop.execute
        }
        self._lock = new_lock()
        self._is_on = False
        self._is_busy = False
        self._has_changed = False
        self._analysis_due_s = -math.inf
        self._self_dependence = SelfDependence(fed_back)
        valid_for_s = {variable.name: variable.valid_for_s for variable in codra.model.variables}
        parameters = [parameter for parameter in model.parameters if parameter.name in loop.adapt]
        self._renewals = Renewals(model.adapter, {name.variable: valid_for_s[name.variable] for name in parameters})
        self._never_known = NeverKnownInputs(planning.model, loop)
        self._unexplained_decisions: list[Decision] = []
        self._is_explaining = False
        self._timer: Timer | None = None
        self._subscription: Subscription | None = None
        watched_variables = planning.watches()
        observed_variables = codra.model.observed_variables
        declared_variables = [
            name for name in watched_variables if name in observed_variables
        ]  # the loop decides on these variables (P1, Equation 4)
        self._declaration = shared_declaration(codra.commands, f"loop {loop.name}", declared_variables)
        self._listener = SharedAcquisition(self._start_listening, self._stop_listening)
        self._idle_event = threading.Event()
        self._idle_event.set()

    def _create_execution(self, model: TreeModel, leaves: Leaves) -> Execution:
        courses = [course for course in self._model.courses if course.name == model.course]
        missing_actions = [action for course in courses for action in course.choose if action not in model.branches]
        if missing_actions or (model.course and not courses):
            missing_text = (
                f"no branch for {', '.join(missing_actions)}"
                if missing_actions
                else f"no course {model.course!r} to follow"
            )
            raise ValueError(f"the tree {model.name!r} has {missing_text}")
        try:
            knowledge = self._codra.knowledge
        except LookupError:
            knowledge = None
        return Execution(
            model,
            leaves=leaves,
            clock=self._clock,
            knowledge=knowledge,
            abort_s=min((course.abort_s for course in courses), default=0.0),
            record_event=self._record_event,
        )

    @property
    def is_running(self) -> bool:
        """Return whether the loop has been started and not stopped since."""
        return self._is_on

    def start(self) -> None:
        """Analyse at once, then keep running."""
        with self._lock:
            if self._is_on:
                return
            self._is_on, self._has_changed = True, True
        self.planning.resume()
        self._never_known.resume()
        self._record_event(self._loop.name, "started", {"adapts": list(self._loop.adapt)})
        self._declaration.begin()
        self._listener.begin()
        self._schedule_round(self._clock.now_s())

    def stop(self) -> None:
        """Stop, and halt the trees.

        If a round is running in another thread, wait for its end first, but at most for the longest `abort_s` of the
        courses.
        """
        with self._lock:
            if not self._is_on:
                return
            self._is_on = False
            if self._timer is not None:
                self._timer.cancel()
                self._timer = None
        self._listener.end()
        self._idle_event.wait(max((course.abort_s for course in self.planning.courses.values()), default=0.0))
        for tree in self.trees.values():
            self._attempt(tree.halt)
        self._declaration.end()
        self._record_event(self._loop.name, "stopped", {})

    def _start_listening(self) -> None:
        watched_variables = self.planning.watches()
        if watched_variables:
            self._subscription = self._codra.subscribe(watched_variables, self._on_change)

    def _stop_listening(self) -> None:
        if self._subscription is not None:
            self._subscription.unsubscribe()

    # Scheduling

    def _on_change(self, reading: Reading[Any]) -> None:
        with self._lock:
            self._has_changed = True
            self._self_dependence.note_input(reading.name)
            due_s = self._next_analysis_s()
        self._schedule_round(due_s)

    def _next_analysis_s(self) -> float:
        """Return when to analyse changes: now, or a period later if only the loop's own results keep changing."""
        now_s = self._clock.now_s()
        return now_s + self._loop.period_s if self._self_dependence.must_pause(now_s) else now_s

    def _schedule_round(self, instant_s: float) -> None:
        with self._lock:
            if not self._is_on or self._is_busy:
                return  # the running round checks again at its end
            if self._timer is not None:
                if self._timer.instant_s <= instant_s:
                    return
                self._timer.cancel()
            self._timer = self._clock.call_at(instant_s, self._begin_round)

    def _begin_round(self) -> None:
        with self._lock:
            self._timer = None
            if not self._is_on or self._is_busy:
                return
            self._is_busy = True
            self._idle_event.clear()
        try:
            self._clock.start(self._run_round_as_work, _ignore)
        except RuntimeError:  # no thread could be started: the loop tries again after a period
            _LOGGER.exception("the loop %r could not run", self._loop.name)
            self._end_round(self._clock.now_s() + self._loop.period_s)

    def _run_round_as_work(self, _: Work) -> None:
        due_s = self._clock.now_s() + self._loop.period_s
        try:
            due_s = self._run_round()
        finally:
            self._end_round(due_s)

    def _attempt(self, run_part: Callable[[], None]) -> None:
        """Run a part of a round. If it fails, the other parts run nevertheless."""
        try:
            run_part()
        except BaseException as error:
            if is_interrupt(error):
                raise
            _LOGGER.error("a part of the loop %r failed", self._loop.name, exc_info=loggable(error))
            self._record_event(self._loop.name, "failed", {"message": described(error)})

    def _end_round(self, due_s: float) -> None:
        with self._lock:
            self._is_busy = False
            self._idle_event.set()
            if self._has_changed:
                due_s = min(due_s, self._next_analysis_s())
        self._schedule_round(due_s)

    # A round

    def _run_round(self) -> float:
        """Run one round, and return the instant at which the next round is due."""
        with self._lock:
            is_due = self._has_changed or self._clock.now_s() >= self._analysis_due_s
            self._has_changed = False
            if is_due:
                self._self_dependence.begin_analysis()
        if is_due:
            self._analysis_due_s = self._clock.now_s() + self._loop.period_s
            self._attempt(self._analyse)
        for tree in self.trees.values():
            if self._clock.now_s() >= tree.due_s:
                self._attempt(tree.tick)
        if self._unexplained_decisions and not self._is_explaining:
            self._attempt(self._explain_in_background)
        return min([self._analysis_due_s, *(tree.due_s for tree in self.trees.values())])

    def _analyse(self) -> None:
        now_s = self._clock.now_s()
        plan = self.planning.plan(self._codra, now_s)
        self._analysis_due_s = min(now_s + self._loop.period_s, plan.due_s)
        for variable_write in plan.values_to_write:
            self._attempt(partial(self._writers.write, self._model.analyst, variable_write, now_s))
        for observation in plan.rate_changes:
            rate = next(rate for rate in self._model.rates if rate.variable == observation.variable)
            self._attempt(partial(self._record_event, self._loop.name, "computed", rate_details(rate, observation)))
        if plan.changed:
            details = analysis_of(self.planning.model, plan.assessment, plan.changed)
            self._attempt(partial(self._record_event, self._loop.name, "analysed", details))
        for decision in plan.decisions:
            self._attempt(partial(self._switch_course, decision))
            if decision.before:
                self._unexplained_decisions.append(decision)
        for setting in plan.settings:
            self._attempt(partial(self._set_parameter, setting))
        for refusal in plan.refusals:
            event_details = {"variable": refusal.parameter.variable, "message": refusal.message}
            self._attempt(partial(self._record_event, refusal.parameter.name, "failed", event_details))
        self._renew_parameters(plan, now_s)
        self._report_never_known_inputs(plan, now_s)
        self._count_changes(plan, now_s)

    def _renew_parameters(self, plan: Plan, now_s: float) -> None:
        """Write the parameters again whose values this analysis confirms, if half of their validity is over."""
        readings = self._codra.readings(self._renewals.variables)
        for variable_write in self._renewals.renew(readings, plan.unconfirmed, now_s):
            self._attempt(partial(self._writers.write, self._model.adapter, variable_write, now_s))
        self._analysis_due_s = min(self._analysis_due_s, self._renewals.due_s)

    def _report_never_known_inputs(self, plan: Plan, now_s: float) -> None:
        for observation, waited_s in self._never_known.overdue(plan.assessment.scene, now_s):
            message = f"{observation.variable!r} was not known during {waited_s:g} s: {observation.because}"
            _LOGGER.warning("an input of the loop %r was never known: %s", self._loop.name, message)
            event_details = {"variable": observation.variable, "message": message}
            self._attempt(partial(self._record_event, self._loop.name, "never_known", event_details))

    def _count_changes(self, plan: Plan, now_s: float) -> None:
        """Count the changes of one analysis, and report what depends on itself."""
        changed_names = [
            *(decision.course for decision in plan.decisions),
            *(setting.parameter.name for setting in plan.settings),
            *plan.changed,
        ]
        with self._lock:
            names = self._self_dependence.end_analysis(changed_names, now_s)
        for name in names:
            message = f"'{name}' has changed {MAX_CHANGES_IN_A_ROW} times in a row: it depends on itself"
            self._record_event(self._loop.name, "failed", {"message": message})

    def _switch_course(self, decision: Decision) -> None:
        course = self.planning.courses[decision.course]
        now_s = decision.instant_s
        self._record_event(course.name, "chosen", chain_of(self._loop.name, course, decision))
        for tree in self.trees.values():
            if tree.model.course == course.name:
                self._attempt(partial(tree.choose, decision.action))
        if course.variable:
            variable_write = VariableWrite(variable=course.variable, value=decision.action, evidence_s=now_s)
            self._writers.write(self._model.adapter, variable_write, now_s)

    def _explain_in_background(self) -> None:
        """Record counterfactuals outside the rounds, because no decision should wait for this long computation."""
        decisions, self._unexplained_decisions = self._unexplained_decisions, []
        self._clock.start(lambda _: self._explain_all(decisions), _ignore)

    def _explain_all(self, decisions: Sequence[Decision]) -> None:
        self._is_explaining = True
        for decision in decisions:
            self._attempt(partial(self._explain, decision))
        self._is_explaining = False

    def _explain(self, decision: Decision) -> None:
        """Record the counterfactuals of a decision, unless the loop has been stopped meanwhile."""
        course = self.planning.courses[decision.course]
        counterfactuals = self.planning.kept_by(decision)
        event_details = {"variable": course.variable or None, "action": decision.action, "before": decision.before}
        if self._is_on:
            self._record_event(
                course.name, "explained", {**event_details, "kept_by": counterfactual_details(counterfactuals)}
            )

    def _set_parameter(self, setting: Setting) -> None:
        model = setting.parameter
        variable_write = VariableWrite(variable=model.variable, value=setting.value, evidence_s=setting.instant_s)
        self._writers.write(self._model.adapter, variable_write, setting.instant_s)
        self._renewals.confirm(variable_write)
        was_set = math.isfinite(setting.since_s)
        self._record_event(
            model.name,
            "set",
            {
                "variable": model.variable,
                "value": setting.value,
                "rule": model.text,
                "place": model.place or None,
                "because": _reason_text(setting),
                "since_s": setting.since_s if was_set else None,
                "dwell_until_s": setting.since_s + model.dwell_s if was_set else None,
                **evidence_of(setting.assessment, model.value.variables()),
            },
        )

    def _record_event(self, name: str, what: str, details: Mapping[str, object]) -> None:
        event_details = {"loop": self._loop.name, **details}
        course = self.planning.courses.get(str(details.get("course", "")))
        if course is not None:  # so that a search for the variable also finds events about branches of the course
            event_details["variable"] = course.variable or None
        self._codra.commands.adapt(self._model.adapter, name, what, without_none_values(event_details))


def _reason_text(setting: Setting) -> str:
    if setting.is_otherwise:
        return "unknown"
    return "worse" if setting.is_urgent else "changed" if math.isfinite(setting.since_s) else "first"


def _robots_of_trees(model: MapeModel, robot: Leaves | Mapping[str, Leaves]) -> Mapping[str, Leaves]:
    """Return a mapping from each tree to its robot; a tree without an entry in `robot` gets a robot without actions."""
    if isinstance(robot, Mapping):
        return {tree.name: robot.get(tree.name, Robot()) for tree in model.trees}
    return {tree.name: robot for tree in model.trees}


def _ignore(_: object) -> None:
    pass


def _check_names(model: MapeModel, loop: LoopModel) -> None:
    """Raise an error if a loop uses a name that is not declared."""
    metrics = () if model.metrics is None else model.metrics.outputs
    used_and_declared_names = {
        "rate": (loop.rates, [rate.variable for rate in model.rates]),
        "metric": (loop.analyse, [metric.name for metric in metrics]),
        "course or parameter": (
            loop.adapt,
            [*(course.name for course in model.courses), *(parameter.name for parameter in model.parameters)],
        ),
        "tree": (loop.execute, [tree.name for tree in model.trees]),
    }
    for kind, (used_names, declared_names) in used_and_declared_names.items():
        for name in used_names:
            if name not in declared_names:
                raise unknown_name_error(kind, name, declared_names)
