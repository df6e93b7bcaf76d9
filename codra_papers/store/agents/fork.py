"""P2's PickUpAgent and DeliverAgent as one agent: it moves the fork, and records the load of the fork in the graph."""

from __future__ import annotations

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.knowledge import Knowledge, Snapshot
from codra_papers.store.agents.working import Executor
from codra_papers.store.body import Body, Lift, Outcome, StopFunction
from codra_papers.store.geometry import Pose2D
from codra_papers.store.knowledge import floor_pose_of
from codra_papers.store.layout import FORK_M

LIFTED_WITHIN_M = 0.5
"""The known pose of the lifted container must be nearer than this to the middle of the fork."""


class Fork:
    """Raises and lowers the fork."""

    def __init__(self, knowledge: Knowledge, body: Body, _: Clock) -> None:
        """Wait for requests."""
        self._knowledge = knowledge
        self._handle = knowledge.as_agent("fork")
        self._body = body
        self._stop_command: StopFunction | None = None
        self._handle.set("robot", "loaded", body.has_load())
        self._lifting = Executor(knowledge, self._handle, "lifting", self._raise, self._stop)
        self._lowering = Executor(knowledge, self._handle, "lowering", self._lower, self._stop)

    def _raise(self, _: Snapshot) -> None:
        self._stop_command = self._body.lift(Lift.UP, self._on_raised)

    def _lower(self, _: Snapshot) -> None:
        self._stop_command = self._body.lift(Lift.DOWN, self._on_lowered)

    def _stop(self) -> None:
        if self._stop_command is not None:
            self._stop_command()

    def _on_raised(self, outcome: Outcome) -> None:
        if outcome is not Outcome.DONE:
            return
        is_loaded, snapshot = self._body.has_load(), self._knowledge.snapshot()
        name = _lifted_container(snapshot) if is_loaded else None
        with self._handle.transaction() as change:
            change.set("robot", "loaded", is_loaded)
            if name is not None:
                change.place("robot", "container_pose", name, snapshot.transform("robot", name).pose)
                change.insert_edge("robot", "carries", name)
        self._lifting.finish("lifted" if is_loaded else "empty")

    def _on_lowered(self, outcome: Outcome) -> None:
        if outcome is not Outcome.DONE:
            return
        snapshot = self._knowledge.snapshot()
        with self._handle.transaction() as change:
            change.set("robot", "loaded", self._body.has_load())
            for edge in snapshot.edges("carries", origin="robot"):
                change.place("world", "container_pose", edge.target, snapshot.transform("world", edge.target).pose)
                change.delete_edge("robot", "carries", edge.target)
        self._lowering.finish("lowered")


def _lifted_container(snapshot: Snapshot) -> str | None:
    """Return the known container that the fork must have lifted; None if no known container is near enough."""
    middle = Pose2D(-FORK_M, 0.0)
    distances_m = {
        node.name: floor_pose_of(snapshot.transform("robot", node.name).pose).distance_m(middle)
        for node in snapshot.nodes("roll_container")
        if snapshot.parent(node.name) == "world"
    }
    name = min(distances_m, key=lambda container: (distances_m[container], container), default=None)
    return name if name is not None and distances_m[name] < LIFTED_WITHIN_M else None
