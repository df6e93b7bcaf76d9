"""What keeps the value of a variable steady: a band between two conditions, and results that must agree."""

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
        """Return true or false, or None between them and where it is unknown whether one of them holds."""
        if self.enter.evaluate(scope) is True:
            return True
        return False if self.leave.evaluate(scope) is True else None

    def leaves_as_is(self, scope: Scope) -> bool:
        """Return whether certainly neither condition holds: then the value stays as it was."""
        return self.enter.evaluate(scope) is False and self.leave.evaluate(scope) is False

    def __repr__(self) -> str:
        return f"between({self.enter!r}, {self.leave!r})"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Debounced(Term):
    """A condition of which `needed` among the last `among` results must say the same."""

    term: Term
    needed: int
    among: int

    def parts(self) -> tuple[Term, ...]:
        """Return the condition."""
        return (self.term,)

    def evaluate(self, scope: Scope) -> Value | None:
        """Return what one result says."""
        return self.term.evaluate(scope)

    def __repr__(self) -> str:
        return f"confirmed({self.term!r}, {self.needed}, {self.among})"


def between(enter: Operand, leave: Operand) -> Term:
    """Return true where `enter` holds, false where `leave` holds, and as before between them."""
    return Hysteresis(_term(enter), _term(leave))


def confirmed(term: Operand, needed: int, among: int) -> Term:
    """Return a condition whose value counts once `needed` of the last `among` results agree on it."""
    return Debounced(_term(term), needed, among)


def _term(operand: Operand) -> Term:
    return operand if isinstance(operand, Term) else literal(operand)


@dataclass(frozen=True, slots=True)
class Vote:
    """What one result said of a variable, and when its evidence was taken."""

    content: Value
    start_s: float
    stamp_s: float


class Votes:
    """The last results of one algorithm about one variable."""

    def __init__(self, needed: int, among: int) -> None:
        """Have no results yet.

        Args:
            needed: how many must agree.
            among: how many are looked at.
        """
        self.needed = needed
        self.among = among
        self._results: deque[Vote] = deque(maxlen=among)

    def clear(self) -> None:
        """Let nothing that was seen until now count any more."""
        self._results.clear()

    def take(self, told: Vote, counts: Callable[[Vote], bool]) -> None:
        """Take the newest result; of those before it only what `counts` says still counts."""
        kept = [each for each in self._results if counts(each)]
        self._results.clear()
        self._results.extend((*kept, told))

    def count(self, content: Value | None) -> int:
        """Return how many of the last results say a value."""
        return len(self._agreeing(content))

    def start_s(self, content: Value) -> float | None:
        """Return when the evidence for a value began to be taken, over all the results that it needs.

        None if too few agree on it.
        """
        agreeing = self._agreeing(content)
        return agreeing[-self.needed].start_s if len(agreeing) >= self.needed else None

    def _agreeing(self, content: Value | None) -> list[Vote]:
        return [each for each in self._results if each.content == content]
