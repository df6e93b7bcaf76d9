"""A row of results: our cost, the peer's cost, and whether their ratio meets its target."""

from __future__ import annotations

from dataclasses import dataclass


class PeerMissingError(Exception):
    """A peer is not installed. The message names the peer and the command that installs it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One measurement. Both sides are from the same run and in the same unit, seconds or bytes."""

    name: str
    ours: float
    peer: float
    target: float

    @property
    def ratio(self) -> float:
        """Return our cost as a multiple of the peer's."""
        return self.ours / self.peer

    def record(self) -> dict[str, object]:
        """Return the row in the form of `results.json`."""
        return {
            "name": self.name,
            "ours": float(f"{self.ours:.4g}"),
            "peer": float(f"{self.peer:.4g}"),
            "ratio": float(f"{self.ratio:.4g}"),
            "target": self.target,
            "met": self.ratio <= self.target,
        }
