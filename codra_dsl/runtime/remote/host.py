"""The program of a host: it executes jobs for a context manager, which decides when they start and judges them.

A host opens a session like a main execution, and attaches itself by its name. The manager then sends orders as notices;
the host reports evidence and outcomes as requests. All reported instants are on the manager's clock.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Any

from codra_dsl.isolation.error_text import described
from codra_dsl.runtime.clock import Clock, Timer, Work
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.perception import Failure, Function, imported
from codra_dsl.runtime.perception.executors import Executors
from codra_dsl.runtime.perception.hosts import JobKey
from codra_dsl.runtime.perception.job import Interval, RunningJob
from codra_dsl.runtime.perception.outcome import Result
from codra_dsl.runtime.remote.clock_offset import MAX_DRIFT, ClockOffset
from codra_dsl.runtime.remote.protocol import MAX_NAME_CHARACTERS, VERSION, PlainData, error_of
from codra_dsl.runtime.values.cell import Reason
from codra_dsl.runtime.values.model import Algorithm

HOST_LEASE_S = 1.5
"""How long the manager waits for a message of a host before the host counts as lost."""

KEEP_PERIOD_S = 0.3
"""The time between two messages that renew the lease and compare the clocks."""

Send = Callable[[PlainData], None]


class Host:
    """Executes the jobs of one host, in any kind of time.

    Attributes:
        name: the name of the host in the spec.
        is_attached: whether the manager has accepted the host.
        refusal: the error with which the manager refused the host; None if it did not.
    """

    def __init__(
        self,
        name: str,
        algorithms: Iterable[Algorithm],
        *,
        handles: Mapping[str, object],
        clock: Clock,
        spec_digest: str = "",
        max_drift: float = MAX_DRIFT,
        find: Callable[[Algorithm], Function] = imported,
    ) -> None:
        """Find the functions of the host's algorithms, and start the processes of isolated ones.

        Args:
            name: the name of the host.
            algorithms: the algorithms of the spec; those of other hosts are ignored.
            handles: the handle of each resource without slots.
            clock: the clock of this machine.
            spec_digest: the digest of the spec, which must be that of the manager's spec.
            max_drift: the largest drift between the clocks of both machines, in seconds per second.
            find: returns the function of an algorithm.

        Raises:
            CallError: if a function or handle is missing.
        """
        self.name = name
        self.is_attached = False
        self._algorithms = {algorithm.name: algorithm for algorithm in algorithms if algorithm.host == name}
        self._handles = handles
        self._clock = clock
        self._spec_digest = spec_digest
        self._executors = Executors(find, clock.start)
        self._executors.prepare(list(self._algorithms.values()), handles)
        self._clock_offset = ClockOffset(max_drift)
        self._lock = new_lock()
        self._send: Send | None = None
        self._works: dict[JobKey, Work] = {}
        self._asked: dict[int, tuple[str, float]] = {}
        self._request_count = 0
        self._keep_timer: Timer | None = None
        self.refusal: Exception | None = None

    def open(self, send: Send) -> None:
        """Attach the host to a manager; `send` passes requests to it, and neither waits nor raises."""
        with self._lock:
            self._send, self.refusal = send, None
            self._ask("hello", lease_s=HOST_LEASE_S)
            self._ask("attach", host=self.name, digest=self._spec_digest)
            self._keep()

    def lose(self) -> None:
        """Cancel all jobs, because the connection to the manager is lost."""
        with self._lock:
            self._send, self.is_attached = None, False
            works = list(self._works.values())
            self._asked.clear()
            if self._keep_timer is not None:
                self._keep_timer.cancel()
        for work in works:
            work.cancel()

    def close(self) -> None:
        """Cancel all jobs, and end all processes. This method waits."""
        self.lose()
        self._executors.close()

    def receive(self, message: Mapping[str, Any]) -> None:
        """Handle an answer, an error or an order of the manager."""
        match message:
            case {"notice": "perform"}:
                self._perform(message)
            case {"notice": "cancel"}:
                if (work := self._works.get((message["algorithm"], message["index"]))) is not None:
                    work.cancel()
            case {"notice": "kill"}:
                if (message["algorithm"], message["index"]) in self._works:
                    self._executors.executor_of(self._algorithms[message["algorithm"]]).kill_job()
            case {"id": int(number)}:
                self._note_answer(number, message)
            case _:
                pass

    # Messages to the manager

    def _ask(self, ask: str, **fields: object) -> None:
        with self._lock:
            if self._send is None:
                return
            self._request_count += 1
            self._asked[self._request_count] = (ask, self._clock.now_s())
            self._send({"codra": VERSION, "id": self._request_count, "ask": ask, **fields})

    def _note_answer(self, number: int, message: Mapping[str, Any]) -> None:
        ask, asked_s = self._asked.pop(number, ("", 0.0))
        if "error" in message and ask in ("hello", "attach"):
            self.refusal = error_of(message["error"])
        elif "error" not in message and ask in ("hello", "keep"):
            self._clock_offset.add(asked_s, message["answer"]["now_s"], self._clock.now_s())
        elif "error" not in message and ask == "attach":
            self.is_attached = True

    def _keep(self) -> None:
        """Renew the lease and compare the clocks, now and then again and again."""
        with self._lock:
            if self._send is None:
                return
            self._ask("keep")
            self._keep_timer = self._clock.call_at(self._clock.now_s() + KEEP_PERIOD_S, self._keep)

    # Jobs

    def _perform(self, order: Mapping[str, Any]) -> None:
        key = (str(order["algorithm"]), int(order["index"]))
        algorithm = self._algorithms.get(key[0])
        if algorithm is None:
            self._report_end(key, Failure(Reason.FAILED, f"host {self.name!r} does not run {key[0]!r}"))
            return
        arguments = {argument["name"]: argument["value"] for argument in order["arguments"]}
        random_seed = str(order["random_seed"])

        def run(work: Work) -> Result | Failure:
            job = _HostJob(work, random_seed, key[1], lambda interval: self._schedule_evidence(work, key, interval))
            return self._executors.execute(algorithm, job, arguments, self._handles)

        with self._lock:  # a job that ends at once is reported after it is in `_works`
            try:
                self._works[key] = self._clock.start(run, partial(self._report_end, key))
            except RuntimeError as error:  # no thread could be started
                self._report_end(key, Failure(Reason.FAILED, described(error)))

    def _report_end(self, key: JobKey, outcome: Result | Failure) -> None:
        with self._lock:
            self._works.pop(key, None)
            fields: PlainData = {"algorithm": key[0], "index": key[1]}
            if isinstance(outcome, Failure):
                self._ask("ended", **fields, message=outcome.message[:MAX_NAME_CHARACTERS])
            else:
                values = [{"name": name, "value": value} for name, value in outcome.values.items() if value is not None]
                self._ask("ended", **fields, values=values)

    def _schedule_evidence(self, work: Work, key: JobKey, interval: Interval) -> None:
        """Report evidence at the instant that the work has reached. In simulated time, it is in the future."""
        self._clock.call_at(work.now_s(), lambda: self._report_evidence(key, interval))

    def _report_evidence(self, key: JobKey, interval: Interval) -> None:
        assert interval.stamp_s is not None
        start, stamp = map(self._clock_offset.manager_time, (interval.start_s, interval.stamp_s))
        self._ask(
            "evidence",
            algorithm=key[0],
            index=key[1],
            start_s=start.instant_s - start.uncertainty_s,
            stamp_s=stamp.instant_s + stamp.uncertainty_s,
            earliest_s=stamp.instant_s - stamp.uncertainty_s,
            host_s=[interval.start_s, interval.stamp_s],
        )


class _HostJob(RunningJob):
    """The `job` argument of a function that a host runs: reports about evidence go to the manager."""

    def __init__(self, work: Work, random_seed: str, index: int, on_report: Callable[[Interval], None]) -> None:
        super().__init__(work, random_seed, index, new_lock())
        self._on_report = on_report

    def report(self, interval: Interval) -> None:
        """Report when the evidence was taken, on the clock of this machine."""
        super().report(interval)
        self._on_report(interval)
