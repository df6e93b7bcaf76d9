"""Server-sent events: a browser gets the newest view as soon as it has received the previous one."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import suppress

from sse_starlette import EventSourceResponse, ServerSentEvent
from sse_starlette.sse import SendTimeoutError
from starlette.responses import Response
from starlette.types import Receive, Scope, Send

from codra_papers.store.page.feed import Feed

MEDIA_TYPE = "text/event-stream"
MOST_STREAMS = 32
"""The largest number of browsers that can follow the page at once."""

PING_S = 10.0
"""The time between two pings; a ping that cannot be sent shows that a browser has gone."""

SEND_TIMEOUT_S = 30.0
"""A browser that has not received an event after this time is disconnected; it may connect again."""


class TooManyError(RuntimeError):
    """Too many browsers follow the page."""


class Streams:
    """The streams of all browsers that follow the page."""

    def __init__(self, feed: Feed) -> None:
        """Begin without streams."""
        self._feed = feed
        self._open: set[_Stream] = set()
        self._ended = asyncio.Event()

    def another(self) -> Response:
        """Return a response that streams views.

        Raises:
            TooManyError: `MOST_STREAMS` browsers already follow the page.
        """
        if len(self._open) >= MOST_STREAMS:
            raise TooManyError(f"{MOST_STREAMS} browsers already follow this page; close one of them")
        return _Stream(_views(self._feed, self._ended), self._open)

    def end(self) -> None:
        """End all streams."""
        self._ended.set()


class _Stream(EventSourceResponse):
    """The stream of one browser; it ends when the browser disconnects, is too slow, or the run is over."""

    def __init__(self, views: AsyncIterator[ServerSentEvent], opened: set[_Stream]) -> None:
        super().__init__(
            views,
            sep="\n",
            ping=PING_S,
            ping_message_factory=lambda: ServerSentEvent(comment="still here"),
            send_timeout=SEND_TIMEOUT_S,
        )
        for name in ("cache-control", "connection"):  # the guard and the server add their own
            del self.headers[name]
        self._opened = opened

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        self._opened.add(self)
        try:
            with suppress(SendTimeoutError):
                await super().__call__(scope, receive, send)
        finally:
            self._opened.discard(self)


async def _views(feed: Feed, ended: asyncio.Event) -> AsyncIterator[ServerSentEvent]:
    """Yield newer and newer views until the streams end."""
    number = 0
    end = asyncio.ensure_future(ended.wait())
    newer = asyncio.ensure_future(feed.after(number))
    try:
        while True:
            await asyncio.wait((newer, end), return_when=asyncio.FIRST_COMPLETED)
            if end.done():
                return
            number, text = newer.result()
            yield ServerSentEvent(data=text, id=str(number))
            newer = asyncio.ensure_future(feed.after(number))
    finally:
        end.cancel()
        newer.cancel()
