"""Trials side by side, each in a fresh process: what one leaves behind touches no other, and none outlives us."""

from __future__ import annotations

import errno
import gc
import multiprocessing
import os
import signal
import tempfile
import threading
import traceback
from collections.abc import Iterator, Sequence
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
from codra_papers.experiments.campaign.interrupts import interrupts_held_back
from codra_papers.experiments.campaign.records import ChangedMeanwhileError, TrialRecord
from codra_papers.lab.simulator.gl import GraphicsUnavailableError, choose_backend, rely_on

_SPAWN = multiprocessing.get_context("spawn")
_TOLD_ENOUGH = (
    ChangedMeanwhileError,
    SpecError,
    CallError,
    NotDeclaredError,
    UnknownNameError,
)
"""What says by itself what is wrong, and is no bug."""


_FULL = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG, errno.EIO)

_TUNABLES = "GLIBC_TUNABLES"
_KEPT = ":".join(
    f"glibc.malloc.{name}={setting}"
    for name, setting in (("trim_threshold", 512 << 20), ("mmap_threshold", 32 << 20), ("tcache_count", 5000))
)
"""How much memory may be free, from which size on a piece is not kept, and how many small pieces are at hand."""


class TrialError(Exception):
    """A trial failed.

    Attributes:
        trial: which one.
        reason: in a line.
        details: the file that tells more; None if there is no more to tell.
    """

    def __init__(self, trial: AnyTrial, reason: str, details: Path | None) -> None:
        super().__init__(f"trial '{trial.name}' (seed {trial.seed}): {reason}")
        self.trial = trial
        self.reason = reason
        self.details = details


class _Done(Enum):
    """What a process says that has kept what came of its trial."""

    DONE = "done"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Failure:
    """What a process says whose trial raised something.

    Attributes:
        error_number: of what the operating system refused; 0 for anything else.
        traceback: empty if the reason is enough.
    """

    reason: str
    error_number: int = 0
    traceback: str = ""


_Told = _Done | _Failure


@dataclass(frozen=True, slots=True)
class _Worker:
    """A process that runs a trial."""

    record: TrialRecord
    process: SpawnProcess
    told: connection.Connection

    def outcome(self) -> AnyOutcome:
        """Return what came of the trial, once the process has said something or ended.

        Raises:
            TrialError: if nothing came of it.
            OSError: if that is what the operating system refused.
        """
        try:
            told = self.told.recv()
        except EOFError:
            self.process.join()
            raise TrialError(self.record.trial, _end_of(self.process.exitcode or 0), None) from None
        self.process.join()
        if isinstance(told, _Failure):
            raise _error_of(self.record, told)
        outcome = self.record.read()
        if outcome is None:
            raise TrialError(self.record.trial, f"its record '{self.record.path}' was changed meanwhile", None)
        return outcome

    def end(self) -> None:
        """End the process, whatever it does, and give back what it held."""
        self.process.kill()
        self.process.join()
        self.process.close()
        self.told.close()


def run_in_processes(records: Sequence[TrialRecord], staging: Path, processes: int) -> Iterator[AnyOutcome]:
    """Run trials, so many at once, in the order given; yield what came of each when it is done.

    Args:
        records: of the trials.
        staging: an empty folder for what is made on the way, on the disk of the records.
        processes: how many run at once.

    Raises:
        TrialError: if a trial fails; the others are given up.
        OSError: if something cannot be written.
    """
    backend = _backend([record.trial for record in records])
    waiting = list(reversed(records))
    running: dict[connection.Connection, _Worker] = {}
    resource_tracker.ensure_running()  # later it would let interrupts through again as it starts
    try:
        while waiting or running:
            with interrupts_held_back():  # also until it is known whom to end
                while waiting and len(running) < processes:
                    worker = _started(waiting.pop(), staging / str(len(waiting)), backend)
                    running[worker.told] = worker
            for told in connection.wait(list(running)):
                assert isinstance(told, connection.Connection)
                outcome = running[told].outcome()
                running.pop(told).end()
                yield outcome
    finally:
        for worker in running.values():
            worker.end()


