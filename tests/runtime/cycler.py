"""A skill whose preview has five conditions, which the main execution or observers may decide (P1, Figure 1)."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager

from codra_dsl.logic import Value
from codra_dsl.runtime import ContextManager, ContextModel, EventLog, SimClock
from codra_dsl.runtime.values.conditions import value
from codra_dsl.runtime.values.model import PreviewCondition, SkillModel, VariableModel, boolean, member, real
from tests.runtime.door import MODEL as DOOR

Manager = ContextManager[str, str]

OPEN_CYCLER = SkillModel(
    name="open_cycler",
    preview=("locked", "battery", "rotor_in_pos_1", "level", "gap", "tube"),
    preview_conditions=(
        PreviewCondition(text="locked == false", condition=~value("locked")),
        PreviewCondition(text="battery > 20 percent", condition=value("battery") > 20.0),
        PreviewCondition(text="rotor_in_pos_1 == true", condition=value("rotor_in_pos_1")),
        PreviewCondition(
            text='level == "high" or gap < 3 cm', condition=(value("level") == "high") | (value("gap") < 0.03)
        ),
    ),
)
MODEL = ContextModel(
    name="cycler",
    variables=tuple(
        VariableModel(name=name, type=type_, sources=("main_execution",), valid_for_s=60.0)
        for name, type_ in {
            "locked": boolean(),
            "battery": real(0.0, 100.0, unit="percent"),
            "rotor_in_pos_1": boolean(),
            "level": member("low", "high"),
            "gap": real(unit="m"),
            "tube": boolean(),
        }.items()
    ),
    observers=(),
    skills=(OPEN_CYCLER,),
    resources=(),
)
HOLDS: Mapping[str, Value] = {
    "locked": False,
    "battery": 80.0,
    "rotor_in_pos_1": True,
    "level": "low",
    "gap": 0.01,
    "tube": False,
}
"""Values for which the preview holds."""

OBSERVED = ContextModel(
    name="door",
    variables=DOOR.variables,
    observers=DOOR.observers,
    skills=(
        SkillModel(
            name="pass_door",
            preview=("open", "near"),
            preview_conditions=(PreviewCondition(text="open == true", condition=value("open")),),
            changes=("open",),
        ),
    ),
    resources=DOOR.resources,
)
"""A door that observers see, and a skill whose preview needs it to be open."""


@contextmanager
def cycler(
    values: Mapping[str, Value | None] = HOLDS, record: EventLog | None = None
) -> Iterator[tuple[Manager, SimClock]]:
    """Start a cycler with some values at the instant 0; variables without a value are unknown."""
    clock = SimClock()
    with Manager(MODEL, clock=clock, resources={}, record=record) as manager:
        for name, known_value in values.items():
            if known_value is not None:
                manager.set(name, known_value)
        yield manager, clock
