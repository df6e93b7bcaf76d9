"""The picker's page over real sockets, while a shop is open: its writes, its views, and refused requests."""

from __future__ import annotations

import json
import random
import socket
from collections.abc import Callable, Iterator, Mapping
from concurrent.futures import ThreadPoolExecutor
from contextlib import ExitStack, closing
from dataclasses import replace
from http.client import HTTPConnection
from pathlib import Path
from typing import Any, TypeVar

import pytest

from codra_dsl.runtime import SimClock, member, real
from codra_dsl.runtime.knowledge import AgentModel, AttributeModel, Knowledge, KnowledgeModel, Phase, by
from codra_papers.experiments.pacing import Beat
from codra_papers.store.knowledge import store_knowledge
from codra_papers.store.page.app import MOST_WAITING_ORDERS
from codra_papers.store.page.connections import MOST_CONNECTIONS, MOST_REQUESTS_AT_ONCE
from codra_papers.store.page.desk import MOST_WAITING, BusyError, Desk
from codra_papers.store.page.requests import MOST_BYTES
from codra_papers.store.page.server import MOST_ACCEPTED, PageServer
from codra_papers.store.page.streaming import MOST_STREAMS
from codra_papers.store.simulator.situations import Situation, StoreSettings
from codra_papers.store.simulator.store import Store

ResultT = TypeVar("ResultT")
MOST_STEPS = 20_000


class OpenShop:
    """A shop with its page. Its time passes while `during` waits for another thread."""

    def __init__(self, model: KnowledgeModel | None = None) -> None:
        self._stack = ExitStack()
        self.clock = SimClock()
        knowledge = Knowledge(model or store_knowledge(), clock=self.clock)
        self.store = Store(self.clock, StoreSettings(situation=Situation.QUIET), knowledge)
        self.page = self._stack.enter_context(PageServer(self.store))
        self._pool = self._stack.enter_context(ThreadPoolExecutor(4))
        Beat(self.clock, None, self.page.desk.serve)

    def close(self) -> None:
        self._stack.close()

    def during(self, act: Callable[[], ResultT]) -> ResultT:
        future = self._pool.submit(act)
        for _ in range(MOST_STEPS):
            if future.done():
                break
            self.clock.sleep(0.1)
        return future.result(timeout=10.0)

    def ask(self, method: str, path: str, body: bytes = b"", **headers: str) -> tuple[int, Mapping[str, Any]]:
        """Send a request as the page does. `headers` override those of the page; an empty header is omitted."""
        own_host = f"127.0.0.1:{self.page.port}"
        usual_headers = {"host": own_host, "origin": f"http://{own_host}", "content-type": "application/json"}
        sent_headers = usual_headers | {name.replace("_", "-"): text for name, text in headers.items()}

        def act() -> tuple[int, Mapping[str, Any]]:
            with closing(HTTPConnection("127.0.0.1", self.page.port, timeout=10.0)) as connection:
                connection.request(method, path, body, {name: text for name, text in sent_headers.items() if text})
                response = connection.getresponse()
                body_bytes = response.read()
                is_json = response.headers.get_content_type() == "application/json"
                return response.status, json.loads(body_bytes) if is_json else {}

        return self.during(act)

    def say(self, path: str, **fields: object) -> tuple[int, Mapping[str, Any]]:
        return self.ask("POST", path, json.dumps(fields).encode())

    def written_counts(self) -> tuple[int, bool]:
        """Return the number of orders, and whether a load is known: everything that a page can write."""
        snapshot = self.store.knowledge.snapshot()
        return len(snapshot.nodes("order")), snapshot.get("robot", "container_load").known

    def stream(self, receive_bytes: int | None = None) -> socket.socket:
        """Open a stream of events as a browser does."""
        stream = socket.socket()
        if receive_bytes is not None:
            stream.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, receive_bytes)
        stream.settimeout(10.0)
        stream.connect(("127.0.0.1", self.page.port))
        stream.sendall(f"GET /events HTTP/1.1\r\nHost: 127.0.0.1:{self.page.port}\r\n\r\n".encode())
        return stream


@pytest.fixture
def shop() -> Iterator[OpenShop]:
    opened = OpenShop()
    yield opened
    opened.close()


def read_until(stream: socket.socket, is_complete: Callable[[bytes], bool]) -> bytes:
    received_bytes = b""
    while not is_complete(received_bytes):
        chunk = stream.recv(65_536)
        assert chunk, "the stream ended"
        received_bytes += chunk
    return received_bytes