def _backend(trials: Sequence[AnyTrial]) -> str | None:
    """Return what draws the frames of trials, lest each of their processes finds it out; None if none draws any.

    Raises:
        TrialError: if nothing here draws.
    """
    drawing = [trial for trial in trials if trial.draws_frames]
    try:
        return choose_backend() if drawing else None
    except GraphicsUnavailableError as error:
        raise TrialError(drawing[0], str(error), None) from error


def _started(record: TrialRecord, staging: Path, backend: str | None) -> _Worker:
    staging.mkdir()
    ours, theirs = _SPAWN.Pipe(duplex=False)
    process = _SPAWN.Process(target=_work, args=(record, staging, backend, theirs))
    with _memory_kept():
        process.start()
    theirs.close()
    return _Worker(record, process, ours)


@contextmanager
def _memory_kept() -> Iterator[None]:
    """Let a process that begins now keep the memory that it frees.

    Perception makes and frees pictures of a megabyte all the time. GNU's C library gives each back to the system, which
    clears every page when it is asked for the next: that takes as long as the work on the picture.
    """
    before = os.environ.get(_TUNABLES)
    os.environ[_TUNABLES] = _KEPT if before is None else f"{_KEPT}:{before}"
    try:
        yield
    finally:
        if before is None:
            del os.environ[_TUNABLES]
        else:
            os.environ[_TUNABLES] = before


def _error_of(record: TrialRecord, failure: _Failure) -> Exception:
    if failure.error_number:
        return OSError(failure.error_number, os.strerror(failure.error_number), str(record.folder))
    if not failure.traceback:
        return TrialError(record.trial, failure.reason, None)
    record.error_path.write_text(failure.traceback, encoding="utf-8")
    return TrialError(record.trial, failure.reason, record.error_path)


def _end_of(code: int) -> str:
    if code >= 0:
        return f"its process ended by itself with exit code {code}"
    hint = ": perhaps there was too little memory" if -code == signal.SIGKILL else ""
    return f"its process was ended by {signal.Signals(-code).name}{hint}"


# In the process of a trial


def _work(record: TrialRecord, staging: Path, backend: str | None, told: connection.Connection) -> None:
    """Run a trial and say what became of it."""
    threading.Thread(target=_end_with_parent, daemon=True).start()
    if backend is not None:
        rely_on(backend)
    tempfile.tempdir = str(staging)
    told.send(_made(record, staging))
    told.close()
    gc.freeze()  # the end gives back all memory anyway: to search it for cycles before would take long


def _made(record: TrialRecord, staging: Path) -> _Told:
    try:
        record.make(staging)
    except _TOLD_ENOUGH as error:
        return _Failure(reason=str(error))
    except OSError as error:
        if error.errno is None or not _is_ours(error, record.folder):
            return _unexpected(error)
        return _Failure(reason=str(error), error_number=error.errno)
    except Exception as error:  # noqa: BLE001  it is told by who began this process
        return _unexpected(error)
    return _Done.DONE


def _is_ours(error: OSError, folder: Path) -> bool:
    """Return whether an error is about keeping what came of a trial; that a disk is full is about no file by name."""
    if error.filename is None:
        return error.errno in _FULL
    return isinstance(error.filename, str) and Path(error.filename).is_relative_to(folder)


def _unexpected(error: Exception) -> _Failure:
    frames = traceback.extract_tb(error.__traceback__)
    package = Path(codra_dsl.__file__).parents[1]
    path = Path(frames[-1].filename)
    place = path.relative_to(package) if path.is_relative_to(package) else path
    reason = f"{type(error).__name__}: {error} ({place.as_posix()}:{frames[-1].lineno})"
    return _Failure(reason=" ".join(reason.split()), traceback="".join(traceback.format_exception(error)))


def _end_with_parent() -> None:
    """End this process when the one that began it is no more, however that ended."""
    parent = multiprocessing.parent_process()
    assert parent is not None
    parent.join()
    os.kill(os.getpid(), signal.SIGKILL)
