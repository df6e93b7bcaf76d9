"""Ordinary clients, which measure how long they wait, and the resources of the process that serves them."""

from __future__ import annotations

import contextlib
import threading
import time
from collections.abc import Callable
from contextlib import closing
from dataclasses import dataclass, field
from http.client import HTTPConnection, HTTPException
from pathlib import Path

from codra_dsl.runtime.remote import RemoteContext

PERIOD_S = 0.05
KEPT_PAGE_PERIOD_S = 0.3
"""The page serves four requests a second of a connection."""


@dataclass
class Waits:
    """How long the requests of an ordinary client took, and why others had no answer."""

    name: str
    seconds: list[float] = field(default_factory=list)
    refusals: list[str] = field(default_factory=list)

    def quantile(self, share: float) -> float:
        """Return the wait that a share of the answered requests does not exceed; 0 if none was answered."""
        return sorted(self.seconds)[min(int(share * len(self.seconds)), len(self.seconds) - 1)] if self.seconds else 0.0


class Measuring:
    """Ordinary clients, each in a thread, until `end` is called."""

    def __init__(self, socket_path: str, port: int) -> None:
        self._socket_path = socket_path
        self._port = port
        self._end_event = threading.Event()
        self._threads: list[threading.Thread] = []
        self._remote = RemoteContext(socket_path)
        self._page_connection = HTTPConnection("127.0.0.1", port, timeout=10.0)
        self.waits = [
            self._start("socket, connected before", self._ask_again),
            self._start("socket, connects for each request", self._ask_newly),
            self._start("page, one connection", self._view_again, KEPT_PAGE_PERIOD_S),
            self._start("page, connects for each request", self._view_newly),
        ]

    def end(self) -> None:
        """End the clients."""
        self._end_event.set()
        for thread in self._threads:
            thread.join()
        self._remote.close()
        self._page_connection.close()

    def _start(self, name: str, ask: Callable[[], None], period_s: float = PERIOD_S) -> Waits:
        waits = Waits(name)

        def measure() -> None:
            while not self._end_event.wait(period_s):
                start_s = time.monotonic()
                try:
                    ask()
                except (OSError, HTTPException) as error:
                    waits.refusals.append(f"{type(error).__name__}: {error}"[:100])
                else:
                    waits.seconds.append(time.monotonic() - start_s)

        thread = threading.Thread(target=measure)
        self._threads.append(thread)
        thread.start()
        return waits

    def _ask_again(self) -> None:
        self._remote.get("near")

    def _ask_newly(self) -> None:
        with RemoteContext(self._socket_path) as remote:
            remote.get("near")

    def _view_again(self) -> None:
        """Ask for the view; connect again if the page has closed the connection, as browsers do."""
        try:
            _view(self._page_connection)
        except (OSError, HTTPException):
            self._page_connection.close()
            _view(self._page_connection)

    def _view_newly(self) -> None:
        with closing(HTTPConnection("127.0.0.1", self._port, timeout=10.0)) as connection:
            _view(connection)


def _view(connection: HTTPConnection) -> None:
    connection.request("GET", "/view")
    response = connection.getresponse()
    response.read()
    if response.status != 200:
        raise ConnectionRefusedError(f"status {response.status}")


class Resources:
    """The largest memory, descriptors and threads of a process, sampled ten times a second."""

    def __init__(self, name: str, process_id: int) -> None:
        self.name = name
        self._folder = Path(f"/proc/{process_id}")
        self.most_descriptors = self.most_threads = 0
        self.descriptors_before, self.memory_before_mb = self.descriptors(), self.memory_mb()
        self._end_event = threading.Event()
        self._thread = threading.Thread(target=self._sample, daemon=True)
        self._thread.start()

    def end(self) -> None:
        """End sampling."""
        self._end_event.set()
        self._thread.join()

    def descriptors(self) -> int:
        """Return the number of open descriptors."""
        return len(list((self._folder / "fd").iterdir()))

    def memory_mb(self, name: str = "VmRSS") -> float:
        """Return the memory in MB; `VmHWM` is the largest memory so far."""
        return self._status(name) / 1024

    def cpu_and_delay_s(self) -> tuple[float, float]:
        """Return how long the present threads have run, and how long they could not run because no core was free."""
        times_ns = [path.read_text("ascii").split() for path in (self._folder / "task").glob("*/schedstat")]
        return sum(int(run) for run, *_ in times_ns) / 1e9, sum(int(delay) for _, delay, *_ in times_ns) / 1e9

    def _status(self, name: str) -> int:
        lines = (self._folder / "status").read_text("ascii").splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith(f"{name}:"))

    def _sample(self) -> None:
        while not self._end_event.wait(0.1):
            with contextlib.suppress(OSError):
                self.most_descriptors = max(self.most_descriptors, self.descriptors())
                self.most_threads = max(self.most_threads, self._status("Threads"))
