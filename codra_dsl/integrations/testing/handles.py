"""Handles of resources: made for each story, and changed during the story."""

from __future__ import annotations

from collections.abc import Mapping, MutableMapping

from codra_dsl.integrations.testing.timeline import Alteration
from codra_dsl.isolation.error_text import described
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.model import Handle
from codra_dsl.runtime import CallError, Clock
from codra_dsl.runtime.perception.site_handles import make_handle

_PLAIN_TYPES = (bool, int, float, str, type(None))


def make_stated_handle(handle: Handle, clock: Clock) -> object:
    """Make a handle as a timeline states.

    Raises:
        CallError: if the class or function cannot be imported, or raises an exception, e.g. for a wrong argument.
    """
    try:
        return make_handle(handle.call, dict(handle.arguments), clock)
    except Exception as error:
        raise CallError(f"{_place_text(handle.place)}: {handle.call!r}: {described(error)}") from error


def alter(handle: object, change: Alteration) -> None:
    """Set attributes of a handle.

    Raises:
        CallError: if there is no handle, or the handle has no such attribute.
    """
    if handle is None:
        message = f"there is no handle {change.resource!r}: add it under the key `resources` of the file"
        raise CallError(f"{_place_text(change.place)}: {message}")
    _set_attributes(handle, change.attributes, f"{_place_text(change.place)}: {change.resource}")


def _set_attributes(target: object, attributes: Mapping[str, object], path: str) -> None:
    for name, value in attributes.items():
        is_mapping = isinstance(target, MutableMapping)
        if not is_mapping and not hasattr(target, name):
            raise CallError(f"{path} has no attribute {name!r}")
        inner_value = target.get(name) if isinstance(target, MutableMapping) else getattr(target, name)
        if isinstance(value, Mapping) and not isinstance(inner_value, _PLAIN_TYPES):
            _set_attributes(inner_value, value, f"{path}.{name}")
        elif isinstance(target, MutableMapping):
            target[name] = value
        else:
            setattr(target, name, value)


def _place_text(place: Place) -> str:
    return f"{place.span.file}:{place.span.line}"
