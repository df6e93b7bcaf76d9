"""The rows about a running forest of a thousand observers: context beside a blackboard, rounds beside ticks."""

from __future__ import annotations

import importlib
import statistics
import subprocess
import sys
import tempfile
import threading
import time
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from types import ModuleType
from typing import Any

import plain_py_trees
from calls import in_turns
from forests import OBSERVERS_PER_CHAIN, WRITTEN_PER_CHAIN, flat, write
from py_trees.blackboard import Blackboard, Client
from py_trees.common import Access
from rows import Row

from codra_dsl.runtime import Clock, EventLog, Journal, SimClock, WallClock

OBSERVER_COUNT = 1_000
DUE_COUNT = 10
CHAIN_COUNT = OBSERVER_COUNT // OBSERVERS_PER_CHAIN
WRITER_COUNT = 7
READ_COUNT = 20_000

_ROBOT = """
import time

def find_door(*, camera, job, **_):
    if camera is not None:
        time.sleep(camera)
    return {"markers": 12, "angle": 1.5}
"""


def rows_of(name: str) -> Callable[[Path], Iterator[Row]]:
    """Return the function that measures one row."""

    def rows(scratch: Path) -> Iterator[Row]:
        yield _MEASURE_FUNCTIONS[name](compile_forest(scratch, CHAIN_COUNT))

    return rows


def compile_forest(scratch: Path, chain_count: int) -> ModuleType:
    """Compile a forest of some chains of observers and import it."""
    write({**flat(chain_count * (OBSERVERS_PER_CHAIN + WRITTEN_PER_CHAIN)), "robot/perception.py": _ROBOT}, scratch)
    subprocess.run((sys.executable, "-m", "codra_dsl", "compile", "."), cwd=scratch, check=True, capture_output=True)
    for module in [name for name in sys.modules if name.split(".")[0] in ("generated", "robot")]:
        del sys.modules[module]
    sys.path.insert(0, str(scratch))
    return importlib.import_module("generated.flat")


@contextmanager
def _running_robot(
    package: ModuleType, clock: Clock, camera: float | None = None, record: EventLog | None = None
) -> Iterator[Any]:
    with package.start(clock=clock, resources={"camera": camera}, record=record) as codra:
        yield codra


def near_variable(chain: int) -> str:
    """Return the variable that says whether the robot is near the doors of a chain."""
    return f"bay_{chain:05}_is_near"


def last_door_variable(chain: int) -> str:
    """Return the variable of the last door of a chain, which needs all others of the chain."""
    return f"bay_{chain:05}_door_{OBSERVERS_PER_CHAIN - 1}_open"


# Context beside a blackboard


def _get(package: ModuleType) -> Row:
    """Measure reading a variable with a validity, beside reading a blackboard value without a validity."""
    with WallClock() as clock, _running_robot(package, clock) as codra:
        blackboard, name = _client(), near_variable(0)
        codra.set(name, True)
        blackboard.set(name, True)
        ours, peer = in_turns([partial(codra.get, name), partial(blackboard.get, name)], [5000, 5000])
    return Row(name="context_get", ours=ours, peer=peer, target=0.1)


def _set(package: ModuleType) -> Row:
    """Measure writing a new value on which a running observer depends."""
    with WallClock() as clock, _running_robot(package, clock) as codra:
        blackboard, name = _client(), near_variable(0)
        codra.declare(f"bay_{0:05}_door_0_open")
        values = [True, False]

        def ours() -> None:
            values.reverse()
            codra.set(name, values[0])

        def peer() -> None:
            values.reverse()
            blackboard.set(name, values[0])

        ours_s, peer_s = in_turns([ours, peer], [2000, 2000])
    return Row(name="context_set", ours=ours_s, peer=peer_s, target=1.2)


def _client() -> Client:
    Blackboard.clear()
    client = Client(name="robot")
    client.register_key(key=near_variable(0), access=Access.WRITE)
    return client


def _get_under_load(package: ModuleType) -> Row:
    """Measure the slowest of a hundred reads while seven threads write, and a callback and perception take a second."""
    with WallClock() as clock, _running_robot(package, clock, camera=1.0) as codra:
        name, is_over = near_variable(0), threading.Event()
        codra.set(name, True)
        codra.declare(last_door_variable(1))

        def keep_writing(number: int) -> None:
            value = True
            while not is_over.is_set():
                value = not value
                codra.set(near_variable(number), value)

        idle_s = statistics.median(_p99_s(codra, name) for _ in range(5))
        threads = [threading.Thread(target=keep_writing, args=(number,), daemon=True) for number in range(WRITER_COUNT)]
        codra.subscribe(name, lambda _: time.sleep(1.0))
        for thread in threads:
            thread.start()
        loaded_s = statistics.median(_p99_s(codra, name) for _ in range(5))
        is_over.set()
        for thread in threads:
            thread.join()
    return Row(name="context_get_p99", ours=loaded_s, peer=idle_s, target=5.0)


