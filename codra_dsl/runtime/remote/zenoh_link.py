"""A link to a manager over Zenoh.

The keys of a manager begin with `codra/NAME`, where NAME is the name of its spec:

    codra/NAME/manager              liveliness token of the manager
    codra/NAME/client/USER/LINK     liveliness token of a link
    codra/NAME/to/USER/LINK         messages to the manager
    codra/NAME/from/USER/LINK       messages of the manager
"""

from __future__ import annotations

import os
import secrets
import threading

from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.remote.json_lines import RESPONSE_TIMEOUT_S, line_of, message_of
from codra_dsl.runtime.remote.links import INHERITED_TEXT, Lose, Receive
from codra_dsl.runtime.remote.ordering import Numbering, Ordering
from codra_dsl.runtime.remote.protocol import PlainData
from codra_dsl.runtime.remote.zenoh_session import NetworkAddress, ZenohSession

ROOT = "codra"

DEFAULT_USER = "anyone"
"""The user of a program on a network without users."""

_FIND_PERIOD_S = 0.2


class ZenohLink:
    """A link to the only manager at an address, or to the manager of a named spec."""

    token = None
    response_timeout_s = 1.2

    def __init__(self, address: NetworkAddress, *, spec: str = "*") -> None:
        """Find the manager.

        Args:
            address: where a manager or a router listens.
            spec: the name of the manager's spec; it may be omitted if there is only one manager.

        Raises:
            ConnectionError: if no manager can be reached, or if there are several.
            MissingZenohError: if Zenoh is not installed.
        """
        self._program_id = os.getpid()
        self._session = ZenohSession(address, is_router=False)
        try:
            manager = self._find_manager(address, spec)
        except BaseException:
            self._session.close()
            raise
        self._root = manager.removesuffix("/manager")
        self._name = f"{self._session.user or DEFAULT_USER}/{secrets.token_hex(8)}"
        self._lock = new_lock()
        self._numbering, self._ordering = Numbering(), Ordering()
        self._is_over = False
        self._lose: Lose = lambda _: None

    def open(self, receive: Receive, lose: Lose) -> None:
        """Begin to receive messages, in another thread."""
        self._lose = lose

        def arrive(_key: str, payload: bytes, attachment: str) -> None:
            try:
                for message in self._ordering.add(int(attachment), message_of(payload)):
                    receive(message)
            except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
                self._end(f"the manager is gone: {error}")

        self._session.subscribe(f"{self._root}/from/{self._name}", arrive)
        self._session.watch(f"{self._root}/manager", self._note_manager)
        self._session.show(f"{self._root}/client/{self._name}")

    def send(self, message: PlainData) -> None:
        """Send a message.

        Raises:
            ConnectionError: if the link is lost, or if this process is a fork of the program that has the link.
        """
        if os.getpid() != self._program_id:
            raise ConnectionError(INHERITED_TEXT)
        payload = line_of(message)
        with self._lock:
            if self._is_over:
                raise ConnectionError("the manager is gone")
            self._session.send(f"{self._root}/to/{self._name}", payload, str(self._numbering.next()))
        if self._session.has_overflown:
            self._end("too many messages wait to be sent")

    def close(self) -> None:
        """Close the link. A fork of the program has inherited nothing that it could close."""
        if os.getpid() == self._program_id:
            with self._lock:
                self._is_over = True
            self._session.close()

    def _find_manager(self, address: NetworkAddress, spec: str) -> str:
        unset_event = threading.Event()
        for _ in range(int(RESPONSE_TIMEOUT_S / 2 / _FIND_PERIOD_S)):
            managers = self._session.find(f"{ROOT}/{spec}/manager", _FIND_PERIOD_S)
            if len(managers) == 1:
                return managers[0]
            if managers:
                names = ", ".join(key.split("/")[1] for key in managers)
                raise ConnectionError(f"{address} has several managers: name one of {names}")
            unset_event.wait(_FIND_PERIOD_S)
        raise ConnectionError(f"no manager can be reached at {address}")

    def _note_manager(self, _key: str, is_alive: bool) -> None:
        if not is_alive:
            self._end("the manager is gone")

    def _end(self, because: str) -> None:
        with self._lock:
            was_over, self._is_over = self._is_over, True
        if not was_over:
            self._lose(because)
