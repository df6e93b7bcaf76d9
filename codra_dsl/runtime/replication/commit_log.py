"""The commits that a replica keeps for other replicas, and the numbers of all commits that it has received."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import islice

from codra_dsl.runtime.replication.commits import Commit
from codra_dsl.runtime.replication.hybrid_time import HybridTime


class CommitLog:
    """Commits by replica and number.

    Attributes:
        vector: for each replica, the number up to which all of its commits were received (a version vector).
        pruned: for each replica, the number up to which its commits are no longer kept.
    """

    def __init__(self) -> None:
        """Create an empty log."""
        self.vector: dict[str, int] = {}
        self.pruned: dict[str, int] = {}
        self._commits: dict[str, dict[int, Commit]] = {}

    def __contains__(self, commit: Commit) -> bool:
        has_received = commit.number <= self.vector.get(commit.replica, 0)
        return has_received or commit.number in self._commits.get(commit.replica, {})

    @property
    def is_empty(self) -> bool:
        """Return whether no commits are kept."""
        return not any(self._commits.values())

    def add(self, commit: Commit) -> None:
        """Add a commit; commits may come in any order."""
        self._commits.setdefault(commit.replica, {})[commit.number] = commit
        self._advance(commit.replica)

    def kept_commits(self) -> list[Commit]:
        """Return all commits that are kept, those of each replica in their order."""
        return [commits[number] for _, commits in sorted(self._commits.items()) for number in sorted(commits)]

    def missing(self, vector: Mapping[str, int], max_count: int) -> list[Commit]:
        """Return the first commits that a replica with another vector lacks."""
        missing_commits = (
            self._commits[replica][number]
            for replica, last_number in sorted(self.vector.items())
            for number in range(max(vector.get(replica, 0), self.pruned.get(replica, 0)) + 1, last_number + 1)
        )
        return list(islice(missing_commits, max_count))

    def has_pruned_for(self, vector: Mapping[str, int]) -> bool:
        """Return whether a replica with another vector lacks commits that are no longer kept."""
        return any(vector.get(replica, 0) < number for replica, number in self.pruned.items())

    def prune(self, stable: HybridTime) -> None:
        """Forget the commits up to an instant; all replicas have received them."""
        for replica, commits in self._commits.items():
            for number in range(self.pruned.get(replica, 0) + 1, self.vector.get(replica, 0) + 1):
                if commits[number].time > stable:
                    break
                del commits[number]
                self.pruned[replica] = number

    def adopt(self, vector: Mapping[str, int], pruned: Mapping[str, int]) -> None:
        """Count the commits that another replica has received as received; those that it keeps must be added first."""
        for replica, number in pruned.items():
            self.pruned[replica] = max(self.pruned.get(replica, 0), number)
            kept_commits = self._commits.get(replica, {})
            self._commits[replica] = {key: commit for key, commit in kept_commits.items() if key > self.pruned[replica]}
        for replica, number in vector.items():
            self.vector[replica] = max(self.vector.get(replica, 0), number)
            self._advance(replica)

    def _advance(self, replica: str) -> None:
        commits, number = self._commits.get(replica, {}), self.vector.get(replica, 0)
        while number + 1 in commits:
            number += 1
        self.vector[replica] = number
