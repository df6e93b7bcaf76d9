"""Run trials on the workers of a Dask cluster.

Each trial is sent to one worker, together with the files that it needs. Dask itself would start the trial of a lost
worker again without a word, so this module decides which worker runs a trial, and reports when a trial is repeated.
"""

from __future__ import annotations

import logging
import pickle
import sys
from collections import Counter, deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import dask
from distributed import CancelledError, Client, Future, KilledWorker, wait

from codra_dsl.integrations.inspection import source_files
from codra_dsl.language.project import root_of
from codra_papers.experiments.campaign.cluster_trial import MadeRecord, Parcel, Refusal
from codra_papers.experiments.campaign.cluster_worker import identity_of, run_parcel
from codra_papers.experiments.campaign.experiment import AnyOutcome
from codra_papers.experiments.campaign.trial_records import (
    FRAMES,
    PACKAGE_FOLDERS,
    RECORD,
    TrialRecord,
    code_digest,
    library_versions,
)
from codra_papers.experiments.campaign.workers import (
    ClusterError,
    Failure,
    TrialError,
    error_of,
    exit_text,
    memory_settings,
)

MAX_LOSSES = 3
"""How many workers may be lost while they run the same trial before the trial counts as failed."""

_POLL_PERIOD_S = 1.0
_CONNECT_TIMEOUT_S = 10.0
_MARKER = {"pyproject.toml": b"[tool.codra]\n"}
"""The file that marks the root of the copied project."""


def run_on_cluster(
    records: Sequence[TrialRecord], staging: Path, address: str, notify: Callable[[str], None]
) -> Iterator[AnyOutcome]:
    """Run trials on the workers of a cluster, one for each thread of a worker. Yield each outcome when it is stored.

    A worker whose code or libraries differ gets no trials. If a worker is lost, its trial is run again. A failed trial
    ends all trials, as in `run_in_processes`. The trials that still run then, or after an interrupt, are killed.

    Args:
        records: the records of the trials to run. The trials are dataclasses.
        staging: an empty folder for temporary files, on the same disk as the records.
        address: the address of the scheduler, e.g. `tcp://10.0.0.1:8786`.
        notify: a function that is called with a sentence about each refused worker, each repeated trial, and about
            missing workers.

    Raises:
        ClusterError: if no scheduler answers, if the scheduler is lost, or if all workers are refused.
        TrialError: if a trial fails, or loses `MAX_LOSSES` workers.
        OSError: if a record cannot be written.
    """
    files_by_spec = {spec: _files_of(spec) for spec in {record.trial.spec for record in records}}
    with _connected(address) as client:
        campaign = _Campaign(client, staging, notify, files_by_spec, deque(records))
        try:
            while campaign.waiting_records or campaign.running:
                with _reporting_lost_scheduler(client, address):
                    campaign.update_workers()
                    campaign.start_trials()
                    done_futures = campaign.done_futures()
                for future in done_futures:
                    outcome = campaign.outcome_of(future)
                    if outcome is not None:
                        yield outcome
        finally:
            campaign.cancel()


@dataclass(frozen=True, slots=True)
class _Attempt:
    """A trial that was sent to a worker."""

    record: TrialRecord
    address: str


