"""The budget of work for the analysis of the conditions of one spec.

Work is counted and not timed, so that a spec has the same findings on every computer. The unit of work is the
evaluation of one part of a condition, which takes a few microseconds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from fractions import Fraction
from typing import TypeVar

from codra_dsl.language.expression import Node

Answer = TypeVar("Answer")

WORK_PER_SPEC = 100_000
"""The work that every spec may need: less than a second. The specs of this repository need less than 10,000."""

WORK_PER_CONDITION = 100
"""The additional work for each condition of a spec, because a long spec may need more work than a short one."""

_CHEAP_BITS = 2000
"""The size up to which an operation with a fraction needs no noticeable work. Beyond it, the work grows quadratically,
because a fraction is reduced after each operation."""


class OutOfBudgetError(Exception):
    """A question needs more work than it may need. `Budget.answer` catches this exception."""


@dataclass(slots=True)
class Budget:
    """The work that may still be done.

    Attributes:
        remaining_work: the work that is left; if it is negative, no further question is decided.
        has_undecided: whether a question was not decided.
        costliest_conditions: the conditions of the question that needed most work.
    """

    remaining_work: int = WORK_PER_SPEC
    has_undecided: bool = False
    costliest_conditions: tuple[Node, ...] = ()
    _most_work: int = 0

    def answer(self, question: Callable[[], Answer], conditions: Sequence[Node], undecided: Answer) -> Answer:
        """Return the answer to a question about conditions, or `undecided` if the budget does not suffice."""
        if self.remaining_work < 0:
            return undecided
        work_before = self.remaining_work
        try:
            return question()
        except OutOfBudgetError:
            self.has_undecided = True
            return undecided
        finally:
            work = work_before - self.remaining_work
            if work > self._most_work:
                self._most_work, self.costliest_conditions = work, tuple(conditions)


_CURRENT_BUDGET: ContextVar[Budget | None] = ContextVar("budget", default=None)


def current_budget() -> Budget:
    """Return the budget of the spec that is checked now. Outside of `shared_budget`, return a new budget."""
    return _CURRENT_BUDGET.get() or Budget()


@contextmanager
def shared_budget(budget: Budget) -> Iterator[Budget]:
    """Let all questions share one budget. A context variable passes it on, because every rule asks questions."""
    token = _CURRENT_BUDGET.set(budget)
    try:
        yield budget
    finally:
        _CURRENT_BUDGET.reset(token)


def spend(work: int) -> None:
    """Subtract work from the current budget.

    Raises:
        OutOfBudgetError: if the budget is used up.
    """
    budget = _CURRENT_BUDGET.get()
    if budget is not None:
        budget.remaining_work -= work
        if budget.remaining_work < 0:
            raise OutOfBudgetError


def spend_on_digits(*numbers: Fraction | float) -> None:
    """Subtract the work for operations with numbers that have many digits."""
    for number in numbers:
        if isinstance(number, Fraction):
            bits = number.numerator.bit_length() + number.denominator.bit_length()
            if bits > _CHEAP_BITS:
                spend((bits // _CHEAP_BITS) ** 2)
