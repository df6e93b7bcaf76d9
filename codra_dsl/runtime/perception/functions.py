"""The functions that `call` of a spec refers to, and the errors that can occur before they run."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

from codra_dsl.isolation.function_host import AbsentError, resolve_call
from codra_dsl.runtime.errors import unknown_name_error
from codra_dsl.runtime.perception.job import RunningJob
from codra_dsl.runtime.values.model import Algorithm, ResourceModel

Function = Callable[..., object]
"""A perception function: it takes keyword arguments and returns a mapping that matches `returns` of the spec.

It can also be a class. Its objects have such a function as method `perceive`, and optionally `setup` and `close`.
"""


class CallError(LookupError):
    """There is no function for `call` of a spec, or a resource has no handle: the robot's program is incomplete."""


class JobError(Exception):
    """A job failed; the error's text is the complete message."""


class Executor(Protocol):
    """Executes the jobs of one algorithm, one at a time."""

    def perform(self, job: RunningJob, arguments: Mapping[str, object], handles: Mapping[str, object]) -> object:
        """Return the function's return value, unchecked.

        Args:
            job: the job.
            arguments: the function's other arguments: literals, and values of context-variables.
            handles: the handles of the resources that the function reads.

        Raises:
            BaseException: any exception that the function raises, or `JobError`.
        """
        ...

    def kill_job(self) -> None:
        """End the running job, if that is possible: it was cancelled, and its time is over. This method never waits."""
        ...

    def await_ready(self) -> None:
        """Wait until it is known that the function exists.

        Raises:
            CallError: if the function does not exist.
        """
        ...

    def begin_close(self) -> None:
        """Begin to end the process, or to close the object of a class. This method never waits."""
        ...

    def close(self) -> None:
        """Wait a short time for the end of the process or of the object's `close`, after `begin_close`."""
        ...


def imported(algorithm: Algorithm) -> Function:
    """Return the function or class to which `call` of an algorithm refers.

    Raises:
        CallError: if there is no such function or class.
    """
    try:
        return resolve_call(algorithm.call)
    except AbsentError as error:
        raise call_error(algorithm, error) from error.__cause__


def call_error(algorithm: Algorithm, problem: object) -> CallError:
    """Return the error for a `call` without a usable function or class; `problem` begins with a comma or colon."""
    return CallError(f"perception {algorithm.name!r} calls {algorithm.call!r}{problem}")


def check_handles(resources: Iterable[ResourceModel], handles: Iterable[str]) -> None:
    """Raise an error for a handle that no algorithm can read: its name is misspelt, or its resource has slots instead.

    Raises:
        CallError: if a resource is unknown or has slots.
    """
    slot_counts = {resource.name: resource.slots for resource in resources}
    for name in handles:
        if name not in slot_counts:
            raise CallError(str(unknown_name_error("resource", name, slot_counts)))
        if slot_counts[name] is not None:
            raise CallError(f"resource {name!r} has slots, so it needs no handle: leave it out of `resources`")
