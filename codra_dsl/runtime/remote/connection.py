"""The connection of one main execution: its unread requests, its unsent messages and its session."""

from __future__ import annotations

import contextlib
import logging
import math
import socket
from collections.abc import Callable
from selectors import EVENT_READ, EVENT_WRITE

from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.remote.json_lines import MAX_LINE_BYTES, RESPONSE_TIMEOUT_S, line_of, request_of_line
from codra_dsl.runtime.remote.protocol import MessageError, PlainData, TokenError, error_to, id_of, notice
from codra_dsl.runtime.remote.session import LEASE_S, Send, Session

_LOGGER = logging.getLogger(__name__)

MAX_UNSENT_BYTES = 1 << 18
"""While more bytes of messages are unsent, requests of the main execution are not read.

If a notice or a late answer has to be sent meanwhile, the connection ends.
"""

_CHUNK_BYTES = 8192
"""How much a connection reads in one turn. It is small so that large requests do not delay other connections."""

_MIN_BYTES_TO_SEND = 16384
"""While further requests wait, fewer bytes are not sent yet.

A call of the operating system may cost a thread its turn, if other threads of the program are busy.
"""

Admit = Callable[[object, Send], Session]
"""Opens the session of a connection, whose first message is the argument. It raises TokenError to refuse."""


class Connection:
    """A connection. Its socket belongs to the server's thread; any thread may call `send` and `close`.

    Attributes:
        peer: the socket.
        deadline_s: when the connection is closed if it has no session; when it ends if it is closed.
        interest: the events of the socket for which the connection waits.
    """

    def __init__(self, peer: socket.socket, clock: Clock, admit: Admit, wake: Callable[[], None]) -> None:
        """Begin without a session, which the first message opens.

        Args:
            peer: a socket that does not block.
            clock: the clock of the context manager.
            admit: opens the session.
            wake: called after a change that the server's thread has to notice.
        """
        self.peer = peer
        self.deadline_s = clock.now_s() + LEASE_S
        self.interest = EVENT_READ
        self._clock = clock
        self._admit = admit
        self._wake = wake
        self._lock = new_lock()
        self._input = bytearray()
        self._line_end = -1
        self._unsent = bytearray()
        self._longest_line_bytes = 0  # changes follow a large graph before a program has read it
        self._session: Session | None = None
        self._is_closed = False
        self._has_peer_ended = False
        self._is_lost = False
        self._is_full = False

    @property
    def is_closed(self) -> bool:
        """Return whether the connection handles no more requests; it may still send messages."""
        return self._is_closed

    @property
    def has_session(self) -> bool:
        """Return whether the main execution has opened its session."""
        return self._session is not None

    @property
    def has_request(self) -> bool:
        """Return whether a complete request can be handled now."""
        return not self._is_closed and self._line_end >= 0 and len(self._unsent) <= MAX_UNSENT_BYTES

    @property
    def is_over(self) -> bool:
        """Return whether the socket can be closed: everything is sent, or the main execution does not read."""
        is_finished = self._has_peer_ended and not self._unsent
        return self._is_lost or (self._is_closed and (is_finished or self._clock.now_s() >= self.deadline_s))

    def send(self, message: PlainData) -> None:
        """Send a message later. The connection ends if too many bytes are unsent, or if the session has ended.

        The caller may hold locks that the session needs, so the thread of the server ends the session.
        """
        line = line_of(message)
        with self._lock:
            if self._is_closed:
                return
            self._is_full |= len(self._unsent) > MAX_UNSENT_BYTES + self._longest_line_bytes
            self._longest_line_bytes = max(self._longest_line_bytes, len(line))
            if not self._is_full:
                self._unsent += line
        if not self._is_full and self._session is not None and self._session.is_over:
            self._close()
        self._wake()

    def close(self, because: str, kind: str = "closed") -> None:
        """End the session, send the reason in a notice, and end the connection; do nothing if it has ended."""
        self._close(line_of(notice(kind, message=because)))
        if self._session is not None:
            self._session.close(because)
        self._wake()

    def take_turn(self, events: int) -> None:
        """Receive a part of a request, handle at most one request, and send as much as the socket accepts."""
        try:
            if events & EVENT_READ:
                self._receive()
            if not self._is_closed:
                self._handle_input()
            if self._is_full:
                self.close("the main execution does not read its messages")
            if not self._is_closed and self._clock.now_s() >= self.deadline_s:
                self.close(f"no message was received for {LEASE_S:g} s", "lease_over")
            if not self.has_request or len(self._unsent) >= _MIN_BYTES_TO_SEND:
                self._flush()
        except OSError:
            self._lose()
        except Exception:
            _LOGGER.exception("the connection of a main execution ends, because a request failed")
            self._lose()
        if self._is_closed:
            self._input.clear()
        may_read = self._is_closed or (self._line_end < 0 and len(self._unsent) <= MAX_UNSENT_BYTES)
        self.interest = EVENT_READ * (may_read and not self._has_peer_ended) | EVENT_WRITE * bool(self._unsent)

    def _receive(self) -> None:
        with contextlib.suppress(BlockingIOError):
            chunk = self.peer.recv(_CHUNK_BYTES)
            self._has_peer_ended = not chunk
            if not self._is_closed:
                old_size = len(self._input)
                self._input += chunk
                self._line_end = self._input.find(b"\n", old_size)

    def _handle_input(self) -> None:
        end = self._line_end
        if (end if end >= 0 else len(self._input)) > MAX_LINE_BYTES:
            self.close(f"a request may have at most {MAX_LINE_BYTES} bytes")
        elif self.has_request:
            line = bytes(self._input[:end])
            del self._input[: end + 1]
            self._line_end = self._input.find(b"\n")
            self._handle_line(line)
        elif self._has_peer_ended and end < 0:
            self.close("the connection was lost")

    def _handle_line(self, line: bytes) -> None:
        message: object = None
        try:
            message = request_of_line(line)
            if self._session is None:
                self._session, self.deadline_s = self._admit(message, self.send), math.inf
        except (MessageError, TokenError) as error:
            self.send(error_to(id_of(message), error))
            if isinstance(error, TokenError):
                self.close(str(error))
        else:
            self._session.receive(message)

    def _flush(self) -> None:
        with self._lock, contextlib.suppress(BlockingIOError):
            while self._unsent:
                del self._unsent[: self.peer.send(self._unsent[:65536])]
            if self._is_closed and not self._has_peer_ended:
                self.peer.shutdown(socket.SHUT_WR)  # then wait for the end of the input: a reset could lose messages

    def _close(self, last_line: bytes = b"") -> None:
        with self._lock:
            if not self._is_closed:
                self._is_closed = True
                self._unsent += last_line
                self._input.clear()
                self.deadline_s = self._clock.now_s() + RESPONSE_TIMEOUT_S

    def _lose(self) -> None:
        self._is_lost = True
        self.close("the connection was lost")
