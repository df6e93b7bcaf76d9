"""The handle of a running skill."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from codra_dsl.runtime.callbacks import Subscription
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.context.commands import Commands
from codra_dsl.runtime.observers.expectations import Expectations, Verdict, Verification, unseen_variables
from codra_dsl.runtime.values.model import SkillModel

Look = Callable[[str], object]
"""A function that looks for a variable as the robot did without observers; it returns the value or None."""


class Skill:
    """A running skill: the variables that it previews and monitors are declared until it ends.

    Attributes:
        model: the declaration of the skill in the spec.
    """

    def __init__(
        self,
        model: SkillModel,
        number: int,
        *,
        commands: Commands,
        expectations: Expectations,
        clock: Clock,
        decide: Callable[[str, Callable[[], object]], object],
        subscribe: Callable[[Callable[[Verdict], None]], Subscription],
    ) -> None:
        """Create the handle of a skill that has begun.

        Args:
            model: the declaration of the skill in the spec.
            number: the number of the skill among the skills that have begun.
            commands: executes the commands of the skill.
            expectations: judges the expectations of the skill.
            clock: the clock for waiting.
            decide: answers a decision about a variable from context, or by a look.
            subscribe: calls back with the outcomes of the expectations.
        """
        self.model = model
        self._number = number
        self._commands = commands
        self._expectations = expectations
        self._clock = clock
        self._decide = decide
        self._subscribe = subscribe

    @contextmanager
    def acting(self) -> Iterator[None]:
        """Act: the variables that the skill changes become unknown, and its expectations start.

        For these variables, only evidence that is taken from now on is used.

        Raises:
            RuntimeError: if the skill has ended.
        """
        self._commands.act(self._number)
        try:
            yield
        finally:
            self._commands.acted(self._number)

    def verify(self, otherwise: Look | None = None, *, wait_up_to_s: float = 0.0) -> Verification:
        """Return the outcomes of all expectations of the skill since `acting`.

        Args:
            otherwise: looks for a variable whose unknown value leaves an expectation open. It is called with the name
                of the variable and returns a value or None. The value is kept as evidence, and the expectation is
                judged with it. Without `otherwise` there is no look.
            wait_up_to_s: how long to wait for all outcomes before falling back.

        Raises:
            RuntimeError: if the skill has not acted yet, or has ended.
            NotOfTypeError: if `otherwise` returns a value of another type.
        """
        verification = self._verification()
        if wait_up_to_s > 0:
            self._clock.wait_until(lambda: self._expectations.is_settled(self._number), wait_up_to_s)
            verification = self._verification()
        if otherwise is None or not verification.not_seen:
            return verification
        for variable in unseen_variables(verification):
            self._look(variable, otherwise)
        return self._verification()

    def subscribe(self, callback: Callable[[Verdict], None]) -> Subscription:
        """Call back with the outcome of each expectation as soon as the outcome is decided, even while the skill acts.

        The callback runs in the same way as a callback of `ContextManager.subscribe`.
        """
        return self._subscribe(callback)

    def _verification(self) -> Verification:
        return self._expectations.verification(self._number, self.model.name)

    def _look(self, variable: str, look: Look) -> None:
        self._decide(variable, lambda: look(variable))
