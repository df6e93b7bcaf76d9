"""The target of a spec's `call`: a function, or a class with `perceive` and, optionally, `setup` and `close`."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Mapping
from typing import Any

from codra_dsl.isolation.messages import described


class AbsentError(LookupError):
    """A `call` does not name a function or class that can perceive."""


def resolved(call: str) -> Callable[..., Any]:
    """Return the function or class that a `call` names.

    Raises:
        AbsentError: if it names neither.
    """
    module, _, path = call.partition(":")
    try:
        target: Any = importlib.import_module(module)
        for name in path.split("."):
            target = getattr(target, name)
    except Exception as error:
        raise AbsentError(f": {described(error)}") from error
    if isinstance(target, type):
        if not callable(getattr(target, "perceive", None)):
            raise AbsentError(", a class without a method 'perceive'")
        return target
    if not callable(target):
        raise AbsentError(", which is not a function")
    function: Callable[..., Any] = target
    return function


class FunctionHost:
    """A function, or the object of a class, which is created and set up once, when its first job begins."""

    def __init__(self, call: Callable[..., Any]) -> None:
        self._class = call if isinstance(call, type) else None
        self._made: Any = None
        self._function: Callable[..., Any] | None = None if isinstance(call, type) else call

    @property
    def is_ready(self) -> bool:
        """Return whether a job can begin."""
        return self._function is not None

    @property
    def is_open(self) -> bool:
        """Return whether there is an object to close."""
        return self._made is not None

    def setup(self, given: Mapping[str, object]) -> None:
        """Create the object, and call its `setup` with those values of `with` and handles that it declares."""
        if self._class is None or self._function is not None:
            return
        made = self._class()
        begin = getattr(made, "setup", None)
        if begin is not None:
            begin(**_named(begin, given))
        self._made, self._function = made, made.perceive

    def perceive(self, **arguments: object) -> object:
        """Execute one job."""
        if self._function is None:
            raise RuntimeError("it is not set up")
        return self._function(**arguments)

    def close(self) -> None:
        """Close the object, if it was set up."""
        made, self._made = self._made, None
        if self._class is not None:
            self._function = None
        end = getattr(made, "close", None)
        if end is not None:
            end()


def _named(function: Callable[..., object], given: Mapping[str, object]) -> dict[str, object]:
    """Return the arguments that a function declares, or all if it takes `**kwargs`."""
    parameters = inspect.signature(function).parameters.values()
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters):
        return dict(given)
    names = {parameter.name for parameter in parameters if parameter.kind is not parameter.POSITIONAL_ONLY}
    return {name: value for name, value in given.items() if name in names}
