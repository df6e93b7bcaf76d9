"""The robot's body for an agent in another process."""

from __future__ import annotations

import itertools
import threading
from collections.abc import Callable, Sequence
from concurrent.futures import Future
from functools import partial
from multiprocessing.connection import Client
from pathlib import Path
from typing import Any

from codra_dsl.runtime.clock import Clock
from codra_papers.store.body import EndCallback, Lift, Picture, Scan, Side, StopFunction, Way
from codra_papers.store.geometry import Point, Pose2D

ANSWER_TIMEOUT_S = 10.0
"""How long the simulator may take to answer."""


class RemoteBody:
    """A body whose methods are calls to a `BodyServer`. They raise ConnectionError if it is gone."""

    def __init__(self, path: Path, key: bytes, clock: Clock, on_lost: Callable[[], object]) -> None:
        """Connect.

        Args:
            path: the Unix socket of the server.
            key: the key of the server.
            clock: calls back when a command has ended.
            on_lost: called when the connection has ended.

        Raises:
            OSError: if no server listens there.
        """
        self._connection = Client(str(path), "AF_UNIX", authkey=key)
        self._clock = clock
        self._on_lost = on_lost
        self._lock = threading.Lock()
        self._numbers = itertools.count(1)
        self._futures: dict[int, Future[Any]] = {}
        self._end_callbacks: dict[int, EndCallback] = {}
        threading.Thread(target=self._receive, name="remote-body", daemon=True).start()

    def believed_pose(self) -> Pose2D:
        """Return the pose from the localisation."""
        pose: Pose2D = self._call("believed_pose")
        return pose

    def localisation_spread_m(self) -> float:
        """Return the uncertainty that the localisation reports."""
        return float(self._call("localisation_spread_m"))

    def scan(self, side: Side) -> Scan:
        """Return the latest scan of a laser."""
        scan: Scan = self._call("scan", side)
        return scan

    def look(self) -> Picture:
        """Return the latest picture."""
        picture: Picture = self._call("look")
        return picture

    def battery_percent(self) -> float:
        """Return the level of the battery."""
        return float(self._call("battery_percent"))

    def is_charging(self) -> bool:
        """Return whether the robot charges."""
        return bool(self._call("is_charging"))

    def has_load(self) -> bool:
        """Return whether the fork carries a load."""
        return bool(self._call("has_load"))

    def is_bumped(self) -> bool:
        """Return whether a bumper was touched within the last two seconds."""
        return bool(self._call("is_bumped"))

    def speed_m_s(self) -> float:
        """Return the speed of the robot."""
        return float(self._call("speed_m_s"))

    def set_max_speed(self, speed_m_s: float) -> None:
        """Drive no faster than this from now on."""
        self._call("set_max_speed", speed_m_s)

    def drive(self, points_m: Sequence[Point], way: Way, done: EndCallback) -> StopFunction:
        """Drive from point to point."""
        return self._begin(done, "drive", tuple(points_m), way)

    def turn(self, angle_rad: float, done: EndCallback) -> StopFunction:
        """Turn on the spot."""
        return self._begin(done, "turn", angle_rad)

    def lift(self, lift: Lift, done: EndCallback) -> StopFunction:
        """Raise or lower the fork."""
        return self._begin(done, "lift", lift)

    def _begin(self, done: EndCallback, name: str, *arguments: object) -> StopFunction:
        number = next(self._numbers)
        self._end_callbacks[number] = done
        self._ask(number, name, arguments)
        return partial(self._stop, number)

    def _stop(self, number: int) -> None:
        if number in self._end_callbacks:  # otherwise the command has ended
            self._call("stop", number)

    def _call(self, name: str, *arguments: object) -> Any:
        return self._ask(next(self._numbers), name, arguments)

    def _ask(self, number: int, name: str, arguments: tuple[object, ...]) -> Any:
        future = self._futures[number] = Future[Any]()
        try:
            with self._lock:
                self._connection.send((number, name, arguments))
            return future.result(ANSWER_TIMEOUT_S)
        except (OSError, TimeoutError) as error:
            raise ConnectionError(f"the robot's body is gone: {error}") from None

    def _receive(self) -> None:
        try:
            while True:
                kind, number, content = self._connection.recv()
                if kind == "ended":
                    done = self._end_callbacks.pop(number)
                    self._clock.call_at(self._clock.now_s(), partial(done, content))
                else:
                    self._futures.pop(number).set_result(content)
        except (EOFError, OSError):
            self._on_lost()
