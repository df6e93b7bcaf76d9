"""Values without flicker: hysteresis between two conditions, and confirmation by several results."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from codra_dsl.logic import Operand, Scope, Term, Value, literal


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Hysteresis(Term):
    """True where `enter` holds, else false where `leave` holds, else as the variable was before."""

    enter: Term
    leave: Term

    def parts(self) -> tuple[Term, ...]:
        """Return both conditions."""
        return (self.enter, self.leave)

    def evaluate(self, scope: Scope) -> Value | None:
        """Return true or false, or None if neither condition holds or it is unknown whether one of them holds."""
        if self.enter.evaluate(scope) is True:
            return True
        return False if self.leave.evaluate(scope) is True else None

    def leaves_as_is(self, scope: Scope) -> bool:
        """Return whether both conditions are known not to hold: then the value stays as it was."""
        return self.enter.evaluate(scope) is False and self.leave.evaluate(scope) is False

    def __repr__(self) -> str:
        return f"between({self.enter!r}, {self.leave!r})"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Debounced(Term):
    """A condition whose value counts once `needed` of the last `among` results agree on it."""

    term: Term
    needed: int
    among: int

    def parts(self) -> tuple[Term, ...]:
        """Return the condition."""
        return (self.term,)

    def evaluate(self, scope: Scope) -> Value | None:
        """Return the value for one result."""
        return self.term.evaluate(scope)

    def __repr__(self) -> str:
        return f"confirmed({self.term!r}, {self.needed}, {self.among})"


def between(enter: Operand, leave: Operand) -> Term:
    """Return a condition that is true where `enter` holds, false where `leave` holds, and as before between them."""
    return Hysteresis(_term(enter), _term(leave))


def confirmed(term: Operand, needed: int, among: int) -> Term:
    """Return a condition whose value counts once `needed` of the last `among` results agree on it."""
    return Debounced(_term(term), needed, among)


def _term(operand: Operand) -> Term:
    return operand if isinstance(operand, Term) else literal(operand)


@dataclass(frozen=True, slots=True)
class Vote:
    """The value of a variable in one result, and when its evidence was taken."""

    content: Value
    start_s: float
    stamp_s: float


class Votes:
    """The last results of one algorithm about one variable."""

    def __init__(self, needed: int, among: int) -> None:
        """Start without results.

        Args:
            needed: how many results must agree.
            among: how many of the last results are counted.
        """
        self.needed = needed
        self.among = among
        self._results: deque[Vote] = deque(maxlen=among)

    def clear(self) -> None:
        """Drop all results."""
        self._results.clear()

    def take(self, newest: Vote, counts: Callable[[Vote], bool]) -> None:
        """Add the newest result, and keep those before it for which `counts` is true."""
        kept = [vote for vote in self._results if counts(vote)]
        self._results.clear()
        self._results.extend((*kept, newest))

    def count(self, content: Value | None) -> int:
        """Return how many of the last results have a value."""
        return len(self._agreeing(content))

    def start_s(self, content: Value) -> float | None:
        """Return when the evidence of the last `needed` results for a value began; None if too few agree on it."""
        agreeing = self._agreeing(content)
        return agreeing[-self.needed].start_s if len(agreeing) >= self.needed else None

    def _agreeing(self, content: Value | None) -> list[Vote]:
        return [vote for vote in self._results if vote.content == content]
