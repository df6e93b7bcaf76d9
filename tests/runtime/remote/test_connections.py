"""Connections that are silent, slow, greedy or foreign: each has limits, and the others are answered."""

from __future__ import annotations

import json
import os
import select
import socket
import stat
import threading
from collections.abc import Iterator
from contextlib import ExitStack
from pathlib import Path
from selectors import EVENT_READ
from typing import Any, BinaryIO

import pytest

from codra_dsl.runtime import ContextManager, WallClock
from codra_dsl.runtime.remote import RemoteContext, Server, TokenError
from codra_dsl.runtime.remote.connection import MAX_UNSENT_BYTES, Connection
from codra_dsl.runtime.remote.json_lines import MAX_LINE_BYTES
from codra_dsl.runtime.remote.server import MAX_CLOSED_CONNECTIONS, MAX_CONNECTIONS
from codra_dsl.runtime.remote.session import open_session
from codra_dsl.runtime.remote.token import token_file
from tests.runtime.door import GIVEN_NEAR, Door, Manager
from tests.runtime.remote.test_server import PATIENCE_S, eventually

HELLO = b'{"codra": 1, "id": 1, "ask": "hello", "lease_s": 60}\n'
DECLARE = b'{"codra": 1, "id": 2, "ask": "declare", "variable": "open"}\n'


@pytest.fixture
def codra() -> Iterator[Manager]:
    with (
        WallClock() as clock,
        ContextManager[str, str](GIVEN_NEAR, clock=clock, resources={"door": Door()}) as manager,
    ):
        manager.set("near", True)
        yield manager


@pytest.fixture
def server(codra: Manager, tmp_path: Path) -> Iterator[Server]:
    with Server(codra, tmp_path / "codra.sock") as opened:
        yield opened


@pytest.fixture
def port_server(codra: Manager, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Iterator[Server]:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "state"))
    with Server(codra) as opened:
        yield opened


class Peer:
    """A main execution that is written by hand."""

    def __init__(self, server: Server, *lines: bytes) -> None:
        is_port = isinstance(server.address, int)
        self.socket = socket.socket(socket.AF_INET if is_port else socket.AF_UNIX, socket.SOCK_STREAM)
        self.socket.settimeout(PATIENCE_S)
        self.socket.connect(("127.0.0.1", server.address) if is_port else str(server.address))
        self.stream: BinaryIO = self.socket.makefile("rb")
        self.socket.sendall(b"".join(lines))

    def __enter__(self) -> Peer:
        return self

    def __exit__(self, *_: object) -> None:
        self.stream.close()
        self.socket.close()

    def message(self) -> dict[str, Any]:
        return dict(json.loads(self.stream.readline()))

    def last_messages(self) -> list[dict[str, Any]]:
        """Return all messages until the connection ends."""
        return [json.loads(line) for line in self.stream]


def descriptor_count() -> int:
    return len(list(Path("/proc/self/fd").iterdir()))


# Peers that do not read


def test_requests_of_a_peer_that_does_not_read_wait_and_none_of_their_answers_is_lost(server: Server) -> None:
    request = json.dumps({"codra": 1, "id": "x" * 100, "ask": "keep"}).encode() + b"\n"
    with Peer(server, HELLO) as peer, RemoteContext(server.address) as other:
        peer.message()
        count, rest = flood(peer.socket, request * 100)
        assert count * 100 * len(request) < 16 * (MAX_UNSENT_BYTES + MAX_LINE_BYTES)
        assert other.get("near").value is True

        def send_rest() -> None:
            peer.socket.sendall(rest)
            peer.socket.shutdown(socket.SHUT_WR)

        sending = threading.Thread(target=send_rest)
        sending.start()
        answers = peer.last_messages()
        sending.join(PATIENCE_S)
    assert sum("answer" in answer for answer in answers) == count * 100


def flood(peer: socket.socket, lines: bytes) -> tuple[int, memoryview]:
    """Send the lines again and again, until the other side reads no more; return how often, and the unsent rest."""
    for count in range(10_000):
        rest = memoryview(lines)
        while rest:
            if not select.select([], [peer], [], 0.5)[1]:
                return count + 1, rest
            rest = rest[peer.send(rest, socket.MSG_DONTWAIT) :]
    return 10_000, memoryview(b"")


