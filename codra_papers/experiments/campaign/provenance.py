"""What a report was made with, so that it can be made again."""

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
        commit: what is checked out.
        is_clean: whether nothing differs from it.
    """

    commit: str
    is_clean: bool


@dataclass(frozen=True, slots=True, kw_only=True)
class Provenance:
    """What a report was made with.

    Attributes:
        command: the command line.
        spec: its file, relative to the project.
        versions: by name.
        code: a digest of the code of codra.
        revision: of the project's working tree; None if it is in no repository.
        seeds: of all trials.
        cores: how many the machine offers, and how many processes used them.
        elapsed_s: how long this call took, without making the page.
        found: how many trials had been run before.
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
    found: int


def versions() -> Mapping[str, str]:
    """Return the versions of all that an outcome, or what is made of it, depends on."""
    return {
        "codra": __version__,
        "Python": platform.python_version(),
        "NumPy": np.__version__,
        "OpenCV": cv2.__version__,
        "MuJoCo": mujoco.__version__,
        "SciPy": scipy.__version__,
    }


def revision_of(root: Path, but: Path) -> Revision | None:
    """Return the state of the working tree that a project is in; None if there is none.

    Args:
        root: the project's folder.
        but: a folder that may differ: where results go.
    """
    try:
        repository = Repository.around(root.resolve())
        return Revision(commit=repository.commit("HEAD"), is_clean=not repository.changed(but.resolve()))
    except RevisionError:
        return None
