"""The bridge between the states of a state machine and the context manager."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from enum import StrEnum
from typing import Any, TypeVar

from rafcon.core.execution.execution_history_items import CallType
from rafcon.core.singleton import global_variable_manager
from rafcon.core.state_machine import StateMachine
from rafcon.core.states.container_state import ContainerState
from rafcon.core.states.state import State, StateExecutionStatus

from codra_dsl.integrations.rafcon.annotations import KEY, Annotation, annotated_states, value_text
from codra_dsl.runtime import (
    Clock,
    ContextManager,
    DecisionState,
    PendingDecision,
    PendingPreview,
    PreviewAnswer,
    Skill,
    UnknownVariable,
)

Result = TypeVar("Result")

_PREEMPTION_CHECK_PERIOD_S = 0.1
"""The interval at which a waiting decision checks whether its state was preempted."""

_ABORTED_OUTCOME_ID = -1
_PREEMPTED_OUTCOME_ID = -2


class Answers(StrEnum):
    """How decisions are answered."""

    CONTEXT = "context"
    """From context; if context does not know the value, by the state that looks."""
    SHADOW = "shadow"
    """Always by the state that looks; the event log records whether context agrees, and the value is not kept."""


def call_directly(function: Callable[[], Result]) -> Result:
    """Call a function immediately, in the thread of the state."""
    return function()


class Bridge:
    """Gives states access to the context manager.

    While a state machine is `attached`, its annotated states declare, act and decide automatically, and scripts can use
    the bridge as the global variable `codra`.
    """

    def __init__(
        self,
        codra: ContextManager[Any, Any],
        clock: Clock,
        *,
        answers: Answers = Answers.CONTEXT,
        do: Callable[[Callable[[], Any]], Any] = call_directly,
    ) -> None:
        """Connect states to a context manager.

        Args:
            codra: the context manager.
            clock: the clock of the context manager.
            answers: how decisions are answered.
            do: calls a function that uses the context manager or the clock; in simulated time, in the clock's thread.
        """
        self._codra = codra
        self._clock = clock
        self._answers = answers
        self._call = do
        self._running_skills: dict[str, Skill] = {}
        self._action_ends_s: dict[str, float] = {}

    @contextmanager
    def attached(self, machine: StateMachine) -> Iterator[None]:
        """Let a state machine decide on context until the end of the `with` statement.

        Raises:
            AnnotationError: if the semantic data of its states is wrong.
        """
        annotations = annotated_states(machine.root_state, self._codra)
        for state, annotation in annotations:
            self._wrap(state, annotation)
        global_variable_manager.set_variable(KEY, self, per_reference=True)
        try:
            yield
        finally:
            global_variable_manager.delete_variable(KEY)
            for state, _ in annotations:
                del state.run

    # For states of the library

    def expect(self, *skills: str) -> None:
        """Announce the skills that come next."""
        self._call(lambda: self._codra.expect(*skills))

    def set(self, variable: str, value: object) -> None:
        """Write a variable as the main execution."""
        self._call(lambda: self._codra.set(variable, value))

    def decide(
        self, state: State, variable: str, *, wait_up_to_s: float = 0.0, max_age_s: float = math.inf
    ) -> str | None:
        """Return the value from context as text; None if the state machine should look.

        Args:
            state: the state that needs the value; the wait ends when this state is preempted.
            variable: the context-variable.
            wait_up_to_s: how long the decision waits for observers.
            max_age_s: a value with older evidence is treated as unknown.
        """
        pending_decision = self._wait_for_decision(state, variable, wait_up_to_s, max_age_s)
        if pending_decision.state is DecisionState.ANSWERED:
            return value_text(pending_decision.value)
        self._call(
            lambda: (
                pending_decision.abandon("preempted") if _is_preempted(state) else pending_decision.record_result(None)
            )
        )
        return None

    def preview(
        self, state: State, skill: str, *, wait_up_to_s: float = 0.0, max_age_s: float = math.inf
    ) -> PreviewAnswer:
        """Return the answer to the preview of a skill: one decision on everything that the skill needs.

        With `Answers.SHADOW`, the context is not asked and each variable of the preview is unknown, so that the state
        machine looks as it does without CoDRA.

        Args:
            state: the state that needs the answer; the wait ends when this state is preempted.
            skill: the skill that comes next.
            wait_up_to_s: how long the preview waits for observers.
            max_age_s: a value with older evidence is treated as unknown.
        """
        if self._answers is Answers.SHADOW:
            return self._unknown_answer(skill)
        pending_preview: PendingPreview = self._call(
            lambda: self._codra.ask_preview(
                skill, since_s=self._action_ends_s, wait_up_to_s=wait_up_to_s, max_age_s=max_age_s
            )
        )
        self._wait(state, pending_preview)
        self._call(lambda: pending_preview.abandon("preempted"))
        return pending_preview.answer

    def _unknown_answer(self, skill: str) -> PreviewAnswer:
        names = self._call(self._codra.skills)[skill].preview
        unknown = tuple(UnknownVariable(name=name, reason="shadow") for name in names)
        return PreviewAnswer(skill=skill, undecided=names, unknown=unknown)

    # For annotated states

    def _wrap(self, state: State, annotation: Annotation) -> None:
        """Wrap the method `run`, which the thread of a state calls, with the effects of the state's annotation."""
        run = state.run

        def run_with_context() -> None:
            if state.backward_execution:
                run()
                return
            try:
                with ExitStack() as stack:
                    self._begin(annotation, stack)
                    if annotation.decide:
                        self._run_unless_known(state, annotation, run)
                    else:
                        run()
            except Exception as error:  # noqa: BLE001 - RAFCON treats errors of scripts the same way
                state.output_data["error"] = error
                self._finish(state, _ABORTED_OUTCOME_ID)

        state.run = run_with_context

    def _begin(self, annotation: Annotation, stack: ExitStack) -> None:
        if annotation.skill:
            self._enter_skill(annotation.skill, stack)
        if annotation.expect:
            self.expect(*annotation.expect)
        if annotation.acting:
            self._enter_action(annotation.acting, stack)

    def _enter_skill(self, name: str, stack: ExitStack) -> None:
        exit_stack = ExitStack()
        self._running_skills[name] = self._call(lambda: exit_stack.enter_context(self._codra.skill(name)))
        stack.callback(self._call, exit_stack.close)

    def _enter_action(self, name: str, stack: ExitStack) -> None:
        if name not in self._running_skills:
            raise RuntimeError(f"skill {name!r} is not running: attach the bridge before it begins")
        skill, exit_stack = self._running_skills[name], ExitStack()

        def end_action() -> None:
            exit_stack.close()
            self._action_ends_s.update(dict.fromkeys(skill.model.changes, self._clock.now_s()))

        self._call(lambda: exit_stack.enter_context(skill.acting()))
        stack.callback(self._call, end_action)

    def _run_unless_known(self, state: State, annotation: Annotation, look: Callable[[], None]) -> None:
        state.preempted = False  # an earlier run may have set it; `run` itself begins with the same assignment
        state.state_execution_status = StateExecutionStatus.ACTIVE
        pending_decision = self._wait_for_decision(
            state, annotation.decide, annotation.wait_up_to_s, annotation.max_age_s
        )
        if pending_decision.state is DecisionState.ANSWERED:
            self._skip(state, annotation.outcome_of(pending_decision.value))
            return
        if _is_preempted(state):
            self._call(lambda: pending_decision.abandon("preempted"))
            self._finish(state, _PREEMPTED_OUTCOME_ID)
            return
        look()
        value = self._value_of_outcome(state, annotation)
        self._call(lambda: pending_decision.record_result(value))

    def _value_of_outcome(self, state: State, annotation: Annotation) -> object:
        """Return the value that the outcome of a state means; None if the outcome means no value."""
        value_by_outcome = {name: value for value, name in annotation.outcomes.items()} or {
            "true": "true",
            "false": "false",
        }
        text = value_by_outcome.get(state.final_outcome.name)
        return {"true": True, "false": False}.get(text, text) if text is not None else None

    def _wait_for_decision(self, state: State, variable: str, wait_up_to_s: float, max_age_s: float) -> PendingDecision:
        """Start a decision and wait for it.

        Evidence from before the end of an action that changes the variable is not used.
        """
        pending_decision: PendingDecision = self._call(
            lambda: self._codra.ask(
                variable,
                since_s=self._action_ends_s,
                wait_up_to_s=wait_up_to_s,
                max_age_s=max_age_s,
                shadow=self._answers is Answers.SHADOW,
            )
        )
        self._wait(state, pending_decision)
        return pending_decision

    def _wait(self, state: State, decision: PendingDecision | PendingPreview) -> None:
        """Wait until a decision does not wait any more, or a state is preempted."""
        while decision.state is DecisionState.WAITING and not _is_preempted(state):
            self._call(lambda: decision.wait(_PREEMPTION_CHECK_PERIOD_S))

    def _skip(self, state: State, outcome: str) -> None:
        """End a state with an outcome, given by name, as if it had run."""
        state.setup_run()
        if isinstance(state, ContainerState):
            state.execution_history.push_call_history_item(state, CallType.CONTAINER, state, state.input_data)
            state.execution_history.push_return_history_item(state, CallType.CONTAINER, state, state.output_data)
        outcome_ids = [
            outcome_id for outcome_id, state_outcome in state.outcomes.items() if state_outcome.name == outcome
        ]
        if not outcome_ids:
            raise ValueError(
                f"the value from context needs the outcome {outcome!r}, which {state.name!r} does not have"
            )
        self._finish(state, outcome_ids[0])

    def _finish(self, state: State, outcome: int) -> None:
        state.state_execution_status = StateExecutionStatus.WAIT_FOR_NEXT_STATE
        state.finalize(state.outcomes[outcome])


def _is_preempted(state: State) -> bool:
    """Return whether a state, or a state around it, should stop.

    RAFCON does not notify states that are just starting.
    """
    parent = state.parent
    return bool(state.preempted) or (isinstance(parent, State) and _is_preempted(parent))
