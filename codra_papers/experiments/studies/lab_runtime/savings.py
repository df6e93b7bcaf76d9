"""Where the time comes from that observers save: what looking takes, and what they knew in time."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from codra_papers.experiments.lab.outcomes import Decision
from codra_papers.experiments.studies.lab_runtime.executions import spent_s
from codra_papers.experiments.studies.lab_runtime.paper import CONTEXT_CHECK_S
from codra_papers.lab.mission import WAIT_S

AT_P1S_CHECK = "each check takes P1's time in place of asking and waiting"
KNOWING_NOTHING = "observers know nothing"
"""Two of the scenarios, which the summary names."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Saving:
    """The perception time of the same work without observers, less that with them, in parts that add up to it.

    Attributes:
        without: how many perception tasks there were without observers.
        answered: how many of those with observers context answered.
        fell_back: how many it did not, so that the robot looked.
        monitors: how many of those with observers came after an action.
        look_s: the mean duration of a perception task without observers: what the world's durations say.
        own_looks_s: what looking took with observers, in all.
        waiting_s: what waiting for observers took, in all.
        asking_s: what asking took, in all.
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
        """Return how many perception tasks there were with observers."""
        return self.answered + self.fell_back

    @property
    def without_s(self) -> float:
        """Return the perception time without observers."""
        return self.without * self.look_s

    @property
    def spared_s(self) -> float:
        """Return what the looks would have taken in whose place context answered."""
        return self.answered * self.look_s

    @property
    def other_looks_s(self) -> float:
        """Return by how much the looks that were still done took less than as many mean ones without observers."""
        return self.fell_back * self.look_s - self.own_looks_s

    @property
    def fewer_s(self) -> float:
        """Return what the perception tasks would have taken that did not come up with observers."""
        return (self.without - self.checks) * self.look_s

    @property
    def saved_s(self) -> float:
        """Return what was saved: `spared_s`, less what it cost, and two differences of chance."""
        return self.spared_s - self.waiting_s - self.asking_s + self.other_looks_s + self.fewer_s

    @property
    def share(self) -> float | None:
        """Return what was saved of the perception time without observers; None if there was none."""
        return self.saved_s / self.without_s if self.without_s else None


def saving(without: Sequence[Decision], observed: Sequence[Decision]) -> Saving:
    """Return where the saving comes from.

    Args:
        without: the perception tasks of a run without observers.
        observed: those of the same work with them.
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
    """What would have been saved, had one thing been otherwise and all else the same.

    Attributes:
        perception_s: the perception time that there would have been with observers, of `without_s` without them.
    """

    name: str
    without_s: float
    perception_s: float

    @property
    def saved_s(self) -> float:
        """Return what would have been saved."""
        return self.without_s - self.perception_s

    @property
    def share(self) -> float | None:
        """Return that as a share of the perception time without observers; None if there is none."""
        return self.saved_s / self.without_s if self.without_s else None


def scenarios(found: Saving) -> Sequence[Scenario]:
    """Return what was saved as it was measured, and what would have been saved otherwise.

    What observers know in time is taken as it was: that depends on what they see while the robot acts, not on how long
    its own looks would have taken.
    """
    cost_s, without_s = found.waiting_s + found.asking_s, found.without_s
    all_looked_s = found.checks * found.look_s
    cases = {
        "as measured": (without_s, cost_s + found.own_looks_s),
        "looks take half as long": (without_s / 2, cost_s + found.own_looks_s / 2),
        "looks take twice as long": (without_s * 2, cost_s + found.own_looks_s * 2),
        AT_P1S_CHECK: (without_s, found.checks * CONTEXT_CHECK_S + found.own_looks_s),
        KNOWING_NOTHING: (without_s, found.asking_s + found.monitors * WAIT_S + all_looked_s),
        "observers know everything at once": (without_s, found.asking_s),
    }
    return [
        Scenario(name=name, without_s=before_s, perception_s=after_s) for name, (before_s, after_s) in cases.items()
    ]
