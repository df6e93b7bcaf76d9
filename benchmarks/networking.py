"""The rows about a manager on a network: a program in another process, beside the same exchange by Zenoh alone.

`python benchmarks/networking.py PEER ENDPOINT` serves one side: `manager` or `zenoh`.
"""

from __future__ import annotations

import socket
import statistics
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from functools import partial
from pathlib import Path
from typing import Any

import zenoh
from rows import Row

from codra_dsl.runtime import ContextManager, ContextModel, WallClock
from codra_dsl.runtime.remote import NetworkAddress, RemoteContext, serve
from codra_dsl.runtime.values.model import VariableModel, boolean

VARIABLE = "door_open"
TARGET = 1.5
TURN_COUNT = 40
CALLS_PER_TURN = 50


def rows(_scratch: Path) -> Iterator[Row]:
    """Measure reading and writing a variable of a manager in another process, both with an answer."""
    with ExitStack() as stack:
        endpoints = [stack.enter_context(_served_by(peer)) for peer in ("manager", "zenoh")]
        codra = stack.enter_context(RemoteContext(NetworkAddress(endpoints[0])))
        query, put = stack.enter_context(_bare_calls(endpoints[1]))
        values = [True, False]

        def set_value() -> None:
            values.reverse()
            codra.set(VARIABLE, values[0])

        set_value()
        ours, peer = _median_s(partial(codra.get, VARIABLE), query)
        yield Row(name="remote_get", ours=ours, peer=peer, target=TARGET)
        ours, peer = _median_s(set_value, put)
        yield Row(name="remote_set", ours=ours, peer=peer, target=TARGET)


def _median_s(*sides: Callable[[], object]) -> list[float]:
    """Return the median duration of a call of each side. The sides take turns."""
    durations_s: list[list[float]] = [[] for _ in sides]
    for _ in range(TURN_COUNT):
        for side, side_durations_s in zip(sides, durations_s, strict=True):
            for _ in range(CALLS_PER_TURN):
                start_s = time.perf_counter()
                side()
                side_durations_s.append(time.perf_counter() - start_s)
    return [statistics.median(side_durations_s) for side_durations_s in durations_s]


@contextmanager
def _served_by(peer: str) -> Iterator[str]:
    """Start a process that serves one side, and yield its endpoint."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{probe.getsockname()[1]}"
    command = [sys.executable, str(Path(__file__).absolute()), peer, endpoint]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as process:
        assert process.stdout is not None
        process.stdout.readline()
        yield endpoint
        assert process.stdin is not None
        process.stdin.close()


@contextmanager
def _bare_calls(endpoint: str) -> Iterator[tuple[Callable[[], object], Callable[[], object]]]:
    """Yield a query with its reply, and a put with the put that echoes it."""
    config = zenoh.Config()
    config.insert_json5("mode", '"client"')
    config.insert_json5("connect/endpoints", f'["{endpoint}"]')
    with zenoh.open(config) as session:
        echo_event = threading.Event()
        handler = zenoh.handlers.Callback(lambda _: echo_event.set(), indirect=False)
        subscriber = session.declare_subscriber("bench/echo", handler)

        def query() -> object:
            return [reply.ok.payload.to_bytes() for reply in session.get("bench/value")]

        def put() -> None:
            echo_event.clear()
            session.put("bench/value", b"true", express=True)
            echo_event.wait()

        query()
        yield query, put
        subscriber.undeclare()


def _serve_manager(endpoint: str) -> None:
    model = ContextModel(
        name="bench",
        variables=(VariableModel(name=VARIABLE, type=boolean(), sources=("main_execution",)),),
        observers=(),
        skills=(),
        resources=(),
    )
    with (
        WallClock() as clock,
        ContextManager[str, str](model, clock=clock, resources={}) as codra,
        serve(codra, NetworkAddress(endpoint)),
    ):
        print("ready", flush=True)
        sys.stdin.read()


def _serve_zenoh(endpoint: str) -> None:
    config = zenoh.Config()
    config.insert_json5("mode", '"router"')
    config.insert_json5("listen/endpoints", f'["{endpoint}"]')
    with zenoh.open(config) as session:

        def reply(query: Any) -> None:
            query.reply("bench/value", b"true")

        def echo(sample: Any) -> None:
            session.put("bench/echo", sample.payload, express=True)

        entities = [
            session.declare_queryable("bench/value", zenoh.handlers.Callback(reply, indirect=False)),
            session.declare_subscriber("bench/value", zenoh.handlers.Callback(echo, indirect=False)),
        ]
        print("ready", flush=True)
        sys.stdin.read()
        for entity in entities:
            entity.undeclare()


if __name__ == "__main__":
    {"manager": _serve_manager, "zenoh": _serve_zenoh}[sys.argv[1]](sys.argv[2])
