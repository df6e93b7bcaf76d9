"""Many trials over all cores, each kept when it is done, so that a campaign that was stopped goes on where it was."""

from __future__ import annotations

import fcntl
import os
import shutil
import tempfile
from collections import Counter
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from codra_papers.experiments.campaign.experiment import AnyOutcome, AnyTrial
from codra_papers.experiments.campaign.records import TrialRecord, records_of
from codra_papers.experiments.campaign.workers import run_in_processes

TRIALS = "trials"
"""The folder, within that of an experiment, in which each trial keeps its record and frames."""

_STAGING = ".codra-"


class CampaignBusyError(Exception):
    """Another program runs trials in the same folder."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Progress:
    """How far a campaign is.

    Attributes:
        done: trials that need not be run any more, of `total`.
        found: those of them that were there before.
        latest: the name of the one that was done last; empty at the start.
    """

    done: int
    total: int
    found: int
    latest: str


def run_campaign(
    trials: Sequence[AnyTrial], folder: Path, *, processes: int | None = None, progress: Callable[[Progress], None]
) -> Mapping[str, Any]:
    """Run all trials that have not been run, and return what came of all, by name, in the order given.

    A trial was run if its record is there and was made from the same trial, spec, code and libraries. What it comes to
    does not depend on the number of processes, nor on what else is run.

    Args:
        trials: of different names, each the name of a file.
        folder: of the experiment; trials are kept in a folder within it.
        processes: how many run at once; None for one a core.
        progress: is told at the start and after each trial.

    Raises:
        ValueError: if a name is no name of a file, or is there twice.
        SpecError: if a spec has errors.
        CampaignBusyError: if another program runs trials in that folder.
        TrialError: if a trial fails; those that were done before are kept.
        OSError: if something cannot be written.
    """
    _check_names([trial.name for trial in trials])
    place = folder / TRIALS
    place.mkdir(parents=True, exist_ok=True)
    with _alone_in(place):
        records = records_of(trials, place)
        outcomes = {record.trial.name: outcome for record in records if (outcome := record.read()) is not None}
        found = len(outcomes)
        progress(Progress(done=found, total=len(trials), found=found, latest=""))
        missing = [record for record in records if record.trial.name not in outcomes]
        for outcome in _run(missing, place, processes or cores()):
            outcomes[outcome.name] = outcome
            progress(Progress(done=len(outcomes), total=len(trials), found=found, latest=outcome.name))
    return {trial.name: outcomes[trial.name] for trial in trials}


def cores() -> int:
    """Return how many cores this program may use."""
    return len(os.sched_getaffinity(0))


def _run(missing: Sequence[TrialRecord], place: Path, processes: int) -> Iterator[AnyOutcome]:
    """Run trials; what is made on the way stands in a folder that is gone in the end, however that comes."""
    if not missing:
        return
    with tempfile.TemporaryDirectory(prefix=_STAGING, dir=place) as staging:
        yield from run_in_processes(missing, Path(staging), processes)


def _check_names(names: Sequence[str]) -> None:
    twice = [name for name, count in Counter(names).items() if count > 1]
    if twice:
        raise ValueError(f"two trials have the name '{twice[0]}'")
    for name in names:
        is_hidden = not name or name.startswith(".") or not name.isprintable()
        if is_hidden or Path(name).name != name or Path(name).suffix in (".json", ".error") or len(name.encode()) > 200:
            raise ValueError(f"the trial {name!r} has a name that cannot be that of a folder")


@contextmanager
def _alone_in(place: Path) -> Iterator[None]:
    """Keep other programs out of the folder of trials, and remove what one left there that was killed."""
    descriptor = os.open(place, os.O_RDONLY)
    try:
        with suppress(OSError):  # a file system without locks
            try:
                fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
            except BlockingIOError as error:
                raise CampaignBusyError(f"another program runs trials in '{place}'") from error
        for left in place.glob(f"{_STAGING}*"):
            shutil.rmtree(left, ignore_errors=True)
        yield
    finally:
        os.close(descriptor)
