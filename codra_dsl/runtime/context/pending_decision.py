"""Decisions that a program, such as a behaviour tree, advances in steps, because the program must not block."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import StrEnum
from typing import Any, Generic, TypeVar

from codra_dsl.logic import Value
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.context.commands import Commands
from codra_dsl.runtime.context.decisions import Decision, DecisionContext, Preview, ValueDecision
from codra_dsl.runtime.observers.waiting import wait_until
from codra_dsl.runtime.values.cell import Reading
from codra_dsl.runtime.values.model import NotOfTypeError
from codra_dsl.runtime.values.previews import PreviewAnswer

DecisionT = TypeVar("DecisionT", bound=Decision)


class DecisionState(StrEnum):
    """The state of a decision."""

    WAITING = "waiting"
    """The decision waits for observers: call `poll` again, or `wait`."""
    ANSWERED = "answered"
    """The answer is final: `value` of a decision on a variable, `answer` of a preview."""
    LOOKING = "looking"
    """The main execution looks itself, then calls `record_result`."""
    DONE = "done"
    """The main execution has reported its result, or has abandoned the decision."""


class Pending(Generic[DecisionT]):
    """A decision that the program advances in steps. Only one thread at a time may use it.

    Attributes:
        state: the state of the decision.
    """

    def __init__(
        self,
        decision: DecisionT,
        *,
        commands: Commands,
        clock: Clock,
        context: DecisionContext,
        convert: Callable[[str, object], Value | None],
    ) -> None:
        """Continue a decision that was just requested.

        Args:
            decision: the return value of `commands.ask` or `commands.ask_preview`.
            commands: executes the further steps.
            clock: measures the wait.
            context: the present context.
            convert: converts a result to the type of a variable, or raises `NotOfTypeError`.
        """
        self._decision = decision
        self._commands = commands
        self._clock = clock
        self._context = context
        self._convert = convert
        self.state = DecisionState.WAITING if decision.is_waiting else self._state_after_wait()

    @property
    def number(self) -> int:
        """Return the number of the decision in the run; previews and decisions on variables share the numbers."""
        return self._decision.number

    def poll(self) -> DecisionState:
        """Continue if context can answer now or the wait is over; return the state."""
        if self.state is DecisionState.WAITING and (
            self._is_wait_over() or self._decision.until_s <= self._clock.now_s()
        ):
            self._end_wait()
        return self.state

    def wait(self, longest_s: float) -> DecisionState:
        """Wait until the state changes, for at most `longest_s`; return the state.

        If `longest_s` is infinite, the decision does not wait any more after this call, even if the clock was closed.
        """
        until_s = min(self._decision.until_s, self._clock.now_s() + longest_s)
        while self.poll() is DecisionState.WAITING:  # an answer can be lost before `poll` reads it
            if not wait_until(self._is_wait_over, self.next_check_s, self._clock, until_s):
                break
        if self.poll() is DecisionState.WAITING and longest_s == math.inf:  # the clock was closed
            self._end_wait()
        return self.state

    def next_check_s(self) -> float:
        """Return the next instant at which time alone can end the wait."""
        return self._decision.next_check_s(self._context, self._clock.now_s())

    def abandon(self, why: str) -> None:
        """Stop waiting or looking, for example because of a more urgent task. If the decision is over, do nothing."""
        if self.state in (DecisionState.WAITING, DecisionState.LOOKING):
            self.state = DecisionState.DONE
            self._commands.abandon(self._decision, why)

    def _converted_result(self, value: object) -> Value | None:
        """Return the value from a look for the first missing variable, in the variable's type; None for no value."""
        if self.state is not DecisionState.LOOKING:
            raise RuntimeError(f"no look was requested for {self._decision.name!r}: the state is {self.state}")
        try:
            return None if value is None else self._convert(self._decision.missing[0], value)
        except NotOfTypeError as error:
            self.abandon(type(error).__name__)
            raise

    def _is_wait_over(self) -> bool:
        """Return whether context can answer now, or is closed."""
        return self._commands.is_closed or self._decision.can_be_decided(self._context, self._clock.now_s())

    def _end_wait(self) -> None:
        self._commands.resume(self._decision)
        self.state = self._state_after_wait()

    def _state_after_wait(self) -> DecisionState:
        return DecisionState.ANSWERED if self._decision.is_over else DecisionState.LOOKING


class PendingDecision(Pending[ValueDecision]):
    """A decision on a variable: answered from context, or by a look of the main execution (P1, section 3.3).

    `ContextManager.ask` creates it.
    """

    @property
    def reading(self) -> Reading[Value]:
        """Return the last reading that was looked up in the context."""
        return self._decision.reading

    @property
    def value(self) -> Any:
        """Return the answer from context.

        Raises:
            RuntimeError: if context has not answered.
        """
        if self.state is not DecisionState.ANSWERED:
            raise RuntimeError(f"context has not answered {self._decision.name!r}: the state is {self.state}")
        return self._decision.reading.content

    def record_result(self, value: object) -> Value | None:
        """Report the value that the main execution acquired by its own look; None or NaN if the look gave no value.

        Returns:
            The value in the type of the variable, or None.

        Raises:
            NotOfTypeError: if the value is not of the type of the variable; then the decision is abandoned.
            RuntimeError: if the state is not `LOOKING`.
        """
        content = self._converted_result(value)
        self.state = DecisionState.DONE
        self._commands.conclude(self._decision, content)
        return content


class PendingPreview(Pending[Preview]):
    """The preview of one skill: answered from context, or by looks of the main execution (P1, section 3.3).

    `ContextManager.ask_preview` creates it. In the state `LOOKING`, the main execution looks for the variable
    `missing[0]` and calls `record_result`. In the state `ANSWERED`, `answer` is final.
    """

    @property
    def answer(self) -> PreviewAnswer:
        """Return the answer as far as it is known: in the state `ANSWERED` it is final."""
        return self._decision.answer

    @property
    def missing(self) -> tuple[str, ...]:
        """Return the variables for which the main execution should look, in this order; none if it need not look."""
        return self._decision.missing if self.state is DecisionState.LOOKING else ()

    def record_result(self, value: object) -> DecisionState:
        """Report the value that was found for the first missing variable; None or NaN if there was none.

        Returns:
            `LOOKING` if the answer needs a further variable, otherwise `ANSWERED`.

        Raises:
            NotOfTypeError: if the value is not of the type of the variable; then the preview is abandoned.
            RuntimeError: if the state is not `LOOKING`.
        """
        content = self._converted_result(value)
        self._commands.record_look(self._decision, self._decision.missing[0], content)
        self.state = self._state_after_wait()
        return self.state
