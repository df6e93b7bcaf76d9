"""Waiting until a condition over the context holds."""

from __future__ import annotations

import math
from collections.abc import Mapping

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
    until_s = end_s = clock.now_s() + timeout_s
    is_condition_met = False

    def next_flip_at_s() -> float:
        now_s = clock.now_s()
        flips_s = term.flips_s(ContextNow(cells, now_s))
        return math.inf if flips_s is None else now_s + flips_s

    def should_wake() -> bool:
        """Return whether the condition holds, or may become true through time alone before `until_s`."""
        nonlocal is_condition_met
        is_condition_met = term.holds(ContextNow(cells, clock.now_s()))
        return is_condition_met or next_flip_at_s() < until_s - PUNCTUALITY_TOLERANCE_S

    while True:  # ages grow without events: check again when a comparison with an age changes
        until_s = min(end_s, next_flip_at_s())
        was_woken = clock.wait_until(should_wake, max(until_s - clock.now_s(), 0.0))
        if is_condition_met:
            return True
        if not was_woken and (
            until_s == end_s or clock.now_s() < until_s - PUNCTUALITY_TOLERANCE_S
        ):  # the time is over, or the clock was closed
            return False
