"""Hosts: other programs, on this machine or another one, that run perception functions for the context manager.

A host executes jobs; the manager decides which jobs start, and judges their evidence. While a host is not connected,
its algorithms cannot look. If a host is lost, its jobs end as failed looks.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Protocol

from codra_dsl.logic import Value
from codra_dsl.runtime.clock import Clock, Work
from codra_dsl.runtime.perception.job import Interval, RunningJob
from codra_dsl.runtime.perception.outcome import Failure, Result, checked
from codra_dsl.runtime.values.cell import Reason
from codra_dsl.runtime.values.model import Algorithm

Deliver = Callable[[Result | Failure], None]

JobKey = tuple[str, int]
"""The name of an algorithm, and the number of one of its jobs."""

NOT_YET_CONNECTED = "it has not connected yet"


def obstacle_text(host: str, because: str = NOT_YET_CONNECTED) -> str:
    """Return why the algorithms of a host cannot look."""
    return f"host {host!r} is not connected: {because}"


class HostConnection(Protocol):
    """Sends orders to a connected host. No method waits or raises."""

    def perform(self, key: JobKey, random_seed: str, arguments: Mapping[str, Value | None]) -> None:
        """Order the host to execute a job."""
        ...

    def cancel(self, key: JobKey) -> None:
        """Order the host to cancel a job, because its result is no longer needed."""
        ...

    def kill(self, key: JobKey) -> None:
        """Order the host to end the process of a job that has not ended by itself."""
        ...


class HostedWork(Work):
    """A job that a host executes, as work of the context manager."""

    def __init__(self, clock: Clock, cancel: Callable[[], None]) -> None:
        super().__init__()
        self._clock = clock
        self._cancel = cancel

    def now_s(self) -> float:
        """Return the present instant."""
        return self._clock.now_s()

    def sleep(self, duration_s: float) -> None:
        """Fail: the function runs elsewhere."""
        raise AssertionError(f"a job of a host cannot sleep {duration_s} s here")

    def cancel(self) -> None:
        """Cancel the job; the host reports its end."""
        super().cancel()
        self._cancel()


@dataclass(frozen=True, slots=True, kw_only=True)
class _HostedJob:
    """A job that a host executes now."""

    algorithm: Algorithm
    job: RunningJob
    deliver: Deliver


class Hosts:
    """The hosts that are connected, and the jobs that they execute. Callers hold the context manager's lock.

    Attributes:
        are_here: whether the program of the context manager also runs the functions of all hosts.
    """

    def __init__(self, clock: Clock, *, are_here: bool) -> None:
        self.are_here = are_here
        self._clock = clock
        self._connections: dict[str, HostConnection | None] = {}
        self._loss_reasons: dict[str, str] = {}
        self._jobs: dict[JobKey, _HostedJob] = {}

    def connect(self, host: str, connection: HostConnection | None) -> None:
        """Note that a host is connected; the connection is None if its jobs run in the program of the manager.

        Raises:
            ValueError: if the host is connected already.
        """
        if host in self._connections:
            raise ValueError(f"host {host!r} is connected already: only one program can be this host")
        self._connections[host] = connection

    def disconnect(self, host: str, because: str) -> None:
        """Note that a host is lost. All of its jobs end."""
        self._connections.pop(host, None)
        self._loss_reasons[host] = because
        lost_jobs = {key: hosted for key, hosted in self._jobs.items() if hosted.algorithm.host == host}
        for key, hosted in lost_jobs.items():
            del self._jobs[key]
            hosted.deliver(Failure(Reason.UNREACHABLE, self.obstacle(host)))

    def obstacle(self, host: str) -> str:
        """Return why the algorithms of a host cannot look; empty if the host is connected, or if `host` is empty."""
        if not host or host in self._connections:
            return ""
        return obstacle_text(host, self._loss_reasons.get(host, NOT_YET_CONNECTED))

    def start(
        self, algorithm: Algorithm, job: RunningJob, arguments: Mapping[str, Value | None], deliver: Deliver
    ) -> None:
        """Order a connected host to execute a job; `deliver` is called with its outcome when the host reports it."""
        key = (algorithm.name, job.index)
        self._jobs[key] = _HostedJob(algorithm=algorithm, job=job, deliver=deliver)
        self._connection(algorithm).perform(key, job.random_seed, arguments)

    def cancel(self, algorithm: Algorithm, index: int) -> None:
        """Order the host of a job to cancel the job, unless it has ended."""
        if (algorithm.name, index) in self._jobs:
            self._connection(algorithm).cancel((algorithm.name, index))

    def kill(self, algorithm: Algorithm, index: int) -> None:
        """Order the host of a job to end its process, unless it has ended."""
        if (algorithm.name, index) in self._jobs:
            self._connection(algorithm).kill((algorithm.name, index))

    def report_evidence(self, host: str, key: JobKey, interval: Interval) -> None:
        """Note when the evidence of a job was taken. A report about another host's job, or an ended job, is ignored."""
        hosted = self._jobs.get(key)
        if hosted is not None and hosted.algorithm.host == host:
            hosted.job.report(interval)

    def end(self, host: str, key: JobKey, outcome: Mapping[str, object] | Failure) -> None:
        """Deliver the outcome of a job: the values that its function returned, or a failure.

        An outcome of another host's job, or of an ended job, is ignored.
        """
        hosted = self._jobs.get(key)
        if hosted is not None and hosted.algorithm.host == host:
            del self._jobs[key]
            hosted.deliver(outcome if isinstance(outcome, Failure) else checked(hosted.algorithm, outcome))

    def work(self, algorithm: Algorithm, index: int) -> HostedWork:
        """Return the work of a job that a host will execute."""
        return HostedWork(self._clock, lambda: self.cancel(algorithm, index))

    def _connection(self, algorithm: Algorithm) -> HostConnection:
        connection = self._connections[algorithm.host]
        assert connection is not None
        return connection
