"""A trip by the book: P2's pick-up and delivery, step by step, as one blocking program (P2, section 3.2 and Figure 2).

It knows no other course: whoever wants another aborts it. It asks for everything through the knowledge graph.
"""

from __future__ import annotations

from math import pi

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.knowledge import Knowledge, Request, Snapshot, Stage
from codra_papers.store.body import Way
from codra_papers.store.geometry import Pose2D
from codra_papers.store.knowledge import pose_of, stand_of
from codra_papers.store.layout import AREAS, approach_to, robot_at

LONGEST_S = 600.0
"""No task takes longer: its deadlines end it before."""


class TripError(RuntimeError):
    """A step of a trip came out otherwise than it should."""


class AbortedError(RuntimeError):
    """A trip was aborted, by its own side or by a deadline."""


class Trip:
    """Drives, looks, fetches and delivers as the agent `picking`."""

    def __init__(self, knowledge: Knowledge, clock: Clock) -> None:
        """Take the agent `picking`; the trip begins with its first call."""
        self._knowledge = knowledge
        self._clock = clock
        self._handle = knowledge.as_agent("picking")
        self._request: Request | None = None
        self._is_aborted = False

    def close(self) -> None:
        """Give the agent back."""
        self._handle.close()

    def abort(self) -> None:
        """Abort the task under way, and with it the trip. May be called from events."""
        self._is_aborted = True
        request = self._request
        if request is not None and self._knowledge.snapshot().handover(request.task).is_open:
            self._handle.abort(request)

    def pick_up(self, area: str) -> bool:
        """Fetch a container from an area; return whether one was found.

        Where none is found from any observation pose, the base is told (P2, section 6).

        Raises:
            TripError: if a step fails.
            AbortedError: if the trip is aborted.
        """
        if not self._find(area):
            self._handle.set("base", "base_notice", "container_not_found")
            return False
        front = approach_to(self._container(area))
        self.go(front.turned(pi))
        self._must("detecting", "found")
        self._must("rotating", "turned")
        self._must("checking", "found")
        self.go(robot_at(self._container(area)), Way.BACKWARD)
        self._must("lifting", "lifted")
        return True

    def deliver(self, area: str) -> None:
        """Set down the container at an area.

        Raises:
            TripError: if a step fails.
            AbortedError: if the trip is aborted.
        """
        self.go(self._named(f"{area}_approach"))
        self.go(self._named(f"{area}_delivery"), Way.BACKWARD)
        self._must("lowering", "lowered")

    def go_to(self, name: str) -> None:
        """Drive to a pose that has a name."""
        self.go(self._named(name))

    def go(self, goal: Pose2D, way: Way = Way.FORWARD) -> None:
        """Drive to a pose.

        Raises:
            TripError: if the robot does not arrive.
            AbortedError: if the trip is aborted.
        """
        with self._handle.transaction() as change:
            change.place("world", "goal_pose", "goal", pose_of(goal))
            change.set("goal", "goal_way", way)
        self._must("navigating", "arrived")

    def _find(self, area: str) -> bool:
        for number in range(1, len(AREAS[area].observation) + 1):
            self.go(self._named(f"{area}_pose_{number}"))
            if self._do("detecting") == "found":
                return True
        return False

    def _must(self, task: str, wanted: str) -> None:
        result = self._do(task)
        if result != wanted:
            raise TripError(f"{task} came out as {result!r} instead of {wanted!r}")

    def _do(self, task: str) -> str:
        if self._is_aborted:
            raise AbortedError(f"the trip was aborted before {task}")
        self._request = self._handle.request(task)
        self._clock.wait_until(lambda: not self._knowledge.snapshot().handover(task).is_open, LONGEST_S)
        handover = self._knowledge.snapshot().handover(task)
        self._request = None
        if handover.stage is not Stage.FINISHED or handover.result is None:
            raise AbortedError(f"{task} was aborted: {handover.reason}")
        return handover.result

    def _named(self, name: str) -> Pose2D:
        return stand_of(self._knowledge.transform("world", name).pose)

    def _container(self, area: str) -> Pose2D:
        """Return where the known container that is nearest to an area stands."""
        snapshot: Snapshot = self._knowledge.snapshot()
        middle = self._named(f"{area}_delivery")
        stands = [
            stand_of(snapshot.transform("world", node.name).pose)
            for node in snapshot.nodes("roll_container")
            if snapshot.parent(node.name) == "world"
        ]
        if not stands:
            raise TripError(f"no container is known near {area}")
        return min(stands, key=lambda stand: (stand.distance_m(middle), stand.x_m, stand.y_m))
