"""The latest events of a file at any instant, found in the file when they are needed."""

from __future__ import annotations

import math
import struct
import tracemalloc
from collections.abc import Callable
from pathlib import Path
from zlib import crc32

import pytest
from hypothesis import given as drawn
from hypothesis import settings
from hypothesis import strategies as st
from mcap.opcode import Opcode
from mcap.records import Message

from codra_dsl.runtime import ContextManager, Journal, SimClock
from codra_dsl.runtime.journal import Event, Kind
from codra_dsl.runtime.journal.chunks import IndexedChunk
from codra_dsl.runtime.journal.events_in_file import EventsInFile, LatestEventsInFile
from codra_dsl.runtime.journal.latest_events import LatestEvents
from codra_dsl.runtime.journal.mcap_file import CHUNK_BYTES
from codra_dsl.runtime.journal.mcap_records import RECORD_HEADER
from codra_dsl.runtime.journal.reader import JournalReader, RawMessage
from codra_dsl.runtime.journal.run_header import RunHeader
from codra_dsl.runtime.journal.spec_summary import SpecSummary
from codra_dsl.runtime.why import explain
from tests.runtime.door import MODEL, Door
from tests.runtime.journal.journals import read, run_door
from tests.runtime.journal.test_limits import CHANNEL, chunk_bytes, forged, message_bytes

NAMES = (
    "present_events",
    "override_events",
    "decision_events",
    "last_value_events",
    "basis_jobs",
    "observer_events",
    "job_starts",
    "job_ends",
    "declaration_events",
    "expectation_events",
    "later_events",
)
SUBJECTS = ("localized", "near", "open", "door_distance", "door_lid", "measure_distance", "look", "missing")

EMPTY_SUMMARY = SpecSummary(name="s", variables={}, observers={}, algorithms={}, skills={}, places={})

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


def events_by_subject(latest_events: LatestEvents | LatestEventsInFile) -> dict[tuple[str, str], object]:
    return {(name, subject): getattr(latest_events, name).get(subject) for name in NAMES for subject in SUBJECTS}


@drawn(share=st.floats(0.0, 1.0), torn_bytes=st.sampled_from(TORN_BYTES))
@settings(max_examples=25, deadline=None)
def test_the_latest_events_at_any_instant_equal_those_of_all_events_until_then(
    torn_runs: dict[int, tuple[Path, list[Event]]], share: float, torn_bytes: int
) -> None:
    path, events = torn_runs[torn_bytes]
    at_s = share * events[-1].instant_s
    state_events = [event for event in events if event.kind is not Kind.INPUT]
    before_close = at_s if at_s < events[-1].instant_s else math.nextafter(at_s, 0.0)
    expected_events = events_by_subject(LatestEvents.of(state_events, before_close))
    with JournalReader(path) as reader, JournalReader(path) as other_reader:
        for file in (
            EventsInFile(reader, reader.header().summary, ends_before_close=False),
            EventsInFile(other_reader, other_reader.header().summary),
        ):
            assert events_by_subject(file.latest_events(before_close)) == expected_events
            assert file.end_s == events[-1].instant_s


def test_without_an_instant_it_ends_before_the_observers_stopped(tmp_path: Path) -> None:
    clock, journal = SimClock(), Journal(tmp_path / "run.mcap")
    with ContextManager[str, str](MODEL, clock=clock, resources={"door": Door()}, record=journal) as manager:
        manager.declare("near")
        clock.sleep(2.5)
    for ends_before_close, last_change in ((True, "started"), (False, "stopped")):
        with JournalReader(journal.path) as reader:
            file = EventsInFile(reader, reader.header().summary, ends_before_close=ends_before_close)
            event = file.latest_events(2.5).observer_events.get("door_distance")
            assert (file.end_s, event and event.what) == (2.5, last_change)


def test_explanations_from_a_file_equal_those_from_all_its_events(long_run: Path, events: list[Event]) -> None:
    with JournalReader(long_run) as reader:
        summary = reader.header().summary
        file = EventsInFile(reader, summary)
        for at_s in (0.0, 33.3, 250.5, 471.0, 800.8):
            explanation_text = str(explain(summary, file.latest_events, "open", at_s))
            assert explanation_text == str(
                explain(summary, lambda until_s: LatestEvents.of(events, until_s), "open", at_s)
            )


