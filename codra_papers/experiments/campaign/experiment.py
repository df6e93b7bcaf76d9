"""The parts of an experiment: its trials, and the function that judges their outcomes."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from enum import StrEnum
from pathlib import Path
from typing import Any, Protocol

from codra_papers.experiments.campaign.document import Document

FIRST_REPORTED_SEED = 301
"""The first seed of reports. Thresholds were tuned on seeds 1 to 5, and the outcomes of seeds 101 to 130 were already
known (docs/papers/protocol.md)."""


class World(StrEnum):
    """The world in which the trials of an experiment run. The world determines which declarations the spec needs."""

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
        """Return how many rounds of its work the trial completed: loops in the lab, missions in the store."""
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
        """Return the stored files that belong to the outcome, relative to the trial's folder."""
        ...

    def to_json(self) -> str:
        """Return the outcome as JSON."""
        ...


class AnyTrial(Protocol):
    """One run of an experiment: a frozen value with everything that is needed to repeat the run."""

    @property
    def name(self) -> str:
        """Return the name of the trial, which is unique in its experiment and is also the name of its record."""
        ...

    @property
    def spec(self) -> Path:
        """Return the file of the spec."""
        ...

    @property
    def seed(self) -> int:
        """Return the seed of all random numbers of the trial."""
        ...

    @property
    def draws_frames(self) -> bool:
        """Return whether the trial draws frames of the laboratory."""
        ...

    def run(self, folder: Path) -> AnyOutcome:
        """Run the trial. Write the files to be stored into the folder, which is created if there are such files."""
        ...

    def outcome(self, text: str) -> AnyOutcome:
        """Return the outcome from the JSON text that its `to_json` returned."""
        ...


@dataclass(frozen=True, slots=True, kw_only=True)
class Settings:
    """The settings of an experiment.

    Attributes:
        spec: the file of the spec under test.
        seeds: the number of further seeds for confidence intervals; each experiment defines their use.
        folder: the folder for everything that the experiment writes.
        is_quick: whether only few trials are wanted, which show each effect.
    """

    spec: Path
    seeds: int
    folder: Path
    is_quick: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Experiment:
    """An experiment.

    Attributes:
        name: the name on the command line.
        question: the question that the experiment answers, in one sentence.
        seeds: the default number of further seeds.
        trials: a function that returns the trials that the experiment needs.
        judge: a function that makes the report from the outcomes. If it uses random numbers, their seeds are fixed, so
            that a report can be reproduced.
        then: a function that returns further trials, which depend on the outcomes of the first trials, e.g. trials that
            use the result of a search; None if there are no further trials.
        world: the world in which the trials run.
        quick_seeds: the number of further seeds with `--quick`. If fewer seeds do not make an experiment quick enough,
            `trials`, `then` and `judge` leave out more if `Settings.is_quick` is true. Together, the quick trials of
            all experiments take at most 15 minutes on two cores.
    """

    name: str
    question: str
    seeds: int
    trials: Callable[[Settings], Sequence[AnyTrial]]
    judge: Callable[[Settings, Mapping[str, Any]], Document]
    then: Callable[[Settings, Mapping[str, Any]], Sequence[AnyTrial]] | None = None
    world: World = World.LAB
    quick_seeds: int = 1
