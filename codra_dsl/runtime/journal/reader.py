"""Read a journal, complete or torn.

A file is torn if its writer was killed, its disk was full, or only a part of the file was copied. Other MCAP readers
look for the end of the file first, and refuse a torn file. `JournalReader` reads the region, which holds the
records that are not in a chunk yet, and the file from its start, as far as possible. The messages of the region come
last.
"""

from __future__ import annotations

import json
import math
import os
import struct
from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field
from io import BytesIO
from itertools import chain
from pathlib import Path
from typing import BinaryIO, NamedTuple, Self
from zlib import crc32

from mcap.data_stream import ReadDataStream
from mcap.exceptions import EndOfFile
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, Message, Metadata, Schema

from codra_dsl.runtime.journal.chunks import (
    IndexedChunk,
    TooLargeError,
    decompress,
    indexed_chunks,
    read_summary_section,
    select_messages,
    split_records,
)
from codra_dsl.runtime.journal.encoding import MalformedEventError, event_of
from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.journal.file_creation import MAGIC, is_being_written
from codra_dsl.runtime.journal.limits import (
    MAX_CONDITIONS_LENGTH,
    MAX_MESSAGE_VALUES,
    MAX_RECORD_BYTES,
    MAX_START_BYTES,
    MAX_SUMMARY_BYTES,
    MAX_UNREADABLE_PARTS,
    JournalError,
    ReadingBudget,
    value_count,
)
from codra_dsl.runtime.journal.mcap_file import OPEN_CHUNK_OPCODE, RECORD_HEADER, parse_region
from codra_dsl.runtime.journal.run_header import FORMAT, FORMAT_VERSION, RunHeader
from codra_dsl.runtime.journal.schemas import Kind, kind_of
from codra_dsl.runtime.journal.spec_summary_data import summary_from_data
from codra_dsl.runtime.journal.writer import SUMMARY_FILE

__all__ = [
    "Damage",
    "JournalError",
    "JournalReader",
]

_OPCODES_TO_READ = frozenset({Opcode.METADATA, Opcode.ATTACHMENT, Opcode.CHUNK, OPEN_CHUNK_OPCODE})
_CHECKSUM_BYTES = 4
_MAX_DESCRIBED_PARTS = 20
_MESSAGE_ERRORS = (ValueError, KeyError, TypeError, AttributeError, OverflowError, RecursionError)


@dataclass(slots=True)
class Damage:
    """Missing and unreadable parts of a journal. They are all known once the journal has been read to its end.

    Attributes:
        is_torn: whether the end of the file is missing.
        unreadable_parts: descriptions of the first parts that cannot be read.
        undescribed_part_count: the number of further parts that cannot be read.
        lost_message_count: the number of messages that are missing between other messages, by their sequence numbers.
        regained_message_count: the number of messages that are in no chunk, but only in the region.
    """

    is_torn: bool = False
    unreadable_parts: list[str] = field(default_factory=list)
    undescribed_part_count: int = 0
    lost_message_count: int = 0
    regained_message_count: int = 0

    def add(self, description: str) -> None:
        """Add a part that cannot be read."""
        if len(self.unreadable_parts) < _MAX_DESCRIBED_PARTS:
            self.unreadable_parts.append(description)
        else:
            self.undescribed_part_count += 1

    def part_texts(self) -> tuple[str, ...]:
        """Return one line for each described part, and one for the others."""
        lines = tuple(f"cannot be read: {part}" for part in self.unreadable_parts)
        return (*lines, f"and {self.undescribed_part_count:,} more parts") if self.undescribed_part_count else lines


class RawMessage(NamedTuple):
    """A message with its channel and schema."""

    schema: Schema
    channel: Channel
    message: Message


