"""A row of results: what we take, what the peer takes, and whether their ratio is what it must be."""

from __future__ import annotations

from dataclasses import dataclass


class PeerMissingError(Exception):
    """A peer is not installed; says which, and what installs it."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """One measurement, both sides taken in the same run and in the same unit: seconds or bytes."""

    name: str
    ours: float
    peer: float
    target: float

    @property
    def ratio(self) -> float:
        """Return how many times the peer's cost ours is."""
        return self.ours / self.peer

    def record(self) -> dict[str, object]:
        """Return the row as `results.json` has it."""
        return {
            "name": self.name,
            "ours": float(f"{self.ours:.4g}"),
            "peer": float(f"{self.peer:.4g}"),
            "ratio": float(f"{self.ratio:.4g}"),
            "target": self.target,
            "met": self.ratio <= self.target,
        }
