"""The web application: it serves the page and its views, and accepts the requests of people."""

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
from codra_papers.store.page.streaming import MEDIA_TYPE, Streams, TooManyStreamsError
from codra_papers.store.simulator.store import PickerPage

AGENT = "picker_page"
MOST_WAITING_ORDERS = 20
"""The largest number of orders that may wait for the robot at once."""

FINAL_STATES = ("done", "aborted", "failed", "cancelled")
"""The final states of orders."""

BODY_TIMEOUT_S = 5.0
"""The longest time to receive the body of a request."""

ANSWER_TIMEOUT_S = 10.0
"""The longest time until a request is answered. If the result is not known by then, the answer is an error."""


class TooManyOrdersError(PermissionError):
    """Too many orders are waiting for the robot."""


class NoSuchOrderError(LookupError):
    """The order does not exist or has already ended, so it cannot be taken back."""


class PageApp:
    """The application.

    Attributes:
        asgi: the application for an ASGI server.
    """

    def __init__(self, knowledge: Knowledge, pickers: PickerPage, feed: Feed, desk: Desk, port: int) -> None:
        """Create the application.

        Args:
            knowledge: the graph that is shown.
            pickers: the agent that writes into the graph.
            feed: the source of the newest view.
            desk: the queue that brings writes to the thread of the simulation.
            port: the port of the page.
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
            exception_handlers={HTTPException: _error_response, BadRequestError: _error_response,
                                BusyError: _error_response, TooManyStreamsError: _error_response,
                                PermissionError: _error_response, LookupError: _error_response},
        )  # fmt: skip
        self.asgi: ASGIApp = _LifespanRouter(app, Guard(app, port))

    def end(self) -> None:
        """End all streams, so that the server can end. Call this method in the server's event loop."""
        self._streams.end()

    @asynccontextmanager
    async def _lifespan(self, _: Starlette) -> AsyncIterator[None]:
        publish_task = asyncio.create_task(self._feed.publish())
        yield
        publish_task.cancel()

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
        return self._streams.new_stream() if request.method == "GET" else Response(media_type=MEDIA_TYPE)

    async def _order(self, request: Request) -> Response:
        order = read_order(await _body(request))

        def write() -> str:
            snapshot = self._knowledge.snapshot()
            states = (snapshot.get(node.name, "state") for node in snapshot.nodes("order"))
            if sum(not (state.known and state.value in FINAL_STATES) for state in states) >= MOST_WAITING_ORDERS:
                raise TooManyOrdersError(
                    f"{MOST_WAITING_ORDERS} orders are already waiting; order again when one has ended"
                )
            return self._pickers.order(order.kind, order.area, order.to)

        return await self._write(write)

    async def _cancel(self, request: Request) -> Response:
        name = read_name(await _body(request))

        def write() -> str:
            snapshot = self._knowledge.snapshot()
            if name not in [node.name for node in snapshot.nodes("order")]:
                raise NoSuchOrderError(f"there is no order {name!r}")
            state = snapshot.get(name, "state")
            if state.known and state.value in FINAL_STATES:
                raise NoSuchOrderError(f"{name} is {state.value} already")
            self._pickers.cancel(name)
            return f"{name}.cancelled"

        return await self._write(write)

    async def _load(self, request: Request) -> Response:
        load = read_load(await _body(request))

        def write() -> str:
            self._pickers.set_load(load)
            return "robot.container_load"

        return await self._write(write)

    async def _write(self, write: Callable[[], str]) -> Response:
        """Call `write` in the thread of the simulation, and return a response with its result."""
        pending_write: Future[str] = self._desk.ask(write)
        try:
            async with asyncio.timeout(ANSWER_TIMEOUT_S):
                written_name = await asyncio.wrap_future(pending_write)
        except TimeoutError:
            raise BusyError(
                "the robot's program does not answer; check below whether the request was executed"
            ) from None
        return JSONResponse({"written": written_name, "by": AGENT}, 201)


class _LifespanRouter:
    """Sends lifespan events to the application itself, and all requests to the guard of the application."""

    def __init__(self, app: ASGIApp, guarded_app: ASGIApp) -> None:
        self._app = app
        self._guarded = guarded_app

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        await (self._app if scope["type"] == "lifespan" else self._guarded)(scope, receive, send)


async def _body(request: Request) -> bytes:
    """Return the body of a request.

    Raises:
        HTTPException: the body is too long, or takes too long.
    """
    body = bytearray()
    try:
        async with asyncio.timeout(BODY_TIMEOUT_S):
            async for chunk in request.stream():
                body += chunk
                if len(body) > MOST_BYTES:
                    raise HTTPException(413, f"the body is longer than {MOST_BYTES} bytes", {"connection": "close"})
    except TimeoutError:
        raise HTTPException(408, "the body took too long; send it again", {"connection": "close"}) from None
    except ClientDisconnect:
        raise HTTPException(400, "the connection ended before the body was complete") from None
    return bytes(body)


async def _error_response(_: Request, error: Exception) -> Response:
    """Return a response with the reason of an error, such as a missing permission or an invalid request."""
    match error:
        case HTTPException():
            return JSONResponse({"error": error.detail}, error.status_code, error.headers)
        case BadRequestError():
            return JSONResponse({"error": str(error)}, 400)
        case BusyError() | TooManyStreamsError():
            return JSONResponse({"error": str(error)}, 503, {"retry-after": "5"})
        case _:
            return JSONResponse({"error": str(error), "by": AGENT}, 409)
