"""The arms of an experiment: the observers of each arm, and whether they run only when needed."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path
from typing import Any

from codra_dsl.integrations.inspection import compile_and_load
from codra_dsl.language.model import Refresh, Spec
from codra_dsl.runtime import ContextManager
from codra_papers.experiments.lab.spec_variants import SpecEdit, WithoutAlternatives, WithoutConditions, WithRefresh

P1_TRIGGER_PERIOD_S = 7.2
"""The mean time between two triggers of a naive observer in P1, section 4.1: 5006 triggers in 35,806 s of operation."""


class Need(StrEnum):
    """The variables for which an arm's observers run."""

    EVERYTHING = "everything, always"
    LIDS = "the lids, always"
    ANNOUNCED = "what the main execution decides on now and next"


@dataclass(frozen=True, slots=True, kw_only=True)
class Arm:
    """One of the compared sets of observers in an experiment.

    Attributes:
        name: the name of the arm, unique in its experiment and shown in tables.
        need: the variables for which the observers of the arm run.
        edits: the edits that turn the experiment's spec into the spec of the arm.
    """

    name: str
    need: Need
    edits: tuple[SpecEdit, ...] = ()

    def with_edit(self, name: str, edit: SpecEdit) -> Arm:
        """Return a copy of this arm with another name and one more edit."""
        return replace(self, name=name, edits=(*self.edits, edit))


@dataclass(frozen=True, slots=True, kw_only=True)
class Observers:
    """The compiled observers of an arm."""

    arm: Arm
    start: Callable[..., ContextManager[Any, Any]]


_NO_ALTERNATIVES, _PERIODIC_REFRESH = WithoutAlternatives(), WithRefresh(refresh=Refresh.PERIODIC)
_ONE_ALGORITHM_PERIODIC = (_NO_ALTERNATIVES, _PERIODIC_REFRESH)

NAIVE = Arm(name="naive", need=Need.EVERYTHING, edits=(*_ONE_ALGORITHM_PERIODIC, WithoutConditions()))
NAIVE_PACED = Arm(
    name="naive, every 7.2 s",
    need=Need.EVERYTHING,
    edits=(*_ONE_ALGORITHM_PERIODIC, WithoutConditions(pause_s=P1_TRIGGER_PERIOD_S)),
)
PRECONDITIONS = Arm(name="preconditions", need=Need.EVERYTHING, edits=_ONE_ALGORITHM_PERIODIC)
NEED = Arm(name="preconditions and need", need=Need.ANNOUNCED, edits=_ONE_ALGORITHM_PERIODIC)
NEED_ON_EVENT = Arm(name="need, on event", need=Need.ANNOUNCED, edits=(_NO_ALTERNATIVES,))
"""The arm in which the spec declares how each variable is refreshed."""

ALTERNATIVES = Arm(name="need, on event, alternatives", need=Need.ANNOUNCED)
"""The arm with the unchanged spec: alternatives by rank as well (P1, section 1: complementary observers)."""

PRECONDITIONS_ALTERNATIVES = Arm(name="preconditions, alternatives", need=Need.EVERYTHING, edits=(_PERIODIC_REFRESH,))
WITHOUT_ALTERNATIVES = {PRECONDITIONS_ALTERNATIVES.name: PRECONDITIONS.name, ALTERNATIVES.name: NEED_ON_EVENT.name}
"""For each arm with alternatives, the arm that differs from it only in having none."""


def observers(arm: Arm, spec: Spec, folder: Path) -> Observers:
    """Compile an arm.

    Args:
        arm: the arm to compile.
        spec: the spec of the experiment, which must have no errors.
        folder: an empty folder for the generated code.

    Raises:
        SpecError: if the arm's spec has errors.
    """
    for edit in arm.edits:
        spec = edit(spec)
    return Observers(arm=arm, start=compile_and_load(spec, folder).start)
