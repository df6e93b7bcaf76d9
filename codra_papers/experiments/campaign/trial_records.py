"""Records of trials on disk. Each record has a digest of everything that the trial was made from."""

from __future__ import annotations

import platform
import shutil
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from hashlib import sha256
from importlib import metadata
from pathlib import Path

import codra_dsl
import codra_papers
from codra_dsl.integrations.inspection import source_files
from codra_dsl.language.project import root_of
from codra_papers.experiments.campaign.experiment import AnyOutcome, AnyTrial

_LIBRARIES = frozenset({"numpy", "mujoco", "opencv-python-headless", "opencv-python", "py_trees", "networkx"})
"""The libraries that compute frames, perception, and routes in the store. Their versions are part of a digest."""


PACKAGE_FOLDERS = (Path(codra_dsl.__file__).parent, Path(codra_papers.__file__).parent)
"""The folders of the packages whose code is part of a digest."""

RECORD, FRAMES = "record", "frames"
"""The names of a record and of the folder of its frames in a temporary folder, before the record is kept."""


class ChangedMeanwhileError(Exception):
    """The inputs of a trial changed while it ran."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialRecord:
    """The record of a trial: the file `NAME.json`, and the frames in the folder `NAME`.

    The first line of the file holds two digests: one of everything that the trial was made from, and one of the rest of
    the file.

    Attributes:
        folder: the folder of the record.
        digest: the present digest of everything that the trial is made from.
    """

    trial: AnyTrial
    folder: Path
    digest: str

    @property
    def path(self) -> Path:
        """Return the path of the file."""
        return self.folder / f"{self.trial.name}.json"

    @property
    def error_path(self) -> Path:
        """Return the file with the traceback, which exists only if the trial failed with an unexpected error."""
        return self.folder / f"{self.trial.name}.error"

    @property
    def frames_folder(self) -> Path:
        """Return the folder of the frames."""
        return self.folder / self.trial.name

    def read(self) -> AnyOutcome | None:
        """Return the outcome in the record.

        The outcome is None if the record or one of its frames is missing, if the record is damaged, or if the inputs of
        the trial have changed.
        """
        try:
            first_line, _, text = self.path.read_text(encoding="utf-8").partition("\n")
            if first_line != self._first_line(text):
                return None
            outcome = self.trial.outcome(text)
        except (OSError, ValueError, TypeError, LookupError, AttributeError):
            return None
        return outcome if all((self.frames_folder / name).is_file() for name in outcome.files()) else None

    def make(self, staging: Path) -> None:
        """Run the trial and write its record, completely or not at all.

        The digest of the inputs is computed again after the run, so that an outcome of changed inputs is never stored
        under the old digest.

        Args:
            staging: an empty folder for this run only, on the same disk as the record.

        Raises:
            ChangedMeanwhileError: if the inputs of the trial changed while it ran.
        """
        text = self.trial.run(staging / FRAMES).to_json()
        if _digest_of_trial(self.trial, _spec_digest(self.trial.spec)) != self.digest:
            raise ChangedMeanwhileError("its spec, or code that it depends on, was changed while it ran")
        (staging / RECORD).write_text(f"{self._first_line(text)}\n{text}", encoding="utf-8")
        self.keep(staging)

    def keep(self, staging: Path) -> None:
        """Move a complete record into its folder: the file `RECORD`, and the folder `FRAMES` if there are frames."""
        self.path.unlink(missing_ok=True)
        shutil.rmtree(self.frames_folder, ignore_errors=True)
        if (staging / FRAMES).exists():
            (staging / FRAMES).replace(self.frames_folder)
        (staging / RECORD).replace(self.path)
        self.error_path.unlink(missing_ok=True)

    def _first_line(self, text: str) -> str:
        return f"{self.digest} {sha256(text.encode()).hexdigest()}"


def records_of(trials: Sequence[AnyTrial], folder: Path) -> Sequence[TrialRecord]:
    """Return the records of trials.

    Raises:
        ValueError: if the `repr` of a trial contains a memory address, as the `repr` of a function does.
        SpecError: if a spec has errors.
    """
    spec_digests = {spec: _spec_digest(spec) for spec in {trial.spec for trial in trials}}
    return [
        TrialRecord(trial=trial, folder=folder, digest=_digest_of_trial(trial, spec_digests[trial.spec]))
        for trial in trials
    ]


def _digest_of_trial(trial: AnyTrial, spec_digest: str) -> str:
    description = repr(trial).replace(repr(trial.spec), repr(Path(trial.spec.name)))
    if " at 0x" in description:
        raise ValueError(
            f"the description of trial '{trial.name}' contains memory addresses, which change with every run;"
            f" use frozen dataclasses instead of functions: {description}"
        )
    return sha256("\n".join((description, spec_digest, code_digest(), str(library_versions()))).encode()).hexdigest()


@cache
def code_digest() -> str:
    """Return a digest of all code of both packages, because outcomes can depend on any of it."""
    digests = (_digest_of(package, _code_files(package)) for package in PACKAGE_FOLDERS)
    return sha256("\n".join(digests).encode()).hexdigest()


def _code_files(package: Path) -> Sequence[Path]:
    return sorted(path for path in package.rglob("*") if path.suffix in (".py", ".j2", ".json") and path.is_file())


def _spec_digest(spec: Path) -> str:
    """Return a digest of a spec: its file, the files that it includes, and the project's modules that it calls."""
    return _digest_of(root_of(spec), source_files(spec))


def _digest_of(root: Path, files: Sequence[Path]) -> str:
    digest = sha256()
    for path in files:
        digest.update(f"{path.relative_to(root).as_posix()}\0".encode())
        digest.update(sha256(path.read_bytes() if path.is_file() else b"").digest())
    return digest.hexdigest()


@cache
def library_versions() -> Mapping[str, str]:
    """Return a mapping from Python and the libraries that outcomes depend on to their versions."""
    installed_versions = {
        name: distribution.version for name in sorted(_LIBRARIES) for distribution in metadata.distributions(name=name)
    }
    return {"Python": platform.python_version(), **installed_versions}
