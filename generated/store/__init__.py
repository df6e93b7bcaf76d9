"""The context of 'store': 0 observers, 35 context-variables, 0 skills.

Made by codra from specs/store.yaml; edits are lost. Renew: codra compile specs/store.yaml
"""

import math
from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any, Literal, Never, TypeVar, overload

from codra_dsl.runtime.generated_api import Agent, Clock, ContextManager, ContextModel, EventLog, Leaves, Mape, Reading

from . import store
from .knowledge import (
    KNOWLEDGE,
    AdaptationHandle,
    AnalysisHandle,
    CameraAgentHandle,
    ContainerDetectionHandle,
    ForkHandle,
    LasersHandle,
    LocalisationHandle,
    MissionHandle,
    NavigationHandle,
    PersonDetectionHandle,
    PickerPageHandle,
    PickingHandle,
    StoreKnowledge,
    TurningHandle,
    WheelCheckHandle,
)
from .mape import MAPE

ContainerLoad = Literal["empty", "loading", "full"]
GoalWay = Literal["forward", "backward"]
BaseNotice = Literal["none", "container_not_found", "container_not_placed", "mission_aborted"]
Course = Literal["pick", "deliver", "start", "dock"]
FloatName = Literal[
    "battery_level",
    "person_distance",
    "front_gap",
    "back_gap",
    "strange_gap",
    "speed",
    "pose_spread",
    "max_speed",
    "battery_drain",
    "crowding",
    "safety",
    "mission_completion",
    "power_autonomy",
    "weight_of_pick",
    "weight_of_deliver",
    "weight_of_start",
    "weight_of_dock",
    "filtered_weight_of_pick",
    "filtered_weight_of_deliver",
    "filtered_weight_of_start",
    "filtered_weight_of_dock",
]
BoolName = Literal[
    "charging",
    "camera_steady",
    "bumped",
    "loaded",
    "full_on_fork",
    "crowded",
    "order_open",
    "picking_up",
]
ContainerLoadName = Literal["container_load"]
GoalWayName = Literal["goal_way"]
BaseNoticeName = Literal["base_notice"]
IntName = Literal["people_at_container"]
CourseName = Literal["course"]
VariableName = FloatName | BoolName | ContainerLoadName | GoalWayName | BaseNoticeName | IntName | CourseName
FloatAnswer = TypeVar("FloatAnswer", bound=float | None)
BoolAnswer = TypeVar("BoolAnswer", bound=bool | None)
ContainerLoadAnswer = TypeVar("ContainerLoadAnswer", bound=ContainerLoad | None)
GoalWayAnswer = TypeVar("GoalWayAnswer", bound=GoalWay | None)
BaseNoticeAnswer = TypeVar("BaseNoticeAnswer", bound=BaseNotice | None)
IntAnswer = TypeVar("IntAnswer", bound=int | None)
CourseAnswer = TypeVar("CourseAnswer", bound=Course | None)
SkillName = Never

MODEL = ContextModel(
    name="store",
    variables=(*store.VARIABLES,),
    observers=(*store.OBSERVERS,),
    skills=(*store.SKILLS,),
    resources=(),
)


