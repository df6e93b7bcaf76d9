"""The executor that ticks a tree."""

from __future__ import annotations

from codra_dsl.runtime.behavior_trees.node import Leaves, Node, Pulse, TickContext
from codra_dsl.runtime.behavior_trees.result import Result
from codra_dsl.runtime.behavior_trees.scope import Scope
from codra_dsl.runtime.clock import Clock

MAX_PASSES = 10_000
"""The maximum number of ticks within one `tick`, so that an endless loop cannot block the robot's program."""


class Tree:
    """A tree that can be ticked: its nodes, bound to entries, a clock and the robot's actions.

    The clock is read only when the tree is ticked. A node that waits reports the instant for which it waits, and
    `due_s` is the earliest of these instants.
    """

    def __init__(self, root: Node, *, leaves: Leaves, clock: Clock, scope: Scope | None = None) -> None:
        """Bind all nodes.

        Args:
            root: the root; its nodes must not belong to another tree.
            leaves: provides the actions of the leaves.
            clock: the clock for delays, timeouts and sleeps.
            scope: the entries of the tree; None for a new scope.

        Raises:
            TreeError: if the robot does not have the action of a leaf.
        """
        self.root = root
        self.scope = Scope() if scope is None else scope
        self._clock = clock
        self._pulse = Pulse()
        root.bind(TickContext(scope=self.scope, clock=clock, leaves=leaves, pulse=self._pulse))

    @property
    def due_s(self) -> float | None:
        """Return the earliest instant for which a node waits, as of the last tick; None if no node waits."""
        return self._pulse.due_s

    def tick_exactly_once(self) -> Result:
        """Tick the root once (`tickExactlyOnce`)."""
        self._pulse.visited_nodes.clear()
        self._pulse.needs_tick = False
        self._pulse.due_s = None
        try:
            result = self.root.execute()
        except BaseException:
            self._halt_all()
            raise
        if result.is_completed:
            self.root.reset()
        return result

    def tick(self) -> Result:
        """Tick the root, and tick it again as long as a node has only yielded between two steps (`tickOnce`)."""
        result = self.tick_exactly_once()
        pass_count = 1
        while result is Result.RUNNING and self._pulse.needs_tick and pass_count < MAX_PASSES:
            result = self.tick_exactly_once()
            pass_count += 1
        return result

    def run(self, period_s: float, *, timeout_s: float = float("inf")) -> Result:
        """Tick until the tree is no longer running (`tickWhileRunning`): in every period, and when a node is due.

        Args:
            period_s: the time between two ticks.
            timeout_s: halt the tree after this time, and return RUNNING.
        """
        end_s = self._clock.now_s() + timeout_s
        result = self.tick()
        while result is Result.RUNNING:
            now_s = self._clock.now_s()
            if now_s >= end_s:
                self.halt()
                break
            due_s = now_s + period_s if self.due_s is None else min(now_s + period_s, self.due_s)
            self._clock.sleep(max(0.0, min(due_s, end_s) - now_s))
            result = self.tick()
        return result

    def halt(self) -> None:
        """Halt the tree if it is running (`haltTree`)."""
        self.root.reset()

    def _halt_all(self) -> None:
        """Halt all running nodes after an action or a script has raised an error within a tick."""
        pending_nodes = [self.root]
        while pending_nodes:
            node = pending_nodes.pop()
            node.reset()
            pending_nodes.extend(reversed(node.nodes))
