"""The results of a node, and the error of a tree that cannot go on."""

from __future__ import annotations

from enum import StrEnum

from py_trees.common import Status


class Result(StrEnum):
    """The states of a node: those of py_trees, and SKIPPED, which py_trees does not have.

    A node is IDLE before it is ticked and after it was halted or skipped. SKIPPED is only returned to a node's parent.
    """

    IDLE = "idle"
    RUNNING = "running"
    SUCCESS = "success"
    FAILURE = "failure"
    SKIPPED = "skipped"

    @property
    def is_completed(self) -> bool:
        """Return whether the result is a success or a failure."""
        return self is Result.SUCCESS or self is Result.FAILURE

    @property
    def status(self) -> Status:
        """Return the status in py_trees, where idle and skipped are both INVALID."""
        return _STATUSES[self]


_STATUSES = {
    Result.IDLE: Status.INVALID,
    Result.RUNNING: Status.RUNNING,
    Result.SUCCESS: Status.SUCCESS,
    Result.FAILURE: Status.FAILURE,
    Result.SKIPPED: Status.INVALID,
}


class TreeError(RuntimeError):
    """A tree cannot go on, for example because an entry is missing or a value has the wrong type."""
