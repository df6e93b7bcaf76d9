"""Links carry messages between a program and a manager: over a local socket, or over a network.

The messages of a link arrive in order, each of them once, until the link is lost. Then its session is over.
"""

from __future__ import annotations

import os
import threading
from collections.abc import Callable
from typing import Any, Protocol

from codra_dsl.runtime.remote.json_lines import (
    RESPONSE_TIMEOUT_S,
    Address,
    connect,
    line_of,
    message_of,
    read_line,
    shut_down,
    with_send_timeout,
)
from codra_dsl.runtime.remote.protocol import PlainData
from codra_dsl.runtime.remote.token import read_token

Receive = Callable[[Any], None]
"""Handles a message of the manager. It may raise ValueError, KeyError, TypeError or AttributeError for a wrong one."""

Lose = Callable[[str], None]
"""Called once, with the reason, when the link is lost or closed."""

INHERITED_TEXT = (
    "the connection belongs to the program of which this process is a fork: create a `RemoteContext` in this process"
)


class Link(Protocol):
    """The program's end of a connection to a manager.

    Attributes:
        response_timeout_s: how long the manager may take to answer before it counts as gone.
    """

    response_timeout_s: float

    @property
    def token(self) -> str | None:
        """Return the token that `hello` must state; None if the manager needs none."""
        ...

    def open(self, receive: Receive, lose: Lose) -> None:
        """Begin to receive messages, in another thread."""
        ...

    def send(self, message: PlainData) -> None:
        """Send a message.

        Raises:
            ConnectionError: if the link is lost, or if this process is a fork of the program that has the link.
        """
        ...

    def close(self) -> None:
        """Close the link. In a fork of the program, close only what this process has inherited."""
        ...


class SocketLink:
    """A link over a Unix socket, or over a port of this machine.

    Attributes:
        token: the token of the manager, if it listens at a port.
    """

    response_timeout_s = RESPONSE_TIMEOUT_S

    def __init__(self, address: Address, token: str | None = None) -> None:
        """Connect.

        Args:
            address: the path of a Unix socket, or a port of 127.0.0.1.
            token: the token of a manager at a port; by default it is read from the manager's token file.

        Raises:
            ConnectionError: if no manager listens at the address, or its token cannot be read.
        """
        try:
            self._socket = with_send_timeout(connect(address, RESPONSE_TIMEOUT_S))
        except OSError as error:
            raise ConnectionError(f"no manager listens at {address}: {error.strerror or error}") from None
        self._program_id = os.getpid()
        try:
            self.token = read_token(address) if token is None and isinstance(address, int) else token
        except ConnectionError:
            self._socket.close()
            raise

    def open(self, receive: Receive, lose: Lose) -> None:
        """Begin to receive messages, in another thread."""
        threading.Thread(target=self._read, args=(receive, lose), name="codra-client", daemon=True).start()

    def send(self, message: PlainData) -> None:
        """Send a message.

        Raises:
            ConnectionError: if the link is lost, or if this process is a fork of the program that has the link.
        """
        if os.getpid() != self._program_id:
            raise ConnectionError(INHERITED_TEXT)
        line = line_of(message)
        try:
            self._socket.sendall(line)
        except OSError as error:
            raise ConnectionError(f"the manager is gone: {error.strerror or error}") from None

    def close(self) -> None:
        """Close the link. In a fork of the program, only close the inherited socket."""
        if os.getpid() == self._program_id:
            shut_down(self._socket)
            return
        descriptor = self._socket.detach()  # `close` would wait for a stream that a thread of the program reads
        if descriptor >= 0:
            os.close(descriptor)

    def _read(self, receive: Receive, lose: Lose) -> None:
        reason = "the manager is gone"
        try:
            with self._socket.makefile("rb") as stream:
                while (line := read_line(stream)) is not None:
                    receive(message_of(line))
        except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
            reason = f"the manager is gone: {error}"
        lose(reason)
