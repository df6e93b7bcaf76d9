"""Slots for the main execution, which gets them before every observer, but waits for the jobs that hold them."""

from __future__ import annotations

import math
import threading
from collections.abc import Iterator
from contextlib import contextmanager

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.context.commands import Commands
from codra_dsl.runtime.errors import UnknownNameError, unknown_name_error
from codra_dsl.runtime.perception.slots import Slots


class MainExecutionSlots:
    """The slots that each thread of the main execution holds."""

    def __init__(self, slots: Slots, commands: Commands, clock: Clock) -> None:
        """Start without slots.

        Args:
            slots: the slots of shared resources.
            commands: executes requests.
            clock: the clock for waiting.
        """
        self._slots = slots
        self._commands = commands
        self._clock = clock
        self._thread_state = threading.local()

    @contextmanager
    def hold(self, resources: tuple[str, ...]) -> Iterator[None]:
        """Hold slots. Slots that the thread already has are not requested again.

        Raises:
            UnknownNameError: if the spec has no such resource, or the resource has no slots.
            RuntimeError: if the thread has slots and requests others, because two threads could wait for each other
                forever; or if the clock was closed before the slots were free.
        """
        for resource in resources:
            self._check_resource(resource)
        held_resources = self._held_resources()
        new_resources = tuple(name for name in dict.fromkeys(resources) if name not in held_resources)
        if not new_resources:
            yield
            return
        if held_resources:
            slots_text = ", ".join(repr(name) for name in (*sorted(held_resources), *new_resources))
            raise RuntimeError(
                f"request all slots in one call, so that threads never wait for each other: slot({slots_text})"
            )
        grant_event = threading.Event()

        def grant() -> None:
            grant_event.set()
            self._clock.notify()

        number = self._commands.request_slots(new_resources, grant)
        try:
            if not self._clock.wait_until(grant_event.is_set, math.inf):
                raise RuntimeError("the clock was closed before the slots were free")
            held_resources.update(dict.fromkeys(new_resources))
            yield
        finally:
            for resource in new_resources:
                held_resources.pop(resource, None)
            self._commands.release_slots(number)

    def _held_resources(self) -> dict[str, None]:
        """Return the resources whose slots this thread has."""
        if not hasattr(self._thread_state, "held_resources"):
            self._thread_state.held_resources = {}
        held_resources: dict[str, None] = self._thread_state.held_resources
        return held_resources

    def _check_resource(self, resource: str) -> None:
        if resource not in self._slots.free_slot_counts:
            raise unknown_name_error("resource", resource, self._slots.free_slot_counts)
        if self._slots.free_slot_counts[resource] == math.inf:
            raise UnknownNameError(
                f"resource {resource!r} has no slots: use its handle, or declare `slots: 1` for it in the spec"
            )
