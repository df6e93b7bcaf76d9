"""One job of one algorithm, from the request to its end."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import Enum

from codra_dsl.logic import Value
from codra_dsl.runtime.clock import Timer, Work
from codra_dsl.runtime.model import Algorithm
from codra_dsl.runtime.perception.job import Interval, RunningJob
from codra_dsl.runtime.perception.outcome import Failure, Result
from codra_dsl.runtime.slots import Ticket


class State(Enum):
    """How far an attempt is."""

    WAITING = "waiting"
    RUNNING = "running"
    ENDED = "ended"


class Attempt:
    """One job of one algorithm, from the request to its end.

    Attributes:
        state: how far it is.
        requested_s: when it was asked for.
        start_s: when the job began; None before.
        outcome: what it brought; None until it has ended, and for ever when it was cancelled or could not begin.
    """

    def __init__(
        self,
        algorithm: Algorithm,
        index: int,
        arguments: Callable[[], Mapping[str, Value | None] | None],
        changed: Callable[[], None],
    ) -> None:
        self.algorithm = algorithm
        self.index = index
        self.arguments = arguments
        self.changed = changed
        self.state = State.WAITING
        self.requested_s = 0.0
        self.start_s: float | None = None
        self.end_s: float | None = None
        self.outcome: Result | Failure | None = None
        self.ticket: Ticket | None = None
        self.timeout: Timer | None = None
        self.work: Work | None = None
        self.job: RunningJob | None = None
        self.heard: tuple[float, Interval] | None = None
        self.noted: Callable[[Attempt, float, Interval], None] = _nothing

    def evidence(self, now_s: float) -> Interval | None:
        """Return when its evidence is taken, as far as the job has told until now; None before it runs.

        The evidence of a job that tells nothing about it is taken during the whole job.
        """
        if self.start_s is None:
            return None
        told = self.job.told_by(now_s) if self.job is not None else None
        if told is None:
            return Interval(self.start_s, self.end_s)
        if told is not self.heard:
            self.heard = told
            self.noted(self, *told)
        return told[1]


def _nothing(*_: object) -> None:
    pass
