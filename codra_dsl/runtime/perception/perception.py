"""Perception outside the tick: jobs that run perception functions, with slots, timeouts and cancellation.

If a perception function raises, hangs or returns an invalid result, its job ends with a `Failure`; the forest and the
main execution are not affected (P1, section 3.2: observers never interfere).
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Collection, Iterable, Mapping

from codra_dsl.isolation.error_text import described
from codra_dsl.logic import Value
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.journal import EventWriter, Kind
from codra_dsl.runtime.perception.cost import Cost, CostMeter
from codra_dsl.runtime.perception.executors import Executors
from codra_dsl.runtime.perception.functions import CallError, Function
from codra_dsl.runtime.perception.hosts import Hosts
from codra_dsl.runtime.perception.job import Interval, RunningJob
from codra_dsl.runtime.perception.job_run import JobRun, State
from codra_dsl.runtime.perception.outcome import Failure, Result
from codra_dsl.runtime.perception.requests import Precedence
from codra_dsl.runtime.perception.slots import Slots
from codra_dsl.runtime.values.cell import Reason
from codra_dsl.runtime.values.model import Algorithm

GRACE_S = 0.2
"""How long a job may take to end by itself after its timeout. Then its process is ended, if it runs in a process."""


class Perception:
    """Runs the jobs of all algorithms of one forest. Callers hold the context manager's lock.

    Attributes:
        hosts: the other programs that run perception functions.
    """

    def __init__(
        self,
        *,
        clock: Clock,
        slots: Slots,
        make_handles: Callable[[Collection[str]], Mapping[str, object]],
        seed: int,
        event_writer: EventWriter,
        hosts: Hosts,
        find_function: Callable[[Algorithm], Function],
    ) -> None:
        """Store the arguments without running anything.

        Args:
            clock: the clock that gives the time of the jobs.
            slots: the slots of shared resources.
            make_handles: returns the handles of all resources whose names are in its argument, by name.
            seed: the seed of the random numbers that jobs draw.
            event_writer: writes the events of jobs.
            hosts: runs the jobs of algorithms with a host.
            find_function: returns the function of an algorithm, or raises `CallError`.
        """
        self._clock = clock
        self._executors = Executors(find_function, clock.start)
        self._slots = slots
        self._make_handles = make_handles
        self._handles: Mapping[str, object] = {}
        self._seed = seed
        self._event_writer = event_writer
        self.hosts = hosts
        self._cost_meters: dict[str, CostMeter] = {}
        self._request_counts: Counter[str] = Counter()
        self._working_jobs: dict[str, JobRun] = {}
        self._reports_lock = new_lock()

    def prepare(self, algorithms: Iterable[Algorithm]) -> None:
        """Find the functions, handles and slots of all algorithms; start the processes of isolated algorithms.

        Raises:
            CallError: if a function, handle or resource is missing.
        """
        algorithms_by_name = {algorithm.name: algorithm for algorithm in algorithms}
        local_algorithms = [algorithm for algorithm in algorithms_by_name.values() if not self._has_host(algorithm)]
        self._handles = self._make_handles({name for algorithm in local_algorithms for name in algorithm.handles})
        for algorithm in local_algorithms:
            self._check_handles(algorithm)
        for algorithm in algorithms_by_name.values():
            self._check_slots(algorithm)
            self._slots.register_user(algorithm.slots, algorithm.timeout_s)
            self._cost_meters[algorithm.name] = CostMeter()
        self._executors.prepare(local_algorithms, self._handles)

    def close(self) -> None:
        """Close the objects of perception classes, and end all processes.

        This method waits, so the caller must not hold the lock.
        """
        self._executors.close()

    def cost_meter(self, algorithm: Algorithm) -> CostMeter:
        """Return the counters of an algorithm's costs and results."""
        return self._cost_meters[algorithm.name]

    def total_cost(self, algorithms: Iterable[Algorithm]) -> Cost:
        """Return the costs and results of some algorithms so far."""
        return sum((self._cost_meters[algorithm.name].cost() for algorithm in algorithms), Cost())

    def working_job(self, algorithm: Algorithm) -> JobRun | None:
        """Return the job whose function has not ended yet, even if the result of the job is no longer needed.

        An algorithm has at most one such job. Return None if it has none.
        """
        return self._working_jobs.get(algorithm.name)

    def request(
        self,
        algorithm: Algorithm,
        precedence: Precedence,
        find_arguments: Callable[[], Mapping[str, Value | None] | None],
        on_change: Callable[[], None],
    ) -> JobRun:
        """Request a job. It starts when it gets its slots: in a later event of the clock, never inside this call.

        Args:
            algorithm: the algorithm; no other job of this algorithm may be running.
            precedence: returns the current precedence of this request among other requests for the same slots.
            find_arguments: called when the job is about to begin; returns the values of the context-variables that the
                job receives, or None if the job must not begin.
            on_change: called when the job ends, when its function ends, and when the function takes too long to end.
        """
        job_run = JobRun(algorithm, self._request_counts[algorithm.name], find_arguments, on_change)
        self._request_counts[algorithm.name] += 1
        job_run.requested_s = self._clock.now_s()
        job_run.ticket = self._slots.request(
            algorithm.slots, precedence, lambda: self._begin_job(job_run), algorithm.timeout_s
        )
        return job_run

    def cancel(self, job_run: JobRun) -> None:
        """Cancel a job, because its result is no longer needed."""
        if job_run.start_s is not None and not isinstance(job_run.outcome, Failure):
            self._cost_meters[job_run.algorithm.name].cancelled_count += 1
        if job_run.state is not State.ENDED:
            self._write_job_event(job_run, "cancelled")
            self._abandon_job(job_run)

    def void(self, job_run: JobRun, condition: str) -> None:
        """Discard the present or future result of a job, because a condition failed while its evidence was taken."""
        if not isinstance(job_run.outcome, Failure):
            self._cost_meters[job_run.algorithm.name].voided_count += 1
        self._write_job_event(job_run, "voided", condition=condition)
        self._abandon_job(job_run)

    def _has_host(self, algorithm: Algorithm) -> bool:
        """Return whether the jobs of an algorithm run in another program."""
        return bool(algorithm.host) and not self.hosts.are_here

    def _check_handles(self, algorithm: Algorithm) -> None:
        missing_handles = [name for name in algorithm.handles if name not in self._handles]
        if missing_handles:
            raise CallError(
                f"perception {algorithm.name!r} reads resource {missing_handles[0]!r}: "
                "pass its handle to start() in `resources`"
            )

    def _check_slots(self, algorithm: Algorithm) -> None:
        unknown_resources = [name for name in algorithm.slots if name not in self._slots.free_slot_counts]
        if unknown_resources:
            resource = unknown_resources[0]
            raise CallError(f"perception {algorithm.name!r} needs a slot of {resource!r}, which is not a resource")

    def _begin_job(self, job_run: JobRun) -> None:
        arguments = job_run.find_arguments()
        if arguments is None:
            self._end_job(job_run)
            job_run.on_change()
            return
        algorithm = job_run.algorithm
        job_run.state, job_run.start_s = State.RUNNING, self._clock.now_s()
        self._cost_meters[algorithm.name].begin(job_run.start_s - job_run.requested_s)
        job_run.on_evidence = self._record_evidence
        self._working_jobs[algorithm.name] = job_run
        self._write_job_event(job_run, "started")
        deadline_s = job_run.start_s + algorithm.timeout_s
        try:
            self._start_job(job_run, arguments)
        except RuntimeError as error:  # no thread could be started
            self._event_writer.write_input(algorithm.name, "unstarted", index=job_run.index, message=str(error))
            self._end_delivered_job(job_run, Failure(Reason.FAILED, described(error)))
            return
        if self.working_job(algorithm) is job_run:  # a host may be lost while it gets its order
            job_run.timer = self._clock.call_at(deadline_s, lambda: self._time_out(job_run))

    def _start_job(self, job_run: JobRun, arguments: Mapping[str, Value | None]) -> None:
        algorithm, index = job_run.algorithm, job_run.index
        random_seed = f"{self._seed}/{algorithm.name}/{index}"
        if not self._has_host(algorithm):
            job_run.work = self._clock.start(
                lambda work: self._run_job(
                    job_run, RunningJob(work, random_seed, index, self._reports_lock), arguments
                ),
                lambda outcome: self._deliver_outcome(job_run, outcome),
            )
            return
        job_run.work = self.hosts.work(algorithm, index)
        job_run.job = RunningJob(job_run.work, random_seed, index, self._reports_lock)
        self.hosts.start(algorithm, job_run.job, arguments, lambda outcome: self._deliver_outcome(job_run, outcome))

    def _run_job(self, job_run: JobRun, job: RunningJob, arguments: Mapping[str, Value | None]) -> Result | Failure:
        job_run.job = job
        return self._executors.execute(job_run.algorithm, job, arguments, self._handles)

    def _record_evidence(self, job_run: JobRun, report_instant_s: float, interval: Interval) -> None:
        """Record a job's report about its evidence when the report is first used."""
        evidence_s = [interval.start_s, interval.stamp_s]
        host_details = {"earliest_s": interval.earliest_stamp_s, "host_s": interval.host_s}
        self._event_writer.write_input(
            job_run.algorithm.name,
            "evidence",
            index=job_run.index,
            told_s=report_instant_s,
            evidence_s=evidence_s,
            **{} if interval.host_s is None else host_details,
        )

    def _deliver_outcome(self, job_run: JobRun, outcome: Result | Failure) -> None:
        self._event_writer.write_input(job_run.algorithm.name, "delivered", index=job_run.index)
        self._end_delivered_job(job_run, outcome)

    def _end_delivered_job(self, job_run: JobRun, outcome: Result | Failure) -> None:
        del self._working_jobs[job_run.algorithm.name]
        if job_run.timer is not None:
            job_run.timer.cancel()
        if job_run.state is not State.ENDED:
            self._end_job(job_run)
            self._set_outcome(job_run, outcome)
        job_run.on_change()

    def _time_out(self, job_run: JobRun) -> None:
        """End a job that takes too long. A job that was cancelled before, but has not ended, is recorded as stuck."""
        if job_run.state is State.ENDED:
            self._write_job_event(job_run, "stuck")
        else:
            self._abandon_job(job_run)
            self._set_outcome(job_run, Failure(Reason.TIMED_OUT, f"no result within {job_run.algorithm.timeout_s:g} s"))
        if self.working_job(job_run.algorithm) is job_run:
            job_run.timer = self._clock.call_at(self._clock.now_s() + GRACE_S, lambda: self._kill_job(job_run))
        job_run.on_change()

    def _kill_job(self, job_run: JobRun) -> None:
        """End the process of a job that has not ended by itself."""
        if self.working_job(job_run.algorithm) is not job_run:
            return
        if self._has_host(job_run.algorithm):
            self.hosts.kill(job_run.algorithm, job_run.index)
        else:
            self._executors.executor_of(job_run.algorithm).kill_job()

    def _set_outcome(self, job_run: JobRun, outcome: Result | Failure) -> None:
        job_run.outcome = outcome
        if isinstance(outcome, Failure):
            self._cost_meters[job_run.algorithm.name].failed_count += 1
            self._write_job_event(job_run, "failed", reason=outcome.reason, message=outcome.message)
        else:
            evidence = job_run.evidence(self._clock.now_s())
            evidence_s = [] if evidence is None else [evidence.start_s, evidence.stamp_s]
            self._write_job_event(job_run, "returned", values=outcome.values, evidence_s=evidence_s)

    def _abandon_job(self, job_run: JobRun) -> None:
        if job_run.state is not State.ENDED:
            self._end_job(job_run)
            if job_run.work is not None:
                job_run.work.cancel()

    def _end_job(self, job_run: JobRun) -> None:
        job_run.state, job_run.end_s = State.ENDED, self._clock.now_s()
        if job_run.start_s is not None:
            self._cost_meters[job_run.algorithm.name].end(job_run.end_s - job_run.start_s, len(job_run.algorithm.slots))
        if job_run.ticket is not None:
            self._slots.release(job_run.ticket)
            # The ticket and the job run refer to each other. Without this reference there is no cycle, so both are
            # freed without the garbage collector.
            job_run.ticket = None

    def _write_job_event(self, job_run: JobRun, what: str, **details: object) -> None:
        self._event_writer.write(Kind.JOB, job_run.algorithm.name, what, index=job_run.index, **details)
