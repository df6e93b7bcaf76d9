"""Serve a context manager over Zenoh: one session for each link of a program."""

from __future__ import annotations

import ipaddress
import re
from dataclasses import dataclass, field
from typing import Any, Self

from codra_dsl.runtime.context.context import ContextManager
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.remote.agents.agent_session import agents_of_manager
from codra_dsl.runtime.remote.json_lines import MAX_LINE_BYTES, line_of, request_of_line
from codra_dsl.runtime.remote.ordering import Numbering, Ordering
from codra_dsl.runtime.remote.permissions import Permissions
from codra_dsl.runtime.remote.protocol import MessageError, PlainData, error_to, notice
from codra_dsl.runtime.remote.server import MAX_CONNECTIONS
from codra_dsl.runtime.remote.session import Session, open_session
from codra_dsl.runtime.remote.zenoh_link import ROOT
from codra_dsl.runtime.remote.zenoh_session import NetworkAddress, ZenohSession, has_users

_HOST = re.compile(r"(?P<protocol>[a-z_]+)/\[?(?P<host>[^\]/]*?)\]?:\d+(?:[?#].*)?")
_PROTECTED_PROTOCOLS = frozenset({"tls", "quic"})


@dataclass(slots=True)
class _Client:
    """The manager's end of one link."""

    session: Session
    numbering: Numbering = field(default_factory=Numbering)
    ordering: Ordering = field(default_factory=Ordering)


class ZenohServer:
    """Serves a context manager at an address of a network. It is also the router of the programs that connect.

    Attributes:
        address: where the manager listens.
    """

    def __init__(self, codra: ContextManager[Any, Any], address: NetworkAddress) -> None:
        """Begin to listen.

        Raises:
            PermissionError: if other machines could connect without TLS and users.
            ConnectionError: if the address is taken or cannot be used.
            MissingZenohError: if Zenoh is not installed.
        """
        check_exposure(address)
        self.address = address
        self._codra = codra
        self._root = f"{ROOT}/{codra.model.name}"
        self._lock = new_lock()
        self._clients: dict[str, _Client] = {}
        self._ended_links: dict[str, None] = {}
        self._session = ZenohSession(address, is_router=True)
        self._session.subscribe(f"{self._root}/to/*/*", self._arrive)
        self._session.watch(f"{self._root}/client/*/*", self._note_client)
        self._session.show(f"{self._root}/manager")

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """End all sessions, and stop listening."""
        with self._lock:
            clients, self._clients = self._clients, {}
        for link, client in clients.items():
            self._send(link, client, notice("closed", message="the manager has closed"))
            client.session.close("the manager has closed")
        self._session.close()

    def _arrive(self, key: str, payload: bytes, attachment: str) -> None:
        link = _link_of(key)
        client = self._client(link, attachment)
        if client is None:
            return
        for ready_payload in client.ordering.add(int(attachment), payload):
            try:
                client.session.receive(_request(ready_payload))
            except MessageError as error:
                self._send(link, client, error_to(None, error))
        if client.session.is_over:
            self._drop(link, "the session is over")

    def _client(self, link: str, attachment: str) -> _Client | None:
        """Return the client of a link, which the first message opens; None if there is none."""
        with self._lock:
            client = self._clients.get(link)
            if client is not None or not attachment.isdecimal() or link in self._ended_links:
                return client
            if not self._has_room():
                message = f"{MAX_CONNECTIONS} programs are connected already: connect again when one has left"
                self._session.send(f"{self._root}/from/{link}", line_of(notice("closed", message=message)), "1")
                return None

            def send(message: PlainData) -> None:
                self._send(link, opened_client, message)

            opened_client = _Client(open_session(self._codra, send, self._permissions(link)))
            self._clients[link] = opened_client
            return opened_client

    def _has_room(self) -> bool:
        """Return whether a client can be added, after clients whose sessions are over were removed."""
        if len(self._clients) >= MAX_CONNECTIONS:
            for link in [link for link, client in self._clients.items() if client.session.is_over]:
                del self._clients[link]
        return len(self._clients) < MAX_CONNECTIONS

    def _permissions(self, link: str) -> Permissions | None:
        """Return what the user of a link may request; None for everything, if the network has no users."""
        if self.address.config is None:
            return None
        user, _number = link.split("/")
        return Permissions(user=user, hosts=self._codra.hosts.names, agents=agents_of_manager(self._codra))

    def _send(self, link: str, client: _Client, message: PlainData) -> None:
        line = line_of(message)
        with self._lock:  # so messages are sent in the order of their numbers
            self._session.send(f"{self._root}/from/{link}", line, str(client.numbering.next()))

    def _note_client(self, key: str, is_alive: bool) -> None:
        if not is_alive:
            self._drop(_link_of(key), "the connection was lost")

    def _drop(self, link: str, because: str) -> None:
        with self._lock:
            client = self._clients.pop(link, None)
            self._ended_links[link] = None
            if len(self._ended_links) > MAX_CONNECTIONS:
                del self._ended_links[next(iter(self._ended_links))]
        if client is not None:
            self._send(link, client, notice("closed", message=because))
            client.session.close(because)


def _request(payload: bytes) -> object:
    """Return the request that a message carries.

    Raises:
        MessageError: if the message is too large, or is not JSON.
    """
    if len(payload) > MAX_LINE_BYTES:
        raise MessageError(f"a request may have at most {MAX_LINE_BYTES} bytes")
    return request_of_line(payload)


def _link_of(key: str) -> str:
    """Return the user and the number of a link, from a key."""
    return "/".join(key.split("/")[-2:])


def check_exposure(address: NetworkAddress) -> None:
    """Check that only programs of this machine can connect, or that TLS and users protect the manager.

    Raises:
        PermissionError: if neither is the case.
        ConnectionError: if the settings cannot be read.
        MissingZenohError: if Zenoh is not installed.
    """
    match = _HOST.fullmatch(address.endpoint)
    if match is not None and _is_loopback(match["host"]):
        return
    is_protected = match is not None and match["protocol"] in _PROTECTED_PROTOCOLS and address.config is not None
    if not is_protected or not has_users(address):
        raise PermissionError(
            f"other machines could connect to {address} without a password: "
            "listen at 127.0.0.1, or configure TLS and users"
        )


def _is_loopback(host: str) -> bool:
    try:
        return host == "localhost" or ipaddress.ip_address(host).is_loopback
    except ValueError:
        return False
