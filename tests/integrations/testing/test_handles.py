"""The handles that timelines make."""

from __future__ import annotations

import pytest

from codra_dsl.integrations.testing.handles import make_stated_handle
from codra_dsl.language.diagnostics import Place, Span
from codra_dsl.language.model import Handle
from codra_dsl.runtime import CallError, SimClock
from tests.runtime.hostile_errors import HOSTILE_ERRORS, hostile_error


def raising(kind: str) -> object:
    raise hostile_error(kind)


@pytest.mark.parametrize("kind", HOSTILE_ERRORS)
def test_a_maker_that_raises_a_hostile_exception_is_reported_with_its_place(kind: str) -> None:
    place = Place(Span("door.timeline.yaml", 3, 5, 3, 9))
    handle = Handle(resource="door", call=f"{__name__}:raising", arguments=(("kind", kind),), place=place)
    with pytest.raises(CallError) as error_info:
        make_stated_handle(handle, SimClock())
    assert str(error_info.value) == f"door.timeline.yaml:3: {handle.call!r}: {HOSTILE_ERRORS[kind]}"
