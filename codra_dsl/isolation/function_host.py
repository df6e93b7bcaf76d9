"""Run the target of a spec's `call`: a function, or a class with `perceive` and, optionally, `setup` and `close`."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Mapping
from typing import Any

from codra_dsl.isolation.error_text import described


class AbsentError(LookupError):
    """A `call` does not name a function or class that can perceive."""


def resolve_call(call: str) -> Callable[..., Any]:
    """Return the function or class that a `call` names.

    Raises:
        AbsentError: if the `call` names neither.
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
    """A function, or an object of a class. The object is created and set up once, when its first job begins."""

    def __init__(self, call: Callable[..., Any]) -> None:
        self._class = call if isinstance(call, type) else None
        self._instance: Any = None
        self._function: Callable[..., Any] | None = None if isinstance(call, type) else call

    @property
    def is_ready(self) -> bool:
        """Return whether a job can begin."""
        return self._function is not None

    @property
    def is_open(self) -> bool:
        """Return whether there is an object to close."""
        return self._instance is not None

    def setup(self, arguments: Mapping[str, object]) -> None:
        """Create the object, and call its `setup` with the values of `with` and the handles that `setup` declares."""
        if self._class is None or self._function is not None:
            return
        instance = self._class()
        setup_method = getattr(instance, "setup", None)
        if setup_method is not None:
            setup_method(**_declared_arguments(setup_method, arguments))
        self._instance, self._function = instance, instance.perceive

    def perceive(self, **arguments: object) -> object:
        """Execute one job."""
        if self._function is None:
            raise RuntimeError("the object is not set up")
        return self._function(**arguments)

    def close(self) -> None:
        """Close the object, if it was set up."""
        instance, self._instance = self._instance, None
        if self._class is not None:
            self._function = None
        close_method = getattr(instance, "close", None)
        if close_method is not None:
            close_method()


def _declared_arguments(function: Callable[..., object], arguments: Mapping[str, object]) -> dict[str, object]:
    """Return the arguments that a function declares as parameters; all arguments if it accepts `**kwargs`."""
    parameters = inspect.signature(function).parameters.values()
    if any(parameter.kind is parameter.VAR_KEYWORD for parameter in parameters):
        return dict(arguments)
    parameter_names = {parameter.name for parameter in parameters if parameter.kind is not parameter.POSITIONAL_ONLY}
    return {name: value for name, value in arguments.items() if name in parameter_names}
