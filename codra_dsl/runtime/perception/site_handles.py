"""Handles that are made by a class or function with literals, for example those that a site states."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Container, Iterable, Mapping
from typing import Any

from codra_dsl.isolation.error_text import described
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.perception.functions import CallError
from codra_dsl.runtime.values.model import ResourceModel


def with_site_handles(
    resources: Iterable[ResourceModel], handles: Mapping[str, object], clock: Clock
) -> Mapping[str, object]:
    """Return the handles of a program and, for the other resources, the handles that the site states.

    Raises:
        CallError: if a class or function of the site cannot be imported, or raises an exception.
    """
    site_handles: dict[str, object] = {}
    for resource in resources:
        handle = resource.handle
        if handle is None or resource.name in handles:
            continue
        try:
            site_handles[resource.name] = make_handle(handle.call, handle.parameters, clock)
        except Exception as error:
            message = f"the site makes the handle {resource.name!r} with {handle.call!r}: {described(error)}"
            raise CallError(message) from error
    return {**site_handles, **handles} if site_handles else handles


def make_handle(call: str, parameters: Mapping[str, object], clock: Clock) -> object:
    """Return a new handle. A class or function with a parameter `clock` gets the clock.

    Args:
        call: `module:name` of the class or function.
        parameters: its arguments.
        clock: the clock of the context manager.

    Raises:
        Exception: any exception of the import or of the call.
    """
    module, _, path = call.partition(":")
    factory: Any = importlib.import_module(module)
    for name in path.split("."):
        factory = getattr(factory, name)
    takes_clock = "clock" not in parameters and "clock" in _parameter_names(factory)
    handle: object = factory(**parameters, **({"clock": clock} if takes_clock else {}))
    return handle


def _parameter_names(factory: Callable[..., object]) -> Container[str]:
    """Return the names of the parameters of a function; none for a built-in function without a signature."""
    try:
        return inspect.signature(factory).parameters
    except ValueError:
        return ()
