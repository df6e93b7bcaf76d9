"""Run trials in parallel, each in its own process.

A fresh process has no state of another trial. The process also writes the trial's record, so that outcomes are always
read from the disk, no matter which call of the command ran the trial. Trial processes block interrupts, so Ctrl-C is
reported only once. If the program that started the trial processes is killed, they end as well.
"""

from __future__ import annotations

import errno
import gc
import multiprocessing
import os
import signal
import tempfile
import threading
import traceback
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from enum import Enum
from multiprocessing import connection, resource_tracker
from multiprocessing.context import SpawnProcess
from pathlib import Path

import codra_dsl
from codra_dsl.integrations.inspection import SpecError
from codra_dsl.runtime import CallError, NotDeclaredError, UnknownNameError
from codra_papers.experiments.campaign.experiment import AnyOutcome, AnyTrial
from codra_papers.experiments.campaign.trial_records import ChangedMeanwhileError, TrialRecord
from codra_papers.experiments.interrupts import interrupts_held_back
from codra_papers.lab.simulator.gl import GraphicsUnavailableError, choose_backend, use_backend

_SPAWN = multiprocessing.get_context("spawn")
_EXPLAINED_ERRORS = (
    ChangedMeanwhileError,
    SpecError,
    CallError,
    NotDeclaredError,
    UnknownNameError,
)
"""Errors in the input of a trial. The message of such an error explains the failure, so no traceback is stored."""


_DISK_ERROR_NUMBERS = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)

_TUNABLES_VARIABLE = "GLIBC_TUNABLES"
_MEMORY_TUNABLES = ":".join(
    f"glibc.malloc.{name}={setting}"
    for name, setting in (("trim_threshold", 512 << 20), ("mmap_threshold", 32 << 20), ("tcache_count", 5000))
)
"""Settings of GNU's memory allocation: how much free memory a process keeps, the size from which a freed block is
returned to the system at once, and how many small blocks are cached."""


class TrialError(Exception):
    """A trial failed.

    Attributes:
        trial: the trial that failed.
        reason: why the trial failed, in one line.
        details: the file with the traceback; None if the reason explains the failure.
    """

    def __init__(self, trial: AnyTrial, reason: str, details: Path | None) -> None:
        super().__init__(f"trial '{trial.name}' (seed {trial.seed}): {reason}")
        self.trial = trial
        self.reason = reason
        self.details = details


class ClusterError(Exception):
    """A cluster cannot run trials."""


class _Done(Enum):
    """The message of a process that has written its trial's record."""

    DONE = "done"


@dataclass(frozen=True, slots=True, kw_only=True)
class Failure:
    """The report of a process whose trial raised an exception.

    Attributes:
        reason: why the trial failed.
        error_number: the `errno` if the operating system refused to write the record; 0 for any other error.
        traceback: the traceback; empty if the reason explains the failure.
    """

    reason: str
    error_number: int = 0
    traceback: str = ""


_Report = _Done | Failure


@dataclass(frozen=True, slots=True)
class _Worker:
    """A process that runs a trial."""

    record: TrialRecord
    process: SpawnProcess
    report_connection: connection.Connection

    def outcome(self) -> AnyOutcome:
        """Wait for the process to report or to end, and return the outcome of its trial.

        Raises:
            TrialError: if the trial has no outcome.
            OSError: if the operating system refused to write the record.
        """
        try:
            report = self.report_connection.recv()
        except EOFError:
            self.process.join()
            raise TrialError(self.record.trial, exit_text(self.process.exitcode or 0), None) from None
        self.process.join()
        if isinstance(report, Failure):
            raise error_of(self.record, report)
        outcome = self.record.read()
        if outcome is None:
            raise TrialError(self.record.trial, f"its record '{self.record.path}' was changed before it was read", None)
        return outcome

    def end(self) -> None:
        """Kill the process if it still runs, and release its resources."""
        self.process.kill()
        self.process.join()
        self.process.close()
        self.report_connection.close()


def run_in_processes(records: Sequence[TrialRecord], staging: Path, processes: int) -> Iterator[AnyOutcome]:
    """Start trials in the given order, several at once. Yield each outcome as soon as its trial is done.

    A failed trial ends all trials, because a report needs every trial, and a correction of the code changes the digests
    of all records.

    Args:
        records: the records of the trials to run.
        staging: an empty folder for temporary files, on the same disk as the records.
        processes: how many trials run at once.

    Raises:
        TrialError: if a trial fails; the others are killed.
        OSError: if a record cannot be written.
    """
    backend = _backend([record.trial for record in records])
    waiting_records = list(reversed(records))
    running_workers: dict[connection.Connection, _Worker] = {}
    resource_tracker.ensure_running()  # if the tracker started within the block below, it would unblock interrupts
    try:
        while waiting_records or running_workers:
            with interrupts_held_back():  # `finally` ends only the workers in `running_workers`
                while waiting_records and len(running_workers) < processes:
                    worker = _start_worker(waiting_records.pop(), staging / str(len(waiting_records)), backend)
                    running_workers[worker.report_connection] = worker
            for report_connection in connection.wait(list(running_workers)):
                assert isinstance(report_connection, connection.Connection)
                outcome = running_workers[report_connection].outcome()
                running_workers.pop(report_connection).end()
                yield outcome
    finally:
        for worker in running_workers.values():
            worker.end()