class JournalReader:
    """Reads a journal once, from its start to its end.

    Attributes:
        metadata: metadata that tools show about the file. The key is the name of the metadata.
        files: the attached files. The key is the name of the file.
        damage: missing and unreadable parts, complete once the journal has been read to its end.
        chunk_offset: the offset of the chunk with the last message.
        message_count: the number of messages that `raw_messages` and `events` have yielded so far. `index` counts all
            messages of a file whose end has no intact index, such as a file that is still being written.
        is_live: whether the program that writes the journal was still running when this reader opened it.
    """

    def __init__(self, path: Path, *, skips_large_chunks: bool = False) -> None:
        """Open a journal and read the part before its messages.

        Args:
            path: the file.
            skips_large_chunks: whether chunks that exceed the limit are damage; otherwise they raise an error.

        Raises:
            JournalError: if the file is not a journal, or this part of it exceeds a limit.
            OSError: if the file cannot be read.
        """
        self.path = path
        self.metadata: dict[str, dict[str, str]] = {}
        self.files: dict[str, bytes] = {}
        self.damage = Damage()
        self.chunk_offset = 0
        self.message_count = 0
        if path.exists() and not path.is_file():
            raise JournalError(f"{path} is not a regular file")
        self._stream: BinaryIO = path.open("rb")
        self.is_live = is_being_written(self._stream)
        self._region: tuple[int, bytes] = (0, b"")
        self._is_region_outdated = False
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._pending_record: tuple[int, int, bytes] | None = None
        self._has_ended = False
        self._skips_large_chunks = skips_large_chunks
        self._budget = ReadingBudget(path, self.size())
        self._counted_chunk_offsets: set[int] = set()
        try:
            self._read_start()
        except BaseException:
            self._stream.close()
            raise

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *_: object) -> None:
        self._stream.close()

    def header(self) -> RunHeader:
        """Return the run header.

        Raises:
            JournalError: if the file has no run header, if the header cannot be read, or if it has a newer format.
        """
        metadata = self.metadata.get(FORMAT)
        if metadata is None or SUMMARY_FILE not in self.files:
            raise JournalError(f"{self.path} is an MCAP file, but not a journal of codra")
        if len(self.files[SUMMARY_FILE]) > MAX_SUMMARY_BYTES:
            raise JournalError(
                f"{self.path} has a spec summary of {len(self.files[SUMMARY_FILE]):,} bytes: "
                f"the limit is {MAX_SUMMARY_BYTES:,} bytes"
            )
        try:
            if int(metadata["format_version"]) > FORMAT_VERSION:
                raise JournalError(
                    f"{self.path} was written by codra {metadata['codra']}, which is newer than this version"
                )
            header = RunHeader.from_data(metadata, summary_from_data(json.loads(self.files[SUMMARY_FILE])))
        except _MESSAGE_ERRORS as error:
            raise JournalError(f"{self.path} has no readable run header: {type(error).__name__}: {error}") from error
        conditions_length = sum(len(rule.python_text) for rule in header.summary.rules())
        if conditions_length > MAX_CONDITIONS_LENGTH:
            raise JournalError(
                f"{self.path} has conditions of {conditions_length:,} characters in its spec summary: "
                f"the limit is {MAX_CONDITIONS_LENGTH:,}"
            )
        return header

    def events(self) -> Iterator[Event]:
        """Yield all events, in the order in which they happened.

        Raises:
            JournalError: if the file exceeds a limit; the same holds for `raw_messages`.
        """
        return (event for raw_message in self.raw_messages() if (event := self.event(raw_message)) is not None)

    def event(self, raw_message: RawMessage) -> Event | None:
        """Return the event of a message; None if the message holds no event or cannot be read."""
        kind = kind_of(raw_message.channel.topic)
        if kind is None:
            return None
        data = raw_message.message.data
        if len(data) > MAX_MESSAGE_VALUES and value_count(data) > MAX_MESSAGE_VALUES:
            raise JournalError(
                f"{self.path} has a message of more than {MAX_MESSAGE_VALUES:,} JSON values, which is the limit"
            )
        try:
            event = event_of(kind, data)
            if not math.isfinite(event.instant_s):
                raise ValueError(f"{event.instant_s} is not an instant")
        except _MESSAGE_ERRORS as error:
            error_text = str(error) if isinstance(error, MalformedEventError) else f"{type(error).__name__}: {error}"
            self._add_damage(f"message {raw_message.message.sequence}: {error_text}")
            return None
        return event

    def raw_messages(self) -> Iterator[RawMessage]:
        """Yield all messages, in the order in which they were written."""
        last_sequence = 0
        for messages, is_region in self._message_groups():
            for message in messages:
                raw_message = self._with_channel(message)
                if raw_message is not None:
                    if message.sequence > last_sequence + 1:
                        self.damage.lost_message_count += message.sequence - last_sequence - 1
                    self.damage.regained_message_count += is_region
                    last_sequence = message.sequence
                    self.message_count += 1
                    yield raw_message

    def index(self) -> list[IndexedChunk]:
        """Return the chunks that have messages, in order. Call this before messages are read.

        If the end of the file has no intact index, all messages are read; only then is `damage` complete.
        """
        position = self._stream.tell()
        offset, section = read_summary_section(self._stream, self.size()) or (0, b"")
        self._stream.seek(position)
        return self._read_index(offset, section) or self._build_index()

    def channel_ids(self) -> dict[str, frozenset[int]]:
        """Return the numbers of the channels of each topic, for the channels that were read so far."""
        channel_ids: dict[str, frozenset[int]] = {}
        for number, channel in self._channels.items():
            channel_ids[channel.topic] = channel_ids.get(channel.topic, frozenset()) | {number}
        return channel_ids

    def kinds(self) -> frozenset[Kind]:
        """Return the kinds of events that the journal has; `index` must have been called."""
        return frozenset(kind for topic in self.channel_ids() if (kind := kind_of(topic)) is not None)

    def messages_in(self, chunk: IndexedChunk, channel_ids: frozenset[int] | None) -> list[tuple[int, RawMessage]]:
        """Return the messages of some channels, or of all, each with its number among all messages of a chunk.

        The chunk is one of those that `index` has returned.
        """
        is_first = chunk.offset not in self._counted_chunk_offsets
        self._counted_chunk_offsets.add(chunk.offset)
        damage, self.damage = self.damage, self.damage if is_first else Damage()  # each part is reported once
        is_in_region = chunk.offset == self._region[0] and not self._is_region_outdated
        records = self._region[1] if is_in_region else self._read_chunk(chunk)
        numbered_messages: Iterable[tuple[int, Message]]
        if is_first or channel_ids is None:
            description = f"the chunk at byte {chunk.offset}"
            numbered_messages = enumerate(self._messages_of_records(records, description, is_counted=is_first))
        else:
            numbered_messages = select_messages(records, channel_ids)
        raw_messages = [
            (number, raw_message)
            for number, message in numbered_messages
            if (raw_message := self._with_channel(message)) is not None
            and (channel_ids is None or message.channel_id in channel_ids)
        ]
        self.damage = damage
        return raw_messages

    def size(self) -> int:
        """Return the current size in bytes; the file grows while a program writes it."""
        return os.fstat(self._stream.fileno()).st_size

    def _read_index(self, offset: int, summary_section: bytes) -> list[IndexedChunk]:
        """Return the chunks from the records at the end of the file; return none if they do not state all topics."""
        try:
            for record in split_records(summary_section):
                self._register(record)
            chunks = indexed_chunks(summary_section, self.chunk_offset, offset)
        except (ValueError, EndOfFile, struct.error):
            return []
        if not chunks or not all(chunk.channel_ids for chunk in chunks):
            return []
        self._is_region_outdated = True  # the end of a file is written when all messages are in chunks
        return chunks

    def _build_index(self) -> list[IndexedChunk]:
        """Return the chunks, after all messages have been read."""
        chunks: dict[int, tuple[int, float, set[int]]] = {}
        for raw_message in self.raw_messages():
            message, offset = raw_message.message, self.chunk_offset
            if offset not in chunks:
                chunks[offset] = (self._stream.tell() - offset, message.log_time / 1e9, set())
            chunks[offset][2].add(message.channel_id)
        self._counted_chunk_offsets.update(chunks)
        return [IndexedChunk(offset, size, start_s, frozenset(ids)) for offset, (size, start_s, ids) in chunks.items()]

    def _read_chunk(self, chunk: IndexedChunk) -> bytes:
        """Return the records of a chunk in the file; return none if they cannot be read."""
        content_byte_count = chunk.byte_count - RECORD_HEADER.size
        self._stream.seek(chunk.offset)
        if self._stream.read(RECORD_HEADER.size) == RECORD_HEADER.pack(Opcode.CHUNK, content_byte_count):
            return self._records_of_chunk(chunk.offset, self._stream.read(content_byte_count)) or b""
        self._add_damage(f"the chunk at byte {chunk.offset}: there is none")
        return b""

    def _with_channel(self, message: Message) -> RawMessage | None:
        """Return a message with its channel; None if the channel was not declared."""
        channel = self._channels.get(message.channel_id)
        schema = None if channel is None else self._schemas.get(channel.schema_id)
        if channel is None or schema is None:
            self._add_damage(f"message {message.sequence}: its channel is missing")
            return None
        return RawMessage(schema, channel, message)

    def _add_damage(self, description: str) -> None:
        self.damage.add(description)
        if self.damage.undescribed_part_count > MAX_UNREADABLE_PARTS:
            raise JournalError(
                f"{self.path} has more than {MAX_UNREADABLE_PARTS:,} parts that cannot be read, which is the limit; "
                f"the first is {self.damage.unreadable_parts[0]}"
            )

    def _read_start(self) -> None:
        magic = self._stream.read(len(MAGIC))
        if magic != MAGIC:
            raise JournalError(f"{self.path} is {_describe_start(magic)}")
        for opcode, offset, content in self._records():
            if offset + len(content) > MAX_START_BYTES and opcode != Opcode.CHUNK:
                raise JournalError(
                    f"{self.path} has more than {MAX_START_BYTES:,} bytes before its messages, which is the limit"
                )
            if opcode not in (OPEN_CHUNK_OPCODE, Opcode.METADATA, Opcode.ATTACHMENT):
                self.chunk_offset, self._pending_record = offset, (opcode, offset, content)
                break
            try:
                self._read_start_record(opcode, content)
            except (ValueError, EndOfFile, struct.error) as error:
                message = f"{self.path} is damaged at byte {offset}, in its run header: "
                raise JournalError(f"{message}{type(error).__name__} {error}".rstrip()) from error

    def _read_start_record(self, opcode: int, content: bytes) -> None:
        """Store a record from the part of the file before the messages.

        The region is read before the chunks. If a program writes the file meanwhile, all chunks that precede the chunk
        in the region already exist in the file. So there is no gap between the messages that are read.
        """
        if opcode == OPEN_CHUNK_OPCODE:
            self._region = parse_region(content)
        elif opcode == Opcode.METADATA:
            metadata = Metadata.read(_stream(content))
            self.metadata[metadata.name] = metadata.metadata
        else:
            if int.from_bytes(content[-_CHECKSUM_BYTES:], "little") not in (0, crc32(content[:-_CHECKSUM_BYTES])):
                raise ValueError("the checksum of an attachment does not match")
            attachment = Attachment.read(_stream(content))
            self.files[attachment.name] = attachment.data

    def _message_groups(self) -> Iterator[tuple[Iterator[Message], bool]]:
        """Yield the messages of each chunk, then those of the region, and whether they are those of the region."""
        pending_records = () if self._pending_record is None else (self._pending_record,)
        for opcode, offset, content in chain(pending_records, self._records()):
            records = self._records_of_chunk(offset, content) if opcode == Opcode.CHUNK else None
            if records is not None:
                self.chunk_offset = offset
                if offset == self._region[0]:
                    self._is_region_outdated = True
                yield self._messages_of_records(records, f"the chunk at byte {offset}"), False
        if not self._is_region_outdated:
            self.chunk_offset = max(self._region[0], self.chunk_offset)
            yield self._messages_of_records(self._region[1], "the region"), True

    def _records_of_chunk(self, offset: int, content: bytes) -> bytes | None:
        """Return the records of a chunk; None if they cannot be read."""
        description = f"the chunk at byte {offset}"
        try:
            return decompress(Chunk.read(_stream(content)))
        except TooLargeError as error:
            if not self._skips_large_chunks:
                raise JournalError(
                    f"{self.path} has a chunk of {error}, at byte {offset}: "
                    "the command codra journal recover leaves such chunks out"
                ) from error
            self._budget.add_bytes(MAX_RECORD_BYTES)
            self._add_damage(f"{description}: {error}")
        except Exception as error:  # noqa: BLE001 - the other chunks can be read despite any error in this one
            self._add_damage(f"{description}: {type(error).__name__}: {error}")
        return None

    def _messages_of_records(self, records: bytes, description: str, *, is_counted: bool = True) -> Iterator[Message]:
        """Register channels and schemas, and yield the messages."""
        if is_counted:
            self._budget.add_chunk(records)
        try:
            for record in split_records(records):
                if isinstance(record, Message):
                    if is_counted:
                        self._budget.add_message()
                    yield record
                else:
                    self._register(record)
        except (ValueError, EndOfFile, struct.error) as error:
            self._add_damage(f"{description}: {type(error).__name__}: {error}")

    def _register(self, record: Schema | Channel | Message) -> None:
        """Store the declaration of a channel or schema."""
        if isinstance(record, Channel):
            self._channels[record.id] = record
        elif isinstance(record, Schema):
            self._schemas[record.id] = record

    def _records(self) -> Iterator[tuple[int, int, bytes]]:
        """Yield opcode, offset and content of each record, up to the end of the data or the last complete record."""
        while not self._has_ended:
            offset = self._stream.tell()
            record_header = self._stream.read(RECORD_HEADER.size)
            opcode, length = RECORD_HEADER.unpack(record_header) if len(record_header) == RECORD_HEADER.size else (0, 0)
            file_byte_count = self._budget.file_byte_count = self.size()
            remaining_byte_count = file_byte_count - offset - RECORD_HEADER.size
            if opcode in (Opcode.DATA_END, Opcode.FOOTER):
                self._stream.seek(-len(MAGIC), 2)
                self.damage.is_torn = self._stream.read() != MAGIC
                self._has_ended = True
            elif opcode == 0 or length > remaining_byte_count:
                self.damage.is_torn = True
                self._has_ended = True
                if offset < file_byte_count and not self.is_live:
                    self._add_damage(f"the last {file_byte_count - offset} bytes, from byte {offset} on")
            elif opcode in _OPCODES_TO_READ and length <= MAX_RECORD_BYTES:
                yield opcode, offset, self._stream.read(length)
            else:
                if opcode in _OPCODES_TO_READ:
                    self._add_damage(
                        f"the record at byte {offset}: {length:,} bytes; the limit is {MAX_RECORD_BYTES:,}"
                    )
                self._stream.seek(length, 1)


def _describe_start(first_bytes: bytes) -> str:
    if not first_bytes:
        return "empty: its run had not begun, or the file was truncated"
    if not any(first_bytes):
        return "not readable: it begins with zeros, because it was truncated while a program wrote it"
    return "not an MCAP file"


def _stream(content: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(content))
