"""Forged journals: readers stop at limits on decompressed bytes, messages, JSON values and the spec summary."""

from __future__ import annotations

import json
import struct
from collections.abc import Callable
from pathlib import Path
from typing import Any

import lz4.frame  # type: ignore[import-untyped]
import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, DataEnd, Footer, Header, McapRecord, Metadata, Schema

from codra_dsl.runtime import Journal
from codra_dsl.runtime.journal import Event, Kind
from codra_dsl.runtime.journal.file_creation import MAGIC
from codra_dsl.runtime.journal.limits import MAX_MESSAGE_VALUES
from codra_dsl.runtime.journal.reader import JournalError, JournalReader
from codra_dsl.runtime.journal.recovery import recover
from codra_dsl.runtime.journal.writer import MAX_MESSAGE_BYTES
from codra_dsl.runtime.values.condition_text import ConditionTextError, parse_condition
from tests.runtime.journal.journals import read, run_door

COMPRESSIONS: dict[str, Callable[[bytes], bytes]] = {
    "": bytes,
    "zstd": zstandard.ZstdCompressor(level=3).compress,
    "lz4": lz4.frame.compress,
}
EVENT = b'{"instant_s":1.0,"name":"near","what":"identified"}'


def record_bytes(record: McapRecord) -> bytes:
    builder: Any = RecordBuilder()
    record.write(builder)
    content: bytes = builder.end()
    return content


CHANNEL = record_bytes(Schema(id=1, data=b"{}", encoding="jsonschema", name="s")) + record_bytes(
    Channel(id=1, topic="/codra/context/near", message_encoding="json", metadata={}, schema_id=1)
)
END = record_bytes(DataEnd(0)) + record_bytes(Footer(0, 0, 0)) + MAGIC


def message_bytes(data: bytes) -> bytes:
    return struct.pack("<BQHIQQ", Opcode.MESSAGE, 22 + len(data), 1, 0, 0, 0) + data


def chunk_bytes(records: bytes, compression: str, declared_size: int | None = None) -> bytes:
    return record_bytes(
        Chunk(
            compression=compression,
            data=COMPRESSIONS[compression](records),
            message_start_time=0,
            message_end_time=0,
            uncompressed_crc=0,
            uncompressed_size=len(records) if declared_size is None else declared_size,
        )
    )