def _backend(trials: Sequence[AnyTrial]) -> str | None:
    """Return the graphics backend that draws the frames of trials. Return None if no trial draws frames.

    The backend is determined once here, so that the processes of trials need not try backends again.

    Raises:
        TrialError: if no graphics backend works on this machine.
    """
    drawing_trials = [trial for trial in trials if trial.draws_frames]
    try:
        return choose_backend() if drawing_trials else None
    except GraphicsUnavailableError as error:
        raise TrialError(drawing_trials[0], str(error), None) from error


def _start_worker(record: TrialRecord, staging: Path, backend: str | None) -> _Worker:
    staging.mkdir()
    receiving_end, sending_end = _SPAWN.Pipe(duplex=False)
    process = _SPAWN.Process(target=_run_trial, args=(record, staging, backend, sending_end))
    with _memory_kept():
        process.start()
    sending_end.close()
    return _Worker(record, process, receiving_end)


@contextmanager
def _memory_kept() -> Iterator[None]:
    """Let a process that is started within the block keep the memory that it frees."""
    before = os.environ.get(_TUNABLES_VARIABLE)
    os.environ.update(memory_settings())
    try:
        yield
    finally:
        if before is None:
            del os.environ[_TUNABLES_VARIABLE]
        else:
            os.environ[_TUNABLES_VARIABLE] = before


def memory_settings() -> Mapping[str, str]:
    """Return the environment variable with which a process keeps the memory that it frees.

    Perception allocates and frees pictures of one megabyte all the time. By default, GNU's C library returns the memory
    of each picture to the system, and the system clears every page at the next allocation. Clearing takes as long as
    the work on the picture.
    """
    before = os.environ.get(_TUNABLES_VARIABLE)
    return {_TUNABLES_VARIABLE: _MEMORY_TUNABLES if before is None else f"{_MEMORY_TUNABLES}:{before}"}


def error_of(record: TrialRecord, failure: Failure) -> Exception:
    """Return the exception for a failed trial, after writing its traceback to a file."""
    if failure.error_number:
        return OSError(failure.error_number, os.strerror(failure.error_number), str(record.folder))
    if not failure.traceback:
        return TrialError(record.trial, failure.reason, None)
    record.error_path.write_text(failure.traceback, encoding="utf-8")
    return TrialError(record.trial, failure.reason, record.error_path)


def exit_text(code: int) -> str:
    """Return how a process ended that reported nothing."""
    if code >= 0:
        return f"its process ended with exit code {code} and reported nothing"
    hint = ": perhaps there was too little memory" if -code == signal.SIGKILL else ""
    return f"its process was ended by {signal.Signals(-code).name}{hint}"


# In the process of a trial


def _run_trial(
    record: TrialRecord, staging: Path, backend: str | None, report_connection: connection.Connection
) -> None:
    """Run a trial and report how it ended."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if backend is not None:
        use_backend(backend)
    tempfile.tempdir = str(staging)
    report_connection.send(make_record(record, staging))
    report_connection.close()
    gc.freeze()  # a last search for reference cycles would take long, and all memory is freed when the process ends


def make_record(record: TrialRecord, staging: Path) -> _Report:
    """Run a trial, write its record, and return how it ended."""
    try:
        record.make(staging)
    except _EXPLAINED_ERRORS as error:
        return Failure(reason=str(error))
    except OSError as error:
        if error.errno is None or not _is_record_error(error, record.folder):
            return _unexpected_failure(error)
        return Failure(reason=str(error), error_number=error.errno)
    except Exception as error:  # noqa: BLE001  the parent process reports it
        return _unexpected_failure(error)
    return _Done.DONE


def _is_record_error(error: OSError, folder: Path) -> bool:
    """Return whether an error means that the record could not be written.

    This is the case if the file of the error is in the folder of records. If the error has no file, it is the case if
    the disk is full or defective.
    """
    if error.filename is None:
        return error.errno in _DISK_ERROR_NUMBERS
    return isinstance(error.filename, str) and Path(error.filename).is_relative_to(folder)


def _unexpected_failure(error: Exception) -> Failure:
    frames = traceback.extract_tb(error.__traceback__)
    packages_folder = Path(codra_dsl.__file__).parents[1]
    path = Path(frames[-1].filename)
    place = path.relative_to(packages_folder) if path.is_relative_to(packages_folder) else path
    reason = f"{type(error).__name__}: {error} ({place.as_posix()}:{frames[-1].lineno})"
    return Failure(reason=" ".join(reason.split()), traceback="".join(traceback.format_exception(error)))


def _end_with_parent() -> None:
    """End this process as soon as its parent process has ended, also if the parent was killed."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os.kill(os.getpid(), signal.SIGKILL)
