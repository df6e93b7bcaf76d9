"""What the users of a network may request. The transport has authenticated the user of each session."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass

from codra_dsl.runtime.remote.protocol import AGENT_REQUESTS, NotPermittedError, Request
from codra_dsl.runtime.values.declarations import MAIN, OPERATOR

_QUESTIONS = frozenset(
    {
        "hello",
        "keep",
        "leave",
        "describe",
        "get",
        "why",
        "obstacle",
        "subscribe",
        "unsubscribe",
        "declare",
        "withdraw",
        "expect",
        "decide",
        "preview",
        "found",
        "graph",
    }
)
_OF_HOSTS = frozenset({"attach", "evidence", "ended"})
_OF_OPERATORS = frozenset({"override", "clear_override"})
_OF_AGENTS = frozenset(AGENT_REQUESTS) - {"graph"}


@dataclass(frozen=True, slots=True, kw_only=True)
class Permissions:
    """The requests that a user may make.

    Every user may declare, ask and read the knowledge graph. Only the main execution sets variables in its own name and
    runs skills, only the operator overrides, only a host attaches itself, and only an agent writes in its own name.

    Attributes:
        user: the user of the session.
        hosts: the hosts of the spec, each of which is a user.
        agents: the agents of the spec, each of which is a user.
    """

    user: str
    hosts: Collection[str] = ()
    agents: Collection[str] = ()

    def check(self, request: Request) -> None:
        """Check that the user may make a request.

        Raises:
            NotPermittedError: if the user may not.
        """
        if not self._permits(request):
            raise NotPermittedError(f"user {self.user!r} may not request {_described(request)}")

    def _permits(self, request: Request) -> bool:
        ask, fields = request.ask, request.fields
        if ask in _OF_HOSTS:
            return self.user in self.hosts and fields.get("host", self.user) == self.user
        if ask in _OF_OPERATORS:
            return self.user == OPERATOR
        if ask in _OF_AGENTS:
            return self.user in self.agents and fields.get("agent", self.user) == self.user
        if ask == "set" and "agent" in fields:
            return self.user in self.agents and fields["agent"] == self.user
        writes = "value" in fields or ask not in _QUESTIONS
        return self.user == MAIN or not writes


def _described(request: Request) -> str:
    if request.ask == "set" and "agent" in request.fields:
        return f"`set` as agent {request.fields['agent']!r}"
    if request.ask == "enter":
        return f"`enter` as agent {request.fields['agent']!r}"
    if request.ask == "attach":
        return f"`attach` as host {request.fields['host']!r}"
    return f"`{request.ask}`" + (" with a value" if request.ask in ("declare", "found") else "")
