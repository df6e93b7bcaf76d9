"""The client of a context manager, for a main execution in another process."""

from __future__ import annotations

import contextlib
import itertools
import logging
import math
import os
import queue
import threading
from collections.abc import Callable, Iterable, Iterator, Mapping
from concurrent.futures import Future
from functools import partial
from types import ModuleType
from typing import Any, Self, TypeVar

from codra_dsl.isolation.error_text import type_name
from codra_dsl.runtime.callbacks import log_raised
from codra_dsl.runtime.clock import Clock
from codra_dsl.runtime.forks import new_lock
from codra_dsl.runtime.remote.agents.remote_knowledge import RemoteKnowledge, digest_of
from codra_dsl.runtime.remote.endpoints import connect
from codra_dsl.runtime.remote.json_lines import Address
from codra_dsl.runtime.remote.links import INHERITED_TEXT
from codra_dsl.runtime.remote.protocol import (
    VERSION,
    NotPermittedError,
    PlainData,
    error_of,
    plain_value,
    preview_of,
    reading_of,
    type_of,
)
from codra_dsl.runtime.remote.session import LEASE_S
from codra_dsl.runtime.remote.zenoh_session import NetworkAddress
from codra_dsl.runtime.values.cell import Reading
from codra_dsl.runtime.values.model import ValueType, unbox
from codra_dsl.runtime.values.previews import PreviewAnswer

Answer = TypeVar("Answer")
Callback = Callable[[Reading[Any]], None]

JOIN_WAIT_S = 25.0
"""How much longer than for another answer a program waits for the graph, which can be large."""

_NO_LIMITS = (("max_age_s", math.inf), ("since_s", -math.inf))

_LOGGER = logging.getLogger(__name__)


class RemoteSkill:
    """A skill in progress."""

    def __init__(self, send_request: Callable[[str], object]) -> None:
        self._send_request = send_request

    @contextlib.contextmanager
    def acting(self) -> Iterator[None]:
        """Act: the variables that the skill changes are unknown until there is newer evidence for them.

        The expectations of the skill count from the beginning of this `with` statement.
        """
        self._send_request("act")
        try:
            yield
        finally:
            with contextlib.suppress(ConnectionError):  # the session is lost anyway; do not hide the program's error
                self._send_request("acted")


