"""A separate process can use only the methods and values of a handle."""

from __future__ import annotations

import os
import subprocess
import threading
from collections.abc import Callable
from functools import cached_property, partialmethod
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from codra_dsl.runtime import CallError, Reason, SimClock, WallClock
from codra_dsl.runtime.perception.handles import has_method, method_of, value_of
from tests.runtime.perception.isolated import (
    Camera,
    await_no_process,
    eye,
    looking,
    processes_of,
    started,
    values,
    wait,
)


def test_a_process_asks_a_handle_that_stays_in_the_program(clock: WallClock) -> None:
    camera = Camera()
    algorithm = eye("asks", handles=("camera", "gain"))
    with started(looking(algorithm), clock, {"camera": camera, "gain": 5}) as manager:
        wait(clock, lambda: manager.get("a").reason is not Reason.NEVER_OBSERVED)
        assert manager.get("a").value is True
        assert values(manager)[0]["number"] == 5
        camera.edges = 7
        wait(clock, lambda: values(manager)[-1]["number"] == 9)
    assert camera.noted == [], "a process gets a copy of a handle's attribute"


class Broken:
    """A handle whose method returns or raises what a function returns or raises."""

    def __init__(self, function: Callable[[], object]) -> None:
        self._function = function

    def frame(self, *_: object, **__: object) -> object:
        return self._function()


HANDLES: dict[str, tuple[Any, str]] = {
    "no attribute": (
        SimpleNamespace(edges=1),
        "AttributeError: 'types.SimpleNamespace' object has no attribute 'frame'",
    ),
    "raises": (Broken(lambda: 1 / 0), "ZeroDivisionError: division by zero"),
    "no copy": (
        Broken(threading.Lock),
        "TypeError: the content of the handle: cannot be copied to another process: TypeError: cannot pickle"
        " '_thread.lock' object",
    ),
    "too large": (
        Broken(lambda: bytes(70_000_000)),
        "ValueError: the content of the handle: 70000037 bytes are more than the 67108864 that a process can receive",
    ),
}


@pytest.mark.parametrize("what", HANDLES)
def test_an_error_of_a_handle_fails_the_job_and_the_process_stays(what: str) -> None:
    handle, message = HANDLES[what]
    clock = SimClock()
    with started(looking(eye("asks", handles=("camera", "gain"))), clock, {"camera": handle, "gain": 1}) as manager:
        clock.sleep(2.5)
        assert manager.get("a").detail == message
        assert len(processes_of(os.getpid())) == 3, "the process, its supervisor and its guard"


class Rig(Camera):
    """A handle with public attributes that lead to other objects of the program."""

    shell = os.system
    Lens = Camera

    def __init__(self) -> None:
        super().__init__()
        self.os = os
        self.lens = Camera()
        self.run = subprocess.getoutput
        self.frame = os.system  # type: ignore[assignment, method-assign]
        self.kind = subprocess.Popen

    @property
    def module(self) -> object:
        return os


KINDS = {
    "os": "module",
    "module": "module",
    "lens": "Camera",
    "Lens": "type",
    "kind": "type",
    "shell": "builtin_function_or_method",
    "frame": "builtin_function_or_method",
    "run": "function",
}
"""The type of each attribute of a rig that is neither a method nor a value."""


@pytest.mark.parametrize("way", ["by the handle", "by forged messages"])
def test_a_process_reaches_only_methods_and_values_of_a_handle(way: str, capfd: pytest.CaptureFixture[str]) -> None:
    function = "asks_for_more" if way == "by the handle" else "forges_calls"
    clock, parameters = SimClock(), {"names": " ".join(KINDS)}
    algorithm = eye(function, parameters=parameters, handles=("camera",))
    with started(looking(algorithm), clock, {"camera": Rig()}) as manager:
        clock.sleep(0.5)
        assert values(manager)[0]["text"].split("\n") == [
            f"a process cannot use {name!r} of handle 'camera': "
            f"a {kind} is neither a method of its class nor a value that can be copied"
            for name, kind in KINDS.items()
        ]
    assert "reached" not in capfd.readouterr().err


@pytest.mark.parametrize(
    ("name", "result"), [("grown", 3), ("doubled", 4), ("named", "Lab"), ("brightness", None), ("pose", None)]
)
def test_every_kind_of_method_and_value_of_a_handle_can_be_used(name: str, result: object) -> None:
    class Lab:
        brightness = 5

        @staticmethod
        def doubled(number: int) -> int:
            return 2 * number

        @classmethod
        def named(cls, _: int) -> str:
            return cls.__name__

        def grown_by(self, amount: int, number: int) -> int:
            return number + amount

        grown = partialmethod(grown_by, 1)

        @cached_property
        def pose(self) -> np.ndarray:
            return np.eye(4)

    handle = Lab()
    assert has_method(handle, name) == (result is not None)
    if result is None:
        assert value_of("lab", handle, name) is getattr(handle, name)
    else:
        assert method_of("lab", handle, name)(2) == result


def test_a_process_cannot_reach_private_attributes_of_a_handle() -> None:
    clock = SimClock()
    with started(looking(eye("asks_for_what_is_hidden", handles=("camera",))), clock, {"camera": Camera()}) as manager:
        clock.sleep(0.0)
        assert manager.get("a").detail == "its process asked for a private attribute of a handle"


REFUSED: dict[str, tuple[object, str]] = {
    "class": (Camera, "it is a type: give an object with methods, or let `call` name a class with `setup`"),
    "module": (np, "it is a module: give an object with methods, or let `call` name a class with `setup`"),
    "generator": ((number for number in ()), "it is a generator: give an object with methods, or"),
    "list": ([Camera()], "it is a list whose content cannot be copied: give an object with a method instead"),
    "nothing": (object(), "it is a object without methods: give an object with a method"),
}


@pytest.mark.parametrize("what", REFUSED)
def test_a_handle_that_a_process_cannot_use_is_refused_before_anything_runs(what: str) -> None:
    handle, message = REFUSED[what]
    with pytest.raises(
        CallError, match="perception 'eye' runs in a separate process, which cannot use handle 'camera'"
    ) as error_info:
        started(looking(eye("asks", handles=("camera",))), SimClock(), {"camera": handle}).__enter__()
    assert message in str(error_info.value)
    await_no_process()
