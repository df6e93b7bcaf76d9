"""The seeds of reports. They follow from the commit of a protocol, so nobody can have seen them before it."""

from __future__ import annotations

from collections.abc import Mapping
from hashlib import sha256

_LAB_COMMIT = "8d37b94381a8a7e5a466ab9c6a8e08495ce8c2bd"

PROTOCOL_COMMITS: Mapping[str, str] = {
    "lab-robustness": _LAB_COMMIT,
    "lab-sensitivity": _LAB_COMMIT,
    "store": "37983028888bd6092369d94c981e815be86b3a01",
}
"""The commit with the protocol of an experiment: docs/papers/protocol.md, or docs/papers/store-experiment.md."""

SEEDS_PER_EXPERIMENT = 1_000
"""The seeds of an experiment begin at a multiple of this number, which is greater than all earlier seeds."""


def reported_seeds(experiment: str, count: int, commit: str | None = None) -> range:
    """Return the first `count` seeds of the report of an experiment.

    The first seed is 1000 times (1 + the first 24 bits of the SHA-256 digest of the commit, a space and the name).

    Args:
        experiment: the name of the experiment.
        count: how many seeds there are, at most `SEEDS_PER_EXPERIMENT`.
        commit: the complete hash of the protocol's commit; None for the one in `PROTOCOL_COMMITS`.

    Raises:
        KeyError: if `commit` is None and the experiment is not in `PROTOCOL_COMMITS`.
        ValueError: if there are more seeds than the experiment has.
    """
    if count > SEEDS_PER_EXPERIMENT:
        raise ValueError(f"{experiment} has {SEEDS_PER_EXPERIMENT} seeds, not {count}")
    protocol_commit = PROTOCOL_COMMITS[experiment] if commit is None else commit
    digest = sha256(f"{protocol_commit} {experiment}".encode()).digest()
    first_seed = SEEDS_PER_EXPERIMENT * (1 + int.from_bytes(digest[:3], "big"))
    return range(first_seed, first_seed + count)
