"""A decision asked step by step, by a main execution that may not wait inside one call: a tree between two ticks."""

from __future__ import annotations

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
    """How far a decision has come."""

    WAITING = "waiting"
    """For observers; `poll` again, or `wait`."""
    ANSWERED = "answered"
    """From context: `value` holds the answer."""
    LOOKING = "looking"
    """The main execution looks itself, then says what it `found`."""
    DONE = "done"
    """The main execution has said what it found."""


class PendingDecision:
    """One decision: answered from context, or by what the main execution finds (P1, section 3.3).

    `ContextManager.ask` makes it. It is used by one thread at a time.

    Attributes:
        step: how far it has come.
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
        """Go on with a decision that was asked just now.

        Args:
            decision: as `commands.ask` returned it.
            commands: takes the further steps.
            clock: measures how long it waits.
            read: returns what is known of the variable now; takes no lock.
            convert: makes what was found a value of the variable, or raises `NotOfTypeError`.
        """
        self._decision = decision
        self._commands = commands
        self._clock = clock
        self._read = read
        self._convert = convert
        waits = not decision.met and decision.request.wait_up_to_s > 0
        self.step = DecisionState.WAITING if waits else self._settled()

    @property
    def number(self) -> int:
        """Return the number of the decision among all of the run."""
        return self._decision.number

    @property
    def reading(self) -> Reading[Value]:
        """Return what context held when it was asked last."""
        return self._decision.reading

    @property
    def value(self) -> Any:
        """Return the answer from context.

        Raises:
            RuntimeError: if context has not answered.
        """
        if self.step is not DecisionState.ANSWERED:
            raise RuntimeError(f"context has not answered {self._decision.request.variable!r}: the step is {self.step}")
        return self._decision.reading.content

    def poll(self) -> DecisionState:
        """Go on, if context can answer by now or the time to wait is over; return the step reached."""
        if self.step is DecisionState.WAITING and (self._need_wait_no_more() or self._left_s() <= 0):
            self._commands.resume(self._decision)
            self.step = self._settled()
        return self.step

    def wait(self, longest_s: float) -> DecisionState:
        """Let time pass until the next step, for `longest_s` at most; return the step reached."""
        if self.poll() is DecisionState.WAITING:
            self._clock.wait_until(self._need_wait_no_more, min(longest_s, self._left_s()))
        return self.poll()

    def found(self, value: object) -> None:
        """Say what the main execution found; None if it found nothing.

        Raises:
            NotOfTypeError: if it is no value of the variable.
            RuntimeError: if nobody was to look.
        """
        if self.step is not DecisionState.LOOKING:
            raise RuntimeError(f"nobody was to look for {self._decision.request.variable!r}: the step is {self.step}")
        try:
            content = None if value is None else self._convert(value)
        except NotOfTypeError as error:
            self.abandon(type(error).__name__)
            raise
        self.step = DecisionState.DONE
        self._commands.conclude(self._decision, content)

    def abandon(self, why: str) -> None:
        """Give up waiting or looking, e.g. because something more urgent came; harmless when it is over."""
        if self.step in (DecisionState.WAITING, DecisionState.LOOKING):
            self.step = DecisionState.DONE
            self._commands.conclude(self._decision, None, raised=why)

    def _settled(self) -> DecisionState:
        return DecisionState.ANSWERED if self._decision.is_answered else DecisionState.LOOKING

    def _is_met(self) -> bool:
        return self._decision.request.is_met(self._read(), self._clock.now_s())

    def _need_wait_no_more(self) -> bool:
        return self._commands.is_closed or self._is_met()

    def _left_s(self) -> float:
        return self._decision.asked_s + self._decision.request.wait_up_to_s - self._clock.now_s()