@dataclass(slots=True)
class _Campaign:
    """The trials that wait, and those that run on workers.

    Attributes:
        files_by_spec: the files that the trials of a spec need. The keys are their paths, relative to the project.
        thread_counts: how many trials each worker runs at once. The keys are the addresses of the workers.
        has_no_workers: whether the lack of workers has been reported.
        worker_ids: the identities of the connected workers. The keys are their addresses.
        refused_ids: the identities of the workers that get no trials.
        loss_counts: how many workers were lost during a trial. The keys are the names of the trials.
    """

    client: Client
    staging: Path
    notify: Callable[[str], None]
    files_by_spec: Mapping[Path, Mapping[str, bytes]]
    waiting_records: deque[TrialRecord]
    running: dict[Future[Any], _Attempt] = field(default_factory=dict)
    thread_counts: Mapping[str, int] = field(default_factory=dict)
    has_no_workers: bool = False
    worker_ids: dict[str, str] = field(default_factory=dict)
    refused_ids: set[str] = field(default_factory=set)
    loss_counts: Counter[str] = field(default_factory=Counter)

    def update_workers(self) -> None:
        """Learn which workers are connected, and repeat the trials of lost workers."""
        self.thread_counts = self.client.nthreads()
        if not self.thread_counts and not self.has_no_workers:
            self.notify("no worker is connected to the scheduler; the trials wait for workers")
        self.has_no_workers = not self.thread_counts
        for address in [address for address in self.worker_ids if address not in self.thread_counts]:
            self._forget(address)
        for future, attempt in list(self.running.items()):
            if attempt.address not in self.worker_ids:
                self._repeat(future)
        new_addresses = [address for address in self.thread_counts if address not in self.worker_ids]
        answers = self.client.run(identity_of, workers=new_addresses, on_error="return") if new_addresses else {}
        for address, answer in answers.items():
            if isinstance(answer, str):
                self.worker_ids[address] = answer
            elif not isinstance(answer, OSError):  # an OSError means that the worker has just been lost
                self.worker_ids[address] = address
                self._refuse(address, f"{type(answer).__name__}: {answer}")

    def start_trials(self) -> None:
        """Send waiting trials to workers that have free threads."""
        busy_counts = Counter(attempt.address for attempt in self.running.values())
        for address, identity in self.worker_ids.items():
            while self.waiting_records and identity not in self.refused_ids:
                if busy_counts[address] >= self.thread_counts[address]:
                    break
                record = self.waiting_records.popleft()
                future = self.client.submit(
                    run_parcel,
                    pickle.dumps(_parcel(record, self.files_by_spec[record.trial.spec])),
                    identity,
                    memory_settings(),
                    workers=[address],
                    pure=False,
                )
                self.running[future] = _Attempt(record, address)
                busy_counts[address] += 1

    def done_futures(self) -> Sequence[Future[Any]]:
        """Wait for a moment, and return the trials that have ended.

        Raises:
            ClusterError: if all workers are refused.
        """
        if not self.running and self.worker_ids and self.refused_ids.issuperset(self.worker_ids.values()):
            raise ClusterError("all workers are refused")
        with suppress(TimeoutError, CancelledError):
            if self.running:
                wait(list(self.running), timeout=_POLL_PERIOD_S, return_when="FIRST_COMPLETED")
            else:
                self.client.wait_for_workers(1, timeout=_POLL_PERIOD_S)
        return [future for future in self.running if future.done()]

    def outcome_of(self, future: Future[Any]) -> AnyOutcome | None:
        """Store the record of a trial that has ended, and return the outcome. Return None if the trial is repeated.

        Raises:
            TrialError: if the trial failed.
            OSError: if the record cannot be written.
        """
        attempt = self.running[future]
        match _result_of(future):
            case None:
                self._forget(attempt.address)
                self._repeat(future)
                return None
            case Refusal(reason=reason):
                del self.running[future]
                self._refuse(attempt.address, reason)
                self.waiting_records.appendleft(attempt.record)
                return None
            case Failure() as failure:
                reason = f"{failure.reason} (on worker '{attempt.address}')"
                raise error_of(attempt.record, replace(failure, reason=reason, error_number=0))
            case MadeRecord() as made_record:
                del self.running[future]
                return _stored(attempt.record, made_record, self.staging)

    def cancel(self) -> None:
        """End the trials that still run."""
        with suppress(OSError, TimeoutError):
            self.client.cancel(list(self.running), force=True)

    def _refuse(self, address: str, reason: str) -> None:
        identity = self.worker_ids.get(address, address)
        if identity not in self.refused_ids:
            self.refused_ids.add(identity)
            self.notify(f"worker '{address}' is refused: {reason}")

    def _forget(self, address: str) -> None:
        self.worker_ids.pop(address, None)

    def _repeat(self, future: Future[Any]) -> None:
        """Let a trial whose worker was lost wait for another worker."""
        attempt = self.running.pop(future)
        trial = attempt.record.trial
        future.cancel(force=True)
        self.loss_counts[trial.name] += 1
        if self.loss_counts[trial.name] == MAX_LOSSES:
            reason = f"{MAX_LOSSES} workers were lost while they ran it, at last '{attempt.address}'"
            raise TrialError(trial, reason, None)
        self.notify(f"worker '{attempt.address}' was lost: trial '{trial.name}' is run again")
        self.waiting_records.appendleft(attempt.record)


