"""Which writes have reached all replicas, so that deletions among them can be forgotten.

From time to time, a replica promises to write only after an instant. Another replica that has received all commits
before this promise has received everything that the first one will ever have written up to this instant. The minimum
of the promises of all replicas, as received by one replica, is the horizon of that replica: no write up to this instant
can still arrive there. The minimum of all horizons is the stable instant: no replica lacks a write up to this instant.

A digest carries the known members together with the horizon. So a replica that uses the horizon of another replica
knows all members for which this horizon holds. A member that joins later writes only after the horizon.
"""

from __future__ import annotations

from collections.abc import Iterable

from codra_dsl.runtime.replication.hybrid_time import BEFORE_ALL, HybridTime


class Stability:
    """The promises and horizons of all members, as far as one replica knows them.

    Attributes:
        name: the replica.
        members: all known replicas, this one included.
    """

    def __init__(self, name: str, others: Iterable[str]) -> None:
        """Begin without promises."""
        self.name = name
        self.members = {name, *others}
        self._promises: dict[str, HybridTime] = {}
        self._horizons: dict[str, HybridTime] = {}

    @property
    def promise(self) -> HybridTime:
        """Return the latest promise of this replica."""
        return self._promises.get(self.name, BEFORE_ALL)

    def receive_promise(self, name: str, instant: HybridTime) -> None:
        """Note a promise of a replica all of whose commits up to the promise were received."""
        self._promises[name] = max(instant, self._promises.get(name, BEFORE_ALL))

    def receive_horizon(self, name: str, instant: HybridTime) -> None:
        """Note the horizon of a replica."""
        self._horizons[name] = max(instant, self._horizons.get(name, BEFORE_ALL))

    def horizon(self) -> HybridTime:
        """Return the instant up to which this replica has received everything that members write."""
        instant = min(self._promises.get(member, BEFORE_ALL) for member in self.members)
        self.receive_horizon(self.name, instant)
        return self._horizons[self.name]

    def stable(self) -> HybridTime:
        """Return the instant up to which all members have received everything that members write."""
        self.horizon()
        return min(self._horizons.get(member, BEFORE_ALL) for member in self.members)
