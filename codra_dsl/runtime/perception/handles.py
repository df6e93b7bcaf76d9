"""Handles of resources, as a function in a separate process can use them: copies, methods and values.

A process can call the public methods of a handle's class, and gets copies of the handle's public values. It cannot
reach other objects through a handle: from a module or a class, a process could reach every function of the program.
"""

from __future__ import annotations

import inspect
import pickle
from collections.abc import Callable, Mapping
from enum import Enum
from functools import partialmethod, singledispatchmethod
from pathlib import PurePath
from types import GeneratorType, ModuleType
from typing import Any

from codra_dsl.runtime.perception.functions import CallError
from codra_dsl.runtime.values.model import Algorithm

_COPIED_TYPES = (type(None), bool, int, float, complex, str, bytes, bytearray, list, tuple, dict, set, frozenset)
_METHOD_WRAPPERS = (staticmethod, classmethod, partialmethod, singledispatchmethod)


def check_handles(algorithm: Algorithm, handles: Mapping[str, object]) -> None:
    """Raise an error for a handle that can neither be copied to a process nor be called from there.

    Raises:
        CallError: if there is such a handle.
    """
    for name in algorithm.handles:
        handle = handles[name]
        if is_copied(handle) and not _can_be_copied(handle):
            problem = (
                f"is a {type(handle).__name__} whose content cannot be copied: give an object with a method instead"
            )
        elif isinstance(handle, (type, ModuleType, GeneratorType)):
            problem = (
                f"is a {type(handle).__name__}: give an object with methods, or let `call` name a class with `setup`"
            )
        elif not is_copied(handle) and not callable(handle) and all(member.startswith("_") for member in dir(handle)):
            problem = f"is a {type(handle).__name__} without methods: give an object with a method"
        else:
            continue
        process_text = f"perception {algorithm.name!r} runs in a separate process"
        raise CallError(f"{process_text}, which cannot use handle {name!r}: it {problem}")


def is_copied(handle: object) -> bool:
    """Return whether a process gets a copy of a handle, because the handle is a plain value."""
    is_array = type(handle).__module__.partition(".")[0] == "numpy"
    return is_array or type(handle) in _COPIED_TYPES or isinstance(handle, (Enum, PurePath))


def has_method(handle: object, name: str) -> bool:
    """Return whether the class of a handle has a method of this name, and the handle has not replaced this method."""
    member = next((vars(cls)[name] for cls in type(handle).__mro__ if name in vars(cls)), None)
    is_descriptor = hasattr(type(member), "__get__") and (callable(member) or isinstance(member, _METHOD_WRAPPERS))
    return is_descriptor and inspect.getattr_static(handle, name) is member


def method_of(handle_name: str, handle: object, name: str | None) -> Callable[..., object]:
    """Return a method of a handle, or the handle itself if `name` is None.

    Raises:
        AttributeError: if the class of the handle has no method of this name.
        TypeError: if `name` is None and the handle cannot be called.
    """
    if name is not None and not has_method(handle, name):
        raise _refusal(handle_name, name, getattr(handle, name))
    method: object = handle if name is None else getattr(handle, name)
    if not callable(method):
        raise TypeError(f"handle {handle_name!r} is a {type(handle).__name__}, which cannot be called")
    return method


def value_of(handle_name: str, handle: object, name: str) -> object:
    """Return the value of an attribute of a handle, which can be copied to a process.

    Raises:
        AttributeError: if the handle has no such attribute, or the attribute is not a plain value.
    """
    value: Any = getattr(handle, name)
    is_code = isinstance(value, (type, ModuleType)) or inspect.isroutine(value)
    if is_code or not (is_copied(value) or _can_be_copied(value)):
        raise _refusal(handle_name, name, value)
    return value


def _refusal(handle_name: str, name: str, value: object) -> AttributeError:
    reason = f"a {type(value).__name__} is neither a method of its class nor a value that can be copied"
    return AttributeError(f"a process cannot use {name!r} of handle {handle_name!r}: {reason}")


def _can_be_copied(value: object) -> bool:
    try:
        pickle.dumps(value, protocol=5)
    except Exception:  # noqa: BLE001 - for any reason
        return False
    return True
