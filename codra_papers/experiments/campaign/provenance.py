"""Everything that is needed to reproduce a report."""

from __future__ import annotations

import platform
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import cv2
import mujoco
import numpy as np
import scipy

from codra_dsl import __version__
from codra_dsl.tooling.revisions import Repository, RevisionError


@dataclass(frozen=True, slots=True, kw_only=True)
class Revision:
    """The state of a working tree.

    Attributes:
        commit: the commit that is checked out.
        is_clean: whether the working tree is the same as the commit, apart from the folder for results.
    """

    commit: str
    is_clean: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """The inputs and the environment of a report.

    Attributes:
        command: the command line.
        spec: the file of the spec, relative to the project.
        versions: a mapping from the names of codra, Python and libraries to their versions.
        code: a digest of the code of codra.
        revision: the state of the project's working tree; None if the project is in no repository.
        seeds: the seeds of all trials.
        cores: how many cores the machine offers.
        processes: how many trials ran at once on this machine.
        cluster: the address of the scheduler of the cluster that ran the trials; None if this machine ran them.
        elapsed_s: the duration of this call, without the time for judging the outcomes and rendering the page.
        reused_trial_count: how many trials had been run before this call.
    """

    command: str
    spec: str
    versions: Mapping[str, str]
    code: str
    revision: Revision | None
    seeds: Sequence[int]
    cores: int
    processes: int
    elapsed_s: float
    reused_trial_count: int
    cluster: str | None = None


def versions() -> Mapping[str, str]:
    """Return a mapping from the programs and libraries that outcomes and reports depend on to their versions."""
    return {
        "codra": __version__,
        "Python": platform.python_version(),
        "NumPy": np.__version__,
        "OpenCV": cv2.__version__,
        "MuJoCo": mujoco.__version__,
        "SciPy": scipy.__version__,
    }


def revision_of(root: Path, results_folder: Path) -> Revision | None:
    """Return the state of a project's working tree; None if the project is in no repository.

    Args:
        root: the project's folder.
        results_folder: the folder for results; differences in it are ignored.
    """
    try:
        repository = Repository.around(root.resolve())
        return Revision(commit=repository.commit("HEAD"), is_clean=not repository.changed(results_folder.resolve()))
    except RevisionError:
        return None
