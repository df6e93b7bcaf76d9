"""One job of one algorithm, from the request to its end."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from enum import Enum

from codra_dsl.logic import Value
from codra_dsl.runtime.clock import Timer, Work
from codra_dsl.runtime.perception.job import Interval, RunningJob
from codra_dsl.runtime.perception.outcome import Failure, Result
from codra_dsl.runtime.perception.requests import Ticket
from codra_dsl.runtime.values.model import Algorithm


class State(Enum):
    """The state of a job."""

    WAITING = "waiting"
    RUNNING = "running"
    ENDED = "ended"


class JobRun:
    """One job of one algorithm, from the request to its end.

    Attributes:
        state: whether the job waits, runs or has ended.
        requested_s: when the job was requested.
        start_s: when the job began; None until then.
        end_s: when the job ended; None until then.
        outcome: the job's result or failure. It is None until the job has ended, and stays None if the job was
            cancelled or could not begin.
    """

    def __init__(
        self,
        algorithm: Algorithm,
        index: int,
        find_arguments: Callable[[], Mapping[str, Value | None] | None],
        on_change: Callable[[], None],
    ) -> None:
        self.algorithm = algorithm
        self.index = index
        self.find_arguments = find_arguments
        self.on_change = on_change
        self.state = State.WAITING
        self.requested_s = 0.0
        self.start_s: float | None = None
        self.end_s: float | None = None
        self.outcome: Result | Failure | None = None
        self.ticket: Ticket | None = None
        self.timer: Timer | None = None
        self.work: Work | None = None
        self.job: RunningJob | None = None
        self.last_report: tuple[float, Interval] | None = None
        self.on_evidence: Callable[[JobRun, float, Interval], None] = lambda *_: None

    def evidence(self, now_s: float) -> Interval | None:
        """Return the interval in which the job's evidence is taken; None before the job runs.

        This is the last interval that the job has reported until now. If the job has reported none, it is the entire
        duration of the job.
        """
        if self.start_s is None:
            return None
        report = self.job.last_report_until(now_s) if self.job is not None else None
        if report is None:
            return Interval(self.start_s, self.end_s)
        if report is not self.last_report:
            self.last_report = report
            self.on_evidence(self, *report)
        return report[1]
