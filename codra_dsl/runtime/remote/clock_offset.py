"""The offset between the clock of a host and the clock of its manager, and how far the estimate can be off.

As in NTP, the host notes its time before a question and after the answer; the manager states its time in between. So
the true offset is within half the round trip of the middle. Between two exchanges, the clocks drift apart.
"""

from __future__ import annotations

from collections import deque
from dataclasses import dataclass
from operator import itemgetter

MAX_DRIFT = 200e-6
"""The largest drift between two clocks, in seconds per second. Oscillators of computers drift by at most 100 ppm."""

_KEPT_EXCHANGES = 64
"""An exchange with a short round trip stays the best one until the drift since then outweighs its advantage."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ClockReading:
    """An instant of a host's clock, on the clock of the manager.

    Attributes:
        instant_s: the estimated instant.
        uncertainty_s: how far the true instant is from it at most.
    """

    instant_s: float
    uncertainty_s: float


@dataclass(frozen=True, slots=True, kw_only=True)
class _Exchange:
    host_s: float
    offset_s: float
    uncertainty_s: float

    def uncertainty_at_s(self, host_s: float, max_drift: float) -> float:
        return self.uncertainty_s + max_drift * abs(host_s - self.host_s)


class ClockOffset:
    """The last exchanges with the manager, and the instants on the clock of the manager that follow from them."""

    def __init__(self, max_drift: float = MAX_DRIFT) -> None:
        self._max_drift = max_drift
        self._exchanges: deque[_Exchange] = deque(maxlen=_KEPT_EXCHANGES)

    def add(self, asked_s: float, manager_s: float, answered_s: float) -> None:
        """Add an exchange.

        Args:
            asked_s: the time of the host when it asked.
            manager_s: the time of the manager when it answered.
            answered_s: the time of the host when it received the answer.
        """
        middle_s = (asked_s + answered_s) / 2.0
        half_trip_s = (answered_s - asked_s) / 2.0
        self._exchanges.append(
            _Exchange(
                host_s=middle_s,
                offset_s=manager_s - middle_s,
                uncertainty_s=half_trip_s * (1.0 + self._max_drift),
            )
        )

    def manager_time(self, host_s: float) -> ClockReading:
        """Return the instant on the manager's clock at which the host's clock showed `host_s`.

        Raises:
            LookupError: if there was no exchange yet.
        """
        if not self._exchanges:
            raise LookupError("the clocks have not been compared yet")
        uncertainty_s, best = min(
            ((exchange.uncertainty_at_s(host_s, self._max_drift), exchange) for exchange in self._exchanges),
            key=itemgetter(0),
        )
        return ClockReading(instant_s=host_s + best.offset_s, uncertainty_s=uncertainty_s)
