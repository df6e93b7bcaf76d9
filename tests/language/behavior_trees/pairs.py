"""Tick a tree by our runtime and by the second interpreter in parallel."""

from __future__ import annotations

from codra_dsl.runtime import SimClock
from tests.language.behavior_trees import btcpp
from tests.language.behavior_trees.random_trees import ENTRIES, RandomTree
from tests.language.behavior_trees.stories import LEAVES, main_tree, planned

LETTERS = {
    "R": btcpp.Status.RUNNING,
    "S": btcpp.Status.SUCCESS,
    "F": btcpp.Status.FAILURE,
    "K": btcpp.Status.SKIPPED,
}


def acting(plans: str, log: list[str], *quirks: btcpp.Quirk) -> btcpp.World:
    """Return a world whose actions follow plans and write to a log, like the actions of `planned`."""
    remaining_plans = {leaf: list("S") for leaf in LEAVES}
    remaining_plans |= {
        leaf: list(plan) for leaf, _, plan in (assignment.partition("=") for assignment in plans.split())
    }

    def act(event: str, name: str) -> btcpp.Status:
        log.append({"start": name, "running": name.lower(), "halt": f"{name}!"}[event])
        plan = remaining_plans[name]
        return btcpp.Status.IDLE if event == "halt" else LETTERS[plan.pop(0) if len(plan) > 1 else plan[0]]

    return btcpp.World(act, frozenset(quirks))


class Both:
    """The same tree in our runtime and in the second interpreter, with the log of each."""

    def __init__(self, made: RandomTree) -> None:
        self._log: list[str] = []
        self._other_log: list[str] = []
        self._clock = SimClock()
        robot = planned(made.plans, self._log)
        self.ours = main_tree(made.text, robot, clock=self._clock)
        self._world = acting(made.plans, self._other_log)
        self.other = btcpp.Tree(made.text, self._world)
        self.write("t", "")

    def write(self, entry: str, value: float | str) -> None:
        self.ours.scope.create(entry, value)
        self.other.board.write(entry, value)

    def wait(self, duration_ms: float) -> None:
        self._clock.sleep(duration_ms / 1000)
        self._world.now_ms += duration_ms

    def halt(self) -> None:
        self.ours.halt()
        self.other.halt()

    def tick(self, *, exactly_once: bool) -> tuple[object, object] | None:
        """Tick both trees and return their results, logs and entries; None if BehaviorTree.CPP would never return."""
        try:
            result = (self.other.tick_exactly_once if exactly_once else self.other.tick)()
        except btcpp.UndefinedError:
            return None
        went = (self.ours.tick_exactly_once if exactly_once else self.ours.tick)()
        entries = [self.ours.scope.get(entry) for entry in (*ENTRIES, "t")]
        return (
            (went.value, self._log, entries),
            (result.value, self._other_log, [self.other.board.read(entry) for entry in (*ENTRIES, "t")]),
        )
