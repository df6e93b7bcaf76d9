"""The latest events of a file at any instant, read from the file on demand."""

from __future__ import annotations

import math
import tracemalloc
from collections.abc import Callable
from pathlib import Path

import pytest
from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as st

from codra_dsl.runtime import ContextManager, Journal, SimClock
from codra_dsl.runtime.journal import Event, Kind
from codra_dsl.runtime.journal.checkpoints import Checkpoints
from codra_dsl.runtime.journal.latest_events import LatestEvents
from codra_dsl.runtime.journal.reader import JournalReader
from codra_dsl.runtime.why import explain
from tests.runtime.door import MODEL, Door
from tests.runtime.journal.journals import read, run_door

NAMES = (
    "present_events",
    "last_value_events",
    "basis_jobs",
    "observer_events",
    "job_starts",
    "job_ends",
    "declaration_events",
    "later_events",
)

TORN_BYTES = (0, 1, 5000, 100_000)


@pytest.fixture(scope="module")
def long_run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path = tmp_path_factory.mktemp("past") / "run.mcap"
    run_door(path, loops=120)
    return path


@pytest.fixture(scope="module")
def events(long_run: Path) -> list[Event]:
    return read(long_run)[1]


@pytest.fixture(scope="module")
def torn_runs(long_run: Path, events: list[Event]) -> dict[int, tuple[Path, list[Event]]]:
    """The run without a number of bytes at its end, and the events that are left."""
    runs = {0: (long_run, events)}
    for torn_bytes in filter(None, TORN_BYTES):
        path = long_run.with_name(f"torn-{torn_bytes}.mcap")
        path.write_bytes(long_run.read_bytes()[:-torn_bytes])
        runs[torn_bytes] = (path, read(path)[1])
    return runs


def event_mappings(latest_events: LatestEvents) -> dict[str, object]:
    return {name: getattr(latest_events, name) for name in NAMES}


@drawn(share=st.floats(0.0, 1.0), torn_bytes=st.sampled_from(TORN_BYTES))
@settings(max_examples=25, deadline=None)
def test_the_latest_events_at_any_instant_equal_those_of_all_events_until_then(
    torn_runs: dict[int, tuple[Path, list[Event]]], share: float, torn_bytes: int
) -> None:
    path, events = torn_runs[torn_bytes]
    at_s = share * events[-1].instant_s
    state_events = [event for event in events if event.kind not in (Kind.INPUT, Kind.DECISION)]
    with JournalReader(path) as reader, JournalReader(path) as other_reader:
        for checkpoints in (Checkpoints(reader, at_s), Checkpoints(other_reader)):
            before_close = at_s if at_s < events[-1].instant_s else math.nextafter(at_s, 0.0)
            assert event_mappings(checkpoints.latest_events(before_close)) == event_mappings(
                LatestEvents.of(state_events, before_close)
            )


def test_without_an_instant_it_ends_before_the_observers_stopped(tmp_path: Path) -> None:
    clock, journal = SimClock(), Journal(tmp_path / "run.mcap")
    with ContextManager[str, str](MODEL, clock=clock, resources={"door": Door()}, record=journal) as manager:
        manager.declare("near")
        clock.sleep(2.5)
    with JournalReader(journal.path) as reader:
        checkpoints = Checkpoints(reader)
        assert checkpoints.end_s == 2.5
        assert [event.what for event in checkpoints.latest_events(math.inf).observer_events.values()] == ["started"]
    with JournalReader(journal.path) as reader:
        assert [event.what for event in Checkpoints(reader, 2.5).latest_events(2.5).observer_events.values()] == [
            "stopped"
        ]


def test_explanations_from_a_file_equal_those_from_all_its_events(long_run: Path, events: list[Event]) -> None:
    with JournalReader(long_run) as reader:
        summary, checkpoints = reader.header().summary, Checkpoints(reader)
        for at_s in (0.0, 33.3, 250.5, 471.0, 800.8):
            explanation_text = str(explain(summary, checkpoints.latest_events, "open", at_s))
            assert explanation_text == str(
                explain(summary, lambda until_s: LatestEvents.of(events, until_s), "open", at_s)
            )


def test_a_long_file_is_not_held_in_memory(long_run: Path) -> None:
    def measure_peak_memory_bytes(read_journal: Callable[[], object]) -> int:
        tracemalloc.start()
        read_journal()
        peak_bytes = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak_bytes

    def read_latest_events() -> None:
        with JournalReader(long_run) as reader:
            Checkpoints(reader).latest_events(100.0)

    assert 8 * measure_peak_memory_bytes(read_latest_events) < measure_peak_memory_bytes(lambda: read(long_run))
