"""A Zenoh session whose callbacks and calls run in threads of ours, so that nothing waits for the network.

A callback of Zenoh only puts what has arrived into a queue. Sending also goes through a queue, because `put` waits
while the network is congested. These are the forms that end with the program, also after an exception.
"""

from __future__ import annotations

import contextlib
import json
import logging
import queue
import threading
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import TYPE_CHECKING, Any

from codra_dsl.isolation.error_text import loggable

if TYPE_CHECKING:
    import zenoh

_LOGGER = logging.getLogger(__name__)

TRANSPORT_LEASE_MS = 1_200
"""How long Zenoh waits for a sign of life of another program, e.g. after a cable was pulled."""

OPEN_TIMEOUT_MS = 1_000
"""How long Zenoh waits for a program that accepts a connection and does not answer. A session cannot end meanwhile."""

MAX_UNSENT_MESSAGES = 10_000
"""If more messages wait to be sent, further ones are dropped, and the link is lost."""

_END_CHECK_PERIOD_S = 0.2
_CLOSE_TIMEOUT_S = 2.0

_HINTS = {
    True: "; an address with TLS needs credentials: `codra serve --write-security` writes them",
    False: "; if the manager has users, it needs the credentials of one of them",
}
"""How to go on without a file of settings, for a session that listens (True) or connects (False)."""

Arrive = Callable[[str, bytes, str], None]
"""Handles a message: its key, its payload and its attachment."""

Appear = Callable[[str, bool], None]
"""Handles the appearance (True) or the disappearance (False) of a liveliness token, given by its key."""


class MissingZenohError(ImportError):
    """Zenoh is not installed."""


@dataclass(frozen=True, slots=True)
class NetworkAddress:
    """An address of a manager on a network.

    Attributes:
        endpoint: the Zenoh endpoint, e.g. `tcp/192.168.1.5:7447`.
        config: a file with further settings of Zenoh, such as TLS and the user; None for none.
    """

    endpoint: str
    config: Path | None = None

    def __str__(self) -> str:
        return self.endpoint


class ZenohSession:
    """A session, and the two threads that handle what arrives and what is sent.

    Attributes:
        user: the user in the file of settings; empty if there is none.
        has_overflown: whether a message was dropped, because too many waited.
    """

    def __init__(self, address: NetworkAddress, *, is_router: bool) -> None:
        """Open the session.

        Args:
            address: where the session listens or connects.
            is_router: whether the session listens and passes messages between others; otherwise it connects.

        Raises:
            MissingZenohError: if Zenoh is not installed.
            ConnectionError: if the session cannot be opened.
        """
        zenoh = _imported_zenoh()
        self.has_overflown = False
        self._is_closed = False
        self._zenoh = zenoh
        self._arrivals: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._unsent: queue.Queue[tuple[str, bytes, str] | None] = queue.Queue(MAX_UNSENT_MESSAGES)
        self._entities: list[Any] = []
        config = _settings(address)
        try:
            _configure(config, address, is_router=is_router)
            self.user = str(json.loads(config.get_json("transport/auth/usrpwd/user")) or "")
            self._session = zenoh.open(config)
        except zenoh.ZError as error:
            doing = "listen" if is_router else "connect"
            reason, _, _source_line = str(error).partition(" at /")
            lacks_credentials = address.config is None and address.endpoint.startswith(("tls/", "quic/"))
            hint = _HINTS[is_router] if lacks_credentials else ""
            raise ConnectionError(f"cannot {doing} at {address}: {reason[:200]}{hint}") from None
        threading.Thread(target=self._handle_arrivals, name="codra-network", daemon=True).start()
        # Not a daemon: at the end of the program, the interpreter may not end a thread that is inside of Zenoh.
        self._sender = threading.Thread(target=self._send_all, name="codra-network-sender", daemon=False)
        self._sender.start()

    def subscribe(self, key: str, arrive: Arrive) -> None:
        """Receive the messages whose keys match."""

        def on_sample(sample: zenoh.Sample) -> None:
            attachment = "" if sample.attachment is None else sample.attachment.to_string()
            arguments = (str(sample.key_expr), sample.payload.to_bytes(), attachment)
            self._arrivals.put(lambda: arrive(*arguments))

        handler = self._zenoh.handlers.Callback(on_sample, indirect=False)
        self._entities.append(self._session.declare_subscriber(key, handler))

    def watch(self, key: str, appear: Appear) -> None:
        """Follow the liveliness tokens whose keys match."""

        def on_sample(sample: zenoh.Sample) -> None:
            name, is_alive = str(sample.key_expr), sample.kind == self._zenoh.SampleKind.PUT
            self._arrivals.put(lambda: appear(name, is_alive))

        handler = self._zenoh.handlers.Callback(on_sample, indirect=False)
        self._entities.append(self._session.liveliness().declare_subscriber(key, handler, history=True))

    def show(self, key: str) -> None:
        """Declare a liveliness token, which lives as long as this session."""
        self._entities.append(self._session.liveliness().declare_token(key))

    def find(self, key: str, timeout_s: float) -> list[str]:
        """Return the keys of the present liveliness tokens that match; wait at most `timeout_s` for the answer."""
        replies = self._session.liveliness().get(key, timeout=timeout_s)
        return sorted(str(reply.ok.key_expr) for reply in replies if reply.ok is not None)

    def send(self, key: str, payload: bytes, attachment: str) -> None:
        """Send a message later."""
        try:
            self._unsent.put_nowait((key, payload, attachment))
        except queue.Full:
            self.has_overflown = True

    def close(self) -> None:
        """Close the session, from any thread; messages that were sent before are passed on first."""
        self._arrivals.put(None)
        self._is_closed = True
        with contextlib.suppress(queue.Full):
            self._unsent.put_nowait(None)
        if threading.current_thread() is not self._sender:
            self._sender.join(_CLOSE_TIMEOUT_S)

    def _handle_arrivals(self) -> None:
        while (handle := self._arrivals.get()) is not None:
            try:
                handle()
            except Exception as error:  # noqa: BLE001 - a wrong message must not end the session
                _LOGGER.warning("a message is ignored: %s", loggable(error))

    def _send_all(self) -> None:
        while (message := self._next_unsent()) is not None:
            key, payload, attachment = message
            try:
                self._session.put(
                    key,
                    payload,
                    attachment=attachment,
                    congestion_control=self._zenoh.CongestionControl.BLOCK,
                    express=True,
                )
            except self._zenoh.ZError as error:
                _LOGGER.warning("a message is not sent: %s", error)
        for entity in self._entities:
            entity.undeclare()
        self._session.close()

    def _next_unsent(self) -> tuple[str, bytes, str] | None:
        """Return the next message to send; None if the session is closed, or if the program ends."""
        while True:
            try:
                return self._unsent.get(timeout=_END_CHECK_PERIOD_S)
            except queue.Empty:
                if self._is_closed or not threading.main_thread().is_alive():
                    return None