def _p99_s(codra: Any, name: str) -> float:
    durations_s = []
    for _ in range(READ_COUNT):
        start_s = time.perf_counter()
        codra.get(name)
        durations_s.append(time.perf_counter() - start_s)
    return statistics.quantiles(durations_s, n=100)[98]


# Rounds beside ticks


def _idle(package: ModuleType) -> Row:
    """Measure passing time while a thousand observers have nothing to do."""
    clock = SimClock()
    with _running_robot(package, clock) as codra:
        for chain in range(CHAIN_COUNT):
            _run_chain(codra, chain)
        clock.sleep(0.5)
        ours, peer = in_turns([lambda: clock.sleep(1e-6), _peers_round(due_count=0)], [2000, 1])
        _require_that_all_look(codra, clock)
    return Row(name="forest_idle", ours=ours, peer=peer, target=1 / 1000)


def _due(package: ModuleType) -> Row:
    """Measure rounds in which ten observers look and their jobs end, every hundredth of a second."""
    with _due_round(package) as our_round:
        ours, peer = in_turns([our_round, _peers_round(due_count=DUE_COUNT)], [20, 1])
    return Row(name="forest_due", ours=ours, peer=peer, target=1 / 40)


def _journalled(package: ModuleType) -> Row:
    """Measure the same rounds with a journal, beside the rounds without: a journal may add a quarter, 25 us a look."""
    with (
        tempfile.TemporaryDirectory(prefix="codra-bench-") as folder,
        _due_round(package, Journal(Path(folder) / "run.mcap")) as round_with_journal,
        _due_round(package) as round_without_journal,
    ):
        ours, peer = in_turns([round_with_journal, round_without_journal], [20, 20])
    return Row(name="journal_due", ours=ours, peer=peer, target=1.25)


@contextmanager
def _due_round(package: ModuleType, record: EventLog | None = None) -> Iterator[Callable[[], None]]:
    """Run the forest, and yield a function that runs a round in which ten observers look."""
    clock = SimClock()
    with _running_robot(package, clock, record=record) as codra:
        for chain in range(CHAIN_COUNT):
            _run_chain(codra, chain)
            clock.sleep(1.0 / CHAIN_COUNT)
        clock.sleep(0.5 / CHAIN_COUNT)
        yield lambda: clock.sleep(1.0 / CHAIN_COUNT)
        _require_that_all_look(codra, clock)


def _run_chain(codra: Any, chain: int) -> None:
    codra.set(f"bay_{chain:05}_is_lit", True)
    codra.set(near_variable(chain), True)
    codra.declare(last_door_variable(chain))


def _require_that_all_look(codra: Any, clock: SimClock) -> None:
    """Require that all observers look, because a forest that does nothing would be the fastest."""
    for chain in range(CHAIN_COUNT):
        codra.set(f"bay_{chain:05}_is_lit", True)
        codra.set(near_variable(chain), True)
    clock.sleep(1.0)
    doors = [
        f"bay_{chain:05}_door_{number}_open" for chain in range(CHAIN_COUNT) for number in range(OBSERVERS_PER_CHAIN)
    ]
    outdated_names = [
        name for name in doors if not codra.get(name).known or codra.get(name).age_s(clock.now_s()) > 1.0 + 1e-9
    ]
    if outdated_names or len(codra.running()) != OBSERVER_COUNT:
        raise RuntimeError(f"{len(outdated_names)} of {len(doors)} variables are not kept up")


def _peers_round(due_count: int) -> Callable[[], None]:
    """Return a function that ticks all trees once. In trees that are due, a tick includes the last leaf."""
    Blackboard.clear()
    keys = {"wanted": True, "never": False, "always": True}
    client = Client(name="robot")
    for key, value in {**keys, "lit": True, "near": True}.items():
        client.register_key(key=key, access=Access.WRITE)
        client.set(key, value)
    trees = [
        plain_py_trees.tree(f"t{number}", ("lit", "near"), "always" if number < due_count else "never")
        for number in range(OBSERVER_COUNT)
    ]

    def tick() -> None:
        for tree in trees:
            tree.tick()

    return tick


_MEASURE_FUNCTIONS: Mapping[str, Callable[[ModuleType], Row]] = {
    "context_get": _get,
    "context_set": _set,
    "context_get_p99": _get_under_load,
    "forest_idle": _idle,
    "forest_due": _due,
    "journal_due": _journalled,
}

GROUPS: Mapping[str, Callable[[Path], Iterator[Row]]] = {name: rows_of(name) for name in _MEASURE_FUNCTIONS}
"""Every row is a group of its own, with the name of the row."""
