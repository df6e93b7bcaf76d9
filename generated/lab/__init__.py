"""The context of 'lab': 7 observers, 15 context-variables, 13 skills.

Made by codra from specs/lab.yaml; edits are lost. Renew: codra compile specs/lab.yaml
"""

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Literal, TypeVar

from codra_dsl.runtime.generated_api import Clock, ContextManager, ContextModel, EventLog, Reading, ResourceModel

from . import centrifuge, lab, pcr_cycler

VariableName = Literal[
    "robot_is_localized",
    "centrifuge_rotor_in_pos_1",
    "centrifuge_rotor_in_pos_2",
    "centrifuge_in_observable_distance",
    "centrifuge_in_manipulation_distance",
    "centrifuge_base_in_FOV",
    "centrifuge_lid_in_FOV",
    "centrifuge_open",
    "centrifuge_locked",
    "pcr_cycler_in_observable_distance",
    "pcr_cycler_in_manipulation_distance",
    "pcr_cycler_base_in_FOV",
    "pcr_cycler_lid_in_FOV",
    "pcr_cycler_open",
    "pcr_cycler_locked",
]
BoolAnswer = TypeVar("BoolAnswer", bound=bool | None)
SkillName = Literal[
    "turn_centrifuge_rotor",
    "take_samples_from_centrifuge",
    "bring_samples_to_centrifuge",
    "drive_to_centrifuge",
    "unlock_centrifuge",
    "lock_centrifuge",
    "open_centrifuge",
    "close_centrifuge",
    "drive_to_pcr_cycler",
    "unlock_pcr_cycler",
    "lock_pcr_cycler",
    "open_pcr_cycler",
    "close_pcr_cycler",
]

MODEL = ContextModel(
    name="lab",
    variables=(*centrifuge.VARIABLES, *lab.VARIABLES, *pcr_cycler.VARIABLES),
    observers=(*centrifuge.OBSERVERS, *lab.OBSERVERS, *pcr_cycler.OBSERVERS),
    skills=(*centrifuge.SKILLS, *lab.SKILLS, *pcr_cycler.SKILLS),
    resources=(ResourceModel(name="camera"), ResourceModel(name="base"), ResourceModel(name="vision", slots=1)),
)


class Lab(ContextManager[VariableName, SkillName]):
    """The context manager of 'lab', with the types of its values."""

    if TYPE_CHECKING:

        def get(self, name: VariableName) -> Reading[bool]:
            """Return the current reading of a variable."""

        def set(self, name: VariableName, value: bool, *, evidence_s: float | None = None) -> None:
            """Write a variable as the main execution."""

        def declare(self, name: VariableName, value: bool | None = None) -> None:
            """Add a variable to the needs of the main execution, with a value if it knows one."""

        def decide(
            self,
            name: VariableName,
            otherwise: Callable[[], BoolAnswer],
            *,
            max_age_s: float = math.inf,
            since_s: float = -math.inf,
            wait_up_to_s: float = 0.0,
            shadow: bool = False,
        ) -> bool | BoolAnswer:
            """Answer a decision from context, or fall back to sequential perception."""


def start(
    *,
    clock: Clock,
    resources: Mapping[str, object],
    seed: int = 0,
    record: EventLog | None = None,
) -> Lab:
    """Return the context manager; nothing is observed before it is declared or expected."""
    return Lab(MODEL, clock=clock, resources=resources, seed=seed, record=record)