class RemoteContext:
    """Sends requests to a context manager that listens at an address.

    The declarations of the client are withdrawn when the client is closed or its process dies. Methods behave like
    those of `ContextManager` and raise the same errors; they also raise ConnectionError if the manager is gone or does
    not answer. Threads may share a client; callbacks run in a separate thread. A child process that the program creates
    by `os.fork` cannot use the client, and must connect itself.

    Attributes:
        hello: the manager's answer to `hello`: spec, party, lease, instant, variables and skills.
    """

    def __init__(
        self, address: Address | NetworkAddress, *, lease_s: float = LEASE_S, token: str | None = None
    ) -> None:
        """Connect.

        Args:
            address: the path of a Unix socket, a port of 127.0.0.1, or an address of a network.
            lease_s: how long declarations are kept after the last message of this process.
            token: the token of a manager at a port; by default it is read from the manager's token file.

        Raises:
            ConnectionError: if no manager listens at the address, its token cannot be read, or it has no place left.
            TokenError: if the manager has another token.
        """
        self._link = connect(address, token)
        self._program_id = os.getpid()
        self._lock = new_lock()
        self._numbers = itertools.count(1)
        self._futures: dict[int, Future[PlainData]] = {}
        self._callbacks: dict[int, Callback] = {}
        self._reading_notices: queue.Queue[PlainData | None] = queue.Queue()
        self._graph: RemoteKnowledge | None = None
        self._graph_lock = new_lock()
        self._end_event = threading.Event()
        self._end_reason = "the connection is closed"
        self._link.open(self._handle_message, self._end)
        threading.Thread(target=self._call_back, name="codra-client", daemon=True).start()
        token_field = {} if self._link.token is None else {"token": self._link.token}
        try:
            self.hello = self._ask("hello", lease_s=lease_s, **token_field)
        except BaseException:
            self._end("the manager refused the connection")
            raise
        period_s = min(lease_s, self._link.response_timeout_s) / 4
        threading.Thread(target=self._keep_alive, args=(period_s,), name="codra-client", daemon=True).start()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Withdraw all declarations, and disconnect. In a fork of the program, only close the inherited socket."""
        if os.getpid() != self._program_id:
            self._link.close()
            return
        with contextlib.suppress(ConnectionError, RuntimeError):
            self._ask("leave")
        self._end("the connection is closed")

    def declare(self, name: str, value: object = None) -> None:
        """Add a variable to C_E(t) (P1, Equation 4)."""
        self._ask("declare", variable=name, **({} if value is None else {"value": plain_value(value)}))

    def withdraw(self, name: str) -> None:
        """Withdraw the declaration of a variable."""
        self._ask("withdraw", variable=name)

    def expect(self, *skills: str) -> None:
        """Announce the skills that come next."""
        self._ask("expect", skills=list(skills))

    @contextlib.contextmanager
    def skill(self, name: str) -> Iterator[RemoteSkill]:
        """Run a skill; the variables that it previews and monitors are declared until it ends."""
        number = self._ask("begin", skill=name)["number"]
        try:
            yield RemoteSkill(lambda what: self._ask(what, number=number))
        finally:
            with contextlib.suppress(ConnectionError):
                self._ask("finish", number=number)

    def describe(self, name: str) -> ValueType:
        """Return the type of a variable, with its unit, range and members."""
        return type_of(self._ask("describe", variable=name)["type"])

    def get(self, name: str) -> Reading[Any]:
        """Return the present reading of a variable."""
        return reading_of(self._ask("get", variable=name)["reading"])

    def why(self, name: str) -> str:
        """Return the explanation of a variable, or of another element that `ContextManager.why` explains."""
        return str(self._ask("why", name=name)["text"])

    def obstacle(self, name: str) -> str:
        """Return why no algorithm of a variable can look now; empty if one can look."""
        return str(self._ask("obstacle", variable=name)["obstacle"])

    def set(self, name: str, value: object, *, evidence_s: float | None = None, agent: str | None = None) -> None:
        """Write a variable as the main execution, or as an agent."""
        optional_fields = {"evidence_s": evidence_s, "agent": agent}
        self._ask(
            "set",
            variable=name,
            value=plain_value(value),
            **{key: content for key, content in optional_fields.items() if content is not None},
        )

    def override(self, name: str, value: object, *, for_s: float, reason: str) -> None:
        """Give a variable a value as the operator, or make it unknown if `value` is None or NaN, for some time."""
        content = plain_value(value)
        value_field = {} if content is None else {"value": content}
        self._ask("override", variable=name, for_s=for_s, reason=reason, **value_field)

    def clear_override(self, name: str) -> None:
        """End the override of a variable, if there is one."""
        self._ask("clear_override", variable=name)

    def decide(
        self,
        name: str,
        otherwise: Callable[[], Answer],
        *,
        max_age_s: float = math.inf,
        since_s: float = -math.inf,
        wait_up_to_s: float = 0.0,
        shadow: bool = False,
    ) -> Any | Answer:
        """Answer a decision from context.

        If context has no answer, or the manager is gone, call `otherwise`, the program's sequential perception. If
        `otherwise` returns NaN, it found no value, and this method returns None.
        """
        wait_up_to_s = min(wait_up_to_s, threading.TIMEOUT_MAX)
        options = {"max_age_s": max_age_s, "since_s": since_s, "wait_up_to_s": wait_up_to_s, "shadow": shadow}
        fields = _fields_of(options)
        try:
            answer = self._ask("decide", wait_up_to_s, variable=name, **fields)
        except ConnectionError as error:
            _LOGGER.warning("the decision on %s falls back to sequential perception: %s", name, error)
            value = otherwise()
            return None if plain_value(value) is None else value
        if answer["answered"]:
            return reading_of(answer["reading"]).content
        looked_value, result = self._look(answer["decision"], otherwise)
        with contextlib.suppress(ConnectionError):
            try:
                self._ask("found", **result)
            except NotPermittedError as error:  # only the main execution gives context a value
                self._ask("found", decision=answer["decision"], raised=type_name(error))
        return looked_value

    def preview(
        self,
        skill: str,
        otherwise: Callable[[str], object] | None = None,
        *,
        max_age_s: float = math.inf,
        since_s: float = -math.inf,
        wait_up_to_s: float = 0.0,
    ) -> PreviewAnswer:
        """Answer the whole preview of a skill, as `ContextManager.preview` does.

        If the manager is gone, the preview raises ConnectionError: only the manager knows the conditions.
        """
        wait_up_to_s = min(wait_up_to_s, threading.TIMEOUT_MAX)
        options = {"max_age_s": max_age_s, "since_s": since_s, "wait_up_to_s": wait_up_to_s}
        answer = self._ask("preview", wait_up_to_s, skill=skill, looks=otherwise is not None, **_fields_of(options))
        while answer["look"] and otherwise is not None:
            (variable,) = answer["look"]
            _, result = self._look(answer["decision"], partial(otherwise, variable))
            answer = self._ask("found", **result)
        return preview_of(answer["preview"])

    def subscribe(self, names: str | Iterable[str], callback: Callback) -> Callable[[], None]:
        """Call `callback` with the present readings of some variables, then whenever a value or a reason changes.

        Returns:
            A function that ends the subscription.
        """
        future = Future[PlainData]()
        future.add_done_callback(
            lambda answered_future: self._register_callback(answered_future, callback)
        )  # the callback is registered before the first reading can arrive
        variables = [names] if isinstance(names, str) else list(names)
        with self._lock:
            request_number = self._send("subscribe", {"variables": variables}, future)
        number = self._await_answer(request_number, future, self._link.response_timeout_s)["subscription"]
        return lambda: self._unsubscribe(number)

    def knowledge(self, package: ModuleType, *, clock: Clock | None = None) -> Any:
        """Return the knowledge graph of the manager, with the methods of `Knowledge` for reading and for agents.

        The result is a copy that each change of the graph reaches, so reading needs no message. Every later call
        returns the same object. It raises ConnectionError when the connection has ended, or when the manager has not
        answered for the duration of the lease. Annotate it with the class of the package to let mypy check your
        program: `knowledge: ShopKnowledge = manager.knowledge(shop)`.

        Args:
            package: the generated package of the spec, which must be that of the manager.
            clock: runs the callbacks, in real time; by default a new `WallClock`.

        Raises:
            LookupError: if the spec declares no knowledge graph.
            ValueError: if the manager has another version of the spec.
        """
        with self._graph_lock:
            if self._graph is None:
                self._graph = graph = RemoteKnowledge(
                    package,
                    self._ask,
                    lease_s=self.hello["lease_s"],
                    end_reason=self._reason_of_end,
                    own_clock=clock,
                )
                try:
                    graph.compare_clocks()
                    graph.join(self._ask("graph", JOIN_WAIT_S, digest=digest_of(package))["graph"])
                except BaseException:
                    self._graph = None
                    graph.end()
                    raise
            return self._graph

    def wait_until_lost(self, timeout_s: float = math.inf) -> str:
        """Wait until the connection ends, or the timeout is over; return why it has ended, or an empty text."""
        self._end_event.wait(min(timeout_s, threading.TIMEOUT_MAX))
        return self._reason_of_end()

    def _look(self, decision: int, otherwise: Callable[[], Answer]) -> tuple[Answer | None, PlainData]:
        """Return the value from the program's own look, and the fields of the request that reports it."""
        try:
            value = otherwise()
            content = plain_value(value)
        except BaseException as error:
            with contextlib.suppress(ConnectionError):
                self._ask("found", decision=decision, raised=type_name(error))
            raise
        if content is None:
            return None, {"decision": decision}
        return value, {"decision": decision, "value": content}

    def _ask(self, ask: str, wait_s: float = 0.0, /, **fields: object) -> PlainData:
        future = Future[PlainData]()
        with self._lock:
            number = self._send(ask, fields, future)
        return self._await_answer(number, future, wait_s + self._link.response_timeout_s)

    def _send(self, ask: str, fields: PlainData, future: Future[PlainData]) -> int:
        if os.getpid() != self._program_id:
            raise ConnectionError(INHERITED_TEXT)
        number = next(self._numbers)
        plain_fields = {key: unbox(field) for key, field in fields.items()}
        if self._end_event.is_set():
            raise ConnectionError(self._end_reason)
        self._futures[number] = future
        try:
            self._link.send({"codra": VERSION, "id": number, "ask": ask, **plain_fields})
        except BaseException:
            del self._futures[number]
            raise
        return number

    def _await_answer(self, number: int, future: Future[PlainData], wait_s: float) -> PlainData:
        try:
            return future.result(min(wait_s, threading.TIMEOUT_MAX))
        except TimeoutError:
            self._futures.pop(number, None)
            raise ConnectionError(f"the manager did not answer within {wait_s:g} s") from None

    def _handle_message(self, message: Any) -> None:
        if message.get("notice") in ("lease_over", "closed"):
            raise OSError(message["message"])
        if message.get("notice") == "change":
            if self._graph is not None:
                self._graph.receive(message)
        elif message.get("notice") == "reading":
            self._reading_notices.put(message)
        elif (future := self._futures.pop(message["id"], None)) is None:
            return
        elif "error" in message:
            future.set_exception(error_of(message["error"]))
        else:
            future.set_result(message["answer"])

    def _end(self, reason: str) -> None:
        with self._lock:
            if self._end_event.is_set():
                return
            self._end_reason = reason
            self._end_event.set()
            open_futures, self._futures = self._futures, {}
        self._reading_notices.put(None)
        for future in open_futures.values():
            future.set_exception(ConnectionError(reason))
        if self._graph is not None:
            self._graph.end()
        self._link.close()

    def _keep_alive(self, period_s: float) -> None:
        while not self._end_event.wait(min(period_s, threading.TIMEOUT_MAX)):
            try:
                self._compare_clocks()
            except ConnectionError as error:
                self._end(str(error))

    def _compare_clocks(self) -> None:
        """Renew the lease, and compare the clocks if the program has the manager's graph."""
        if self._graph is None:
            self._ask("keep")
        else:
            self._graph.compare_clocks()

    def _reason_of_end(self) -> str:
        return self._end_reason if self._end_event.is_set() else ""

    def _register_callback(self, future: Future[PlainData], callback: Callback) -> None:
        if future.exception() is None:
            self._callbacks[future.result()["subscription"]] = callback

    def _unsubscribe(self, number: int) -> None:
        self._callbacks.pop(number, None)
        with contextlib.suppress(ConnectionError, ValueError):
            self._ask("unsubscribe", subscription=number)

    def _call_back(self) -> None:
        while (message := self._reading_notices.get()) is not None:
            callback = self._callbacks.get(message["subscription"])
            if callback is not None:
                try:
                    callback(reading_of(message["reading"]))
                except BaseException as error:  # noqa: BLE001 - errors of a callback are logged
                    log_raised(callback, error)


def _fields_of(options: Mapping[str, object]) -> PlainData:
    """Return only the options of a decision that set a limit, because a message cannot express an infinite limit."""
    return {key: option for key, option in options.items() if (key, option) not in _NO_LIMITS}
