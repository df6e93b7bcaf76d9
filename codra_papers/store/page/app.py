"""The page's answers: the page itself, what changes on it, and what people ask for."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Callable
from concurrent.futures import Future
from contextlib import asynccontextmanager
from typing import Any

from starlette.applications import Starlette
from starlette.exceptions import HTTPException
from starlette.requests import ClientDisconnect, Request
from starlette.responses import JSONResponse, Response
from starlette.routing import Route
from starlette.types import ASGIApp

from codra_dsl.runtime.knowledge import Knowledge
from codra_papers.store.page.desk import BusyError, Desk
from codra_papers.store.page.document import page_html, static_text
from codra_papers.store.page.feed import Feed
from codra_papers.store.page.guard import Guard
from codra_papers.store.page.requests import MOST_BYTES, BadRequestError, read_load, read_name, read_order
from codra_papers.store.page.streaming import MEDIA_TYPE, Streams, TooManyError
from codra_papers.store.simulator.store import PickerPage

AGENT = "picker_page"
MOST_WAITING_ORDERS = 20
"""More orders than these are not waiting for the robot at once."""

ENDED = ("done", "aborted", "failed", "cancelled")
"""The states of orders for which nothing will be done any more."""

BODY_S = 5.0
"""Whoever takes longer to send a request is not waited for."""

DONE_S = 10.0
"""Whoever asks for something is told within this time, if only that it is not known yet."""


class TooManyOrdersError(PermissionError):
    """The robot has enough to do."""


class NoSuchOrderError(LookupError):
    """There is no such order to take back."""


class PageApp:
    """The application.

    Attributes:
        asgi: what a server calls.
    """

    def __init__(self, knowledge: Knowledge, pickers: PickerPage, feed: Feed, desk: Desk, port: int) -> None:
        """Take what the page shows and does.

        Args:
            knowledge: what is shown.
            pickers: the agent that writes.
            feed: the newest view.
            desk: by which writes come into the thread of the simulation.
            port: at which the page is.
        """
        self._knowledge = knowledge
        self._pickers = pickers
        self._feed = feed
        self._desk = desk
        self._streams = Streams(feed)
        app = Starlette(
            routes=[
                Route("/", self._page),
                Route("/page.js", self._script),
                Route("/page.css", self._style),
                Route("/favicon.ico", self._icon),
                Route("/view", self._view),
                Route("/events", self._events),
                Route("/orders", self._order, methods=["POST"]),
                Route("/cancel", self._cancel, methods=["POST"]),
                Route("/load", self._load, methods=["POST"]),
            ],
            lifespan=self._lifespan,
            exception_handlers={HTTPException: _failed, BadRequestError: _failed, BusyError: _failed,
                                TooManyError: _failed, PermissionError: _failed, LookupError: _failed},
        )  # fmt: skip
        self.asgi: ASGIApp = _WithLifespan(app, Guard(app, port))

    def end(self) -> None:
        """End what streams, so that the server can end; called in its event loop."""
        self._streams.end()

    @asynccontextmanager
    async def _lifespan(self, _: Starlette) -> AsyncIterator[None]:
        publishing = asyncio.create_task(self._feed.publish())
        yield
        publishing.cancel()

    async def _page(self, _: Request) -> Response:
        return Response(page_html(), media_type="text/html")

    async def _script(self, _: Request) -> Response:
        return Response(static_text("page.js"), media_type="text/javascript")

    async def _style(self, _: Request) -> Response:
        return Response(static_text("page.css"), media_type="text/css")

    async def _icon(self, _: Request) -> Response:
        return Response(status_code=204)

    async def _view(self, _: Request) -> Response:
        return JSONResponse(self._feed.view())

    async def _events(self, request: Request) -> Response:
        return self._streams.another() if request.method == "GET" else Response(media_type=MEDIA_TYPE)

    async def _order(self, request: Request) -> Response:
        order = read_order(await _body(request))

        def write() -> str:
            snapshot = self._knowledge.snapshot()
            states = (snapshot.get(node.name, "state") for node in snapshot.nodes("order"))
            if sum(not (state.known and state.value in ENDED) for state in states) >= MOST_WAITING_ORDERS:
                raise TooManyOrdersError(f"{MOST_WAITING_ORDERS} orders are waiting already")
            return self._pickers.order(order.kind, order.area, order.to)

        return await self._written(write)

    async def _cancel(self, request: Request) -> Response:
        name = read_name(await _body(request))

        def write() -> str:
            snapshot = self._knowledge.snapshot()
            if name not in [node.name for node in snapshot.nodes("order")]:
                raise NoSuchOrderError(f"there is no order {name!r}")
            state = snapshot.get(name, "state")
            if state.known and state.value in ENDED:
                raise NoSuchOrderError(f"{name} is {state.value} already")
            self._pickers.cancel(name)
            return f"{name}.cancelled"

        return await self._written(write)

    async def _load(self, request: Request) -> Response:
        load = read_load(await _body(request))

        def write() -> str:
            self._pickers.tell_load(load)
            return "robot.container_load"

        return await self._written(write)

    async def _written(self, write: Callable[[], str]) -> Response:
        """Let something be written in the thread of the simulation, and tell what came of it."""
        asked: Future[str] = self._desk.ask(write)
        try:
            async with asyncio.timeout(DONE_S):
                written = await asyncio.wrap_future(asked)
        except TimeoutError:
            raise BusyError("the robot's program does not answer; look below whether it was done") from None
        return JSONResponse({"written": written, "by": AGENT}, 201)


class _WithLifespan:
    """Lets the application begin and end by itself, and all requests go through its guard."""

    def __init__(self, app: ASGIApp, guarded: ASGIApp) -> None:
        self._app = app
        self._guarded = guarded

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        await (self._app if scope["type"] == "lifespan" else self._guarded)(scope, receive, send)


async def _body(request: Request) -> bytes:
    """Return the body of a request.

    Raises:
        HTTPException: if it is too long, or takes too long.
    """
    body = bytearray()
    try:
        async with asyncio.timeout(BODY_S):
            async for chunk in request.stream():
                body += chunk
                if len(body) > MOST_BYTES:
                    raise HTTPException(413, f"the body is longer than {MOST_BYTES} bytes", {"connection": "close"})
    except TimeoutError:
        raise HTTPException(408, "the body took too long", {"connection": "close"}) from None
    except ClientDisconnect:
        raise HTTPException(400, "the body has no end") from None
    return bytes(body)


async def _failed(_: Request, error: Exception) -> Response:
    """Tell why something was not done: who may not do what, or what is wrong with the request."""
    match error:
        case HTTPException():
            return JSONResponse({"error": error.detail}, error.status_code, error.headers)
        case BadRequestError():
            return JSONResponse({"error": str(error)}, 400)
        case BusyError() | TooManyError():
            return JSONResponse({"error": str(error)}, 503, {"retry-after": "5"})
        case _:
            return JSONResponse({"error": str(error), "by": AGENT}, 409)
