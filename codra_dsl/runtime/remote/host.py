"""The program of a host: it executes jobs for a context manager, which decides when they start and judges them.

A host opens a session like a main execution, and attaches itself by its name. The manager then sends orders as notices;
the host reports evidence and outcomes as requests. All reported instants are on the manager's clock.
"""

from __future__ import annotations

import contextlib
import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

from codra_dsl.isolation.error_text import described
from codra_dsl.runtime.clock import Clock, Timer, Work
from codra_dsl.runtime.context.package_files import manifest_of
from codra_dsl.runtime.errors import unknown_name_error
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.perception import Failure, Function, imported
from codra_dsl.runtime.perception.executors import Executors
from codra_dsl.runtime.perception.hosts import JobKey
from codra_dsl.runtime.perception.job import Interval, RunningJob
from codra_dsl.runtime.perception.outcome import Result
from codra_dsl.runtime.perception.site_handles import with_site_handles
from codra_dsl.runtime.remote.clock_offset import MAX_DRIFT, ClockOffset
from codra_dsl.runtime.remote.links import Link
from codra_dsl.runtime.remote.protocol import MAX_NAME_CHARACTERS, VERSION, PlainData, error_of
from codra_dsl.runtime.values.cell import Reason
from codra_dsl.runtime.values.model import Algorithm

HOST_LEASE_S = 1.5
"""How long a host and its manager wait for a message of each other before they count as lost."""

KEEP_PERIOD_S = 0.3
"""The time between two messages that renew the lease and compare the clocks."""

RECONNECT_PERIOD_S = 0.5
"""The time between two attempts to connect."""

Connect = Callable[[], Link]
"""Returns a link to the manager, or raises ConnectionError."""

_LOGGER = logging.getLogger(__name__)


