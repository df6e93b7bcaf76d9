"""The agent `mission`: it chooses the order to serve, and runs the leaves of its tree (P2, section 5.2, Figure 7)."""

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
"""A mapping from messages of the tree to notices for the base."""


class Mission:
    """Takes orders, the oldest first, and closes them.

    An order stays open until one of these happens: its container is set down; no container is found; the order has
    failed too often; the picker takes the order back. An order that a course abandons without closing it is set aside.
    After the robot has been back at the start, the order waits again, behind the orders that were abandoned less often.
    The agent records in the graph whether an order can be served now, so that the loops know whether there is work.
    """

    def __init__(self, knowledge: Knowledge) -> None:
        """Open the handle of the agent `mission`; no order is taken yet."""
        self._knowledge = knowledge
        self._handle = knowledge.as_agent("mission")
        self._taken_order = ""
        self._orders_aside: set[str] = set()
        self._abandon_counts: Counter[str] = Counter()
        self._failure_counts: Counter[str] = Counter()
        self._handle.set("robot", "order_open", False)
        self._subscription = knowledge.subscribe(
            self._on_orders, path(some("order", called="order"), "to_area", anything())
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

    def _on_orders(self, change: Change) -> None:
        for match in change.new:
            name = match.node("order")
            self._knowledge.follow(name, "cancelled", partial(self._on_cancelled, name))
        if change.new:
            self._record_open_order()

    def _on_cancelled(self, name: str, reading: Reading[bool]) -> None:
        """Close an order that the picker takes back, even if it is being served."""
        if reading.known and reading.value and name in self._open_orders():
            self._close(name, "cancelled")

    def _record_open_order(self) -> None:
        """Record whether an order can be served. While the fork is loaded, only the taken order can be served."""
        is_waiting = not self._is_loaded() and bool(self._waiting_orders())
        self._handle.set("robot", "order_open", bool(self._taken_order) or is_waiting)

    def _is_loaded(self) -> bool:
        loaded_reading = self._knowledge.get("robot", "loaded")
        return loaded_reading.known and bool(loaded_reading.value)

    def _open_orders(self) -> list[str]:
        """Return the orders that are not closed, the oldest first."""
        snapshot = self._knowledge.snapshot()
        states = ((node.name, snapshot.get(node.name, "state")) for node in snapshot.nodes("order"))
        return [name for name, state in states if not state.known or state.value == "open"]

    def _waiting_orders(self) -> list[str]:
        """Return the open orders that are not set aside, sorted by how often they were abandoned, then by age."""
        return sorted(
            (name for name in self._open_orders() if name not in self._orders_aside),
            key=lambda name: self._abandon_counts[name],
        )

    def _take(self, ports: Ports) -> Result:
        """Continue the taken order, or take the first waiting order. The leaf runs on while no order is waiting."""
        if not self._taken_order:
            waiting_names = self._waiting_orders()
            if not waiting_names:
                return Result.RUNNING
            self._taken_order = waiting_names[0]
            with self._handle.transaction() as change:
                change.set(self._taken_order, "state", "open")
                change.set("base", "base_notice", "none")
        ports.set("observation_pose", f"{self._area_of_order('of_area')}_pose_1")
        ports.set("delivery_pose", f"{self._area_of_order('to_area')}_delivery")
        return Result.SUCCESS

    def _area_of_order(self, edge: str) -> str:
        return next(match.target for match in self._knowledge.snapshot().edges(edge, origin=self._taken_order))

    def _set_aside(self) -> bool:
        """Set the order aside. The leaf fails if no order is taken, or if the container is already on the fork."""
        if not self._taken_order or self._is_loaded():
            return False
        self._orders_aside.add(self._taken_order)
        self._abandon_counts[self._taken_order] += 1
        self._taken_order = ""
        self._record_open_order()
        return True

    def _give_up(self, ports: Ports) -> bool:
        """Count a failed attempt. If the order has failed too often, close it; otherwise the leaf fails.

        After the order is closed, other orders need not wait for it.
        """
        if not self._taken_order or self._is_loaded():
            return False
        self._failure_counts[self._taken_order] += 1
        if self._failure_counts[self._taken_order] < ports.number("tries"):
            return False
        self._close(self._taken_order, "failed")
        return True

    def _resume(self) -> bool:
        """Let the orders that were set aside wait again."""
        if self._orders_aside:
            self._orders_aside.clear()
            self._record_open_order()
        return True

    def _complete(self, ports: Ports) -> bool:
        """Close the order after its container was set down: at the order's target as `done`, elsewhere as `aborted`."""
        if self._taken_order:
            is_at_target = ports.text("at") == f"{self._area_of_order('to_area')}_delivery"
            self._close(self._taken_order, "done" if is_at_target else "aborted")
        self._record_open_order()
        return True

    def _redirect(self) -> bool:
        """Abort an order whose container cannot be set down at the order's target.

        The leaf fails if no order is taken, or if the target is already the general delivery.
        """
        if not self._taken_order or self._area_of_order("to_area") == DELIVERY.name:
            return False
        self._close(self._taken_order, "aborted")
        return True

    def _close_as(self, ports: Ports) -> bool:
        """Close the order with the outcome that the port `outcome` gives. The leaf fails if no order is taken."""
        if not self._taken_order:
            return False
        self._close(self._taken_order, ports.text("outcome"))
        return True

    def _close(self, name: str, state: str) -> None:
        self._handle.set(name, "state", state)
        self._orders_aside.discard(name)
        if name == self._taken_order:
            self._taken_order = ""
        self._record_open_order()

    def _inform(self, ports: Ports) -> bool:
        """Write a notice for the base, but keep the notice that the base already has, because it gives the reason."""
        notice = _NOTICES.get(ports.text("message"))
        current_notice = self._knowledge.get("base", "base_notice")
        if notice is not None and not (current_notice.known and current_notice.value != "none"):
            self._handle.set("base", "base_notice", notice)
        return True
