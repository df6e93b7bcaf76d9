"""The agent `mission`: it chooses the order to serve, and has the leaves of its tree (P2, section 5.2, Figure 7)."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from functools import partial

from codra_dsl.runtime import Reading
from codra_dsl.runtime.behavior_trees import Ports, Result, Robot, Task
from codra_dsl.runtime.knowledge import Change, Knowledge, anything, path, some
from codra_papers.store.layout import DELIVERY
from codra_papers.store.mission.move_to import MoveTo

_NOTICES = {"mission aborted": "mission_aborted"}
"""The notices to the base by message."""


class Mission:
    """Takes orders in the order of arrival, and closes them.

    An order stays open until its container was set down, until no container was found, until it has failed too often,
    or until the picker takes it back. An order that a course has left is set aside. Once the robot was back at the
    start, it waits again, behind the orders that were left less often. The agent records in the graph whether an order
    can be served now, so that the loops know whether the robot has work.
    """

    def __init__(self, knowledge: Knowledge) -> None:
        """Take the agent `mission`, without an order."""
        self._knowledge = knowledge
        self._handle = knowledge.as_agent("mission")
        self._taken = ""
        self._aside: set[str] = set()
        self._left: Counter[str] = Counter()
        self._failed: Counter[str] = Counter()
        self._handle.set("robot", "order_open", False)
        self._subscription = knowledge.subscribe(
            self._ordered, path(some("order", called="order"), "to_area", anything())
        )

    def leaves(self) -> Robot:
        """Return the functions of the leaves of `trees/mission.xml`."""
        robot = Robot()
        knowledge, handle = self._knowledge, self._handle
        leaves: dict[str, Callable[[Ports], bool | Result]] = {
            "TakeOrder": self._take,
            "SetOrderAside": lambda _: self._set_aside(),
            "GiveOrderUp": self._give_up,
            "ResumeOrders": lambda _: self._resume(),
            "CompleteOrder": self._complete,
            "RedirectOrder": lambda _: self._redirect(),
            "CloseOrder": self._close_as,
            "IsLoaded": lambda _: self._is_loaded(),
            "Inform": self._inform,
        }
        for name, leaf in leaves.items():
            robot.does(name, leaf)
        robot.can("MoveTo", lambda: MoveTo(handle, knowledge))
        robot.can("PickUp", lambda: Task("fetching", handle, knowledge, succeeds_with=("fetched",)))
        robot.can("LowerFork", lambda: Task("lowering", handle, knowledge))
        return robot

    def _ordered(self, change: Change) -> None:
        for match in change.new:
            name = match.node("order")
            self._knowledge.follow(name, "cancelled", partial(self._cancelled, name))
        if change.new:
            self._record_open_order()

    def _cancelled(self, name: str, reading: Reading[bool]) -> None:
        """Close an order that is taken back, also while it is served."""
        if reading.known and reading.value and name in self._open():
            self._close(name, "cancelled")

    def _record_open_order(self) -> None:
        """Record whether an order can be served. While the fork is loaded, only the taken order counts."""
        is_waiting = not self._is_loaded() and bool(self._waiting())
        self._handle.set("robot", "order_open", bool(self._taken) or is_waiting)

    def _is_loaded(self) -> bool:
        loaded = self._knowledge.get("robot", "loaded")
        return loaded.known and bool(loaded.value)

    def _open(self) -> list[str]:
        """Return the orders that are not closed, the oldest first."""
        snapshot = self._knowledge.snapshot()
        states = ((node.name, snapshot.get(node.name, "state")) for node in snapshot.nodes("order"))
        return [name for name, state in states if not state.known or state.value == "open"]

    def _waiting(self) -> list[str]:
        """Return the open orders that are not set aside, sorted by how often they were left, then by age."""
        return sorted((name for name in self._open() if name not in self._aside), key=lambda name: self._left[name])

    def _take(self, ports: Ports) -> Result:
        """Continue the taken order, or take the first waiting one. Wait while no order is waiting."""
        if not self._taken:
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
        return next(match.target for match in self._knowledge.snapshot().edges(edge, origin=self._taken))

    def _set_aside(self) -> bool:
        """Set the order aside. Fail if no order is taken, or if its container is already on the fork."""
        if not self._taken or self._is_loaded():
            return False
        self._aside.add(self._taken)
        self._left[self._taken] += 1
        self._taken = ""
        self._record_open_order()
        return True

    def _give_up(self, ports: Ports) -> bool:
        """Close an order that has failed too often, so that others need not wait for it; else fail."""
        if not self._taken or self._is_loaded():
            return False
        self._failed[self._taken] += 1
        if self._failed[self._taken] < ports.number("tries"):
            return False
        self._close(self._taken, "failed")
        return True

    def _resume(self) -> bool:
        """Let the orders that were set aside wait again."""
        if self._aside:
            self._aside.clear()
            self._record_open_order()
        return True

    def _complete(self, ports: Ports) -> bool:
        """Close the order when its container was set down. It is done if that is its target."""
        if self._taken:
            is_there = ports.text("at") == f"{self._area('to_area')}_delivery"
            self._close(self._taken, "done" if is_there else "aborted")
        self._record_open_order()
        return True

    def _redirect(self) -> bool:
        """Abort an order whose container cannot be set down at its target. Fail for the general delivery."""
        if not self._taken or self._area("to_area") == DELIVERY.name:
            return False
        self._close(self._taken, "aborted")
        return True

    def _close_as(self, ports: Ports) -> bool:
        """Close the order with the outcome of the port. Fail if no order is taken."""
        if not self._taken:
            return False
        self._close(self._taken, ports.text("outcome"))
        return True

    def _close(self, name: str, state: str) -> None:
        self._handle.set(name, "state", state)
        self._aside.discard(name)
        if name == self._taken:
            self._taken = ""
        self._record_open_order()

    def _inform(self, ports: Ports) -> bool:
        """Set the notice to the base, unless it already has one with the reason."""
        notice = _NOTICES.get(ports.text("message"))
        current = self._knowledge.get("base", "base_notice")
        if notice is not None and not (current.known and current.value != "none"):
            self._handle.set("base", "base_notice", notice)
        return True