def test_a_subscriber_that_does_not_read_is_disconnected_with_the_reason(server: Server, codra: Manager) -> None:
    subscribe = b'{"codra": 1, "id": 3, "ask": "subscribe", "variables": ["near"]}\n'
    with Peer(server, HELLO, DECLARE, subscribe) as peer:
        eventually(lambda: "open" in codra.declared())
        value = [True]

        def is_withdrawn_after_changes() -> bool:
            for _ in range(100):
                value[0] = not value[0]
                codra.set("near", value[0])
            return "open" not in codra.declared()

        eventually(is_withdrawn_after_changes)
        *_, last_message = peer.last_messages()
    assert last_message == {
        "codra": 1,
        "notice": "closed",
        "message": "the main execution does not read its messages",
    }


def test_a_connection_that_had_to_drop_a_message_ends_even_if_the_peer_reads_again(codra: Manager) -> None:
    near, far = socket.socketpair()
    with near, far:
        near.setblocking(False)
        connection = Connection(near, codra.clock, lambda _, send: open_session(codra, send), lambda: None)
        far.sendall(HELLO)
        connection.take_turn(EVENT_READ)
        for _ in range(3):  # the third message does not fit
            connection.send({"text": "x" * (MAX_UNSENT_BYTES + 1)})
        reader = threading.Thread(target=lambda: [None for _ in iter(lambda: far.recv(1 << 16), b"")])
        reader.start()
        eventually(lambda: connection._flush() or not connection._unsent)
        connection.send({"text": "x"})
        connection.take_turn(0)
        near.shutdown(socket.SHUT_RDWR)
        reader.join(PATIENCE_S)

    assert connection.is_closed


# Peers that send nothing


@pytest.mark.parametrize("lines", [[b'{"codra": 1, "id": 1, "ask": "hello", "lease_s": 0.1}\n', DECLARE]])
def test_a_connection_ends_with_its_lease_and_its_descriptors_and_threads_are_released(
    server: Server, codra: Manager, lines: list[bytes]
) -> None:
    before = descriptor_count(), threading.active_count()
    peers = [Peer(server, *lines) for _ in range(20)]
    for peer in peers:
        with peer:
            *_, last_message = peer.last_messages()
            assert (last_message["notice"], last_message["message"]) == (
                "lease_over",
                "no message was received for 0.1 s",
            )
    eventually(lambda: (descriptor_count(), threading.active_count()) == before)
    assert codra.declared() == frozenset()


