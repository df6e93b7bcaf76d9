"""Which writes have reached all replicas, so that deletions among them can be forgotten.

Each replica promises from time to time that it will write only after an instant. A replica that has received all
commits which another one had made until its promise has received everything that the other one will ever have written
up to this instant. The minimum over all replicas is the horizon of a replica: up to this instant nothing new arrives.
The minimum of all horizons is the stable instant: up to it, no replica lacks any write.

A digest carries the known members together with the horizon. Therefore a replica that uses the horizon of another one
knows all members which that horizon takes into account, and the members that join later write only after it.
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
