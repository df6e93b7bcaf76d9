"""The parts of an experiment: its trials, and the function that judges their outcomes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, Protocol

from codra_papers.experiments.campaign.document import Document

FIRST_REPORTED_SEED = 301
"""The first seed of reports. Thresholds were tuned on 1 to 5; 101 to 130 are known (docs/papers/protocol.md)."""


class World(StrEnum):
    """The world in which the trials of an experiment run. It determines the declarations that the spec needs."""

    LAB = "lab"
    STORE = "store"


class AnyOutcome(Protocol):
    """The outcome of a trial, as plain data that can be stored in a file."""

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
        """Return the duration of the trial in simulated time."""
        ...

    @property
    def loops(self) -> int:
        """Return how many rounds of its work were completed: loops in the lab, missions in the store."""
        ...

    @property
    def error(self) -> str | None:
        """Return the error that ended the trial early, or None."""
        ...

    @property
    def frames(self) -> int:
        """Return how many frames were rendered for perception."""
        ...

    def files(self) -> Sequence[str]:
        """Return the stored files that belong to it, relative to its folder."""
        ...

    def to_json(self) -> str:
        """Return it as JSON."""
        ...


class AnyTrial(Protocol):
    """One run of an experiment: a frozen value with everything that is needed to run it again."""

    @property
    def name(self) -> str:
        """Return its name, unique in its experiment; also the name of its record."""
        ...

    @property
    def spec(self) -> Path:
        """Return the file of its spec."""
        ...

    @property
    def seed(self) -> int:
        """Return the seed of all random numbers in it."""
        ...

    @property
    def draws_frames(self) -> bool:
        """Return whether it draws frames of the laboratory."""
        ...

    def run(self, folder: Path) -> AnyOutcome:
        """Run it; files to be stored go to the folder, which is created if there are any."""
        ...

    def outcome(self, text: str) -> AnyOutcome:
        """Return the outcome that `to_json` wrote as this text."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The settings of an experiment.

    Attributes:
        spec: the file of the spec under test.
        seeds: the number of further seeds for confidence intervals; each experiment defines their use.
        folder: for everything that the experiment writes.
    """

    spec: Path
    seeds: int
    folder: Path


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """An experiment.

    Attributes:
        name: as on the command line.
        question: that it answers, in a sentence.
        seeds: the default number of further seeds.
        trials: returns the runs that it needs.
        judge: makes the report from their outcomes. It uses fixed seeds only, so a report can be reproduced.
        then: returns further runs that depend on the outcomes of the first ones, e.g. with the result of a search; or
            None.
        world: in which they run.
    """

    name: str
    question: str
    seeds: int
    trials: Callable[[Settings], Sequence[AnyTrial]]
    judge: Callable[[Settings, Mapping[str, Any]], Document]
    then: Callable[[Settings, Mapping[str, Any]], Sequence[AnyTrial]] | None = None
    world: World = World.LAB