class Host:
    """Executes the jobs of one host, in any kind of time. It connects again whenever the connection is lost.

    Attributes:
        name: the name of the host in the spec.
        is_attached: whether the manager has accepted the host.
    """

    def __init__(
        self,
        name: str,
        algorithms: Iterable[Algorithm],
        *,
        handles: Mapping[str, object],
        clock: Clock,
        connect: Connect,
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
            connect: connects to the manager.
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
        self._connect = connect
        self._spec_digest = spec_digest
        self._max_drift = max_drift
        self._executors = Executors(find, clock.start)
        self._executors.prepare(list(self._algorithms.values()), handles)
        self._lock = new_lock()
        self._connect_lock = new_lock()
        self._link: Link | None = None
        self._is_closed = False
        self._works: dict[tuple[Link, JobKey], Work] = {}
        self._questions: dict[int, tuple[str, PlainData, float]] = {}
        self._request_count = 0
        self._clock_offset = ClockOffset(max_drift)
        self._last_answer_s = 0.0
        self._timer: Timer | None = None
        self._last_report = ""

    def start(self) -> None:
        """Connect to the manager, now or as soon as it can be reached."""
        with self._connect_lock:
            if self._is_closed or self._link is not None:
                return
            try:
                link = self._connect()
            except ConnectionError as error:
                with self._lock:
                    self._report(str(error))
                    if not self._is_closed:
                        self._schedule(RECONNECT_PERIOD_S, self.start)
                return
            with self._lock:
                if not self._is_closed:
                    self._open(link)
                    return
            link.close()

    def _open(self, link: Link) -> None:
        self._link = link
        self._clock_offset, self._last_answer_s = ClockOffset(self._max_drift), self._clock.now_s()
        self._questions.clear()
        link.open(partial(self._receive, link), partial(self._lose, link))
        token_field = {} if link.token is None else {"token": link.token}
        self._ask("hello", lease_s=HOST_LEASE_S, **token_field)
        self._ask("attach", host=self.name, digest=self._spec_digest)
        self._keep()

    def close(self) -> None:
        """Cancel all jobs, leave the manager, and end all processes. This method waits."""
        with self._lock:
            self._is_closed = True
            self._ask("leave")
            link = self._link
        if link is not None:
            self._lose(link, "the host has closed")
        self._executors.close()
        with self._connect_lock:  # the program must not end while a thread connects: Zenoh would abort it
            pass

    # Connection

    def _schedule(self, delay_s: float, callback: Callable[[], None]) -> None:
        if self._timer is not None:
            self._timer.cancel()
        self._timer = self._clock.call_at(self._clock.now_s() + delay_s, callback)

    def _report(self, text: str) -> None:
        """Log the state of the connection if it has changed."""
        if text != self._last_report:
            self._last_report = text
            _LOGGER.warning("host %s: %s", self.name, text)

    def _lose(self, link: Link, because: str) -> None:
        """Cancel all jobs, because a link is lost; connect again a little later, unless the host is closed."""
        with self._lock:
            if link is not self._link:
                return  # an earlier link, which is lost already
            self._link, self.is_attached = None, False
            works = list(self._works.values())
            self._report(f"not connected: {because}")
            if self._timer is not None:
                self._timer.cancel()
            if not self._is_closed:
                self._schedule(RECONNECT_PERIOD_S, self.start)
        link.close()
        for work in works:
            work.cancel()

    def _ask(self, ask: str, **fields: object) -> None:
        """Send a request, unless the host is not connected: then the manager has given up its jobs."""
        with self._lock:
            if self._link is None:
                return
            self._request_count += 1
            self._questions[self._request_count] = (ask, fields, self._clock.now_s())
            with contextlib.suppress(ConnectionError):  # the end of the link follows
                self._link.send({"codra": VERSION, "id": self._request_count, "ask": ask, **fields})

    def _keep(self) -> None:
        """Renew the lease and compare the clocks, again and again; a manager that does not answer is lost."""
        with self._lock:
            link = self._link
            if link is None:
                return
            is_silent = self._clock.now_s() - self._last_answer_s > HOST_LEASE_S
            if not is_silent:
                self._ask("keep")
                self._schedule(KEEP_PERIOD_S, self._keep)
        if is_silent:
            self._lose(link, f"the manager did not answer for {HOST_LEASE_S:g} s")

    def _receive(self, link: Link, message: Any) -> None:
        """Handle an answer, an error or an order of the manager, unless its link is lost."""
        if link is not self._link:
            return
        match message:
            case {"notice": "perform"}:
                self._perform(link, message)
            case {"notice": "cancel"}:
                if (work := self._works.get((link, (message["algorithm"], message["index"])))) is not None:
                    work.cancel()
            case {"notice": "kill"}:
                if (link, (message["algorithm"], message["index"])) in self._works:
                    self._executors.executor_of(self._algorithms[message["algorithm"]]).kill_job()
            case {"notice": "closed" | "lease_over"}:
                self._lose(link, str(message["message"]))
            case {"id": int(number)}:
                self._note_answer(link, number, message)
            case _:
                pass

    def _note_answer(self, link: Link, number: int, message: Mapping[str, Any]) -> None:
        with self._lock:
            if link is not self._link:
                return
            ask, fields, asked_s = self._questions.pop(number, ("", {}, 0.0))
            now_s = self._last_answer_s = self._clock.now_s()
            if "error" not in message and ask in ("hello", "keep"):
                self._clock_offset.add(asked_s, message["answer"]["now_s"], now_s)
            elif "error" not in message and ask == "attach":
                self.is_attached = True
                self._report("connected")
            elif "error" in message and "values" in fields:
                because = f"the manager refuses its result: {error_of(message['error'])}"
                self._report_end(link, (fields["algorithm"], fields["index"]), Failure(Reason.FAILED, because))
        if "error" in message and (ask in ("hello", "attach") or message["error"]["kind"] == "lease_over"):
            self._lose(link, str(error_of(message["error"])))

    # Jobs

    def _perform(self, link: Link, order: Mapping[str, Any]) -> None:
        key = (str(order["algorithm"]), int(order["index"]))
        algorithm = self._algorithms.get(key[0])
        if algorithm is None:
            self._report_end(link, key, Failure(Reason.FAILED, f"host {self.name!r} does not run {key[0]!r}"))
            return
        arguments = {argument["name"]: argument["value"] for argument in order["arguments"]}
        random_seed = str(order["random_seed"])

        def run(work: Work) -> Result | Failure:
            job = _HostJob(
                work, random_seed, key[1], lambda interval: self._schedule_evidence(work, link, key, interval)
            )
            return self._executors.execute(algorithm, job, arguments, self._handles)

        with self._lock:  # a job that ends at once is reported after it is in `_works`
            if link is not self._link:
                return
            if any(name == algorithm.name for _, (name, _) in self._works):  # a cancelled job of an earlier link
                self._executors.executor_of(algorithm).kill_job()
            try:
                self._works[link, key] = self._clock.start(run, partial(self._report_end, link, key))
            except RuntimeError as error:  # no thread could be started
                self._report_end(link, key, Failure(Reason.FAILED, described(error)))

    def _report_end(self, link: Link, key: JobKey, outcome: Result | Failure) -> None:
        """Report the outcome of a job, unless its link is lost: the next manager may have a job with the same key."""
        with self._lock:
            self._works.pop((link, key), None)
            if link is not self._link:
                return
            fields: PlainData = {"algorithm": key[0], "index": key[1]}
            if isinstance(outcome, Failure):
                self._ask("ended", **fields, message=outcome.message[:MAX_NAME_CHARACTERS])
            else:
                values = [{"name": name, "value": value} for name, value in outcome.values.items() if value is not None]
                self._ask("ended", **fields, values=values)

    def _schedule_evidence(self, work: Work, link: Link, key: JobKey, interval: Interval) -> None:
        """Report evidence at the instant that the work has reached. In simulated time, it is in the future."""
        self._clock.call_at(work.now_s(), lambda: self._report_evidence(link, key, interval))

    def _report_evidence(self, link: Link, key: JobKey, interval: Interval) -> None:
        assert interval.stamp_s is not None
        with self._lock:
            if link is not self._link:
                return
            start, stamp = map(self._clock_offset.manager_time, (interval.start_s, interval.stamp_s))
            start_s = start.instant_s - start.uncertainty_s
            self._ask(
                "evidence",
                algorithm=key[0],
                index=key[1],
                start_s=start_s,
                stamp_s=stamp.instant_s + stamp.uncertainty_s,
                earliest_s=max(start_s, stamp.instant_s - stamp.uncertainty_s),
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


def host_of_package(
    package: ModuleType,
    name: str,
    *,
    handles: Mapping[str, object],
    clock: Clock,
    connect: Connect,
    max_drift: float = MAX_DRIFT,
) -> Host:
    """Return a host for a generated package; call its `start`.

    Args:
        package: the package, which the manager has as well.
        name: the name of the host in the spec.
        handles: the handle of each resource without slots; handles that the site states may be left out.
        clock: the clock of this machine.
        connect: connects to the manager.
        max_drift: the largest drift between the clocks of both machines, in seconds per second.

    Raises:
        UnknownNameError: if no algorithm of the spec has this host.
        CallError: if a function or handle is missing.
    """
    algorithms = [algorithm for algorithm in _algorithms_of(package) if algorithm.host == name]
    if not algorithms:
        raise unknown_name_error("host", name, sorted({algorithm.host for algorithm in _algorithms_of(package)} - {""}))
    names = {handle for algorithm in algorithms for handle in algorithm.handles}
    resources = [resource for resource in package.MODEL.resources if resource.name in names]
    return Host(
        name,
        algorithms,
        handles=with_site_handles(resources, handles, clock),
        clock=clock,
        connect=connect,
        spec_digest=manifest_of(Path(package.__file__ or "").parent).get("model", ""),
        max_drift=max_drift,
    )


def _algorithms_of(package: ModuleType) -> Sequence[Algorithm]:
    modules = [module for module in vars(package).values() if isinstance(module, ModuleType)]
    return [member for module in modules for member in vars(module).values() if isinstance(member, Algorithm)]
