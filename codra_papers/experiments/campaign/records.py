"""The place where what came of a trial is kept, and how it is known what it was made from."""

from __future__ import annotations

import platform
import shutil
from collections.abc import Sequence
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
"""What a frame, what is seen in it, and ways in the store are computed with."""


PACKAGES = (Path(codra_dsl.__file__).parent, Path(codra_papers.__file__).parent)


class ChangedMeanwhileError(Exception):
    """What a trial is made from is not what it was when the trial began."""


@dataclass(frozen=True, slots=True, kw_only=True)
class TrialRecord:
    """What is kept of a trial: `NAME.json`, and the frames in the folder `NAME`.

    The first line of the file tells what the trial was made from and what the rest of the file should be, as digests.

    Attributes:
        folder: in which it is kept.
        digest: of all that the trial is made from.
    """

    trial: AnyTrial
    folder: Path
    digest: str

    @property
    def path(self) -> Path:
        """Return the file."""
        return self.folder / f"{self.trial.name}.json"

    @property
    def error_path(self) -> Path:
        """Return the file that tells how the trial failed, if it did."""
        return self.folder / f"{self.trial.name}.error"

    @property
    def frames(self) -> Path:
        """Return the folder of the frames."""
        return self.folder / self.trial.name

    def read(self) -> AnyOutcome | None:
        """Return what is kept; None if there is nothing, it is damaged, or was made from something else."""
        try:
            head, _, text = self.path.read_text(encoding="utf-8").partition("\n")
            if head != self._head(text):
                return None
            outcome = self.trial.outcome(text)
        except (OSError, ValueError, TypeError, LookupError, AttributeError):
            return None
        return outcome if all((self.frames / name).is_file() for name in outcome.files()) else None

    def make(self, staging: Path) -> None:
        """Run the trial and keep what came of it, all or nothing.

        Args:
            staging: an empty folder of this run alone, on the same disk.

        Raises:
            ChangedMeanwhileError: if it is not known what it was made from.
        """
        text = self.trial.run(staging / "frames").to_json()
        if _digest_of_trial(self.trial, _spec_digest(self.trial.spec)) != self.digest:
            raise ChangedMeanwhileError("its spec, or code that it depends on, was changed while it ran")
        (staging / "record").write_text(f"{self._head(text)}\n{text}", encoding="utf-8")
        self.path.unlink(missing_ok=True)
        shutil.rmtree(self.frames, ignore_errors=True)
        if (staging / "frames").exists():
            (staging / "frames").replace(self.frames)
        (staging / "record").replace(self.path)
        self.error_path.unlink(missing_ok=True)

    def _head(self, text: str) -> str:
        return f"{self.digest} {sha256(text.encode()).hexdigest()}"


def records_of(trials: Sequence[AnyTrial], folder: Path) -> Sequence[TrialRecord]:
    """Return where trials are kept.

    Raises:
        ValueError: if something in a trial is told by its address alone, such as a function.
        SpecError: if a spec has errors.
    """
    specs = {spec: _spec_digest(spec) for spec in {trial.spec for trial in trials}}
    return [TrialRecord(trial=each, folder=folder, digest=_digest_of_trial(each, specs[each.spec])) for each in trials]


def _digest_of_trial(trial: AnyTrial, spec_digest: str) -> str:
    told = repr(trial).replace(repr(trial.spec), repr(Path(trial.spec.name)))
    if " at 0x" in told:
        raise ValueError(f"the trial '{trial.name}' is told by addresses, which mean nothing in another run: {told}")
    return sha256("\n".join((told, spec_digest, code_digest(), _libraries())).encode()).hexdigest()


@cache
def code_digest() -> str:
    """Return a digest of the code of both packages, on which an outcome can depend."""
    digests = (_digest_of(package, _code_files(package)) for package in PACKAGES)
    return sha256("\n".join(digests).encode()).hexdigest()


def _code_files(package: Path) -> Sequence[Path]:
    return sorted(path for path in package.rglob("*") if path.suffix in (".py", ".j2", ".json") and path.is_file())


def _spec_digest(spec: Path) -> str:
    """Return a digest of a spec's file, of what it includes, and of the project's modules that it calls."""
    return _digest_of(root_of(spec), source_files(spec))


def _digest_of(root: Path, files: Sequence[Path]) -> str:
    digest = sha256()
    for path in files:
        digest.update(f"{path.relative_to(root).as_posix()}\0".encode())
        digest.update(sha256(path.read_bytes() if path.is_file() else b"").digest())
    return digest.hexdigest()


@cache
def _libraries() -> str:
    """Return the versions of what frames and perception are made with."""
    there = {name: each.version for name in _LIBRARIES for each in metadata.distributions(name=name)}
    return f"{platform.python_version()} {sorted(there.items())}"
