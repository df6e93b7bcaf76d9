"""Waiting until a condition over the context holds."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping

from codra_dsl.logic import Term
from codra_dsl.runtime.clock import PUNCTUALITY_TOLERANCE_S, Clock
from codra_dsl.runtime.values.cell import Cell
from codra_dsl.runtime.values.conditions_held import ContextNow


def wait_for(term: Term, cells: Mapping[str, Cell], clock: Clock, timeout_s: float) -> bool:
    """Wait until a condition holds; return whether it holds. A condition can become true through time alone.

    Args:
        term: the condition.
        cells: all variables.
        clock: the clock to wait on.
        timeout_s: the longest wait.
    """

    def holds() -> bool:
        return term.holds(ContextNow(cells, clock.now_s()))

    def next_check_s() -> float:
        now_s = clock.now_s()
        wait_s = term.flips_s(ContextNow(cells, now_s))
        return math.inf if wait_s is None else now_s + wait_s

    return wait_until(holds, next_check_s, clock, clock.now_s() + timeout_s)


def wait_until(is_over: Callable[[], bool], next_check_s: Callable[[], float], clock: Clock, end_s: float) -> bool:
    """Wait until `is_over()` is true or an instant is reached; return whether `is_over()` is true.

    Args:
        is_over: called at the start and after changes; must not acquire a lock.
        next_check_s: returns the next instant at which time alone may change the result of `is_over`.
        clock: the clock to wait on.
        end_s: the end of the wait.
    """
    until_s, was_over = end_s, False

    def should_wake() -> bool:
        """Return whether the wait is over, or may be over through time alone before `until_s`."""
        nonlocal was_over
        was_over = is_over()
        return was_over or next_check_s() < until_s - PUNCTUALITY_TOLERANCE_S

    while True:  # ages grow without events: check again when a comparison with an age changes
        until_s = min(end_s, next_check_s())
        was_woken = clock.wait_until(should_wake, max(until_s - clock.now_s(), 0.0))
        if was_over:
            return True
        if not was_woken and (
            until_s == end_s or clock.now_s() < until_s - PUNCTUALITY_TOLERANCE_S
        ):  # the time is over, or the clock was closed
            return False
