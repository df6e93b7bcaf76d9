"""The duration of a decision that context answers, while the laboratory's observers run in real time.

`python benchmarks/deciding.py` prints quantiles of wall-clock time, for calls within the process and for calls from
another process.
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
"""The pause before each decision: a main execution decides from time to time, not as fast as possible."""

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
            _print_quantiles("in process", _decision_durations_s(lambda: codra.decide(VARIABLE, _must_not_look)))
            address = str(Path(folder) / "codra")
            with Server(codra, address), multiprocessing.get_context("spawn").Pool(1) as process_pool:
                _print_quantiles("from another process", process_pool.apply(_remote_durations_s, (address,)))


def _remote_durations_s(address: str) -> list[float]:
    with RemoteContext(address) as codra:
        return _decision_durations_s(lambda: codra.decide(VARIABLE, _must_not_look))


def _must_not_look() -> bool:
    raise RuntimeError("context has no answer: nothing was measured")


def _decision_durations_s(decide: Callable[[], object]) -> list[float]:
    durations_s = []
    for _ in range(DECISIONS):
        time.sleep(PAUSE_S)
        start_s = time.perf_counter()
        decide()
        durations_s.append(time.perf_counter() - start_s)
    return durations_s


def _print_quantiles(label: str, durations_s: list[float]) -> None:
    quantiles_s = statistics.quantiles(durations_s, n=1000)
    selected_quantiles_s = {
        "median": quantiles_s[499],
        "p99": quantiles_s[989],
        "p99.9": quantiles_s[998],
        "most": max(durations_s),
    }
    print(
        f"{label:22}",
        *(f"{name} {1000 * quantile_s:.3f} ms" for name, quantile_s in selected_quantiles_s.items()),
        flush=True,
    )


if __name__ == "__main__":
    main()
