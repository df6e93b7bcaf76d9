"""Waiting until a condition over the context holds."""

from __future__ import annotations

import math
from collections.abc import Mapping

from codra_dsl.logic import Term
from codra_dsl.runtime.clock import PUNCTUAL_S, Clock
from codra_dsl.runtime.values.cell import Cell
from codra_dsl.runtime.values.evidence import ContextNow


def wait_for(term: Term, cells: Mapping[str, Cell], clock: Clock, timeout_s: float) -> bool:
    """Wait until a condition holds, also by time alone; return whether it does.

    Args:
        term: the condition.
        cells: all variables.
        clock: in which to wait.
        timeout_s: how long at most.
    """
    until_s = end_s = clock.now_s() + timeout_s
    held = False

    def flips_at_s() -> float:
        now_s = clock.now_s()
        flips_s = term.flips_s(ContextNow(cells, now_s))
        return math.inf if flips_s is None else now_s + flips_s

    def is_told() -> bool:
        """Return whether the condition holds, or may come to hold by time alone sooner than it could before."""
        nonlocal held
        held = term.holds(ContextNow(cells, clock.now_s()))
        return held or flips_at_s() < until_s - PUNCTUAL_S

    while True:  # ages grow although nothing happens: look again when a comparison with one changes
        until_s = min(end_s, flips_at_s())
        was_told = clock.wait_until(is_told, max(until_s - clock.now_s(), 0.0))
        if held:
            return True
        if not was_told and (until_s == end_s or clock.now_s() < until_s - PUNCTUAL_S):  # over, or the clock was closed
            return False
