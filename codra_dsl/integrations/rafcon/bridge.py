"""Between the states of a state machine and the context manager."""

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

from codra_dsl.integrations.rafcon.annotations import KEY, Annotation, annotated, value_text
from codra_dsl.runtime import Clock, ContextManager, DecisionState, PendingDecision, Skill

Result = TypeVar("Result")

_SLICE_S = 0.1
"""A decision that waits looks so often whether its state was preempted."""

_ABORTED = -1
_PREEMPTED = -2


class Answers(StrEnum):
    """How decisions are answered."""

    CONTEXT = "context"
    """From context, or else by the state that looks."""
    SHADOW = "shadow"
    """By the state that looks, in any case; the record says whether context agrees, and nothing is kept."""


def directly(function: Callable[[], Result]) -> Result:
    """Run a function here and now, in the thread of the state."""
    return function()


class Bridge:
    """What states ask of the context manager.

    While a state machine is `attached`, its annotated states declare, act and decide by themselves, and scripts find
    the bridge as the global variable `codra`.
    """

    def __init__(
        self,
        codra: ContextManager[Any, Any],
        clock: Clock,
        *,
        answers: Answers = Answers.CONTEXT,
        do: Callable[[Callable[[], Any]], Any] = directly,
    ) -> None:
        """Bridge to a context manager.

        Args:
            codra: which.
            clock: the one that it was started with.
            answers: how decisions are answered.
            do: runs whatever touches the context manager or the clock; in simulated time in the clock's thread.
        """
        self._codra = codra
        self._clock = clock
        self._answers = answers
        self._do = do
        self._begun: dict[str, Skill] = {}
        self._acted_s: dict[str, float] = {}

    @contextmanager
    def attached(self, machine: StateMachine) -> Iterator[None]:
        """Let a state machine decide on context until the end of the `with` statement.

        Raises:
            AnnotationError: if the semantic data of its states is wrong.
        """
        found = annotated(machine.root_state, self._codra)
        for state, annotation in found:
            self._wrap(state, annotation)
        global_variable_manager.set_variable(KEY, self, per_reference=True)
        try:
            yield
        finally:
            global_variable_manager.delete_variable(KEY)
            for state, _ in found:
                del state.run

    # What states of the library ask

    def expect(self, *skills: str) -> None:
        """Say which skills come next."""
        self._do(lambda: self._codra.expect(*skills))

    def set(self, variable: str, value: object) -> None:
        """Write a variable as the main execution."""
        self._do(lambda: self._codra.set(variable, value))

    def decide(
        self, state: State, variable: str, *, wait_up_to_s: float = 0.0, max_age_s: float = math.inf
    ) -> str | None:
        """Return the value from context as text, or None: then the state machine goes on to look.

        Args:
            state: that asks; it stops waiting when it is preempted.
            variable: whose value it needs.
            wait_up_to_s: how long it waits for observers.
            max_age_s: older evidence does not do.
        """
        question = self._asked(state, variable, wait_up_to_s, max_age_s)
        if question.step is DecisionState.ANSWERED:
            return value_text(question.value)
        self._do(lambda: question.abandon("preempted") if _is_preempted(state) else question.found(None))
        return None

    # What annotated states do

    def _wrap(self, state: State, annotation: Annotation) -> None:
        """Put what a state says around its `run`, which its thread calls."""
        run = state.run

        def bridged() -> None:
            if state.backward_execution:
                run()
                return
            try:
                with ExitStack() as stack:
                    self._begin(annotation, stack)
                    if annotation.decide:
                        self._look_unless_known(state, annotation, run)
                    else:
                        run()
            except Exception as error:  # noqa: BLE001 - as RAFCON treats what a script raises
                state.output_data["error"] = error
                self._finish(state, _ABORTED)

        state.run = bridged

    def _begin(self, annotation: Annotation, stack: ExitStack) -> None:
        if annotation.skill:
            self._enter_skill(annotation.skill, stack)
        if annotation.expect:
            self.expect(*annotation.expect)
        if annotation.acting:
            self._enter_action(annotation.acting, stack)

    def _enter_skill(self, name: str, stack: ExitStack) -> None:
        under_way = ExitStack()
        self._begun[name] = self._do(lambda: under_way.enter_context(self._codra.skill(name)))
        stack.callback(self._do, under_way.close)

    def _enter_action(self, name: str, stack: ExitStack) -> None:
        if name not in self._begun:
            raise RuntimeError(f"skill {name!r} is not under way: attach the bridge before it begins")
        skill, under_way = self._begun[name], ExitStack()

        def end() -> None:
            under_way.close()
            self._acted_s.update(dict.fromkeys(skill.model.changes, self._clock.now_s()))

        self._do(lambda: under_way.enter_context(skill.acting()))
        stack.callback(self._do, end)

    def _look_unless_known(self, state: State, annotation: Annotation, look: Callable[[], None]) -> None:
        state.preempted = False  # as it was left by an earlier run; `run` itself begins so
        state.state_execution_status = StateExecutionStatus.ACTIVE
        question = self._asked(state, annotation.decide, annotation.wait_up_to_s, annotation.max_age_s)
        if question.step is DecisionState.ANSWERED:
            self._leave_out(state, annotation.outcome_of(question.value))
            return
        if _is_preempted(state):
            self._do(lambda: question.abandon("preempted"))
            self._finish(state, _PREEMPTED)
            return
        look()
        seen = self._seen(state, annotation)
        self._do(lambda: question.found(seen))

    def _seen(self, state: State, annotation: Annotation) -> object:
        """Return the value that a state's outcome says; None if it says none."""
        values = {name: value for value, name in annotation.outcomes.items()} or {"true": "true", "false": "false"}
        text = values.get(state.final_outcome.name)
        return {"true": True, "false": False}.get(text, text) if text is not None else None

    def _asked(self, state: State, variable: str, wait_up_to_s: float, max_age_s: float) -> PendingDecision:
        """Ask a decision and wait for it; what was seen before the end of an action that changes it does not count."""
        question: PendingDecision = self._do(
            lambda: self._codra.ask(
                variable,
                since_s=self._acted_s.get(variable, -math.inf),
                wait_up_to_s=wait_up_to_s,
                max_age_s=max_age_s,
                shadow=self._answers is Answers.SHADOW,
            )
        )
        while question.step is DecisionState.WAITING and not _is_preempted(state):
            self._do(lambda: question.wait(_SLICE_S))
        return question

    def _leave_out(self, state: State, outcome: str) -> None:
        """Let a state end with an outcome, by name, as if it had run."""
        state.setup_run()
        if isinstance(state, ContainerState):
            state.execution_history.push_call_history_item(state, CallType.CONTAINER, state, state.input_data)
            state.execution_history.push_return_history_item(state, CallType.CONTAINER, state, state.output_data)
        numbers = [number for number, each in state.outcomes.items() if each.name == outcome]
        if not numbers:
            raise ValueError(f"context says {outcome!r}, for which {state.name!r} has no outcome")
        self._finish(state, numbers[0])

    def _finish(self, state: State, outcome: int) -> None:
        state.state_execution_status = StateExecutionStatus.WAIT_FOR_NEXT_STATE
        state.finalize(state.outcomes[outcome])


def _is_preempted(state: State) -> bool:
    """Return whether a state is to stop, or one around it: RAFCON tells those that begin just then nothing."""
    around = state.parent
    return bool(state.preempted) or (isinstance(around, State) and _is_preempted(around))
