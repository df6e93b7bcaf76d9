"""Two ways to keep the value of a variable steady: hysteresis between two conditions, and votes of several results."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from codra_dsl.logic import Operand, Scope, Term, Value, literal


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class Hysteresis(Term):
    """True if `enter` holds, otherwise false if `leave` holds, otherwise the value that the variable had before."""

    enter: Term
    leave: Term

    def parts(self) -> tuple[Term, ...]:
        """Return both conditions."""
        return (self.enter, self.leave)

    def evaluate(self, scope: Scope) -> Value | None:
        """Return true if `enter` holds, otherwise false if `leave` holds.

        Return None if neither holds, or if it is unknown whether one of them holds.
        """
        if self.enter.evaluate(scope) is True:
            return True
        return False if self.leave.evaluate(scope) is True else None

    def keeps_value(self, scope: Scope) -> bool:
        """Return whether it is known that neither condition holds. Then the variable keeps its value."""
        return self.enter.evaluate(scope) is False and self.leave.evaluate(scope) is False

    def __repr__(self) -> str:
        return f"between({self.enter!r}, {self.leave!r})"


@dataclass(frozen=True, slots=True, eq=False, repr=False)
class DebouncedCondition(Term):
    """A condition with a value that counts as soon as `needed` of the last `among` results have this value."""

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
    """Return a condition that is true if `enter` holds, false if `leave` holds, and otherwise keeps its value."""
    return Hysteresis(_to_term(enter), _to_term(leave))


def confirmed(term: Operand, needed: int, among: int) -> Term:
    """Return a condition with a value that counts as soon as `needed` of the last `among` results have this value."""
    return DebouncedCondition(_to_term(term), needed, among)


def _to_term(operand: Operand) -> Term:
    return operand if isinstance(operand, Term) else literal(operand)


@dataclass(frozen=True, slots=True)
class Vote:
    """The value of a variable in one result, and when the evidence of this result was taken."""

    content: Value
    start_s: float
    stamp_s: float


class Votes:
    """The last results of one algorithm about one variable."""

    def __init__(self, needed: int, among: int) -> None:
        """Start without results.

        Args:
            needed: how many of the counted results must agree on a value.
            among: how many of the last results are counted.
        """
        self.needed = needed
        self.among = among
        self._votes: deque[Vote] = deque(maxlen=among)

    def clear(self) -> None:
        """Drop all results."""
        self._votes.clear()

    def add(self, newest_vote: Vote, is_still_counted: Callable[[Vote], bool]) -> None:
        """Add the newest result. Of the earlier results, keep those for which `is_still_counted` returns true."""
        counted_votes = [vote for vote in self._votes if is_still_counted(vote)]
        self._votes.clear()
        self._votes.extend((*counted_votes, newest_vote))

    def count(self, content: Value | None) -> int:
        """Return how many of the last results have the value `content`."""
        return len(self._agreeing_votes(content))

    def start_s(self, content: Value) -> float | None:
        """Return the start of the evidence for a value; None if fewer than `needed` results have the value.

        The evidence starts with the oldest of the last `needed` results that have the value.
        """
        agreeing_votes = self._agreeing_votes(content)
        return agreeing_votes[-self.needed].start_s if len(agreeing_votes) >= self.needed else None

    def _agreeing_votes(self, content: Value | None) -> list[Vote]:
        return [vote for vote in self._votes if vote.content == content]
