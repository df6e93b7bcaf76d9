"""Many trials over all cores, each kept when it is done, so that a campaign that was stopped goes on where it was."""

from __future__ import annotations

import multiprocessing
import os
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import Future, ProcessPoolExecutor, as_completed
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from pathlib import Path

import codra_dsl
from codra_dsl.experiments.outcomes import Outcome
from codra_dsl.experiments.trials import Trial, run_trial

TRIALS = "trials"
"""The folder, within that of an experiment, in which each trial keeps its record and frames."""


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
    trials: Sequence[Trial], folder: Path, *, processes: int | None = None, progress: Callable[[Progress], None]
) -> Mapping[str, Outcome]:
    """Run all trials that have not been run, and return what came of all, by name, in the order given.

    A trial was run if its record is there and was made from the same trial, spec and code. What it comes to does not
    depend on the number of processes, nor on what else is run.

    Args:
        trials: of different names.
        folder: of the experiment; trials are kept in a folder within it.
        processes: how many run at once; None for one a core.
        progress: is told at the start and after each trial.

    Raises:
        SpecError: if a spec has errors.
    """
    records = {trial.name: _Record(trial, folder / TRIALS) for trial in trials}
    kept = {name: record.read() for name, record in records.items()}
    outcomes = {name: outcome for name, outcome in kept.items() if outcome is not None}
    missing = [record for name, record in records.items() if name not in outcomes]
    found = len(outcomes)
    progress(Progress(done=found, total=len(trials), found=found, latest=""))
    for outcome in _run(missing, processes or _cores()):
        outcomes[outcome.name] = outcome
        progress(Progress(done=len(outcomes), total=len(trials), found=found, latest=outcome.name))
    return {trial.name: outcomes[trial.name] for trial in trials}


@dataclass(frozen=True, slots=True)
class _Record:
    """The place where what came of a trial is kept."""

    trial: Trial
    folder: Path

    def read(self) -> Outcome | None:
        """Return what is kept; None if there is nothing, or it was made from something else."""
        try:
            digest, _, text = self._path.read_text(encoding="utf-8").partition("\n")
            return Outcome.from_json(text) if digest == self._digest else None
        except (OSError, ValueError, TypeError, KeyError):
            return None

    def make(self) -> Outcome:
        """Run the trial and keep what came of it, all or nothing."""
        outcome = run_trial(self.trial, self.folder / self.trial.name)
        self.folder.mkdir(parents=True, exist_ok=True)
        being_written = self._path.with_suffix(f".{os.getpid()}")
        being_written.write_text(f"{self._digest}\n{outcome.to_json()}", encoding="utf-8")
        being_written.replace(self._path)
        return outcome

    @property
    def _path(self) -> Path:
        return self.folder / f"{self.trial.name}.json"

    @property
    def _digest(self) -> str:
        text = "\n".join((repr(self.trial), _spec_digest(self.trial.spec), _code_digest()))
        return sha256(text.encode()).hexdigest()


def _run(records: Sequence[_Record], processes: int) -> Iterator[Outcome]:
    """Run trials side by side, each in a fresh process; yield each when it is done."""
    if not records:
        return
    with ProcessPoolExecutor(
        max_workers=min(processes, len(records)),
        mp_context=multiprocessing.get_context("spawn"),
        initializer=_prepare_process,
        max_tasks_per_child=1,  # what a trial leaves behind in a process touches no other
    ) as pool:
        running: list[Future[Outcome]] = [pool.submit(record.make) for record in records]
        try:
            for done in as_completed(running):
                yield done.result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _prepare_process() -> None:
    """Keep the software renderer to one thread: side by side, more only take the cores from each other."""
    os.environ.setdefault("LP_NUM_THREADS", "1")


def _cores() -> int:
    return len(os.sched_getaffinity(0))


@cache
def _code_digest() -> str:
    """Return a digest of all code that an outcome could depend on."""
    package = Path(codra_dsl.__file__).parent
    digest = sha256()
    for path in sorted(package.rglob("*.py")):
        digest.update(path.relative_to(package).as_posix().encode())
        digest.update(path.read_bytes())
    return digest.hexdigest()


@cache
def _spec_digest(spec: Path) -> str:
    """Return a digest of a spec's file and of all that lie in its folder or below, which it may include."""
    digest = sha256()
    for path in sorted(spec.parent.rglob("*.yaml")):
        digest.update(path.read_bytes())
    return digest.hexdigest()