# Writes


@pytest.mark.parametrize(
    ("order_fields", "of_area", "to_area"),
    [
        ({"kind": "provide", "area": "area_2"}, "supply", "area_2"),
        ({"kind": "collect", "area": "area_3"}, "area_3", "delivery"),
        ({"kind": "move", "area": "area_3", "to": "area_1"}, "area_3", "area_1"),
    ],
)
def test_the_agent_picker_page_writes_an_order_into_the_graph(
    shop: OpenShop, order_fields: Mapping[str, str], of_area: str, to_area: str
) -> None:
    status, answer = shop.say("/orders", **order_fields)

    snapshot = shop.store.knowledge.snapshot()
    (order,) = snapshot.nodes("order")
    assert (status, answer) == (201, {"written": order.name, "by": "picker_page"})
    assert (order.writer, snapshot.get(order.name, "kind").value) == ("picker_page", order_fields["kind"])
    assert snapshot.has_edge(order.name, "of_area", of_area)
    assert snapshot.has_edge(order.name, "to_area", to_area)


def test_the_load_of_a_container_is_written_into_the_graph(shop: OpenShop) -> None:
    status, _ = shop.say("/load", load="full")

    reading = shop.store.knowledge.get("robot", "container_load")
    assert (status, reading.value, reading.source) == (201, "full", "picker_page")


def test_an_order_is_taken_back_once_and_only_if_there_is_one(shop: OpenShop) -> None:
    assert shop.say("/orders", kind="provide", area="area_2")[0] == 201

    assert shop.say("/cancel", order="order_1") == (201, {"written": "order_1.cancelled", "by": "picker_page"})
    assert shop.store.knowledge.get("order_1", "cancelled").value is True
    assert shop.say("/cancel", order="order_2") == (409, {"error": "there is no order 'order_2'", "by": "picker_page"})
    assert shop.say("/cancel", order=7)[0] == 400
    shop.store.knowledge.as_agent("mission").set("order_1", "state", "done")
    assert shop.say("/cancel", order="order_1")[1]["error"] == "order_1 is done already"


def test_a_refused_write_names_the_agents_that_may_write() -> None:
    model = store_knowledge()
    robot = next(node_type for node_type in model.node_types if node_type.name == "robot")
    attributes = tuple(
        replace(attribute, sources=by("mission")) if attribute.name == "container_load" else attribute
        for attribute in robot.attributes
    )
    types = tuple(
        replace(robot, attributes=attributes) if node_type is robot else node_type for node_type in model.node_types
    )
    shop = OpenShop(replace(model, node_types=types))
    with closing(shop):
        status, answer = shop.say("/load", load="full")
        _, view = shop.ask("GET", "/view")

    assert status == 409
    assert answer == {
        "error": "'robot.container_load' may be written by mission, not by 'picker_page'",
        "by": "picker_page",
    }
    assert [(refusal["agent"], refusal["why"]) for refusal in view["refusals"]] == [("picker_page", answer["error"])]


def test_too_many_waiting_orders_are_refused(shop: OpenShop) -> None:
    statuses = [shop.say("/orders", kind="provide", area="area_1")[0] for _ in range(MOST_WAITING_ORDERS + 1)]

    assert statuses == [201] * MOST_WAITING_ORDERS + [409]
    assert shop.written_counts()[0] == MOST_WAITING_ORDERS


# Refused requests


@pytest.mark.parametrize(
    ("headers", "status"),
    [
        ({"host": "shop.example"}, 421),
        ({"host": "127.0.0.1"}, 421),
        ({"host": "127.0.0.1:1"}, 421),
        ({"origin": "http://shop.example"}, 403),
        ({"origin": "null"}, 403),
        ({"origin": ""}, 403),
        ({"content_type": "text/plain"}, 415),
        ({"content_type": "application/x-www-form-urlencoded"}, 415),
        ({"content_type": ""}, 415),
    ],
)
def test_requests_of_other_sites_are_refused(shop: OpenShop, headers: Mapping[str, str], status: int) -> None:
    refused_status, answer = shop.ask("POST", "/load", b'{"load": "full"}', **headers)

    assert (refused_status, "error" in answer) == (status, True)
    assert shop.written_counts() == (0, False)


