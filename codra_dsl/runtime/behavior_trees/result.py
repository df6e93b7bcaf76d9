"""What a node of a tree comes to, and what is wrong when a tree cannot go on."""

from __future__ import annotations

from enum import StrEnum

from py_trees.common import Status


class Result(StrEnum):
    """The states of a node: those of py_trees, and SKIPPED, which py_trees does not know.

    A node is IDLE before it is ticked and after it was halted or skipped; SKIPPED is only ever told to its parent.
    """

    IDLE = "idle"
    RUNNING = "running"
    SUCCESS = "success"
    FAILURE = "failure"
    SKIPPED = "skipped"

    @property
    def is_completed(self) -> bool:
        """Return whether it is a success or a failure."""
        return self is Result.SUCCESS or self is Result.FAILURE

    @property
    def status(self) -> Status:
        """Return it as py_trees says it; idle and skipped are both INVALID there."""
        return _STATUSES[self]


_STATUSES = {
    Result.IDLE: Status.INVALID,
    Result.RUNNING: Status.RUNNING,
    Result.SUCCESS: Status.SUCCESS,
    Result.FAILURE: Status.FAILURE,
    Result.SKIPPED: Status.INVALID,
}


class TreeError(RuntimeError):
    """Something that a tree asks for and that cannot be done: an entry that is not there, a value that does not fit."""
