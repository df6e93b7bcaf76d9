"""What an experiment is: trials, and what is made of their outcomes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, Protocol

from codra_papers.experiments.campaign.document import Document

FIRST_REPORTED_SEED = 301
"""Thresholds were tuned on seeds 1 to 5, and 101 to 130 are known (docs/papers/protocol.md)."""


class World(StrEnum):
    """Where the trials of an experiment run, which says what its spec must have."""

    LAB = "lab"
    STORE = "store"


class AnyOutcome(Protocol):
    """What came of a trial, as plain data that can be kept in a file."""

    @property
    def name(self) -> str:
        """Return the name of the trial."""
        ...

    @property
    def seed(self) -> int:
        """Return the seed of the trial."""
        ...

    @property
    def duration_s(self) -> float:
        """Return how long it lasted, in simulated time."""
        ...

    @property
    def loops(self) -> int:
        """Return how many rounds of its work were completed: loops, or missions."""
        ...

    @property
    def error(self) -> str | None:
        """Return what ended it early; None if nothing did."""
        ...

    @property
    def frames(self) -> int:
        """Return how many frames were rendered for perception."""
        ...

    def files(self) -> Sequence[str]:
        """Return the files that were kept with it, relative to its folder."""
        ...

    def to_json(self) -> str:
        """Return it as JSON."""
        ...


class AnyTrial(Protocol):
    """One run of an experiment, told completely enough to be run again: a frozen value."""

    @property
    def name(self) -> str:
        """Return its name, unique in its experiment; also the name of the file that keeps what came of it."""
        ...

    @property
    def spec(self) -> Path:
        """Return the file of its spec."""
        ...

    @property
    def seed(self) -> int:
        """Return the seed of all that chance decides in it."""
        ...

    @property
    def draws_frames(self) -> bool:
        """Return whether it draws frames of the laboratory."""
        ...

    def run(self, folder: Path) -> AnyOutcome:
        """Run it; files to be kept go to the folder, which is made if there are some."""
        ...

    def outcome(self, text: str) -> AnyOutcome:
        """Return what its outcome's `to_json` wrote."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """How an experiment is asked for.

    Attributes:
        spec: the file of the spec under test.
        seeds: how many further seeds intervals are drawn from; each experiment says what for.
        folder: where what comes of it goes.
    """

    spec: Path
    seeds: int
    folder: Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """An experiment.

    Attributes:
        name: as on the command line.
        question: what it asks, in a sentence.
        seeds: how many further seeds it uses unless told otherwise.
        trials: which runs it needs.
        judge: what is made of their outcomes: it draws no chance but by fixed seeds, so a report can be made again.
        then: which further runs it needs, by what came of these, e.g. with what a search has found; None if none.
        world: in which they run.
    """

    name: str
    question: str
    seeds: int
    trials: Callable[[Settings], Sequence[AnyTrial]]
    judge: Callable[[Settings, Mapping[str, Any]], Document]
    then: Callable[[Settings, Mapping[str, Any]], Sequence[AnyTrial]] | None = None
    world: World = World.LAB
