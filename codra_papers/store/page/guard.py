"""The page's protection against requests from other sites.

The page has no password, because it is served to this computer only. But other sites must not be able to send orders
through somebody's browser. So the host name of a request must be that of this computer. This protects against DNS
rebinding, where a name controlled by an outsider resolves to this computer. A request that writes must also come from
the page itself. This protects against cross-site request forgery.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from starlette.datastructures import Headers
from starlette.responses import JSONResponse
from starlette.types import ASGIApp, Message, Receive, Scope, Send

HEADERS: Mapping[str, str] = {
    "content-security-policy": (
        "default-src 'none'; script-src 'self'; style-src 'self'; connect-src 'self'; img-src 'self'; "
        "base-uri 'none'; form-action 'none'; frame-ancestors 'none'"
    ),
    "x-content-type-options": "nosniff",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
}
"""Headers of every answer: no content from other sites, no embedding in other sites, no caching."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rejection:
    """The reason why a request is rejected."""

    status: int
    error: str


class Guard:
    """Middleware that rejects requests from other sites."""

    def __init__(self, app: ASGIApp, port: int) -> None:
        """Accept only requests to this computer's own name on this port."""
        self._app = app
        self._hosts = frozenset(f"{name}:{port}" for name in ("127.0.0.1", "localhost"))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Reject a request, or pass it to the application."""
        if scope["type"] != "http":
            if scope["type"] == "websocket":
                await send({"type": "websocket.close"})
            return

        async def send_with_headers(message: Message) -> None:
            if message["type"] == "http.response.start":
                own_headers = [(name.encode(), text.encode()) for name, text in HEADERS.items()]
                message = {**message, "headers": [*message["headers"], *own_headers]}
            await send(message)

        rejection = self._rejection(scope["method"], Headers(scope=scope))
        if rejection is None:
            await self._app(scope, receive, send_with_headers)
        else:
            answer = JSONResponse({"error": rejection.error}, rejection.status, {"connection": "close"})
            await answer(scope, receive, send_with_headers)

    def _rejection(self, method: str, headers: Headers) -> Rejection | None:
        hosts = headers.getlist("host")
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return Rejection(status=421, error=f"unknown host; open this page at {' or '.join(sorted(self._hosts))}")
        if method in ("GET", "HEAD"):
            return None
        if headers.getlist("origin") != [f"http://{hosts[0]}"]:
            return Rejection(status=403, error="only the page itself may send this request")
        if headers.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
            return Rejection(status=415, error="the content type must be application/json")
        return None