def has_users(address: NetworkAddress) -> bool:
    """Return whether the settings of an address demand passwords, and deny what no rule allows.

    Raises:
        MissingZenohError: if Zenoh is not installed.
        ConnectionError: if the settings cannot be read.
    """
    config = _settings(address)
    keys = ("transport/auth/usrpwd/dictionary_file", "access_control/enabled", "access_control/default_permission")
    passwords_file, is_controlled, default_permission = (json.loads(config.get_json(key)) for key in keys)
    return bool(passwords_file) and is_controlled is True and default_permission == "deny"


def _imported_zenoh() -> ModuleType:
    try:
        import zenoh  # noqa: PLC0415 - an extra, which most programs do not need
    except ImportError as error:
        raise MissingZenohError("a network address needs Zenoh: pip install 'codra-dsl[net]'") from error
    return zenoh


def _settings(address: NetworkAddress) -> Any:
    """Return the settings of an address, or raise an error as `ZenohSession` does."""
    zenoh_module = _imported_zenoh()
    if address.config is None:
        return zenoh_module.Config()
    try:
        return zenoh_module.Config.from_file(address.config)
    except zenoh_module.ZError as error:
        reason = " ".join(str(error).partition(" at /")[0].split())
        raise ConnectionError(f"the credentials '{address.config}' cannot be read: {reason[:200]}") from None


def _configure(config: Any, address: NetworkAddress, *, is_router: bool) -> None:
    passwords_file = json.loads(config.get_json("transport/auth/usrpwd/dictionary_file"))
    if passwords_file and address.config is not None:
        path = address.config.absolute().parent / passwords_file
        config.insert_json5("transport/auth/usrpwd/dictionary_file", json.dumps(str(path)))
    settings: dict[str, object] = {
        "mode": "router" if is_router else "client",
        "scouting/multicast/enabled": False,
        "transport/link/tx/lease": TRANSPORT_LEASE_MS,
        "transport/link/tx/keep_alive": 4,
        "transport/unicast/open_timeout": OPEN_TIMEOUT_MS,
        ("listen" if is_router else "connect") + "/endpoints": [address.endpoint],
        "listen/exit_on_failure" if is_router else "connect/timeout_ms": True if is_router else 1_500,
    }
    for key, setting in settings.items():
        config.insert_json5(key, json.dumps(setting))
