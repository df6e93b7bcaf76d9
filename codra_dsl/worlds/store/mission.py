"""The agent `mission`: which order the robot serves, and what the leaves of its tree do (P2, section 5.2, Figure 7)."""

from __future__ import annotations

from codra_dsl.runtime.knowledge import Change, Knowledge
from codra_dsl.runtime.knowledge.declarations import anything, path, some
from codra_dsl.runtime.trees import Ports, Result, Robot, Task
from codra_dsl.worlds.store.move_to import MoveTo

_NOTICES = {"mission aborted": "mission_aborted"}
"""What the base is told by messages that it must know of."""


class Mission:
    """Takes orders in the turn in which they came, and closes them.

    It tells in the graph whether an order is open, so that the loops know that there is something to do.
    """

    def __init__(self, knowledge: Knowledge) -> None:
        """Take the agent `mission`; no order is taken yet."""
        self._knowledge = knowledge
        self._handle = knowledge.as_agent("mission")
        self._taken = ""
        self._handle.set("robot", "order_open", False)
        self._subscription = knowledge.subscribe(self._ordered, path(some("order"), "to_area", anything()))

    def leaves(self) -> Robot:
        """Return what the leaves of `trees/mission.xml` do."""
        robot = Robot()
        knowledge, handle = self._knowledge, self._handle
        robot.does("TakeOrder", self._take)
        robot.does("CompleteOrder", self._complete)
        robot.does("AbortOrder", self._abort)
        robot.does("Inform", self._inform)
        robot.can("MoveTo", lambda: MoveTo(handle, knowledge))
        robot.can("PickUp", lambda: Task("fetching", handle, knowledge, succeeds_with=("fetched",)))
        robot.can("LowerFork", lambda: Task("lowering", handle, knowledge))
        return robot

    def _ordered(self, change: Change) -> None:
        if change.new:
            self._tell()

    def _tell(self) -> None:
        """Tell whether there is an order to serve; while something must be put down first there is none but that."""
        loaded = self._knowledge.get("robot", "loaded")
        may_take = not (loaded.known and loaded.value)
        self._handle.set("robot", "order_open", bool(self._taken) or (may_take and bool(self._waiting())))

    def _waiting(self) -> list[str]:
        """Return the orders that have no state yet, the oldest first."""
        snapshot = self._knowledge.snapshot()
        return [node.name for node in snapshot.nodes("order") if not snapshot.get(node.name, "state").known]

    def _take(self, ports: Ports) -> Result:
        """Take the oldest order; wait while there is none."""
        waiting = self._waiting()
        if not waiting:
            return Result.RUNNING
        self._taken = waiting[0]
        with self._handle.transaction() as change:
            change.set(self._taken, "state", "open")
            change.set("base", "base_notice", "none")
        ports.set("observation_pose", f"{self._area('of_area')}_pose_1")
        ports.set("delivery_pose", f"{self._area('to_area')}_delivery")
        return Result.SUCCESS

    def _area(self, edge: str) -> str:
        return next(each.target for each in self._knowledge.snapshot().edges(edge, origin=self._taken))

    def _complete(self, ports: Ports) -> bool:
        """Close the order when its container was set down: it is done if that is where it was to go."""
        if self._taken:
            is_there = ports.text("at") == f"{self._area('to_area')}_delivery"
            self._close("done" if is_there else "aborted")
        self._tell()
        return True

    def _abort(self, ports: Ports) -> bool:
        """Close the order otherwise; fail if none is taken."""
        if not self._taken:
            return False
        self._close(ports.text("outcome"))
        return True

    def _close(self, state: str) -> None:
        self._handle.set(self._taken, "state", state)
        self._taken = ""
        self._tell()

    def _inform(self, ports: Ports) -> bool:
        """Tell the base; what it was told of the reason before stands."""
        notice = _NOTICES.get(ports.text("message"))
        told = self._knowledge.get("base", "base_notice")
        if notice is not None and not (told.known and told.value != "none"):
            self._handle.set("base", "base_notice", notice)
        return True
