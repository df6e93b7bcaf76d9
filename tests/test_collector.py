"""The pauses of the garbage collector, in a program that freezes objects and in one that does not."""

from __future__ import annotations

import gc
import subprocess
import sys

import pytest

from codra_dsl.collector import paused_collector

IN_A_NEW_PROCESS = """\
import gc
from codra_dsl.collector import paused_collector

with paused_collector():
    first = [[] for _ in range(10)]
    assert not gc.isenabled()
assert gc.isenabled()
assert gc.get_freeze_count() == 0
assert any(value is first for value in gc.get_objects(generation=2))

gc.freeze()
frozen_count = gc.get_freeze_count()
with paused_collector():
    second = [[] for _ in range(10)]
assert gc.get_freeze_count() == frozen_count > 0
assert not any(value is second for value in gc.get_objects(generation=2))
"""


def test_new_values_get_old_and_objects_that_the_program_froze_stay_frozen() -> None:
    subprocess.run([sys.executable, "-c", IN_A_NEW_PROCESS], check=True)


def test_the_objects_that_a_program_froze_are_counted_once(monkeypatch: pytest.MonkeyPatch) -> None:
    counts: list[int] = []

    def count() -> int:
        counts.append(7)
        return 7

    monkeypatch.setattr(gc, "get_freeze_count", count)

    for _ in range(10):
        with paused_collector():
            pass

    assert len(counts) <= 1
