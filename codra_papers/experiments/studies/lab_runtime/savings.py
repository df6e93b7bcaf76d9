"""Where the time that observers save comes from: the duration of looks, and answers that were ready in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from codra_papers.experiments.lab.outcomes import Decision
from codra_papers.experiments.studies.lab_runtime.executions import spent_s
from codra_papers.experiments.studies.lab_runtime.paper import CONTEXT_CHECK_S
from codra_papers.lab.mission import WAIT_S

AT_P1S_CHECK = "each check takes P1's time in place of asking and waiting"
WITHOUT_KNOWLEDGE = "observers know nothing"
"""The two scenarios that the summary mentions."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Saving:
    """The saved perception time: the time without observers minus the time with observers. It is the sum of its parts.

    Attributes:
        without: the number of perception tasks without observers.
        answered: the number of perception tasks with observers that context answered.
        fell_back: the number of perception tasks with observers that context did not answer, so that the robot looked.
        monitors: the number of perception tasks with observers that came after an action.
        look_s: the mean duration of a perception task without observers; it follows from the world's durations.
        own_looks_s: the total duration of the looks that the robot made although it had observers.
        waiting_s: the total time of waiting for observers.
        asking_s: the total time of asking.
    """

    without: int
    answered: int
    fell_back: int
    monitors: int
    look_s: float
    own_looks_s: float
    waiting_s: float
    asking_s: float

    @property
    def checks(self) -> int:
        """Return the number of perception tasks with observers."""
        return self.answered + self.fell_back

    @property
    def without_s(self) -> float:
        """Return the perception time without observers."""
        return self.without * self.look_s

    @property
    def spared_s(self) -> float:
        """Return the duration of the looks that answers from context replaced."""
        return self.answered * self.look_s

    @property
    def other_looks_s(self) -> float:
        """Return the time that the remaining looks would take at the mean duration, minus the time that they took."""
        return self.fell_back * self.look_s - self.own_looks_s

    @property
    def fewer_s(self) -> float:
        """Return the duration of the perception tasks that did not occur with observers."""
        return (self.without - self.checks) * self.look_s

    @property
    def saved_s(self) -> float:
        """Return the saved time: `spared_s` minus waiting and asking, plus two random differences."""
        return self.spared_s - self.waiting_s - self.asking_s + self.other_looks_s + self.fewer_s

    @property
    def share(self) -> float | None:
        """Return the saved share of the perception time without observers, or None if this perception time is 0."""
        return self.saved_s / self.without_s if self.without_s else None


def saving(without: Sequence[Decision], observed: Sequence[Decision]) -> Saving:
    """Return the saving and its parts.

    Args:
        without: the perception tasks of a run without observers.
        observed: the perception tasks of the same work with observers.
    """
    fell_back = [decision for decision in observed if decision.has_looked]
    looked_s = sum(decision.looked_s for decision in observed)
    waited_s = sum(decision.waited_s for decision in observed)
    return Saving(
        without=len(without),
        answered=len(observed) - len(fell_back),
        fell_back=len(fell_back),
        monitors=sum(not decision.is_preview for decision in observed),
        look_s=spent_s(without) / len(without) if without else 0.0,
        own_looks_s=looked_s,
        waiting_s=waited_s,
        asking_s=spent_s(observed) - looked_s - waited_s,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Scenario:
    """The saving under one changed assumption, with everything else the same.

    Attributes:
        without_s: the assumed perception time without observers.
        perception_s: the assumed perception time with observers.
    """

    name: str
    without_s: float
    perception_s: float

    @property
    def saved_s(self) -> float:
        """Return the time that would have been saved."""
        return self.without_s - self.perception_s

    @property
    def share(self) -> float | None:
        """Return the saved share of the perception time without observers, or None if this perception time is 0."""
        return self.saved_s / self.without_s if self.without_s else None


def scenarios(measured_saving: Saving) -> Sequence[Scenario]:
    """Return the measured saving, and the savings under other assumptions.

    The scenarios with other durations use the measured answers, because answers depend on what observers see while the
    robot acts, and not on the duration of the robot's own looks.
    """
    cost_s, without_s = measured_saving.waiting_s + measured_saving.asking_s, measured_saving.without_s
    all_looked_s = measured_saving.checks * measured_saving.look_s
    cases = {
        "as measured": (without_s, cost_s + measured_saving.own_looks_s),
        "looks take half as long": (without_s / 2, cost_s + measured_saving.own_looks_s / 2),
        "looks take twice as long": (without_s * 2, cost_s + measured_saving.own_looks_s * 2),
        AT_P1S_CHECK: (without_s, measured_saving.checks * CONTEXT_CHECK_S + measured_saving.own_looks_s),
        WITHOUT_KNOWLEDGE: (without_s, measured_saving.asking_s + measured_saving.monitors * WAIT_S + all_looked_s),
        "observers know everything at once": (without_s, measured_saving.asking_s),
    }
    return [
        Scenario(name=name, without_s=before_s, perception_s=after_s) for name, (before_s, after_s) in cases.items()
    ]
