"""The context of 'kitchen': 9 observers, 17 context-variables, 5 skills.

Made by codra from specs/kitchen.yaml; edits are lost. Renew: codra compile specs/kitchen.yaml
"""

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Literal, overload

from codra_dsl.runtime import Clock, ContextManager, Reading, Record
from codra_dsl.runtime.context import Answer
from codra_dsl.runtime.model import ContextModel, ResourceModel

from . import dishwasher, fridge, kitchen

RobotPlace = Literal["hall", "counter", "stove"]
KettleState = Literal["empty", "cold", "hot", "boiling"]
HobLevel = Literal["off", "low", "high"]
BoolName = Literal[
    "robot_is_localized",
    "light_is_on",
    "kettle_in_view",
    "kettle_docked",
    "pot_on_hob",
    "fridge_in_reach",
    "fridge_open",
    "dishwasher_in_reach",
    "dishwasher_open",
]
RobotPlaceName = Literal["robot_place"]
KettleStateName = Literal["kettle_state"]
FloatName = Literal["kettle_water", "hob_power", "pot_fill", "fridge_angle", "dishwasher_angle"]
HobLevelName = Literal["hob_level"]
VariableName = BoolName | RobotPlaceName | KettleStateName | FloatName | HobLevelName
SkillName = Literal["boil_water", "pour_water", "cook", "open_fridge", "open_dishwasher"]

MODEL = ContextModel(
    name="kitchen",
    variables=(*dishwasher.VARIABLES, *fridge.VARIABLES, *kitchen.VARIABLES),
    observers=(*dishwasher.OBSERVERS, *fridge.OBSERVERS, *kitchen.OBSERVERS),
    skills=(*dishwasher.SKILLS, *fridge.SKILLS, *kitchen.SKILLS),
    resources=(ResourceModel(name="kitchen"), ResourceModel(name="vision", slots=1)),
)


class Kitchen(ContextManager[VariableName, SkillName]):
    """The context manager of 'kitchen', with the types of its values."""

    @overload
    def get(self, name: BoolName) -> Reading[bool]: ...

    @overload
    def get(self, name: RobotPlaceName) -> Reading[RobotPlace]: ...

    @overload
    def get(self, name: KettleStateName) -> Reading[KettleState]: ...

    @overload
    def get(self, name: FloatName) -> Reading[float]: ...

    @overload
    def get(self, name: HobLevelName) -> Reading[HobLevel]: ...

    @overload
    def get(self, name: VariableName) -> Reading[Any]: ...

    def get(self, name: VariableName) -> Reading[Any]:
        """Return what is known of a variable now."""
        return super().get(name)

    if not TYPE_CHECKING:
        get = ContextManager.get  # the types are for tools: at run time it is called without a detour

    @overload
    def decide(
        self,
        name: BoolName,
        otherwise: Callable[[], Answer],
        *,
        max_age_s: float = ...,
        since_s: float = ...,
        wait_up_to_s: float = ...,
        shadow: bool = ...,
    ) -> bool | Answer: ...

    @overload
    def decide(
        self,
        name: RobotPlaceName,
        otherwise: Callable[[], Answer],
        *,
        max_age_s: float = ...,
        since_s: float = ...,
        wait_up_to_s: float = ...,
        shadow: bool = ...,
    ) -> RobotPlace | Answer: ...

    @overload
    def decide(
        self,
        name: KettleStateName,
        otherwise: Callable[[], Answer],
        *,
        max_age_s: float = ...,
        since_s: float = ...,
        wait_up_to_s: float = ...,
        shadow: bool = ...,
    ) -> KettleState | Answer: ...

    @overload
    def decide(
        self,
        name: FloatName,
        otherwise: Callable[[], Answer],
        *,
        max_age_s: float = ...,
        since_s: float = ...,
        wait_up_to_s: float = ...,
        shadow: bool = ...,
    ) -> float | Answer: ...

    @overload
    def decide(
        self,
        name: HobLevelName,
        otherwise: Callable[[], Answer],
        *,
        max_age_s: float = ...,
        since_s: float = ...,
        wait_up_to_s: float = ...,
        shadow: bool = ...,
    ) -> HobLevel | Answer: ...

    @overload
    def decide(
        self,
        name: VariableName,
        otherwise: Callable[[], Answer],
        *,
        max_age_s: float = ...,
        since_s: float = ...,
        wait_up_to_s: float = ...,
        shadow: bool = ...,
    ) -> Any | Answer: ...

    def decide(
        self,
        name: VariableName,
        otherwise: Callable[[], Answer],
        *,
        max_age_s: float = math.inf,
        since_s: float = -math.inf,
        wait_up_to_s: float = 0.0,
        shadow: bool = False,
    ) -> Any | Answer:
        """Answer a decision from context, or fall back to sequential perception."""
        return super().decide(
            name, otherwise, max_age_s=max_age_s, since_s=since_s, wait_up_to_s=wait_up_to_s, shadow=shadow
        )


def start(
    *,
    clock: Clock,
    resources: Mapping[str, object],
    seed: int = 0,
    record: Record | None = None,
) -> Kitchen:
    """Return the context manager; nothing is observed before it is declared or expected."""
    return Kitchen(MODEL, clock=clock, resources=resources, seed=seed, record=record)