def test_only_the_chunks_with_events_of_the_subject_are_read(long_run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    offsets: list[int] = []
    read_chunk = JournalReader.messages_in

    def note_and_read_chunk(
        reader: JournalReader, chunk: IndexedChunk, channel_ids: frozenset[int] | None
    ) -> list[tuple[int, RawMessage]]:
        offsets.append(chunk.offset)
        return read_chunk(reader, chunk, channel_ids)

    monkeypatch.setattr(JournalReader, "messages_in", note_and_read_chunk)
    with JournalReader(long_run) as reader:
        file = EventsInFile(reader, reader.header().summary)
        assert file.latest_events(math.inf).present_events.get("near") is not None
        chunk_count = len(reader.index())

    assert len(set(offsets)) <= 2 < chunk_count


def test_a_file_with_a_damaged_index_is_read_from_its_start(
    long_run: Path, events: list[Event], tmp_path: Path
) -> None:
    content = bytearray(long_run.read_bytes())
    content[-100] ^= 1
    (tmp_path / "run.mcap").write_bytes(content)
    state_events = [event for event in events if event.kind is not Kind.INPUT]
    with JournalReader(tmp_path / "run.mcap") as reader:
        file = EventsInFile(reader, reader.header().summary)
        assert events_by_subject(file.latest_events(100.0)) == events_by_subject(LatestEvents.of(state_events, 100.0))


def test_messages_of_other_subjects_become_objects_only_once(long_run: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    sequences: list[int] = []
    add_channel = JournalReader._with_channel

    def note_and_add_channel(reader: JournalReader, message: Message) -> RawMessage | None:
        sequences.append(message.sequence)
        return add_channel(reader, message)

    monkeypatch.setattr(JournalReader, "_with_channel", note_and_add_channel)
    with JournalReader(long_run) as reader:
        file = EventsInFile(reader, reader.header().summary)
        for topic in (
            "/codra/context/near",
            "/codra/context/open",
            "/codra/declaration/near",
            "/codra/observer/door_lid",
        ):
            assert file.find((len(reader.index()), 0), topic, lambda _: False) is None

    assert len(sequences) < 2 * len(set(sequences))


CHUNK_INDEX_FIELDS = struct.Struct("<QQQQI")
"""The first fields of the index of a chunk: two times, the offset, the size, and the size of the list of channels."""


def forge_index(journal: Path, target: Path, change: Callable[[int, list[int]], list[int] | None]) -> None:
    """Change the first fields of the index of each chunk, or leave the chunk out of the index of a file."""
    content = journal.read_bytes()
    end = content[-37:]  # the footer, and the end of the file
    (start,) = struct.unpack_from("<Q", end, 9)
    section, forged, position, number = content[start:-37], b"", 0, 0
    while position < len(section):
        opcode, length = RECORD_HEADER.unpack_from(section, position)
        record, position = section[position : position + 9 + length], position + 9 + length
        if opcode == Opcode.CHUNK_INDEX:
            fields = change(number, list(CHUNK_INDEX_FIELDS.unpack_from(record, 9)))
            rest, number = record[9 + CHUNK_INDEX_FIELDS.size :], number + 1
            record = b"" if fields is None else record[:9] + CHUNK_INDEX_FIELDS.pack(*fields) + rest
        forged += record
    checksum = struct.pack("<I", crc32(end[:25], crc32(forged)))
    target.write_bytes(content[:start] + forged + end[:25] + checksum + end[29:])


@pytest.mark.parametrize(
    "change",
    [
        lambda number, fields: [*fields[:2], 2**64 - 1, *fields[3:]] if number == 2 else fields,
        lambda number, fields: [*fields[:3], 2**63, fields[4]] if number == 2 else fields,
        lambda number, fields: [*fields[:4], 2**32 - 1] if number == 2 else fields,
        lambda number, fields: [*fields[:4], fields[4] + 40] if number == 2 else fields,
        lambda number, fields: None if number < 2 else fields,
        lambda number, fields: None if number > 1 else fields,
        lambda number, fields: None if number == 1 else fields,
    ],
    ids=["offset", "size", "channels", "overlap", "first", "last", "gap"],
)
def test_an_index_that_does_not_describe_the_file_is_not_used(
    long_run: Path, events: list[Event], tmp_path: Path, change: Callable[[int, list[int]], list[int] | None]
) -> None:
    forge_index(long_run, tmp_path / "run.mcap", change)
    state_events = [event for event in events if event.kind is not Kind.INPUT]
    with JournalReader(tmp_path / "run.mcap") as reader:
        file = EventsInFile(reader, reader.header().summary)
        for at_s in (10.0, 400.0, 800.0):
            expected_events = events_by_subject(LatestEvents.of(state_events, at_s))
            assert events_by_subject(file.latest_events(at_s)) == expected_events
        assert not reader.damage.is_torn


def test_a_file_that_is_finished_after_it_was_opened_is_read_to_its_end(tmp_path: Path) -> None:
    clock, journal = SimClock(), Journal(tmp_path / "run.mcap")
    with ContextManager[str, str](MODEL, clock=clock, resources={"door": Door()}, record=journal) as manager:
        manager.declare("near")
        for _ in range(300):
            manager.set("localized", True)
            clock.sleep(1.0)
        reader = JournalReader(journal.path)
        clock.sleep(2.5)
        manager.set("localized", True)
    with reader:
        assert reader.chunk_offset > 0
        file = EventsInFile(reader, reader.header().summary)
        event = file.latest_events(302.5).present_events.get("localized")
        assert (file.end_s, event and event.instant_s) == (302.5, 302.5)


def test_events_before_the_zero_of_the_clock_are_found(tmp_path: Path) -> None:
    journal = run_door(tmp_path / "run.mcap", start_s=-100.0)
    with JournalReader(journal.path) as reader:
        file = EventsInFile(reader, reader.header().summary)
        event = file.latest_events(-99.0).present_events.get("localized")
        assert event is not None
        assert event.instant_s == -100.0


def test_a_message_that_cannot_be_read_is_reported_once(tmp_path: Path) -> None:
    path = run_door(tmp_path / "whole.mcap", loops=1).path
    chunk = chunk_bytes(CHANNEL + message_bytes(b"{}"), "zstd")
    with JournalReader(forged(path, tmp_path / "run.mcap", chunk)) as reader:
        file = EventsInFile(reader, reader.header().summary)
        assert file.latest_events(math.inf).last_value_events.get("near") is None
        assert file.latest_events(math.inf).present_events.get("near") is None
        assert len(reader.damage.unreadable_parts) == 1


def test_a_damaged_chunk_is_reported_if_it_is_needed(long_run: Path, tmp_path: Path) -> None:
    with JournalReader(long_run) as reader:
        last_chunk = reader.index()[-1]
    content = bytearray(long_run.read_bytes())
    content[last_chunk.offset + 200] ^= 1
    (tmp_path / "run.mcap").write_bytes(content)
    with JournalReader(tmp_path / "run.mcap") as reader:
        file = EventsInFile(reader, reader.header().summary)
        assert file.latest_events(100.0).present_events.get("near") is not None
        assert f"the chunk at byte {last_chunk.offset}: " in reader.damage.unreadable_parts[0]


def test_events_about_knowledge_are_the_same_from_every_checkpoint(tmp_path: Path) -> None:
    path, header = (
        tmp_path / "run.mcap",
        RunHeader(spec="s", file="", model="", seed=0, start_s=0.0, summary=EMPTY_SUMMARY),
    )
    journal = Journal(path)
    journal.begin(lambda: header)
    events = [
        Event(
            float(number),
            Kind.KNOWLEDGE,
            f"node_{number % 7}",
            ("placed", "written")[number % 2],
            {"agent": "", "version": number, "message": "x" * (CHUNK_BYTES // 16)},
        )
        for number in range(600)
    ]
    for event in events:
        journal.add(event)
    journal.end()
    with JournalReader(path) as reader:
        file = EventsInFile(reader, EMPTY_SUMMARY)
        for until_s in (599.0, 17.0, 300.5, 301.0, 0.0):
            expected_events = LatestEvents.of(events, until_s).knowledge_events
            assert file.latest_events(until_s).knowledge_events == expected_events


def test_a_long_file_is_not_held_in_memory(long_run: Path) -> None:
    def measure_peak_memory_bytes(read_journal: Callable[[], object]) -> int:
        tracemalloc.start()
        read_journal()
        peak_bytes = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return peak_bytes

    def read_latest_events() -> None:
        with JournalReader(long_run) as reader:
            events_by_subject(EventsInFile(reader, reader.header().summary).latest_events(100.0))

    assert 4 * measure_peak_memory_bytes(read_latest_events) < measure_peak_memory_bytes(lambda: read(long_run))
