"""What the page answers to strangers: nothing.

It has no password, since it is served to this machine only. So a browser must not be made to speak for a page of
somebody else: the name by which it came must be this machine's (a name that an outsider controls may lead here, which
is DNS rebinding), and whatever writes must come from the page itself (or else it is cross-site request forgery).
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
"""Of every answer: nothing comes from elsewhere, nobody else may show it, and nothing is kept."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Refused:
    """Why a request is not looked at."""

    status: int
    error: str


class Guard:
    """Stands before an application."""

    def __init__(self, app: ASGIApp, port: int) -> None:
        """Let through what comes to this machine by its own name, on this port."""
        self._app = app
        self._hosts = frozenset(f"{name}:{port}" for name in ("127.0.0.1", "localhost"))

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer a request, or let the application answer it."""
        if scope["type"] != "http":
            if scope["type"] == "websocket":
                await send({"type": "websocket.close"})
            return

        async def send_guarded(message: Message) -> None:
            if message["type"] == "http.response.start":
                own = [(name.encode(), text.encode()) for name, text in HEADERS.items()]
                message = {**message, "headers": [*message["headers"], *own]}
            await send(message)

        refused = self._refused(scope["method"], Headers(scope=scope))
        if refused is None:
            await self._app(scope, receive, send_guarded)
        else:
            answer = JSONResponse({"error": refused.error}, refused.status, {"connection": "close"})
            await answer(scope, receive, send_guarded)

    def _refused(self, method: str, headers: Headers) -> Refused | None:
        hosts = headers.getlist("host")
        if len(hosts) != 1 or hosts[0] not in self._hosts:
            return Refused(status=421, error=f"this page is at {' and '.join(sorted(self._hosts))} alone")
        if method in ("GET", "HEAD"):
            return None
        if headers.getlist("origin") != [f"http://{hosts[0]}"]:
            return Refused(status=403, error="only the page itself may ask for this")
        if headers.get("content-type", "").partition(";")[0].strip().lower() != "application/json":
            return Refused(status=415, error="the body is to be application/json")
        return None