def test_requests_with_another_host_name_are_refused(shop: OpenShop) -> None:
    for path in ("/", "/view", "/events", "/page.js"):
        assert shop.ask("GET", path, host="shop.example:80")[0] == 421


@pytest.mark.parametrize(
    ("path", "body", "status"),
    [
        ("/orders", b"", 400),
        ("/orders", b"[]", 400),
        ("/orders", b"\xff\xfe", 400),
        ("/orders", b"[" * 1000, 400),
        ("/orders", b'{"kind": "provide"}', 400),
        ("/orders", b'{"kind": "provide", "area": "delivery"}', 400),
        ("/orders", b'{"kind": "provide", "area": ["area_1"]}', 400),
        ("/orders", b'{"kind": "steal", "area": "area_1"}', 400),
        ("/orders", b'{"kind": "move", "area": "area_1", "to": "area_1"}', 400),
        ("/orders", b'{"kind": "provide", "area": "area_1", "state": "done"}', 400),
        ("/load", b'{"load": true}', 400),
        ("/load", b'{"load": "full"}' + b" " * MOST_BYTES, 413),
        ("/nowhere", b"{}", 404),
        ("/view", b"{}", 405),
    ],
)
def test_invalid_requests_do_not_write(shop: OpenShop, path: str, body: bytes, status: int) -> None:
    refused_status, answer = shop.ask("POST", path, body)

    assert (refused_status, bool(answer["error"])) == (status, True)
    assert shop.written_counts() == (0, False)


@pytest.mark.parametrize("method", ["PUT", "DELETE", "PATCH", "OPTIONS", "TRACE"])
def test_other_methods_are_refused(shop: OpenShop, method: str) -> None:
    assert shop.ask(method, "/load", b'{"load": "full"}')[0] == 405
    assert shop.written_counts() == (0, False)


def test_random_bytes_do_not_harm_the_server(shop: OpenShop) -> None:
    chance = random.Random(1)
    beginnings = (
        b"",
        b"POST /load HTTP/1.1\r\n",
        b"GET / HTTP/1.1\r\nHost: ",
        b"POST /orders HTTP/1.1\r\nContent-Length: -",
    )

    def send() -> None:
        for number in range(200):
            with socket.create_connection(("127.0.0.1", shop.page.port), timeout=10.0) as connection:
                connection.sendall(beginnings[number % 4] + chance.randbytes(chance.randrange(1, 3000)))

    shop.during(send)

    assert shop.written_counts() == (0, False)
    assert any(
        shop.ask("GET", "/")[0] == 200 for _ in range(100)
    )  # first the server must notice that all clients have gone


def test_answers_forbid_content_from_other_sites(shop: OpenShop) -> None:
    def headers() -> Mapping[str, str]:
        with closing(HTTPConnection("127.0.0.1", shop.page.port, timeout=10.0)) as connection:
            connection.request("GET", "/")
            response = connection.getresponse()
            assert b"://" not in response.read().replace(b"http://www.w3.org/2000/svg", b"")
            return dict(response.headers.items())

    response_headers = shop.during(headers)

    assert response_headers["content-security-policy"].startswith("default-src 'none'; script-src 'self';")
    assert "access-control-allow-origin" not in response_headers


# Views


def test_a_view_shows_the_robots_knowledge_and_not_the_truth(shop: OpenShop) -> None:
    shop.clock.sleep(1.0)
    _, view = shop.ask("GET", "/view")

    assert view["containers"] == [], "the robot has not looked for the existing ones"
    assert len(shop.store.world.state().containers_on_floor()) == 2
    assert view["robot"]["x_m"] == pytest.approx(8.2, abs=0.2)
    assert {task["stage"] for task in view["tasks"]} == {""}
    assert (view["metrics"], view["weights"], view["courses"]) == ([], [], [])


def model_with_loop() -> KnowledgeModel:
    """Return the shop's declarations with the attributes that agents of a loop write."""
    model = store_knowledge()
    attributes = (
        AttributeModel(name="safety", type=real(0, 1), sources=by("analysis")),
        AttributeModel(name="weight_of_deliver", type=real(0, 1), sources=by("analysis")),
        AttributeModel(name="course", type=member("deliver", "start"), sources=by("adaptation")),
    )
    return replace(
        model,
        nodes=tuple(replace(node, attributes=attributes) if node.name == "base" else node for node in model.nodes),
        agents=(*model.agents, AgentModel(name="analysis", phase=Phase.ANALYSE)),
    )


