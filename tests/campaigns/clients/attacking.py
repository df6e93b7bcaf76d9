"""Silent, slow and greedy clients: `python -m tests.campaigns.clients.attacking SOCKET PORT CLIENTS SEED`.

Half of the clients use the socket, the others the page. A client whose connection ends connects again after a pause.
The process prints a line when all clients have begun, and attacks until its input ends.
"""

from __future__ import annotations

import contextlib
import json
import os
import resource
import select
import socket
import sys
import time
from collections.abc import Iterator
from random import Random
from selectors import EVENT_READ, EVENT_WRITE, DefaultSelector

PAUSE_S = 5.0
"""The mean pause between the end of a connection and the next one."""

TRICKLE_S = 0.3
"""The time between two bytes of a slow client."""

KINDS = ("silent", "slow", "greedy")


def request(ask: str, **fields: object) -> bytes:
    """Return the line of a request."""
    return json.dumps({"codra": 1, "id": 1, "ask": ask, **fields}).encode() + b"\n"


GREEDY_REQUESTS = {
    "keep": request("keep") * 50,
    "get": request("get", variable="near") * 50,
    "id of 1 MB": request("keep", id="x" * 1_000_000),
    "250 KB": request("set", variable="near", value="x" * 250_000),
    "names": request("expect", skills=["drive"] * 10_000),
    "lease": b"".join(request("hello", lease_s=3600.0 - number) for number in range(50)),
    "subscribe": request("subscribe", variables=["near", "open"]) * 50,
    "decide": request("decide", variable="open", wait_up_to_s=1e9) * 50,
    "found": request("found", decision=1, raised="x" * 1_000) * 50,
    "change": request("declare", variable="near", value=True) + request("declare", variable="near", value=False),
    "begin": request("begin", skill="open_door") * 50,
    "no JSON": b"[" * 100_000 + b"\n",
}


class Client:
    """A client with one connection at a time."""

    def __init__(self, kind: str, address: str | int, random: Random, selector: DefaultSelector) -> None:
        self.next_s = 0.0
        self._kind = kind
        self._address = address
        self._random = random
        self._selector = selector
        self._socket: socket.socket | None = None
        self._unsent = memoryview(b"")
        self._message = b""
        self._reads = True

    def act(self, now_s: float) -> None:
        """Connect if there is no connection; send a byte if the client is slow."""
        self.next_s = now_s + TRICKLE_S
        with self._ending_with_errors(now_s):
            if self._socket is None:
                self._connect()
            elif self._kind == "slow" and not self._unsent:
                self._socket.send(b"x")

    def handle(self, events: int, now_s: float) -> None:
        """Read and write what is possible at once."""
        with self._ending_with_errors(now_s):
            if self._socket is not None and events & EVENT_READ and not self._socket.recv(65_536):
                raise ConnectionResetError
            if self._socket is not None and events & EVENT_WRITE:
                self._send()

    def _connect(self) -> None:
        is_page = isinstance(self._address, int)
        self._socket = socket.socket(socket.AF_INET if is_page else socket.AF_UNIX, socket.SOCK_STREAM)
        self._socket.setblocking(False)
        with contextlib.suppress(BlockingIOError if is_page else ()):  # a full backlog of a Unix socket is an error
            self._socket.connect(("127.0.0.1", self._address) if is_page else self._address)
        self._reads = self._kind != "greedy" or self._random.random() < 0.5
        beginning, self._message = self._on_page(self._address) if is_page else self._on_socket()
        self._unsent = memoryview(beginning)
        self._selector.register(self._socket, EVENT_READ * self._reads | EVENT_WRITE, self)

    def _on_socket(self) -> tuple[bytes, bytes]:
        """Return what the client sends first, and what it then sends again and again."""
        if self._kind == "greedy":
            return request("hello", lease_s=5.0), self._random.choice(list(GREEDY_REQUESTS.values()))
        return (request("hello", lease_s=2.0) if self._kind == "slow" and self._random.random() < 0.5 else b""), b""

    def _on_page(self, port: str | int) -> tuple[bytes, bytes]:
        host = f"Host: 127.0.0.1:{port}\r\n"
        if self._kind == "greedy":
            path = self._random.choice(("/", "/view", "/page.js", "/events"))
            return b"", f"GET {path} HTTP/1.1\r\n{host}\r\n".encode() * 20
        body = f"Origin: http://127.0.0.1:{port}\r\nContent-Type: application/json\r\nContent-Length: 999"
        beginnings = (f"GET /view HTTP/1.1\r\n{host}x-slow: ", f"POST /load HTTP/1.1\r\n{host}{body}\r\n\r\n")
        return (self._random.choice(beginnings).encode() if self._kind == "slow" else b""), b""

    def _send(self) -> None:
        assert self._socket is not None
        if self._unsent:
            self._unsent = self._unsent[self._socket.send(self._unsent) :]
        elif self._message:
            self._unsent = memoryview(self._message)
        else:
            self._selector.modify(self._socket, EVENT_READ, self)

    @contextlib.contextmanager
    def _ending_with_errors(self, now_s: float) -> Iterator[None]:
        try:
            yield
        except BlockingIOError:
            pass
        except OSError:
            self.next_s = now_s + PAUSE_S * self._random.uniform(0.5, 1.5)
            if self._socket is not None:
                with contextlib.suppress(KeyError):
                    self._selector.unregister(self._socket)
                self._socket.close()
                self._socket = None


def attack(socket_path: str, port: int, client_count: int, seed: int) -> None:
    """Run all clients until the input ends."""
    selector = DefaultSelector()
    clients = [
        Client(
            KINDS[number // 2 % len(KINDS)], port if number % 2 else socket_path, Random(f"{seed} {number}"), selector
        )
        for number in range(client_count)
    ]
    print(len(clients), flush=True)
    while not select.select([sys.stdin], [], [], 0.0)[0]:
        now_s = time.monotonic()
        for client in clients:
            if client.next_s <= now_s:
                client.act(now_s)
        for key, events in selector.select(0.05):
            key.data.handle(events, now_s)


if __name__ == "__main__":
    _, hard_limit = resource.getrlimit(resource.RLIMIT_NOFILE)
    chosen_count, chosen_seed = int(sys.argv[3]), int(sys.argv[4])
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(chosen_count + 100, hard_limit), hard_limit))
    os.nice(5)
    attack(sys.argv[1], int(sys.argv[2]), chosen_count, chosen_seed)
