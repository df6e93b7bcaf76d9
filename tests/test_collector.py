"""The pauses of the garbage collector, in a program that freezes objects and in one that does not."""

from __future__ import annotations

import subprocess
import sys

IN_A_NEW_PROCESS = """\
import gc
from codra_dsl.collector import paused_collector

with paused_collector():
    first = [[] for _ in range(100_000)]
    assert not gc.isenabled()
assert gc.isenabled()
assert gc.get_freeze_count() == 0
assert any(value is first for value in gc.get_objects(generation=2))

gc.freeze()
frozen_count = gc.get_freeze_count()
with paused_collector():
    second = [[] for _ in range(100_000)]
assert gc.get_freeze_count() == frozen_count > 0
assert not any(value is second for value in gc.get_objects(generation=2))
"""
IN_A_LONG_RUN = """\
from codra_dsl.collector import paused_collector


class Cycle:
    living = 0

    def __init__(self):
        Cycle.living += 1
        self.itself = self

    def __del__(self):
        Cycle.living -= 1


for _ in range(300):
    with paused_collector():
        cycles = [Cycle() for _ in range(1000)]
assert Cycle.living < 100_000, Cycle.living
"""


def test_many_new_values_get_old_and_objects_that_the_program_froze_stay_frozen() -> None:
    subprocess.run([sys.executable, "-c", IN_A_NEW_PROCESS], check=True)


def test_values_of_many_small_pauses_are_collected_when_they_are_no_longer_used() -> None:
    subprocess.run([sys.executable, "-c", IN_A_LONG_RUN], check=True)
