"""Previews that a program, such as a behaviour tree, advances in steps, because the program must not block."""

from __future__ import annotations

from collections.abc import Callable

from codra_dsl.logic import Value
from codra_dsl.runtime.clock import PUNCTUALITY_TOLERANCE_S, Clock
from codra_dsl.runtime.context.pending_decision import DecisionState, Pending
from codra_dsl.runtime.context.preview_commands import PreviewCommands
from codra_dsl.runtime.context.previews import Preview
from codra_dsl.runtime.values.model import NotOfTypeError
from codra_dsl.runtime.values.previews import PreviewAnswer


class PendingPreview(Pending):
    """The preview of one skill: answered from context, or by looks of the main execution (P1, section 3.3).

    `ContextManager.ask_preview` creates it. In the state `LOOKING`, the main execution looks for the variable
    `missing[0]` and calls `record_result`. In the state `ANSWERED`, `answer` is final.
    """

    def __init__(
        self,
        preview: Preview,
        *,
        commands: PreviewCommands,
        clock: Clock,
        is_closed: Callable[[], bool],
        convert: Callable[[str, object], Value | None],
    ) -> None:
        """Continue a preview that was just requested.

        Args:
            preview: the return value of `commands.ask`.
            commands: executes the further steps.
            clock: measures the wait.
            is_closed: returns whether the context manager is closed.
            convert: converts a result to the type of a variable, or raises `NotOfTypeError`.
        """
        self._preview = preview
        self._commands = commands
        self._clock = clock
        self._until_s = preview.asked_s + preview.request.wait_up_to_s
        self._is_closed = is_closed
        self._convert = convert
        is_waiting = not preview.is_over and preview.request.wait_up_to_s > 0
        self.state = DecisionState.WAITING if is_waiting else self._state_after_wait()

    @property
    def number(self) -> int:
        """Return the number of the preview among the decisions of the run."""
        return self._preview.number

    @property
    def answer(self) -> PreviewAnswer:
        """Return the answer as far as it is known: in the state `ANSWERED` it is final."""
        return self._preview.answer

    @property
    def missing(self) -> tuple[str, ...]:
        """Return the variables for which the main execution should look, in this order; none if it need not look."""
        return self._preview.missing if self.state is DecisionState.LOOKING else ()

    def wait(self, longest_s: float) -> DecisionState:
        """Wait as a decision does. Time alone may decide a preview: its conditions can compare ages."""
        until_s = self._clock.now_s() + longest_s
        while self.poll() is DecisionState.WAITING:
            now_s, flips_s = self._clock.now_s(), self._commands.flips_s(self._preview)
            if flips_s >= min(until_s - now_s, self._remaining_s()):
                return super().wait(until_s - now_s)
            is_decided = self._clock.wait_until(self._is_wait_over, flips_s)
            if not is_decided and self._clock.now_s() < now_s + flips_s - PUNCTUALITY_TOLERANCE_S:  # it was closed
                return super().wait(until_s - self._clock.now_s())
        return self.state

    def next_check_s(self) -> float:
        """Return the next instant at which the wait ends, or an age in a condition passes its limit."""
        return min(self._until_s, self._clock.now_s() + self._commands.flips_s(self._preview))

    def record_result(self, value: object) -> DecisionState:
        """Report the value that was found for the first missing variable; None or NaN if there was none.

        Returns:
            `LOOKING` if the answer needs a further variable, otherwise `ANSWERED`.

        Raises:
            NotOfTypeError: if the value is not of the type of the variable; then the preview is abandoned.
            RuntimeError: if the state is not `LOOKING`.
        """
        if self.state is not DecisionState.LOOKING:
            raise RuntimeError(f"no look was requested for {self.answer.skill!r}: the state is {self.state}")
        variable = self._preview.missing[0]
        try:
            content = None if value is None else self._convert(variable, value)
        except NotOfTypeError as error:
            self.abandon(type(error).__name__)
            raise
        self._commands.record_look(self._preview, variable, content)
        self.state = self._state_after_wait()
        return self.state

    def abandon(self, why: str) -> None:
        """Stop waiting or looking, for example because of a more urgent task. If the preview is over, do nothing."""
        if self.state in (DecisionState.WAITING, DecisionState.LOOKING):
            self.state = DecisionState.DONE
            self._commands.abandon(self._preview, why)

    def _is_wait_over(self) -> bool:
        return self._is_closed() or self._commands.is_decided(self._preview)

    def _end_wait(self) -> None:
        self._commands.resume(self._preview)
        self.state = self._state_after_wait()

    def _state_after_wait(self) -> DecisionState:
        return DecisionState.ANSWERED if self._preview.is_over else DecisionState.LOOKING
