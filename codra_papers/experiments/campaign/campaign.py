"""Run many trials on all cores. Each trial is stored when it is done, so a stopped campaign can be continued."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

from codra_papers.experiments.campaign.experiment import AnyOutcome, AnyTrial
from codra_papers.experiments.campaign.trial_records import TrialRecord, records_of
from codra_papers.experiments.campaign.workers import run_in_processes

TRIALS = "trials"
"""The name of the folder for the records and frames of trials, within the folder of an experiment."""

_STAGING = ".codra-"

Runner = Callable[[Sequence[TrialRecord], Path], Iterator[AnyOutcome]]
"""A function that runs trials, stores each record, and yields each outcome as soon as its trial is done. It gets the
records, and an empty folder for temporary files on the same disk."""


class CampaignBusyError(Exception):
    """Another program runs trials in the same folder."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """The progress of a campaign.

    Attributes:
        done: how many trials are complete.
        total: how many trials there are.
        reused_trial_count: how many of the complete trials already had a valid record at the start.
        latest: the name of the trial that was completed last; empty at the start.
    """

    done: int
    total: int
    reused_trial_count: int
    latest: str


def local_processes(processes: int) -> Runner:
    """Return a function that runs trials on this machine, `processes` of them at once."""
    return partial(run_in_processes, processes=processes)


def run_campaign(
    trials: Sequence[AnyTrial], folder: Path, *, run: Runner, progress: Callable[[Progress], None]
) -> Mapping[str, Any]:
    """Run all trials that have no valid record, and return the outcomes of all trials in the given order.

    The key of an outcome is the name of its trial. A record is valid if it was made from the same trial, spec, code and
    libraries. An outcome does not depend on the other trials, or on the machine and the process that ran it.

    Args:
        trials: the trials; their names must differ and be valid file names.
        folder: the folder of the experiment; the records are written to its subfolder `trials`.
        run: the function that runs trials, e.g. `local_processes(2)`.
        progress: a function that is called at the start and after each trial.

    Raises:
        ValueError: if a name is not a valid file name, or occurs twice.
        SpecError: if a spec has errors.
        CampaignBusyError: if another program runs trials in the same folder.
        TrialError: if a trial fails; the records of the trials that were completed before this trial are kept.
        OSError: if a file cannot be written.

    Other errors of `run` are passed on.
    """
    _check_names([trial.name for trial in trials])
    trials_folder = folder / TRIALS
    trials_folder.mkdir(parents=True, exist_ok=True)
    with _locked_folder(trials_folder):
        records = records_of(trials, trials_folder)
        outcomes = {record.trial.name: outcome for record in records if (outcome := record.read()) is not None}
        reused_trial_count = len(outcomes)
        progress(Progress(done=reused_trial_count, total=len(trials), reused_trial_count=reused_trial_count, latest=""))
        missing_records = [record for record in records if record.trial.name not in outcomes]
        for outcome in _run_missing_trials(missing_records, trials_folder, run):
            outcomes[outcome.name] = outcome
            progress(
                Progress(
                    done=len(outcomes), total=len(trials), reused_trial_count=reused_trial_count, latest=outcome.name
                )
            )
    return {trial.name: outcomes[trial.name] for trial in trials}


def cores() -> int:
    """Return how many cores this program may use."""
    return len(os.sched_getaffinity(0))


def _run_missing_trials(
    missing_records: Sequence[TrialRecord], trials_folder: Path, run: Runner
) -> Iterator[AnyOutcome]:
    """Run trials, and yield each outcome. A temporary folder of the trials is removed at the end, or after an error."""
    if not missing_records:
        return
    with tempfile.TemporaryDirectory(prefix=_STAGING, dir=trials_folder) as staging:
        yield from run(missing_records, Path(staging))


def _check_names(names: Sequence[str]) -> None:
    repeated_names = [name for name, count in Counter(names).items() if count > 1]
    if repeated_names:
        raise ValueError(f"two trials have the name '{repeated_names[0]}'")
    for name in names:
        is_hidden = not name or name.startswith(".") or not name.isprintable()
        if is_hidden or Path(name).name != name or Path(name).suffix in (".json", ".error") or len(name.encode()) > 200:
            raise ValueError(f"{name!r} is not a valid name for a trial")


@contextmanager
def _locked_folder(trials_folder: Path) -> Iterator[None]:
    """Lock the folder of trials against other programs, and remove the temporary files of killed programs."""
    descriptor = os.open(trials_folder, os.O_RDONLY)
    try:
        with suppress(OSError):  # a file system without locks
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise CampaignBusyError(f"another program runs trials in '{trials_folder}'") from error
        for stale_folder in trials_folder.glob(f"{_STAGING}*"):
            shutil.rmtree(stale_folder, ignore_errors=True)
        yield
    finally:
        os.close(descriptor)