def test_a_connection_without_a_message_ends_after_the_usual_lease(
    server: Server, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("codra_dsl.runtime.remote.connection.LEASE_S", 0.1)
    with Peer(server) as silent, Peer(server, b'{"codra": 1, "ask') as slow:
        assert silent.last_messages() == slow.last_messages()
    with Peer(server) as silent:
        (message,) = silent.last_messages()
    assert (message["notice"], message["message"]) == ("lease_over", "no message was received for 0.1 s")


def test_a_peer_that_never_closes_its_side_is_dropped(server: Server, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("codra_dsl.runtime.remote.connection.RESPONSE_TIMEOUT_S", 0.1)
    before = descriptor_count()
    with Peer(server, b'{"codra": 1, "id": 1, "ask": "leave"}\n') as peer:
        assert [message["id"] for message in peer.last_messages()] == [1]
        eventually(lambda: descriptor_count() == before + 1)


# Too many peers


def test_one_connection_too_many_is_refused_with_the_reason(server: Server) -> None:
    with ExitStack() as stack:
        peers = [stack.enter_context(Peer(server, HELLO)) for _ in range(MAX_CONNECTIONS)]
        for peer in peers:
            assert peer.message()["id"] == 1
        with Peer(server, HELLO) as refused:
            assert [message["message"] for message in refused.last_messages()] == [
                f"{MAX_CONNECTIONS} programs are connected already: connect again when one has left"
            ]
        with pytest.raises(ConnectionError, match="64 programs are connected already"):
            RemoteContext(server.address)
        peers[0].socket.sendall(b'{"codra": 1, "id": 2, "ask": "leave"}\n')
        assert peers[0].message()["id"] == 2
        with RemoteContext(server.address) as remote:
            assert remote.get("near").value is True


def test_silent_connections_give_their_places_to_new_ones(server: Server) -> None:
    before = descriptor_count()
    with ExitStack() as stack:
        silent_peers = [stack.enter_context(Peer(server)) for _ in range(2 * MAX_CONNECTIONS)]
        with RemoteContext(server.address) as remote:
            assert remote.get("near").value is True
        (message,) = silent_peers[0].last_messages()
        assert message["message"] == "a new connection has taken the place of this one, which sent no request"
        most = before + len(silent_peers) + MAX_CONNECTIONS + MAX_CLOSED_CONNECTIONS
        eventually(lambda: descriptor_count() <= most)


# Tokens


def test_a_program_of_the_same_user_finds_the_token_of_a_port(port_server: Server, tmp_path: Path) -> None:
    assert isinstance(port_server.address, int)
    path = token_file(port_server.address)
    assert path == port_server.token_file == tmp_path / "state" / "codra" / f"{port_server.address}.token"
    assert stat.S_IMODE(path.stat().st_mode) == 0o600
    assert stat.S_IMODE(path.parent.stat().st_mode) == 0o700
    with RemoteContext(port_server.address) as remote:
        assert remote.get("near").value is True
    port_server.close()
    assert not path.exists()


def test_a_wrong_token_is_refused_and_the_connection_ends(port_server: Server) -> None:
    with pytest.raises(TokenError, match="the first request at a port must be `hello` with the `token` in"):
        RemoteContext(port_server.address, token="x" * 43)


@pytest.mark.parametrize(
    "line",
    [
        HELLO,
        DECLARE,
        b'{"codra": 1, "id": 1, "ask": "hello", "token": ""}\n',
        b'{"codra": 1, "id": 1, "ask": "hello", "token": null}\n',
        b'{"codra": 1, "id": 1, "ask": "hello", "token": "\\ud800"}\n',
        b"[]\n",
    ],
)
def test_a_port_without_the_token_answers_and_does_nothing(port_server: Server, codra: Manager, line: bytes) -> None:
    with Peer(port_server, line, DECLARE) as peer:
        error, closed = peer.last_messages()
    assert (error["error"]["kind"], closed["notice"]) == ("wrong_token", "closed")
    assert codra.declared() == frozenset()


def test_a_web_page_cannot_use_a_port(port_server: Server, codra: Manager) -> None:
    with Peer(port_server, b"POST / HTTP/1.1\r\n", DECLARE) as peer:
        kinds = [message["error"]["kind"] for message in peer.last_messages() if "error" in message]
    assert kinds == ["malformed", "wrong_token"]
    assert codra.declared() == frozenset()


def test_the_error_of_a_missing_token_names_its_file(port_server: Server) -> None:
    assert port_server.token_file is not None
    port_server.token_file.unlink()
    with pytest.raises(ConnectionError, match=rf"cannot read the token .* from {port_server.token_file}: No such file"):
        RemoteContext(port_server.address)


def test_a_token_that_cannot_be_written_is_reported(
    codra: Manager, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("XDG_STATE_HOME", str(tmp_path / "file"))
    (tmp_path / "file").write_text("", encoding="utf-8")
    with pytest.raises(OSError, match=r"cannot write the token of the manager to .*Not a directory"):
        Server(codra)


def test_a_unix_socket_is_for_its_owner_only_whatever_the_umask(codra: Manager, tmp_path: Path) -> None:
    old_umask = os.umask(0)
    try:
        with Server(codra, tmp_path / "codra.sock"):
            assert stat.S_IMODE((tmp_path / "codra.sock").stat().st_mode) == 0o600
    finally:
        os.umask(old_umask)


# The server's thread


def test_the_thread_and_the_descriptors_of_a_closed_server_are_released(codra: Manager, tmp_path: Path) -> None:
    before = descriptor_count(), threading.active_count()
    server = Server(codra, tmp_path / "codra.sock")
    with Peer(server, HELLO) as peer:
        peer.message()
        server.close()
        assert [message["message"] for message in peer.last_messages()] == ["the manager has closed"]
    eventually(lambda: (descriptor_count(), threading.active_count()) == before)


def test_requests_that_arrive_in_pieces_or_together_are_answered_in_order(server: Server) -> None:
    lines = b"".join(b'{"codra": 1, "id": %d, "ask": "keep"}\r\n' % number for number in range(500))
    with Peer(server, HELLO) as peer:
        peer.message()
        for start in range(0, len(lines), 777):
            peer.socket.sendall(lines[start : start + 777])
        assert [peer.message()["id"] for _ in range(500)] == list(range(500))


def test_requests_before_the_end_of_the_input_are_answered(server: Server) -> None:
    with Peer(server, HELLO, DECLARE, b'{"codra": 1, "ask": "unfinished') as peer:
        peer.socket.shutdown(socket.SHUT_WR)
        assert [message.get("id") for message in peer.last_messages()][:2] == [1, 2]


def test_the_longest_request_is_accepted(server: Server) -> None:
    line = b'{"codra": 1, "id": 1, "ask": "keep"}'
    with Peer(server, line.ljust(MAX_LINE_BYTES) + b"\n") as peer:
        assert "answer" in peer.message()