def test_metrics_weights_and_the_course_are_shown_where_agents_write_them() -> None:
    shop = OpenShop(model_with_loop())
    with closing(shop):
        with shop.store.knowledge.as_agent("analysis") as analysis:
            analysis.set("base", "safety", 0.5)
            analysis.set("base", "weight_of_deliver", 0.25)
        _, view = shop.ask("GET", "/view")

    assert [(metric["label"], metric["value"]) for metric in view["metrics"]] == [("Safety", 0.5)]
    assert [(weight["label"], weight["value"]) for weight in view["weights"]] == [("Deliver", 0.25)]
    assert [(course["value"], course["reason"]) for course in view["courses"]] == [(None, "Never observed")]
    assert [phase["wrote_s"] for phase in view["loop"] if phase["phase"] == "analyse"] == [0.0]


def test_a_browser_gets_a_new_view_after_a_change(shop: OpenShop) -> None:
    with closing(shop.stream()) as stream:
        shop.during(lambda: read_until(stream, lambda received_bytes: b'"orders":[]' in received_bytes))
        shop.say("/orders", kind="provide", area="area_4")
        shop.during(lambda: read_until(stream, lambda received_bytes: b'"to_area":"area_4"' in received_bytes))


def test_a_browser_that_does_not_read_delays_neither_the_shop_nor_other_browsers(shop: OpenShop) -> None:
    with closing(shop.stream(receive_bytes=2048)) as slow_stream, closing(shop.stream()) as quick_stream:
        views = shop.during(
            lambda: read_until(quick_stream, lambda received_bytes: received_bytes.count(b"\ndata: ") > 30)
        )
        shop.say("/load", load="loading")
        shop.during(lambda: read_until(quick_stream, lambda received_bytes: b'"value":"loading"' in received_bytes))
        shop.during(lambda: read_until(slow_stream, lambda received_bytes: b'"value":"loading"' in received_bytes))

    assert len(views) > 30 * 2048
    assert shop.store.knowledge.get("robot", "container_load").value == "loading"


def test_too_many_browsers_get_an_error(shop: OpenShop) -> None:
    with ExitStack() as stack:
        for _ in range(MOST_STREAMS):
            stream = stack.enter_context(closing(shop.stream()))
            shop.during(lambda stream=stream: read_until(stream, lambda received_bytes: b"data: " in received_bytes))  # type: ignore[misc]
        refused_status, answer = shop.ask("GET", "/events")

    assert (refused_status, answer) == (
        503,
        {"error": f"{MOST_STREAMS} browsers already follow this page; close one of them"},
    )


# Connections


def connect(shop: OpenShop, request: bytes = b"") -> socket.socket:
    connection = socket.create_connection(("127.0.0.1", shop.page.port), timeout=10.0)
    connection.sendall(request.replace(b"PORT", str(shop.page.port).encode()))
    return connection


SLOW_REQUESTS = {
    "silent": b"",
    "slow header": b"GET / HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nx-",
    "slow body": b"POST /load HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\nOrigin: http://127.0.0.1:PORT\r\n"
    b"Content-Type: application/json\r\nContent-Length: 1000\r\n\r\n{",
    "finished": b"GET /favicon.ico HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\n\r\n",
}


@pytest.mark.parametrize("kind", SLOW_REQUESTS)
def test_connections_that_wait_for_their_clients_keep_nobody_out(shop: OpenShop, kind: str) -> None:
    with ExitStack() as stack:
        for _ in range(2 * MOST_CONNECTIONS):
            stack.enter_context(connect(shop, SLOW_REQUESTS[kind]))
        for _ in range(3):
            assert shop.ask("GET", "/view")[0] == 200


def test_many_connections_at_once_leave_only_as_many_open_as_allowed(shop: OpenShop) -> None:
    before = len(list(Path("/proc/self/fd").iterdir()))
    with ExitStack() as stack:
        clients = [stack.enter_context(connect(shop)) for _ in range(4 * MOST_CONNECTIONS)]
        assert shop.ask("GET", "/view")[0] == 200
        shop.during(lambda: is_closed(clients[0]))
        assert len(list(Path("/proc/self/fd").iterdir())) - before - len(clients) <= MOST_CONNECTIONS + MOST_ACCEPTED


def is_closed(connection: socket.socket) -> bool:
    try:
        while connection.recv(65_536):
            pass
    except ConnectionResetError:
        pass
    return True


