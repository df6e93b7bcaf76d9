"""The context of 'kitchen': 9 observers, 17 context-variables, 5 skills.

Made by codra from specs/kitchen.yaml; edits are lost. Renew: codra compile specs/kitchen.yaml
"""

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Literal, Never, TypeVar, overload

from codra_dsl.runtime.generated_api import Clock, ContextManager, ContextModel, EventLog, Reading, ResourceModel

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
BoolAnswer = TypeVar("BoolAnswer", bound=bool | None)
RobotPlaceAnswer = TypeVar("RobotPlaceAnswer", bound=RobotPlace | None)
KettleStateAnswer = TypeVar("KettleStateAnswer", bound=KettleState | None)
FloatAnswer = TypeVar("FloatAnswer", bound=float | None)
HobLevelAnswer = TypeVar("HobLevelAnswer", bound=HobLevel | None)
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

    if TYPE_CHECKING:

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
            """Return the current reading of a variable."""

        @overload
        def set(self, name: BoolName, value: bool, *, evidence_s: float | None = ...) -> None: ...

        @overload
        def set(self, name: RobotPlaceName, value: RobotPlace, *, evidence_s: float | None = ...) -> None: ...

        @overload
        def set(self, name: KettleStateName, value: KettleState, *, evidence_s: float | None = ...) -> None: ...

        @overload
        def set(self, name: FloatName, value: float, *, evidence_s: float | None = ...) -> None: ...

        @overload
        def set(self, name: HobLevelName, value: HobLevel, *, evidence_s: float | None = ...) -> None: ...

        @overload
        def set(self, name: VariableName, value: Never, *, evidence_s: float | None = ...) -> None: ...

        def set(self, name: VariableName, value: Any, *, evidence_s: float | None = None) -> None:
            """Write a variable as the main execution."""

        @overload
        def declare(self, name: BoolName, value: bool | None = None) -> None: ...

        @overload
        def declare(self, name: RobotPlaceName, value: RobotPlace | None = None) -> None: ...

        @overload
        def declare(self, name: KettleStateName, value: KettleState | None = None) -> None: ...

        @overload
        def declare(self, name: FloatName, value: float | None = None) -> None: ...

        @overload
        def declare(self, name: HobLevelName, value: HobLevel | None = None) -> None: ...

        @overload
        def declare(self, name: VariableName, value: None = None) -> None: ...

        def declare(self, name: VariableName, value: Any = None) -> None:
            """Add a variable to the needs of the main execution, with a value if it knows one."""

        @overload
        def decide(
            self,
            name: BoolName,
            otherwise: Callable[[], BoolAnswer],
            *,
            max_age_s: float = ...,
            since_s: float = ...,
            wait_up_to_s: float = ...,
            shadow: bool = ...,
        ) -> bool | BoolAnswer: ...

        @overload
        def decide(
            self,
            name: RobotPlaceName,
            otherwise: Callable[[], RobotPlaceAnswer],
            *,
            max_age_s: float = ...,
            since_s: float = ...,
            wait_up_to_s: float = ...,
            shadow: bool = ...,
        ) -> RobotPlace | RobotPlaceAnswer: ...

        @overload
        def decide(
            self,
            name: KettleStateName,
            otherwise: Callable[[], KettleStateAnswer],
            *,
            max_age_s: float = ...,
            since_s: float = ...,
            wait_up_to_s: float = ...,
            shadow: bool = ...,
        ) -> KettleState | KettleStateAnswer: ...

        @overload
        def decide(
            self,
            name: FloatName,
            otherwise: Callable[[], FloatAnswer],
            *,
            max_age_s: float = ...,
            since_s: float = ...,
            wait_up_to_s: float = ...,
            shadow: bool = ...,
        ) -> float | FloatAnswer: ...

        @overload
        def decide(
            self,
            name: HobLevelName,
            otherwise: Callable[[], HobLevelAnswer],
            *,
            max_age_s: float = ...,
            since_s: float = ...,
            wait_up_to_s: float = ...,
            shadow: bool = ...,
        ) -> HobLevel | HobLevelAnswer: ...

        @overload
        def decide(
            self,
            name: VariableName,
            otherwise: Callable[[], Never],
            *,
            max_age_s: float = ...,
            since_s: float = ...,
            wait_up_to_s: float = ...,
            shadow: bool = ...,
        ) -> Any: ...

        def decide(
            self,
            name: VariableName,
            otherwise: Callable[[], Any],
            *,
            max_age_s: float = math.inf,
            since_s: float = -math.inf,
            wait_up_to_s: float = 0.0,
            shadow: bool = False,
        ) -> Any:
            """Answer a decision from context, or fall back to sequential perception."""


def start(
    *,
    clock: Clock,
    resources: Mapping[str, object],
    seed: int = 0,
    record: EventLog | None = None,
) -> Kitchen:
    """Return the context manager; nothing is observed before it is declared or expected."""
    return Kitchen(MODEL, clock=clock, resources=resources, seed=seed, record=record)
