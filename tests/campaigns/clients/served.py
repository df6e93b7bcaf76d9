"""A process that is attacked: `python -m tests.campaigns.clients.served [SOCKET]` serves until its input ends.

It serves a context manager at a socket or, without a socket, the store's page, whose port it prints. It may open 1,024
files, as a program may by default.
"""

from __future__ import annotations

import resource
import sys
import threading
from pathlib import Path

from codra_dsl.runtime import ContextManager, SimClock, WallClock
from codra_dsl.runtime.knowledge import Knowledge
from codra_dsl.runtime.remote import Server
from codra_papers.experiments.pacing import Beat
from codra_papers.store.knowledge import store_knowledge
from codra_papers.store.page.server import PageServer
from codra_papers.store.simulator.situations import Situation, StoreSettings
from codra_papers.store.simulator.store import Store
from tests.runtime.door import GIVEN_NEAR, Door

MAX_DESCRIPTORS = 1_024


def serve_messages(socket_path: Path, has_ended: threading.Event) -> None:
    """Serve a context manager at a Unix socket."""
    resources = {"door": Door(angle_rad=1.0, duration_s=0.02)}
    with (
        WallClock() as clock,
        ContextManager[str, str](GIVEN_NEAR, clock=clock, resources=resources) as codra,
        Server(codra, socket_path),
    ):
        codra.set("near", True)
        print(0, flush=True)
        has_ended.wait()


def serve_page(has_ended: threading.Event) -> None:
    """Serve a shop's page at a free port."""
    clock, real_clock = SimClock(), WallClock()
    store = Store(clock, StoreSettings(situation=Situation.QUIET), Knowledge(store_knowledge(), clock=clock))
    with PageServer(store) as page:
        Beat(clock, real_clock, page.desk.serve)
        print(page.port, flush=True)
        while not has_ended.is_set():
            clock.sleep(0.1)


def end_with_input() -> threading.Event:
    """Return an event that is set when the input ends."""
    has_ended = threading.Event()

    def wait() -> None:
        sys.stdin.read()
        has_ended.set()

    threading.Thread(target=wait, daemon=True).start()
    return has_ended


if __name__ == "__main__":
    _, hard_limit = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (min(MAX_DESCRIPTORS, hard_limit), hard_limit))
    if sys.argv[1:]:
        serve_messages(Path(sys.argv[1]), end_with_input())
    else:
        serve_page(end_with_input())
