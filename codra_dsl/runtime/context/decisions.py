"""Decisions of the main execution: the request and its state (P1, section 3.3)."""

from __future__ import annotations

import math
from dataclasses import dataclass

from codra_dsl.logic import Value
from codra_dsl.runtime.values.cell import Reading


@dataclass(frozen=True, slots=True, kw_only=True)
class DecisionRequest:
    """A request for the value of a variable.

    Attributes:
        variable: the variable.
        max_age_s: the largest permitted age of the evidence.
        since_s: the taking of the evidence must have begun at or after this instant.
        wait_up_to_s: the longest wait for observers.
        shadow: whether the main execution looks in any case.
    """

    variable: str
    max_age_s: float = math.inf
    since_s: float = -math.inf
    wait_up_to_s: float = 0.0
    shadow: bool = False

    def __post_init__(self) -> None:
        """Refuse a limit that is NaN.

        Raises:
            ValueError: if there is one.
        """
        if any(map(math.isnan, (self.max_age_s, self.since_s, self.wait_up_to_s))):
            raise ValueError("`max_age_s`, `since_s` and `wait_up_to_s` of a decision must not be NaN")

    def is_met(self, reading: Reading[Value], now_s: float) -> bool:
        """Return whether a reading answers the request at an instant."""
        return reading.known and reading.start_s >= self.since_s and reading.age_s(now_s) <= self.max_age_s


@dataclass(slots=True, kw_only=True)
class Decision:
    """The state of one decision.

    Attributes:
        number: the number of the decision in the run, from 1.
        asked_s: when the decision was requested.
        reading: the last reading of the variable that was looked up for this decision.
        is_met: whether this reading answers the request.
        looked_s: when the main execution itself began to look.
    """

    number: int
    request: DecisionRequest
    asked_s: float
    reading: Reading[Value]
    is_met: bool = False
    looked_s: float = math.nan

    @property
    def is_answered(self) -> bool:
        """Return whether context has answered, so that the main execution need not look."""
        return self.is_met and not self.request.shadow
