"""Handles that a site states are made at the start, unless the program passes its own."""

from __future__ import annotations

from types import SimpleNamespace

import pytest

from codra_dsl.runtime import CallError, SimClock
from codra_dsl.runtime.perception.site_handles import with_site_handles
from codra_dsl.runtime.values.model import HandleModel, ResourceModel

CAMERA = ResourceModel(name="camera", handle=HandleModel(call="types:SimpleNamespace", parameters={"height": 1.2}))
RESOURCES = (CAMERA, ResourceModel(name="laser"), ResourceModel(name="arm", slots=2))


class Timer:
    """A handle that needs the clock."""

    def __init__(self, clock: SimClock, period_s: float) -> None:
        self.clock, self.period_s = clock, period_s


def test_the_handle_of_the_site_is_used_where_the_program_passes_none() -> None:
    handles = with_site_handles(RESOURCES, {"laser": 7}, SimClock())

    assert handles == {"laser": 7, "camera": SimpleNamespace(height=1.2)}


def test_the_handle_of_the_program_wins_and_the_other_one_is_not_made() -> None:
    resource = ResourceModel(name="camera", handle=HandleModel(call="no_such_module:Camera"))

    assert with_site_handles((resource,), {"camera": None}, SimClock()) == {"camera": None}


def test_a_class_with_a_parameter_clock_gets_the_clock() -> None:
    clock = SimClock()
    resource = ResourceModel(name="timer", handle=HandleModel(call=f"{__name__}:Timer", parameters={"period_s": 2.0}))
    timer = with_site_handles((resource,), {}, clock)["timer"]

    assert isinstance(timer, Timer)
    assert (timer.clock, timer.period_s) == (clock, 2.0)


@pytest.mark.parametrize("call", ["no_such_module:Camera", "types:Camera", "types:ModuleType"])
def test_a_handle_that_cannot_be_made_names_the_resource_and_the_call(call: str) -> None:
    resource = ResourceModel(name="camera", handle=HandleModel(call=call, parameters={"height": 1.2}))

    with pytest.raises(CallError, match=f"the site makes the handle 'camera' with '{call}'"):
        with_site_handles((resource,), {}, SimClock())
