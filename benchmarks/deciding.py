"""The duration of a decision that context answers, while the laboratory's observers run in real time.

`python benchmarks/deciding.py` prints quantiles of wall-clock time, for calls within the process and from another one.
"""

from __future__ import annotations

import multiprocessing
import statistics
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

from codra_dsl.runtime import WallClock
from codra_dsl.runtime.remote import RemoteContext, Server
from codra_papers.lab.robot import Localization
from codra_papers.lab.simulator.camera import ArmCamera, FrameSource
from codra_papers.lab.simulator.world import LabWorld
from generated import lab

DECISIONS = 5_000
PAUSE_S = 0.002
"""A main execution makes decisions from time to time, not as fast as possible."""

VARIABLE = "robot_is_localized"


def main() -> None:
    """Measure decisions in the process, then from another process."""
    world = LabWorld(seed=1)
    with WallClock() as clock, FrameSource(world) as frames, tempfile.TemporaryDirectory() as folder:
        handles = {"camera": ArmCamera(frames, clock), "base": Localization(world, clock)}
        with lab.start(clock=clock, resources=handles, seed=1) as codra:
            codra.set(VARIABLE, True)
            for name in codra.modelled():
                codra.declare(name)
            _print("in process", _timed(lambda: codra.decide(VARIABLE, _must_not_look)))
            address = str(Path(folder) / "codra")
            with Server(codra, address), multiprocessing.get_context("spawn").Pool(1) as other:
                _print("from another process", other.apply(_asked_from_outside, (address,)))


def _asked_from_outside(address: str) -> list[float]:
    with RemoteContext(address) as codra:
        return _timed(lambda: codra.decide(VARIABLE, _must_not_look))


def _must_not_look() -> bool:
    raise RuntimeError("context has no answer: nothing was measured")


def _timed(decide: Callable[[], object]) -> list[float]:
    taken_s = []
    for _ in range(DECISIONS):
        time.sleep(PAUSE_S)
        began_s = time.perf_counter()
        decide()
        taken_s.append(time.perf_counter() - began_s)
    return taken_s


def _print(way: str, taken_s: list[float]) -> None:
    quantiles_s = statistics.quantiles(taken_s, n=1000)
    selected = {"median": quantiles_s[499], "p99": quantiles_s[989], "p99.9": quantiles_s[998], "most": max(taken_s)}
    print(f"{way:22}", *(f"{name} {1000 * quantile_s:.3f} ms" for name, quantile_s in selected.items()), flush=True)


if __name__ == "__main__":
    main()