@pytest.mark.parametrize("kind", ["silent", "slow header", "finished"])
def test_a_connection_ends_if_its_client_sends_no_complete_header_in_time(
    shop: OpenShop, kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("codra_papers.store.page.connections.HEADER_S", 0.2)
    with connect(shop, SLOW_REQUESTS[kind]) as connection, closing(shop.stream()) as stream:

        def trickle() -> bool:
            try:
                for _ in range(5):
                    connection.sendall(b"y")
            except OSError:
                pass
            return is_closed(connection)

        assert shop.during(trickle if kind == "slow header" else lambda: is_closed(connection))
        shop.during(lambda: read_until(stream, lambda read: b"data: " in read))
        shop.say("/load", load="full")
        shop.during(lambda: read_until(stream, lambda read: b'"value":"full"' in read))


def test_many_requests_of_one_connection_are_answered_in_order_and_wait_for_others(
    shop: OpenShop, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("codra_papers.store.page.connections.REQUEST_PERIOD_S", 0.02)
    line = b"GET /nowhere%d HTTP/1.1\r\nHost: 127.0.0.1:PORT\r\n\r\n"
    requests = b"".join(line % number for number in range(2 * MOST_REQUESTS_AT_ONCE))
    with connect(shop, requests) as greedy:
        read = shop.during(
            lambda: read_until(greedy, lambda read: read.count(b"HTTP/1.1 404") == 2 * MOST_REQUESTS_AT_ONCE)
        )
        assert shop.ask("GET", "/view")[0] == 200
    assert read.count(b"HTTP/1.1") == 2 * MOST_REQUESTS_AT_ONCE


def test_a_connection_that_ends_while_its_requests_wait_does_no_harm(shop: OpenShop) -> None:
    with connect(shop, SLOW_REQUESTS["finished"] * 3 * MOST_REQUESTS_AT_ONCE) as greedy:
        shop.during(lambda: read_until(greedy, lambda read: read.count(b"HTTP/1.1 204") >= MOST_REQUESTS_AT_ONCE))
    assert shop.ask("GET", "/view")[0] == 200


def test_one_request_in_progress_too_many_gets_an_error(shop: OpenShop, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("codra_papers.store.page.connections.MOST_CONNECTIONS", 2)
    with ExitStack() as stack:
        for _ in range(2):
            stream = stack.enter_context(closing(shop.stream()))
            shop.during(lambda stream=stream: read_until(stream, lambda read: b"data: " in read))  # type: ignore[misc]
        assert shop.ask("GET", "/view") == (503, {"error": "too many requests are in progress; try again"})
    assert any(shop.ask("GET", "/view")[0] == 200 for _ in range(100))  # first the server must notice the ends


def test_the_page_ends_with_the_run_though_browsers_look_at_it() -> None:
    shop = OpenShop()
    with closing(shop.stream()) as stream:
        shop.during(lambda: read_until(stream, lambda received_bytes: b"data: " in received_bytes))
        shop.close()
        while stream.recv(65_536):
            pass
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.1", shop.page.port), timeout=10.0)


def test_it_listens_on_this_computer_only(shop: OpenShop) -> None:
    assert shop.page.url == f"http://127.0.0.1:{shop.page.port}/"
    with pytest.raises(ConnectionRefusedError):
        socket.create_connection(("127.0.0.2", shop.page.port), timeout=10.0)


# The desk


def test_the_desk_runs_waiting_calls_in_the_serving_thread_and_returns_their_results() -> None:
    desk, done = Desk(), []
    first, second = desk.ask(lambda: done.append("first")), desk.ask(lambda: 1 / 0)
    assert done == []

    desk.serve()

    assert (done, first.result()) == (["first"], None)
    assert isinstance(second.exception(), ZeroDivisionError)


def test_a_cancelled_call_is_not_run() -> None:
    desk, done = Desk(), []
    desk.ask(lambda: done.append("done")).cancel()

    desk.serve()

    assert done == []


def test_a_full_or_closed_desk_raises_an_error() -> None:
    desk = Desk()
    waiting_calls = [desk.ask(lambda: None) for _ in range(MOST_WAITING)]
    with pytest.raises(BusyError, match="too many"):
        desk.ask(lambda: None)

    desk.close()

    assert {str(future.exception()) for future in waiting_calls} == {"the run is over"}
    with pytest.raises(BusyError, match="over"):
        desk.ask(lambda: None)
