"""What a spec's `call` names, and what may go wrong about it before anything runs."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from typing import Protocol

from codra_dsl.isolation.perceiver import AbsentError, found
from codra_dsl.runtime.model import Algorithm, ContextModel
from codra_dsl.runtime.names import unknown
from codra_dsl.runtime.perception.job import RunningJob

Function = Callable[..., object]
"""A perception function: called with keyword arguments, it returns a mapping as the spec's `returns` says.

Or a class whose objects have `perceive`, which is such a function, and, if they like, `setup` and `close`.
"""


class CallError(LookupError):
    """A spec's `call` names no function, or a resource has no handle: a mistake in how the robot is put together."""


class ToldError(Exception):
    """A job failed, and this is the whole message."""


class Performer(Protocol):
    """Does the jobs of one algorithm, one at a time."""

    def perform(self, job: RunningJob, given: Mapping[str, object], handles: Mapping[str, object]) -> object:
        """Return what the function returns, whatever that is.

        Args:
            job: the job.
            given: what the function gets besides: literals, and values of context-variables.
            handles: of the resources that it reads.

        Raises:
            BaseException: whatever the function raises, or `ToldError`.
        """
        ...

    def give_up(self) -> None:
        """End the job that is under way, if there is a way to; it was cancelled, and its time is over. Never waits."""
        ...

    def await_ready(self) -> None:
        """Wait until it is known that there is a function.

        Raises:
            CallError: if there is none.
        """
        ...

    def hang_up(self) -> None:
        """Let everything end; never waits."""
        ...

    def close(self) -> None:
        """Wait for the end, for a moment at most."""
        ...


def imported(algorithm: Algorithm) -> Function:
    """Return the function, or class, that an algorithm's `call` names.

    Raises:
        CallError: if there is none.
    """
    try:
        return found(algorithm.call)
    except AbsentError as error:
        raise absent(algorithm, error) from error.__cause__


def absent(algorithm: Algorithm, why: object) -> CallError:
    """Return the error about a `call` that names nothing that perceives; `why` begins with a comma or colon."""
    return CallError(f"perception {algorithm.name!r} calls {algorithm.call!r}{why}")


def check_handles(model: ContextModel, handles: Iterable[str]) -> None:
    """Refuse a handle that nothing reads: its name is misspelt, or its resource has slots instead."""
    slots = {resource.name: resource.slots for resource in model.resources}
    for name in handles:
        if name not in slots:
            raise CallError(str(unknown("resource", name, slots)))
        if slots[name] is not None:
            raise CallError(f"resource {name!r} has slots and takes no handle: leave it out of `resources`")
