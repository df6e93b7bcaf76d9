"""The agents of P2's robot (P2, section 5.2). An agent uses only its sensors and the knowledge graph."""

from __future__ import annotations

from collections.abc import Mapping

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.knowledge import Knowledge
from codra_papers.store.agents.container_detection import ContainerDetection
from codra_papers.store.agents.fork import Fork
from codra_papers.store.agents.monitors import CameraAgent, Lasers, Localisation
from codra_papers.store.agents.navigation import Navigation
from codra_papers.store.agents.person_detection import PersonDetection
from codra_papers.store.agents.turning import Turning
from codra_papers.store.agents.wheel_check import WheelCheck
from codra_papers.store.body import Body

Agent = (
    Localisation
    | CameraAgent
    | Lasers
    | PersonDetection
    | ContainerDetection
    | WheelCheck
    | Navigation
    | Turning
    | Fork
)

AGENTS: Mapping[str, type[Agent]] = {
    "localisation": Localisation,
    "camera_agent": CameraAgent,
    "lasers": Lasers,
    "person_detection": PersonDetection,
    "container_detection": ContainerDetection,
    "wheel_check": WheelCheck,
    "navigation": Navigation,
    "turning": Turning,
    "fork": Fork,
}
"""The agents of the robot's body, by their names in the spec."""


def start_agents(knowledge: Knowledge, body: Body, clock: Clock) -> tuple[Agent, ...]:
    """Start all agents of the robot's body, each under its own name."""
    return tuple(agent(knowledge, body, clock) for agent in AGENTS.values())
