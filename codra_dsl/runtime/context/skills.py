"""A skill under way, as the main execution holds it."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import contextmanager

from codra_dsl.runtime.callbacks import Subscription
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.context.commands import Commands
from codra_dsl.runtime.observers.expectations import Expectations, Verdict, Verification, unseen
from codra_dsl.runtime.values.model import SkillModel

Look = Callable[[str], object]
"""Looks for a variable as the robot did without observers: returns its value, or None if it found none."""


class Skill:
    """A skill under way: what it previews and monitors is declared until it ends.

    Attributes:
        model: what the spec says of it.
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
        """Hold a skill that has begun.

        Args:
            model: what the spec says of it.
            number: among all that have begun.
            commands: take what it does.
            expectations: judge what it expects.
            clock: in which it waits.
            decide: answers a decision about a variable from context, or by a look.
            subscribe: calls back with what comes of its expectations.
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
        """Act: from here what the skill changes is unknown, only newer evidence counts, and so do its expectations.

        Raises:
            RuntimeError: if the skill has ended.
        """
        self._commands.act(self._number)
        try:
            yield
        finally:
            self._commands.acted(self._number)

    def verify(self, otherwise: Look | None = None, *, wait_up_to_s: float = 0.0) -> Verification:
        """Return what came of all that the skill expects, counted from `acting`.

        Args:
            otherwise: looks for a variable of which nothing is known that decides, given its name; it returns a value
                or None. What it finds is kept as evidence, and judged. Without it nobody looks.
            wait_up_to_s: how long to wait until everything has an outcome, before falling back.

        Raises:
            RuntimeError: if the skill has not acted yet, or has ended.
            NotOfTypeError: if `otherwise` returns what is no value of the variable.
        """
        verification = self._verification()
        if wait_up_to_s > 0:
            self._clock.wait_until(lambda: self._expectations.is_settled(self._number), wait_up_to_s)
            verification = self._verification()
        if otherwise is None or not verification.not_seen:
            return verification
        for variable in unseen(verification):
            self._look(variable, otherwise)
        return self._verification()

    def subscribe(self, callback: Callable[[Verdict], None]) -> Subscription:
        """Call back with what comes of each expectation, when it is clear: also while the skill acts.

        The callback runs as those of `ContextManager.subscribe` do.
        """
        return self._subscribe(callback)

    def _verification(self) -> Verification:
        return self._expectations.verification(self._number, self.model.name)

    def _look(self, variable: str, look: Look) -> None:
        self._decide(variable, lambda: look(variable))
