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
"""The time between two pings; a ping that cannot be sent shows that a browser has disconnected."""

SEND_TIMEOUT_S = 30.0
"""A browser that has not received an event after this time is disconnected. The browser may connect again."""


class TooManyStreamsError(RuntimeError):
    """Too many browsers follow the page."""


class Streams:
    """The streams of all browsers that follow the page."""

    def __init__(self, feed: Feed) -> None:
        """Begin without streams."""
        self._feed = feed
        self._open_streams: set[_Stream] = set()
        self._end_event = asyncio.Event()

    def new_stream(self) -> Response:
        """Return a response that streams views.

        Raises:
            TooManyStreamsError: `MOST_STREAMS` browsers already follow the page.
        """
        if len(self._open_streams) >= MOST_STREAMS:
            raise TooManyStreamsError(f"{MOST_STREAMS} browsers already follow this page; close one of them")
        return _Stream(_views(self._feed, self._end_event), self._open_streams)

    def end(self) -> None:
        """End all streams."""
        self._end_event.set()


class _Stream(EventSourceResponse):
    """The stream of one browser; it ends when the browser disconnects, is too slow, or the run is over."""

    def __init__(self, views: AsyncIterator[ServerSentEvent], open_streams: set[_Stream]) -> None:
        super().__init__(
            views,
            sep="\n",
            ping=PING_S,
            ping_message_factory=lambda: ServerSentEvent(comment="still here"),
            send_timeout=SEND_TIMEOUT_S,
        )
        for name in ("cache-control", "connection"):  # the guard and the server add these headers
            del self.headers[name]
        self._open_streams = open_streams

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        self._open_streams.add(self)
        try:
            with suppress(SendTimeoutError):
                await super().__call__(scope, receive, send)
        finally:
            self._open_streams.discard(self)


async def _views(feed: Feed, end_event: asyncio.Event) -> AsyncIterator[ServerSentEvent]:
    """Yield a view, and then each time a newer view, until the streams end."""
    number = 0
    end_task = asyncio.ensure_future(end_event.wait())
    newer_view = asyncio.ensure_future(feed.wait_for_newer(number))
    try:
        while True:
            await asyncio.wait((newer_view, end_task), return_when=asyncio.FIRST_COMPLETED)
            if end_task.done():
                return
            number, text = newer_view.result()
            yield ServerSentEvent(data=text, id=str(number))
            newer_view = asyncio.ensure_future(feed.wait_for_newer(number))
    finally:
        end_task.cancel()
        newer_view.cancel()
