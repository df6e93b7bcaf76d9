"""Server-sent events: to each browser the newest view, as soon as it has taken the one before."""

from __future__ import annotations

import asyncio

from starlette.responses import Response
from starlette.types import Message, Receive, Scope, Send

from codra_papers.store.page.feed import Feed

MEDIA_TYPE = "text/event-stream"
MOST_STREAMS = 32
"""More browsers at once are told to come again."""

QUIET_S = 10.0
"""When nothing has changed for so long, something is sent all the same: so it shows who is still there."""

TAKEN_S = 30.0
"""A browser that has not taken what it was sent after this time is left; it may come again."""


class TooManyError(RuntimeError):
    """Too many browsers look at the page."""


class Streams:
    """All browsers that look."""

    def __init__(self, feed: Feed) -> None:
        """Begin without any."""
        self._feed = feed
        self._open: set[asyncio.Task[None]] = set()

    def another(self) -> Response:
        """Return a response that streams views.

        Raises:
            TooManyError: if there are too many.
        """
        if len(self._open) >= MOST_STREAMS:
            raise TooManyError(f"{MOST_STREAMS} browsers look at this page already")
        return _Stream(self._feed, self._open)

    def end(self) -> None:
        """End all of them."""
        for task in self._open:
            task.cancel()


class _Stream(Response):
    """One browser's stream; it ends when the browser goes, takes too long, or the run is over."""

    media_type = MEDIA_TYPE

    def __init__(self, feed: Feed, opened: set[asyncio.Task[None]]) -> None:
        super().__init__()
        del self.headers["content-length"]
        self._feed = feed
        self._opened = opened

    async def __call__(self, _: Scope, receive: Receive, send: Send) -> None:
        await send({"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers})
        sending, leaving = asyncio.create_task(self._send(send)), asyncio.create_task(_left(receive))
        self._opened.add(sending)
        try:
            await asyncio.wait((sending, leaving), return_when=asyncio.FIRST_COMPLETED)
        finally:
            self._opened.discard(sending)
            is_over = sending.cancelled()
            sending.cancel()
            leaving.cancel()
            await asyncio.gather(sending, leaving, return_exceptions=True)
        if is_over:
            await send({"type": "http.response.body"})

    async def _send(self, send: Send) -> None:
        number = 0
        while True:
            try:
                async with asyncio.timeout(QUIET_S):
                    number, text = await self._feed.after(number)
                told = f"id: {number}\ndata: {text}\n\n"
            except TimeoutError:
                told = ": still here\n\n"
            async with asyncio.timeout(TAKEN_S):
                await send(_piece(told))


def _piece(text: str) -> Message:
    return {"type": "http.response.body", "body": text.encode(), "more_body": True}


async def _left(receive: Receive) -> None:
    """Return when the browser has gone."""
    while (await receive())["type"] != "http.disconnect":
        pass
