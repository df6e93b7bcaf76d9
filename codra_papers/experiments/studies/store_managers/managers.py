"""The compared managers, which decide on the course and the speed (docs/papers/store-experiment.md).

All managers use the same trees, agents and handshakes. A manager is a list of edits of the loops that the spec
declares, so every manager is run by the same planner.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from types import ModuleType
from typing import Any, Protocol

from codra_dsl.integrations.inspection import SpecError
from codra_dsl.runtime.loops import Counterfactual, Decision, HardRuleModel, Mape, MapeModel, Planning
from codra_dsl.runtime.values.conditions import literal
from codra_papers.experiments.store.run import CompiledSpec

NOMINAL_COURSE = "pick"
"""P2's nominal course: pick up, deliver, back to the start (section 5.1)."""

NORMAL_M_S = 1.2
"""The maximum speed of the spec while nobody is near."""


class ModelEdit(Protocol):
    """An edit of the loops of a spec: a frozen value, whose text describes it in reports and in names of trials."""

    def __call__(self, model: MapeModel) -> MapeModel:
        """Return the edited loops."""
        ...


@dataclass(frozen=True, slots=True)
class NominalCourse:
    """Always choose the nominal course. Metrics and weights are computed, and have no influence on the course."""

    def __call__(self, model: MapeModel) -> MapeModel:
        """Return the loops with a rule that always holds in place of the hard rules of the courses."""
        rule = HardRuleModel(condition=literal(True), action=NOMINAL_COURSE, text="always")
        return replace(model, courses=tuple(replace(course, always=(rule,)) for course in model.courses))


@dataclass(frozen=True, slots=True)
class NormalSpeed:
    """Always set the normal speed."""

    def __call__(self, model: MapeModel) -> MapeModel:
        """Return the loops with a constant in place of the value of the speed."""
        parameters = (replace(speed, value=literal(NORMAL_M_S), text=f"{NORMAL_M_S} m/s") for speed in model.parameters)
        return replace(model, parameters=tuple(parameters))


@dataclass(frozen=True, slots=True, kw_only=True)
class Manager:
    """Decides on the course and the speed.

    Attributes:
        name: the name in tables.
        edits: the edits of the loops of the spec; none for the loops as they are declared.
    """

    name: str
    edits: Sequence[ModelEdit] = ()

    def edited(self, model: MapeModel) -> MapeModel:
        """Return the loops of the spec after all edits."""
        for edit in self.edits:
            model = edit(model)
        return model

    def managed_spec(self, package: ModuleType) -> CompiledSpec:
        """Return a compiled spec whose loops are those of this manager.

        Raises:
            SpecError: if the spec has no loops.
        """
        if not hasattr(package, "MAPE"):
            raise SpecError("the spec has no loops, so no managers can be compared")
        model = self.edited(package.MAPE)

        def start_loops(codra: Any, **options: Any) -> Mape:
            return Mape(codra, model, planner=_UnexplainedPlanning, **options)

        return CompiledSpec(start=package.start, loops=start_loops)


NONE = Manager(name="none", edits=(NominalCourse(), NormalSpeed()))
SPEED_ONLY = Manager(name="speed only", edits=(NominalCourse(),))
COURSE_ONLY = Manager(name="course only", edits=(NormalSpeed(),))
OURS = Manager(name="ours")
THRESHOLD, OURS_TUNED = "threshold", "ours tuned"
"""The names of the managers with one more edit, which is the result of a search."""


def managers(chosen_edits: Mapping[str, ModelEdit]) -> Sequence[Manager]:
    """Return the compared managers, in the order of tables.

    Args:
        chosen_edits: for each of `THRESHOLD` and `OURS_TUNED`, the result of its search.
    """
    threshold, ours_tuned = (Manager(name=name, edits=(chosen_edits[name],)) for name in (THRESHOLD, OURS_TUNED))
    return (NONE, SPEED_ONLY, COURSE_ONLY, threshold, OURS, ours_tuned)


class _UnexplainedPlanning(Planning):
    """Planning without explanations, which take long and have no influence on decisions."""

    def kept_by(self, decision: Decision) -> tuple[Counterfactual, ...]:
        """Return no changes that would have kept the course."""
        del decision
        return ()
