"""What a spec's `call` names: a function, or a class with `perceive` and, if it likes, `setup` and `close`."""

from __future__ import annotations

import importlib
import inspect
from collections.abc import Callable, Mapping
from typing import Any

from codra_dsl.isolation.messages import described


class AbsentError(LookupError):
    """A `call` names nothing that can perceive."""


def found(call: str) -> Callable[..., Any]:
    """Return the function or class that a `call` names.

    Raises:
        AbsentError: if there is none.
    """
    module, _, path = call.partition(":")
    try:
        thing: Any = importlib.import_module(module)
        for name in path.split("."):
            thing = getattr(thing, name)
    except Exception as error:
        raise AbsentError(f": {described(error)}") from error
    if isinstance(thing, type):
        if not callable(getattr(thing, "perceive", None)):
            raise AbsentError(", a class without a method 'perceive'")
        return thing
    if not callable(thing):
        raise AbsentError(", which is no function")
    function: Callable[..., Any] = thing
    return function


class Perceiver:
    """A function, or an object of a class that is made once: when its first job begins, and set up then."""

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
        """Return whether there is something to close."""
        return self._made is not None

    def setup(self, given: Mapping[str, object]) -> None:
        """Make the object, and give `setup` what it names of `with` and of the handles."""
        if self._class is None or self._function is not None:
            return
        made = self._class()
        begin = getattr(made, "setup", None)
        if begin is not None:
            begin(**_named(begin, given))
        self._made, self._function = made, made.perceive

    def perceive(self, **arguments: object) -> object:
        """Do one job."""
        if self._function is None:
            raise RuntimeError("it is not set up")
        return self._function(**arguments)

    def close(self) -> None:
        """End it, if it was set up."""
        made, self._made = self._made, None
        if self._class is not None:
            self._function = None
        end = getattr(made, "close", None)
        if end is not None:
            end()


def _named(function: Callable[..., object], given: Mapping[str, object]) -> dict[str, object]:
    """Return those arguments that a function names, all if it takes any."""
    parameters = inspect.signature(function).parameters.values()
    if any(each.kind is each.VAR_KEYWORD for each in parameters):
        return dict(given)
    names = {each.name for each in parameters if each.kind is not each.POSITIONAL_ONLY}
    return {name: value for name, value in given.items() if name in names}
