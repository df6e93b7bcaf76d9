"""The limits of the page's connections, so that silent and slow ones keep nobody out.

Uvicorn has no limit for the time until the header of a request is complete, and answers everybody with an error while
too many connections are open.
"""

from __future__ import annotations

import asyncio
import json

from uvicorn.protocols.http.h11_impl import H11Protocol

MOST_CONNECTIONS = 64
"""The largest number of open connections. If there are more, the one that has been waiting longest is closed."""

MOST_REFUSED_CONNECTIONS = 64
"""The largest number of refused connections that have not been closed yet."""

HEADER_S = 5.0
"""The longest time until the header of a request is complete, from the begin of the connection or the last response."""

MOST_REQUESTS_AT_ONCE = 8
REQUEST_PERIOD_S = 0.25
"""After `MOST_REQUESTS_AT_ONCE` requests, a connection may send one request in this time; others wait."""

REFUSING_S = 1.0
"""How long a refused connection stays open, so that its client can read the response."""

_BODY = json.dumps({"error": "too many requests are in progress; try again"}).encode()
_REFUSAL = (
    b"HTTP/1.1 503 Service Unavailable\r\ncontent-type: application/json\r\ncontent-length: %d\r\nretry-after: 5\r\n"
    b"connection: close\r\n\r\n%s" % (len(_BODY), _BODY)
)


class LimitedConnection(H11Protocol):
    """One connection; it ends if its client does not send a complete header in time, or others need its place."""

    _header_timer: asyncio.TimerHandle | None = None
    _waiting_since_s = 0.0
    _allowed_until_s = 0.0
    _is_refused = False

    def connection_made(self, transport: asyncio.Transport) -> None:  # type: ignore[override]
        """Accept the connection, and close another one or refuse this one if there are too many."""
        super().connection_made(transport)
        self._wait_for_header()
        connections = [
            connection
            for connection in self.connections
            if isinstance(connection, LimitedConnection) and not connection.transport.is_closing()
        ]
        refused_count = sum(connection._is_refused for connection in connections)
        if len(connections) - refused_count <= MOST_CONNECTIONS:
            return
        waiting = [connection for connection in connections if connection is not self and connection._is_waiting()]
        if waiting:
            min(waiting, key=lambda connection: connection._waiting_since_s).transport.abort()
        elif refused_count < MOST_REFUSED_CONNECTIONS:
            self._refuse()
        else:
            transport.abort()

    def connection_lost(self, exc: Exception | None) -> None:
        """Forget the connection."""
        self._stop_timer()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        """Handle a part of a request."""
        if not self._is_refused:
            super().data_received(data)
            if not self._is_between_requests():
                self._stop_timer()

    def on_response_complete(self) -> None:
        """Wait for the next request, and before that for its turn if there were too many requests."""
        now_s = self.loop.time()
        self._allowed_until_s = max(self._allowed_until_s, now_s) + REQUEST_PERIOD_S
        pause_s = self._allowed_until_s - now_s - MOST_REQUESTS_AT_ONCE * REQUEST_PERIOD_S
        if pause_s > 0:
            self.loop.call_later(pause_s, self._begin_next_request)
        else:
            self._begin_next_request()

    def _begin_next_request(self) -> None:
        super().on_response_complete()
        if self._is_between_requests():
            self._wait_for_header()

    def _is_between_requests(self) -> bool:
        return self.cycle is None or self.cycle.response_complete

    def _is_waiting(self) -> bool:
        """Return whether the next step is the client's: the rest of a header or of a body."""
        return not self._is_refused and (self._is_between_requests() or self.cycle.more_body)

    def _wait_for_header(self) -> None:
        self._stop_timer()
        self._waiting_since_s = self.loop.time()
        self._header_timer = self.loop.call_later(HEADER_S, self.transport.abort)

    def _stop_timer(self) -> None:
        if self._header_timer is not None:
            self._header_timer.cancel()

    def _refuse(self) -> None:
        """Send an error, and read until the client has closed its side: a reset could lose the error."""
        self._is_refused = True
        self._stop_timer()
        self.transport.write(_REFUSAL)
        self.transport.write_eof()
        self._header_timer = self.loop.call_later(REFUSING_S, self.transport.abort)
