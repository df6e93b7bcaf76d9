"""The orders of a manager to a connected host, as notices of the host's session."""

from __future__ import annotations

from collections.abc import Callable, Mapping

from codra_dsl.logic import Value
from codra_dsl.runtime.perception.hosts import JobKey
from codra_dsl.runtime.remote.protocol import PlainData, notice


class HostOrders:
    """Sends orders to a host. The manager's lock is held meanwhile, so `send` must not wait for another lock."""

    def __init__(self, send: Callable[[PlainData], None]) -> None:
        self._send = send

    def perform(self, key: JobKey, random_seed: str, arguments: Mapping[str, Value | None]) -> None:
        """Order the host to execute a job."""
        plain_arguments = [{"name": name, "value": value} for name, value in arguments.items()]
        self._order("perform", key, random_seed=random_seed, arguments=plain_arguments)

    def cancel(self, key: JobKey) -> None:
        """Order the host to cancel a job."""
        self._order("cancel", key)

    def kill(self, key: JobKey) -> None:
        """Order the host to end the process of a job."""
        self._order("kill", key)

    def _order(self, kind: str, key: JobKey, **fields: object) -> None:
        self._send(notice(kind, algorithm=key[0], index=key[1], **fields))
