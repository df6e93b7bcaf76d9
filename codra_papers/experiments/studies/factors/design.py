"""The factors, their levels, the cells of the full factorial design, and the trials of the cells.

The level of the localiser is a property of arms, so that both levels watch the same frames of the same run. The levels
of the lid and the camera are properties of trials.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from itertools import product
from pathlib import Path

from codra_papers.experiments.lab.arms import (
    NAIVE_PACED,
    NEED,
    NEED_ON_EVENT,
    P1_TRIGGER_PERIOD_S,
    PRECONDITIONS,
    Arm,
    Need,
)
from codra_papers.experiments.lab.outcomes import Outcome
from codra_papers.experiments.lab.run import Work
from codra_papers.experiments.lab.spec_variants import WithFunction, WithMinimumInterval
from codra_papers.experiments.lab.trials import Trial
from codra_papers.lab.simulator.laboratory import LABORATORY, Mount

SEEDS_PER_CELL = 12
"""The smallest number of seeds of a reported cell."""


class Localiser(StrEnum):
    """What the localiser of lids answers if it sees the base of a machine and not the lid."""

    ABSTAINS = "abstains"
    ANSWERS = "always answers"


class Lid(StrEnum):
    """The lid of a machine between two visits to the machine."""

    CLOSED = "closed"
    OPEN = "left open"


@dataclass(frozen=True, slots=True, kw_only=True)
class Cell:
    """A combination of one level of each factor."""

    localiser: Localiser
    lid: Lid
    camera: Mount

    @property
    def levels(self) -> tuple[str, ...]:
        """Return the levels, in the order of `FACTORS`."""
        return (self.localiser.value, self.lid.value, self.camera.value)

    @property
    def trial_prefix(self) -> str:
        """Return the beginning of the names of the cell's trials, which contain both levels of the localiser."""
        return f"lid {self.lid}, camera {self.camera}"


FACTORS: Mapping[str, type[StrEnum]] = {"localiser": Localiser, "lid": Lid, "camera": Mount}
"""The factors. The first level of each factor is that of the protocol's laboratory."""

CELLS = tuple(
    Cell(localiser=localiser, lid=lid, camera=camera) for localiser, lid, camera in product(Localiser, Lid, Mount)
)
"""The cells of the full factorial design. In the first cell, all factors have their first level."""

_PROBE = "codra_papers.lab.perception.functions:localize_lid"
_ALWAYS_ANSWERS = WithFunction(function=_PROBE, other_function=f"{_PROBE}_always")
_EQUAL_CADENCE = WithMinimumInterval(algorithms="_lid", min_interval_s=P1_TRIGGER_PERIOD_S)

NAIVE_LIDS = replace(NAIVE_PACED, name="naive, lids", need=Need.LIDS)
"""P1's naive observers: only the two lids are observed, each at most once in 7.2 s."""

PACED_ARMS = tuple(
    arm.with_edit(f"{arm.name}, every {P1_TRIGGER_PERIOD_S:g} s", _EQUAL_CADENCE)
    for arm in (PRECONDITIONS, NEED, NEED_ON_EVENT)
)
"""The arms whose triggers are compared with those of `NAIVE_LIDS`: they look at a lid no more often."""

ARMS = (NAIVE_LIDS, PRECONDITIONS, *PACED_ARMS)


def arm_name(arm: Arm, localiser: Localiser) -> str:
    """Return the name of an arm in a trial, in which the arm takes part with both levels of the localiser."""
    return f"{arm.name}; {localiser}"


def trial_arms() -> tuple[Arm, ...]:
    """Return the arms of each trial: all arms, with both levels of the localiser."""
    return tuple(
        replace(arm, name=arm_name(arm, localiser), edits=(*arm.edits, *edits))
        for localiser, edits in ((Localiser.ABSTAINS, ()), (Localiser.ANSWERS, (_ALWAYS_ANSWERS,)))
        for arm in ARMS
    )


def factorial_trials(spec: Path, seeds: Iterable[int], work: Callable[[Lid], Work]) -> Sequence[Trial]:
    """Return the trials of all cells, with the same seeds in each cell.

    Args:
        spec: the file of the spec.
        seeds: the seeds.
        work: a function that returns the work of the main execution at a level of the lid.
    """
    cells = {cell.trial_prefix: cell for cell in CELLS}
    return [
        Trial(
            name=f"{prefix} {seed}",
            spec=spec,
            seed=seed,
            arms=trial_arms(),
            laboratory=replace(LABORATORY, camera=cell.camera),
            work=work(cell.lid),
        )
        for seed in seeds
        for prefix, cell in cells.items()
    ]


def is_factorial(name: str) -> bool:
    """Return whether a trial, given by its name, belongs to the factorial design."""
    return any(name.rpartition(" ")[0] == cell.trial_prefix for cell in CELLS)


def outcomes_of(cell: Cell, outcomes: Mapping[str, Outcome]) -> Sequence[Outcome]:
    """Return the outcomes of the trials of a cell, in the given order."""
    return [outcome for name, outcome in outcomes.items() if name.rpartition(" ")[0] == cell.trial_prefix]