class Store(ContextManager[VariableName, SkillName]):
    """The context manager of 'store', with the types of its values."""

    if TYPE_CHECKING:
        knowledge: StoreKnowledge

        @overload  # type: ignore[override]  # takes fewer names, on purpose
        def agent(self, name: Literal["localisation"]) -> Agent[VariableName, LocalisationHandle]: ...

        @overload
        def agent(self, name: Literal["camera_agent"]) -> Agent[VariableName, CameraAgentHandle]: ...

        @overload
        def agent(self, name: Literal["lasers"]) -> Agent[VariableName, LasersHandle]: ...

        @overload
        def agent(self, name: Literal["person_detection"]) -> Agent[VariableName, PersonDetectionHandle]: ...

        @overload
        def agent(self, name: Literal["container_detection"]) -> Agent[VariableName, ContainerDetectionHandle]: ...

        @overload
        def agent(self, name: Literal["wheel_check"]) -> Agent[VariableName, WheelCheckHandle]: ...

        @overload
        def agent(self, name: Literal["navigation"]) -> Agent[VariableName, NavigationHandle]: ...

        @overload
        def agent(self, name: Literal["turning"]) -> Agent[VariableName, TurningHandle]: ...

        @overload
        def agent(self, name: Literal["fork"]) -> Agent[VariableName, ForkHandle]: ...

        @overload
        def agent(self, name: Literal["picker_page"]) -> Agent[VariableName, PickerPageHandle]: ...

        @overload
        def agent(self, name: Literal["mission"]) -> Agent[VariableName, MissionHandle]: ...

        @overload
        def agent(self, name: Literal["picking"]) -> Agent[VariableName, PickingHandle]: ...

        @overload
        def agent(self, name: Literal["adaptation"]) -> Agent[VariableName, AdaptationHandle]: ...

        @overload
        def agent(self, name: Literal["analysis"]) -> Agent[VariableName, AnalysisHandle]: ...

        def agent(self, name: Any) -> Any:
            """Return the handle with which an agent writes."""

        @overload
        def get(self, name: FloatName) -> Reading[float]: ...

        @overload
        def get(self, name: BoolName) -> Reading[bool]: ...

        @overload
        def get(self, name: ContainerLoadName) -> Reading[ContainerLoad]: ...

        @overload
        def get(self, name: GoalWayName) -> Reading[GoalWay]: ...

        @overload
        def get(self, name: BaseNoticeName) -> Reading[BaseNotice]: ...

        @overload
        def get(self, name: IntName) -> Reading[int]: ...

        @overload
        def get(self, name: CourseName) -> Reading[Course]: ...

        @overload
        def get(self, name: VariableName) -> Reading[Any]: ...

        def get(self, name: VariableName) -> Reading[Any]:
            """Return the current reading of a variable."""

        @overload
        def set(self, name: FloatName, value: float, *, evidence_s: float | None = ...) -> None: ...

        @overload
        def set(self, name: BoolName, value: bool, *, evidence_s: float | None = ...) -> None: ...

        @overload
        def set(self, name: ContainerLoadName, value: ContainerLoad, *, evidence_s: float | None = ...) -> None: ...

        @overload
        def set(self, name: GoalWayName, value: GoalWay, *, evidence_s: float | None = ...) -> None: ...

        @overload
        def set(self, name: BaseNoticeName, value: BaseNotice, *, evidence_s: float | None = ...) -> None: ...

        @overload
        def set(self, name: IntName, value: int, *, evidence_s: float | None = ...) -> None: ...

        @overload
        def set(self, name: CourseName, value: Course, *, evidence_s: float | None = ...) -> None: ...

        @overload
        def set(self, name: VariableName, value: Never, *, evidence_s: float | None = ...) -> None: ...

        def set(self, name: VariableName, value: Any, *, evidence_s: float | None = None) -> None:
            """Write a variable as the main execution."""

        @overload
        def declare(self, name: FloatName, value: float | None = None) -> None: ...

        @overload
        def declare(self, name: BoolName, value: bool | None = None) -> None: ...

        @overload
        def declare(self, name: ContainerLoadName, value: ContainerLoad | None = None) -> None: ...

        @overload
        def declare(self, name: GoalWayName, value: GoalWay | None = None) -> None: ...

        @overload
        def declare(self, name: BaseNoticeName, value: BaseNotice | None = None) -> None: ...

        @overload
        def declare(self, name: IntName, value: int | None = None) -> None: ...

        @overload
        def declare(self, name: CourseName, value: Course | None = None) -> None: ...

        @overload
        def declare(self, name: VariableName, value: None = None) -> None: ...

        def declare(self, name: VariableName, value: Any = None) -> None:
            """Add a variable to the needs of the main execution, with a value if it knows one."""

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
            name: ContainerLoadName,
            otherwise: Callable[[], ContainerLoadAnswer],
            *,
            max_age_s: float = ...,
            since_s: float = ...,
            wait_up_to_s: float = ...,
            shadow: bool = ...,
        ) -> ContainerLoad | ContainerLoadAnswer: ...

        @overload
        def decide(
            self,
            name: GoalWayName,
            otherwise: Callable[[], GoalWayAnswer],
            *,
            max_age_s: float = ...,
            since_s: float = ...,
            wait_up_to_s: float = ...,
            shadow: bool = ...,
        ) -> GoalWay | GoalWayAnswer: ...

        @overload
        def decide(
            self,
            name: BaseNoticeName,
            otherwise: Callable[[], BaseNoticeAnswer],
            *,
            max_age_s: float = ...,
            since_s: float = ...,
            wait_up_to_s: float = ...,
            shadow: bool = ...,
        ) -> BaseNotice | BaseNoticeAnswer: ...

        @overload
        def decide(
            self,
            name: IntName,
            otherwise: Callable[[], IntAnswer],
            *,
            max_age_s: float = ...,
            since_s: float = ...,
            wait_up_to_s: float = ...,
            shadow: bool = ...,
        ) -> int | IntAnswer: ...

        @overload
        def decide(
            self,
            name: CourseName,
            otherwise: Callable[[], CourseAnswer],
            *,
            max_age_s: float = ...,
            since_s: float = ...,
            wait_up_to_s: float = ...,
            shadow: bool = ...,
        ) -> Course | CourseAnswer: ...

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
) -> Store:
    """Return the context manager; nothing is observed before it is declared or expected."""
    return Store(MODEL, clock=clock, resources=resources, seed=seed, record=record, knowledge=KNOWLEDGE)


def loops(codra: Store, *, clock: Clock, robot: Leaves | Mapping[str, Leaves] | None = None) -> Mape:
    """Return the loops, which run within a `with` block; `robot` gives each leaf of the trees its action."""
    return Mape(codra, MAPE, clock=clock, robot=robot)
