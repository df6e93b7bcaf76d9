"""Decisions that a program, such as a behaviour tree, advances in steps, because the program must not block."""

from __future__ import annotations

import math
from collections.abc import Callable
from enum import StrEnum
from typing import Any

from codra_dsl.logic import Value
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.context.commands import Commands
from codra_dsl.runtime.context.decisions import Decision
from codra_dsl.runtime.values.cell import Reading
from codra_dsl.runtime.values.model import NotOfTypeError


class DecisionState(StrEnum):
    """The state of a decision."""

    WAITING = "waiting"
    """The decision waits for observers: call `poll` again, or `wait`."""
    ANSWERED = "answered"
    """Context has answered: `value` is the answer."""
    LOOKING = "looking"
    """The main execution looks itself, then calls `record_result`."""
    DONE = "done"
    """The main execution has reported its result, or has abandoned the decision."""


class Pending:
    """A question to context that the program advances in steps. Only one thread at a time may use it.

    Attributes:
        state: the state of the question.
    """

    state: DecisionState
    _clock: Clock
    _until_s: float
    """When the question stops waiting for observers."""

    def poll(self) -> DecisionState:
        """Continue if context can answer now or the wait is over; return the state."""
        if self.state is DecisionState.WAITING and (self._is_wait_over() or self._remaining_s() <= 0):
            self._end_wait()
        return self.state

    def wait(self, longest_s: float) -> DecisionState:
        """Wait until the state changes, for at most `longest_s`; return the state.

        If `longest_s` is infinite, the question does not wait any more after this call, even if the clock was closed.
        """
        if self.poll() is DecisionState.WAITING:
            self._clock.wait_until(self._is_wait_over, min(longest_s, self._remaining_s()))
        if self.poll() is DecisionState.WAITING and longest_s == math.inf:  # the clock was closed
            self._end_wait()
        return self.state

    def next_check_s(self) -> float:
        """Return the next instant at which time alone can end the wait."""
        return self._until_s

    def _is_wait_over(self) -> bool:
        """Return whether context can answer now, or is closed."""
        raise NotImplementedError

    def _end_wait(self) -> None:
        """Look up the context again, and leave the state `WAITING`."""
        raise NotImplementedError

    def _remaining_s(self) -> float:
        return self._until_s - self._clock.now_s()


class PendingDecision(Pending):
    """One decision: answered from context, or by a look of the main execution (P1, section 3.3).

    `ContextManager.ask` creates it. Only one thread at a time may use it.

    Attributes:
        state: the state of the decision.
    """

    def __init__(
        self,
        decision: Decision,
        *,
        commands: Commands,
        clock: Clock,
        read: Callable[[], Reading[Value]],
        convert: Callable[[object], Value | None],
    ) -> None:
        """Continue a decision that was just requested.

        Args:
            decision: the return value of `commands.ask`.
            commands: executes the further steps.
            clock: measures the wait.
            read: returns the reading of the variable now; takes no lock.
            convert: converts a result to the type of the variable, or raises `NotOfTypeError`.
        """
        self._decision = decision
        self._commands = commands
        self._clock = clock
        self._until_s = decision.asked_s + decision.request.wait_up_to_s
        self._read = read
        self._convert = convert
        is_waiting = not decision.is_met and decision.request.wait_up_to_s > 0
        self.state = DecisionState.WAITING if is_waiting else self._state_after_wait()

    @property
    def number(self) -> int:
        """Return the number of the decision in the run."""
        return self._decision.number

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
            raise RuntimeError(
                f"context has not answered {self._decision.request.variable!r}: the state is {self.state}"
            )
        return self._decision.reading.content

    def record_result(self, value: object) -> Value | None:
        """Report the value that the main execution acquired by its own look; None or NaN if the look gave no value.

        Returns:
            The value in the type of the variable, or None.

        Raises:
            NotOfTypeError: if the value is not of the type of the variable.
            RuntimeError: if the state is not `LOOKING`.
        """
        if self.state is not DecisionState.LOOKING:
            raise RuntimeError(
                f"no look was requested for {self._decision.request.variable!r}: the state is {self.state}"
            )
        try:
            content = None if value is None else self._convert(value)
        except NotOfTypeError as error:
            self.abandon(type(error).__name__)
            raise
        self.state = DecisionState.DONE
        self._commands.conclude(self._decision, content)
        return content

    def abandon(self, why: str) -> None:
        """Stop waiting or looking, for example because of a more urgent task. If the decision is over, do nothing."""
        if self.state in (DecisionState.WAITING, DecisionState.LOOKING):
            self.state = DecisionState.DONE
            self._commands.conclude(self._decision, None, raised=why)

    def _end_wait(self) -> None:
        self._commands.resume(self._decision)
        self.state = self._state_after_wait()

    def _state_after_wait(self) -> DecisionState:
        return DecisionState.ANSWERED if self._decision.is_answered else DecisionState.LOOKING

    def _is_wait_over(self) -> bool:
        return self._commands.is_closed or self._decision.request.is_met(self._read(), self._clock.now_s())