@pytest.fixture(scope="module")
def journal(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return run_door(tmp_path_factory.mktemp("limits") / "run.mcap", loops=1).path


def forged(journal: Path, target: Path, chunks: bytes, summary: bytes | None = None) -> Path:
    """Write a file with the start of a journal, other chunks, and perhaps another spec summary."""
    with JournalReader(journal) as reader:
        metadata, files = reader.metadata, reader.files
    start = [Metadata(name=name, metadata=entries) for name, entries in metadata.items()]
    attachments = [
        Attachment(0, 0, name, "application/json", data if summary is None else summary) for name, data in files.items()
    ]
    content = b"".join(map(record_bytes, [Header(profile="", library=""), *start, *attachments]))
    target.write_bytes(MAGIC + content + chunks + END)
    return target


def read_events(path: Path) -> int:
    with JournalReader(path) as reader:
        reader.header()
        return sum(1 for _ in reader.events())


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_a_chunk_that_grows_beyond_the_limit_stops_the_reader(journal: Path, tmp_path: Path, compression: str) -> None:
    large_chunk = chunk_bytes(CHANNEL + message_bytes(b" " * 40_000_000), compression)

    with pytest.raises(JournalError, match=r"a chunk of more than 16,777,216 bytes, which is the limit.*, at byte \d+"):
        read_events(forged(journal, tmp_path / "bomb.mcap", large_chunk * 3))


def test_recover_leaves_a_chunk_beyond_the_limit_out(journal: Path, tmp_path: Path) -> None:
    chunks = [CHANNEL + message_bytes(EVENT), message_bytes(b" " * 17_000_000), message_bytes(EVENT)]
    path = forged(journal, tmp_path / "bomb.mcap", b"".join(chunk_bytes(chunk, "zstd") for chunk in chunks))

    recovery = recover(path, tmp_path / "recovered.mcap")

    assert recovery.message_count == 2
    assert [part.split(": ")[1] for part in recovery.damage.unreadable_parts] == [
        "more than 16,777,216 bytes, which is the limit for a chunk"
    ]


@pytest.mark.parametrize("compression", list(COMPRESSIONS))
@pytest.mark.parametrize("declared_size", [1000, 2**60])
def test_a_chunk_with_a_wrong_declared_size_is_damage(
    journal: Path, tmp_path: Path, compression: str, declared_size: int
) -> None:
    wrong_chunk = chunk_bytes(CHANNEL + message_bytes(b" " * 1_000_000), compression, declared_size)
    path = forged(journal, tmp_path / "wrong.mcap", wrong_chunk + chunk_bytes(CHANNEL + message_bytes(EVENT), ""))

    with JournalReader(path) as reader:
        assert [event.name for event in reader.events()] == ["near"]
        assert ["it has not the size that it declares" in part for part in reader.damage.unreadable_parts] == [True]


@pytest.mark.parametrize("compression", ["zstd", "lz4"])
def test_many_chunks_within_the_limit_stop_the_reader_by_their_sum(
    journal: Path, tmp_path: Path, compression: str
) -> None:
    chunk = chunk_bytes(CHANNEL + message_bytes(b" " * 15_000_000), compression)

    with pytest.raises(JournalError, match=r"bytes of decompressed messages: the limit is 16,777,216, and 32 for each"):
        read_events(forged(journal, tmp_path / "bomb.mcap", chunk * 20))


def test_very_many_small_messages_stop_the_reader(journal: Path, tmp_path: Path) -> None:
    chunk = chunk_bytes(CHANNEL + message_bytes(EVENT) * 100_000, "zstd")

    with pytest.raises(
        JournalError, match=r"more than 50,\d+ messages: the limit is 50,000, and 0.125 for each of the"
    ):
        read_events(forged(journal, tmp_path / "bomb.mcap", chunk))


@pytest.mark.parametrize("compression", list(COMPRESSIONS))
def test_very_many_empty_messages_stop_the_reader(journal: Path, tmp_path: Path, compression: str) -> None:
    chunk = chunk_bytes(CHANNEL + message_bytes(b"") * 20_000, compression)

    with pytest.raises(JournalError, match="more than 10,000 parts that cannot be read, which is the limit; the first"):
        read_events(forged(journal, tmp_path / "bomb.mcap", chunk))


@pytest.mark.parametrize("compression", list(COMPRESSIONS))
def test_a_message_with_very_many_values_stops_the_reader(journal: Path, tmp_path: Path, compression: str) -> None:
    message = EVENT[:-1] + b',"q":[' + b"[]," * 600_000 + b"0]}"

    with pytest.raises(JournalError, match="JSON values"):
        read_events(forged(journal, tmp_path / "bomb.mcap", chunk_bytes(CHANNEL + message_bytes(message), compression)))


@pytest.mark.parametrize("instant", ["1" + "0" * 400, "1e999", "NaN", "-1e999"])
def test_a_message_without_a_finite_instant_is_damage(journal: Path, tmp_path: Path, instant: str) -> None:
    message = message_bytes(f'{{"instant_s":{instant},"name":"near","what":"identified"}}'.encode())
    path = forged(journal, tmp_path / "instant.mcap", chunk_bytes(CHANNEL + message + message_bytes(EVENT), ""))

    with JournalReader(path) as reader:
        assert [event.instant_s for event in reader.events()] == [1.0]
        assert len(reader.damage.unreadable_parts) == 1


def test_a_large_spec_summary_is_refused(journal: Path, tmp_path: Path) -> None:
    path = forged(journal, tmp_path / "summary.mcap", b"", b'{"a":[' + b"[]," * 1_500_000 + b"0]}")

    with pytest.raises(JournalError, match="a spec summary of 4,500,009 bytes: the limit is 4,194,304 bytes"):
        read_events(path)


def test_long_conditions_in_a_spec_summary_are_refused(journal: Path, tmp_path: Path) -> None:
    with JournalReader(journal) as reader:
        (summary,) = map(json.loads, reader.files.values())
    algorithm = summary["algorithms"]["look"]
    algorithm["observable_when"] = [
        {"text": None, "place": None, "python": 'value("near").is_in(' + "1," * 150_000 + "1)"}
    ]
    path = forged(journal, tmp_path / "summary.mcap", b"", json.dumps(summary).encode())

    with pytest.raises(JournalError, match=r"conditions of 300,\d+ characters in its spec summary: the limit is"):
        read_events(path)


def test_attachments_beyond_the_limit_are_refused(journal: Path, tmp_path: Path) -> None:
    attachments = b"".join(record_bytes(Attachment(0, 0, f"{number}", "", bytes(6_000_000))) for number in range(3))

    with pytest.raises(JournalError, match="more than 16,777,216 bytes before its messages, which is the limit"):
        read_events(forged(journal, tmp_path / "attached.mcap", attachments))


@pytest.mark.parametrize("text", ['literal("a"*3000000000)', "first_of((1,)*1000000000)", "literal(1 + 1)"])
def test_a_condition_that_computes_with_constants_is_refused_before_the_computation(text: str) -> None:
    with pytest.raises(ConditionTextError, match="are not conditions"):
        parse_condition(text)


def test_a_long_journal_stays_far_below_the_limits(tmp_path: Path) -> None:
    """The content of a journal grows with its file; this one has a quarter of what the limits allow, or less."""
    path = run_door(tmp_path / "run.mcap", loops=60).path
    file_byte_count = path.stat().st_size

    with JournalReader(path) as reader:
        messages = [raw_message.message.data for raw_message in reader.raw_messages()]

    assert len(messages) < 0.125 / 3 * file_byte_count
    assert sum(map(len, messages)) < 32 / 4 * file_byte_count
    assert sum(message.count(b",") for message in messages) < 2 / 4 * file_byte_count


def large_event(instant_s: float, detail: object) -> Event:
    return Event(instant_s, Kind.VARIABLE, "near", "unknown", {"detail": detail})


def test_a_journal_that_repeats_long_texts_can_be_read(journal: Path, tmp_path: Path) -> None:
    """A text of a million equal characters becomes thousands of times smaller by compression."""
    header, _events = read(journal)
    large = Journal(tmp_path / "large.mcap")
    large.begin(lambda: header)
    for number in range(20):
        large.add(large_event(float(number), "a" * 10**6))
    large.end()
    assert [event.instant_s for event in read(large.path)[1]] == list(range(20))


def test_an_event_that_readers_would_refuse_ends_the_journal_with_the_reason(journal: Path, tmp_path: Path) -> None:
    header, _events = read(journal)
    for number, detail in enumerate(["a" * MAX_MESSAGE_BYTES, [0] * (MAX_MESSAGE_VALUES + 1)]):
        path = tmp_path / f"{number}.mcap"
        large = Journal(path)
        large.begin(lambda: header)
        large.add(large_event(1.0, "small"))
        large.add(large_event(2.0, detail))
        large.end()
        assert large.failure is not None
        assert "TooLargeEventError: an event has" in large.failure
        assert [event.instant_s for event in read(path)[1]] == [1.0]


def test_an_event_of_the_largest_size_can_be_read(journal: Path, tmp_path: Path) -> None:
    header, _events = read(journal)
    path = tmp_path / "large.mcap"
    large = Journal(path)
    large.begin(lambda: header)
    large.add(large_event(1.0, "a" * (MAX_MESSAGE_BYTES - 200)))
    large.end()
    assert [event.instant_s for event in read(path)[1]] == [1.0]