@contextmanager
def _connected(address: str) -> Iterator[Client]:
    """Yield a connection to a scheduler.

    Raises:
        ClusterError: if no scheduler answers.
    """
    for name in [name for name in logging.root.manager.loggerDict if name.startswith("distributed")]:
        logging.getLogger(name).setLevel(logging.CRITICAL)  # errors of the cluster are reported once, in a line
    with dask.config.set({"distributed.comm.timeouts.connect": f"{_CONNECT_TIMEOUT_S:g}s"}):
        try:
            client = Client(address, timeout=_CONNECT_TIMEOUT_S)
        except (OSError, TimeoutError, ValueError, TypeError) as error:
            raise ClusterError(f"no scheduler answers at '{address}': {error}") from error
        try:
            yield client
        finally:
            client.close(timeout=_POLL_PERIOD_S)


@contextmanager
def _reporting_lost_scheduler(client: Client, address: str) -> Iterator[None]:
    try:
        yield
    except (OSError, TimeoutError) as error:
        raise ClusterError(f"the scheduler at '{address}' was lost") from error
    if client.status != "running":
        raise ClusterError(f"the scheduler at '{address}' was lost")


def _result_of(future: Future[Any]) -> MadeRecord | Failure | Refusal | None:
    """Return what a worker reported about a trial; None if the worker was lost."""
    if future.status == "error" and not isinstance(error := future.exception(), KilledWorker):
        return Refusal(reason=f"{type(error).__name__}: {error}")
    match future.result() if future.status == "finished" else None:
        case int() as exit_code:
            return Failure(reason=exit_text(exit_code))
        case bytes() as report:
            result: MadeRecord | Failure | Refusal = pickle.loads(report)
            return result
        case _:
            return None


def _files_of(spec: Path) -> Mapping[str, bytes]:
    """Return a spec, the files that it includes, and the modules of its project that it calls or that are imported."""
    root = root_of(spec)
    paths = [path for path in (*source_files(spec), *_project_modules(root)) if path.is_file()]
    return {**{path.relative_to(root).as_posix(): path.read_bytes() for path in paths}, **_MARKER}


def _parcel(record: TrialRecord, files: Mapping[str, bytes]) -> Parcel:
    trial: Any = record.trial
    return Parcel(
        trial=pickle.dumps(replace(trial, spec=trial.spec.absolute().relative_to(root_of(trial.spec)))),
        files=files,
        digest=record.digest,
        code=code_digest(),
        versions=library_versions(),
    )


def _project_modules(root: Path) -> Iterator[Path]:
    """Yield the files of the imported modules that belong to a project, e.g. the module of the experiment."""
    for module in list(sys.modules.values()):
        path = Path(getattr(module, "__file__", None) or "")
        is_installed = any(path.is_relative_to(folder) for folder in (sys.prefix, *PACKAGE_FOLDERS))
        if path.suffix == ".py" and path.is_relative_to(root) and not is_installed:
            yield path


def _stored(record: TrialRecord, files: MadeRecord, staging: Path) -> AnyOutcome:
    """Write the files of a trial as a local process does, and return the outcome."""
    folder = staging / record.trial.name
    folder.mkdir()
    (folder / RECORD).write_bytes(files.record)
    for name, content in files.frames.items():
        path = folder / FRAMES / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    record.keep(folder)
    outcome = record.read()
    if outcome is None:
        raise TrialError(record.trial, f"its record '{record.path}' was changed before it was read", None)
    return outcome
