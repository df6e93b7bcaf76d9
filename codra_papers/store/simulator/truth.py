"""The scores of a run, from the world's own state. The robot's code never uses them.

- A second is *unsafe* while a person's body is nearer than `UNSAFE_BELOW_M` to the robot or its load, and some point of
  the robot may move faster than `UNSAFE_ABOVE_M_S`: its speed plus its turn rate times its reach.
- A *mission* is completed when a container is set down at a delivery place.
- A *bump* is a step in which the robot would have moved into an object or a person.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

from codra_papers.store.layout import AREAS
from codra_papers.store.simulator.driving import STEP_S
from codra_papers.store.simulator.people import PERSON_RADIUS_M
from codra_papers.store.simulator.state import StoreState, Whereabouts

UNSAFE_BELOW_M = 1.0
UNSAFE_ABOVE_M_S = 0.3
SET_DOWN_WITHIN_M = 0.3


@dataclass(frozen=True, slots=True, kw_only=True)
class Score:
    """The totals of a run.

    Attributes:
        deliveries: the names of the areas where containers were set down, in order.
    """

    unsafe_s: float = 0.0
    bumps: int = 0
    driven_m: float = 0.0
    deliveries: tuple[str, ...] = ()

    @property
    def missions(self) -> int:
        """Return how many missions were completed."""
        return len(self.deliveries)


class Judge:
    """Computes the score from the states of a shop."""

    def __init__(self, state: StoreState) -> None:
        """Begin with a state."""
        self.score = Score()
        self._last_state = state

    def see(self, state: StoreState) -> None:
        """Add one step to the score."""
        score = self.score
        self.score = replace(
            score,
            unsafe_s=round(score.unsafe_s + (STEP_S if is_unsafe(state) else 0.0), 6),
            bumps=score.bumps + (state.robot.bumped_s != self._last_state.robot.bumped_s),
            driven_m=score.driven_m + self._last_state.robot.at.distance_m(state.robot.at),
            deliveries=score.deliveries + _delivery_areas(self._last_state, state),
        )
        self._last_state = state


def nearest_person_m(state: StoreState) -> float:
    """Return the distance of the nearest person's body from the robot and its load; infinite without people."""
    gaps = [box.distance_m(at_m) - PERSON_RADIUS_M for box in state.footprint() for _, at_m in state.people_m]
    return max(min(gaps, default=float("inf")), 0.0)


def is_unsafe(state: StoreState) -> bool:
    """Return whether the robot moves fast near a person."""
    return state.robot.surface_speed_m_s() > UNSAFE_ABOVE_M_S and nearest_person_m(state) < UNSAFE_BELOW_M


def _delivery_areas(before: StoreState, after: StoreState) -> tuple[str, ...]:
    carried_container = before.carried_container()
    if carried_container is None or after.carried_container() is not None:
        return ()
    released_container = next(container for container in after.containers if container.name == carried_container.name)
    if released_container.where is not Whereabouts.FLOOR:
        return ()
    return tuple(
        area.name for area in AREAS.values() if area.places[0].distance_m(released_container.at) < SET_DOWN_WITHIN_M
    )[:1]
