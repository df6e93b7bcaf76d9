"""A trial of a cluster: the process that a worker starts, in a copy of the files that the trial needs."""

from __future__ import annotations

import gc
import os
import pickle
import signal
import sys
import tempfile
import threading
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

from codra_papers.experiments.campaign.trial_records import TrialRecord, code_digest, library_versions, records_of
from codra_papers.experiments.campaign.workers import Failure, make_record
from codra_papers.lab.simulator.gl import GraphicsUnavailableError, choose_backend


@dataclass(frozen=True, slots=True, kw_only=True)
class Parcel:
    """A trial and everything that a worker needs to run it.

    Attributes:
        trial: the trial as `pickle` writes it. Its class may be in one of the files.
        files: the files of the project that the trial needs. The keys are their paths, relative to the project.
        digest: the digest of everything that the trial is made from.
        code: the digest of codra's code.
        versions: the versions of Python and of libraries.
    """

    trial: bytes
    files: Mapping[str, bytes]
    digest: str
    code: str
    versions: Mapping[str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class MadeRecord:
    """The files of a completed trial.

    Attributes:
        record: the content of the record.
        frames: the stored files. The keys are their paths, relative to the folder of the frames.
    """

    record: bytes
    frames: Mapping[str, bytes]


@dataclass(frozen=True, slots=True, kw_only=True)
class Refusal:
    """The reason why trials must not run on a worker."""

    reason: str


def main(result_name: str) -> None:
    """Run the trial of the parcel on standard input, and write the result to a file in the working directory."""
    parcel: Parcel = pickle.load(sys.stdin.buffer)
    threading.Thread(target=_end_with_worker, daemon=True).start()
    folder = Path.cwd()
    result = _run(parcel, folder)
    (folder / result_name).write_bytes(pickle.dumps(result))
    gc.freeze()  # as at the end of the process of a local trial


def _end_with_worker() -> None:
    """End this process as soon as the worker has ended, also if the worker was killed."""
    os.read(sys.stdin.fileno(), 1)  # not `sys.stdin.read`, whose lock the interpreter needs at its end
    os.kill(os.getpid(), signal.SIGKILL)


def _run(parcel: Parcel, folder: Path) -> MadeRecord | Failure | Refusal:
    if differences := [*_differences(parcel)]:
        return Refusal(reason="; ".join(differences))
    record = _unpacked(parcel, folder)
    if isinstance(record, Refusal):
        return record
    staging = folder / "staging"
    staging.mkdir()
    tempfile.tempdir = str(staging)
    report = make_record(record, staging)
    if isinstance(report, Failure):
        return report
    frames = {
        path.relative_to(record.frames_folder).as_posix(): path.read_bytes()
        for path in record.frames_folder.rglob("*")
        if path.is_file()
    }
    return MadeRecord(record=record.path.read_bytes(), frames=frames)


def _differences(parcel: Parcel) -> Iterator[str]:
    """Yield what the outcome of a trial depends on and what is different here."""
    if code_digest() != parcel.code:
        yield f"it has other code of codra (SHA-256 {code_digest()[:12]} instead of {parcel.code[:12]})"
    versions = library_versions()
    for name in sorted({*versions, *parcel.versions}):
        here, needed = (mapping.get(name, "none") for mapping in (versions, parcel.versions))
        if here != needed:
            yield f"it has {name} {here} instead of {needed}"


def _unpacked(parcel: Parcel, folder: Path) -> TrialRecord | Refusal:
    """Write the files of a parcel, enter their folder, and return the record of the trial."""
    project = folder / "project"
    for name, content in parcel.files.items():
        (project / name).parent.mkdir(parents=True, exist_ok=True)
        (project / name).write_bytes(content)
    os.chdir(project)
    sys.path.insert(0, str(project))
    records_folder = folder / "trials"
    records_folder.mkdir()
    try:
        trial = pickle.loads(parcel.trial)
        (record,) = records_of([trial], records_folder)
        if trial.draws_frames:
            choose_backend()
    except GraphicsUnavailableError as error:
        return Refusal(reason=str(error))
    except Exception as error:  # noqa: BLE001  whatever it is, it does not happen where the campaign was started
        return Refusal(reason=f"it cannot load the trial: {type(error).__name__}: {error}")
    if record.digest != parcel.digest:
        return Refusal(reason="the files of the spec were changed, or another installed module replaces one of them")
    return record
