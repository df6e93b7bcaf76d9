"""Runs that write a journal, and functions that read journals as other programs do."""

from __future__ import annotations

import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any

from mcap.reader import make_reader
from mcap.stream_reader import StreamReader

from codra_dsl.runtime import ContextManager, ContextModel, Journal, SimClock
from codra_dsl.runtime.journal import Event
from codra_dsl.runtime.journal.reader import JournalReader
from codra_dsl.runtime.journal.run_header import RunHeader
from tests.runtime.door import MODEL, Door


def run_door(path: Path, loops: int = 3, seed: int = 0, start_s: float = 0.0) -> Journal:
    """Run a robot that opens a door repeatedly, in simulated time; return its journal."""
    journal, door, clock = Journal(path), Door(angle_rad=1.0), SimClock(start_s)
    resources = {"door": door}
    with ContextManager[str, str](MODEL, clock=clock, resources=resources, seed=seed, record=journal) as manager:
        manager.declare("localized", True)
        for loop in range(loops):
            manager.expect("open_door")
            door.markers, door.distance_m = (4, 1.0) if loop % 3 != 2 else (1, 1.0)
            clock.sleep(4.3)
            with manager.skill("open_door") as skill:
                manager.decide("open", lambda: None, max_age_s=0.2, wait_up_to_s=0.7)
                with skill.acting():
                    clock.sleep(1.0)
                manager.decide("open", lambda: True, shadow=loop == 1)
            with manager.slot("vision"):
                clock.sleep(0.4)
            door.distance_m = 5.0
            clock.sleep(1.1)
    return journal


def read(path: Path) -> tuple[RunHeader, list[Event]]:
    with JournalReader(path) as reader:
        return reader.header(), list(reader.events())


def messages(path: Path) -> list[tuple[str, Mapping[str, Any], int, int]]:
    """Return topic, content, log time and publish time of each message, read by MCAP's own reader."""
    with path.open("rb") as stream:
        mcap_messages = make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False)
        return [
            (channel.topic, json.loads(message.data), message.log_time, message.publish_time)
            for _, channel, message in mcap_messages
        ]


def records(path: Path) -> list[Any]:
    with path.open("rb") as stream:
        return list(StreamReader(stream, validate_crcs=True, emit_chunks=True).records)


__all__ = ["ContextModel", "messages", "read", "records", "run_door"]
