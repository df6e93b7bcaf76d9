"""The rows about an hour of the lab: replaying its journal and asking `why`, beside reading the file with `mcap`.

The journal is that of the lab's spec in simulated time, with a program that declares, expects, writes and acts by
chance, about three times a second. It has about 58,000 messages, and 2.4 MB. All sides are complete processes, measured
by their processor time. The peer reads each message with the reader of the library `mcap`, and decodes none.

The peer of the row about memory is the limit of 100 MB.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from functools import partial
from pathlib import Path

import processes
from rows import Row

from generated import lab
from tests.campaigns.whys.arena import run_until

ROOT = Path(__file__).parents[1]
HOUR_S = 3600.0
VARIABLE = "centrifuge_open"
TURNS = 5
MAX_REPLAY_BYTES = 100e6

_READ = """
import sys
from mcap.reader import make_reader

with open(sys.argv[1], "rb") as stream:
    for _ in make_reader(stream).iter_messages(log_time_order=False):
        pass
"""


def rows(scratch: Path) -> Iterator[Row]:
    """Write the journal, and measure the three commands in turns."""
    journal = scratch / "hour.mcap"
    run_until(lab, 0, HOUR_S, journal).manager.close()
    codra = (sys.executable, "-m", "codra_dsl")
    commands: list[tuple[str | Path, ...]] = [
        (*codra, "replay", journal),
        (*codra, "why", VARIABLE, "--journal", journal),
        (sys.executable, "-c", _READ, journal),
    ]
    replay, why, reading = processes.in_turns(TURNS, *(partial(processes.run, command, ROOT) for command in commands))
    yield Row(name="replay_1h", ours=replay.cpu_s, peer=reading.cpu_s, target=5.0)
    yield Row(name="why_1h", ours=why.cpu_s, peer=reading.cpu_s, target=1.2)
    yield Row(name="replay_memory", ours=replay.peak_bytes, peer=MAX_REPLAY_BYTES, target=1.0)
