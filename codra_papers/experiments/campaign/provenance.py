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
        commit: that is checked out.
        is_clean: whether the working tree equals it.
    """

    commit: str
    is_clean: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """The inputs and the environment of a report.

    Attributes:
        command: the command line.
        spec: its file, relative to the project.
        versions: by name.
        code: a digest of the code of codra.
        revision: of the project's working tree; None if it is in no repository.
        seeds: of all trials.
        cores: how many the machine offers; `processes` is how many trials ran at once.
        elapsed_s: how long this call took, without rendering the page.
        reused: how many trials had been run before.
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
    reused: int


def versions() -> Mapping[str, str]:
    """Return the versions of everything that outcomes and reports depend on."""
    return {
        "codra": __version__,
        "Python": platform.python_version(),
        "NumPy": np.__version__,
        "OpenCV": cv2.__version__,
        "MuJoCo": mujoco.__version__,
        "SciPy": scipy.__version__,
    }


def revision_of(root: Path, but: Path) -> Revision | None:
    """Return the state of a project's working tree; None if it is in no repository.

    Args:
        root: the project's folder.
        but: a folder in which differences are ignored, for results.
    """
    try:
        repository = Repository.around(root.resolve())
        return Revision(commit=repository.commit("HEAD"), is_clean=not repository.changed(but.resolve()))
    except RevisionError:
        return None
