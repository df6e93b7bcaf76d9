"""Waiting until a condition over the context holds."""

from __future__ import annotations

from collections.abc import Mapping

from codra_dsl.logic import Term
from codra_dsl.runtime.cell import Cell
from codra_dsl.runtime.clock import PUNCTUAL_S, Clock
from codra_dsl.runtime.evidence import Present


def wait_for(term: Term, cells: Mapping[str, Cell], clock: Clock, timeout_s: float) -> bool:
    """Wait until a condition holds, also by time alone; return whether it does.

    Args:
        term: the condition.
        cells: all variables.
        clock: in which to wait.
        timeout_s: how long at most.
    """

    def holds() -> bool:
        return term.holds(Present(cells, clock.now_s()))

    end_s = clock.now_s() + timeout_s
    while True:  # ages grow although nothing happens: look again when a comparison with one changes
        now_s = clock.now_s()
        flips_s = term.flips_s(Present(cells, now_s))
        until_s = end_s if flips_s is None else min(now_s + flips_s, end_s)
        if clock.wait_until(holds, max(until_s - now_s, 0.0)):
            return True
        if until_s == end_s or clock.now_s() < until_s - PUNCTUAL_S:  # over, or the clock was closed
            return False
