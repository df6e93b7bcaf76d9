"""A file in MCAP format (https://mcap.dev/spec) that loses nothing when its writer is killed or interrupted.

Messages go into compressed chunks. Until a chunk is full, it exists only in memory. Therefore each record of this chunk
is also written to a region of the file that lies before all chunks, by one call of the operating system. The region is
as large as one chunk. When the chunk itself is written, the region is filled from its start again. The region is one
record. Its opcode is one of those that MCAP reserves for applications, so every reader skips the record. In a finished
file, the region is empty.

In the region, the length of a record, a checksum, and the offset at which the chunk will be written precede each
record. If the file holds a complete chunk at that offset, readers ignore the region.

A signal handler may run between any two instructions of the main thread. It may raise, and it may write a message
itself. Therefore a message first goes into a queue, by one operation, and the messages in the queue are written in
steps. A step derives from the present state and the first message what to write at which position, writes it, and
assigns the next state. If a step is interrupted, it is repeated later with the same result.
"""

from __future__ import annotations

import errno
import os
import struct
import threading
from collections import deque
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, BinaryIO, NamedTuple, NoReturn, TypeVar
from zlib import crc32

from mcap.opcode import Opcode
from mcap.records import Channel, Schema

from codra_dsl.runtime.journal.file_creation import unlock
from codra_dsl.runtime.journal.mcap_records import (
    RECORD_HEADER,
    IndexEntry,
    WrittenChunk,
    make_chunk,
    make_end,
    make_head,
    record_bytes,
)

__all__ = ["CHUNK_BYTES", "OPEN_CHUNK_OPCODE", "RECORD_HEADER", "ChannelDeclaration", "McapFile", "parse_region"]

OPEN_CHUNK_OPCODE = 0x80
"""The opcode of the region. The region is a record that holds the chunk until it is full."""

CHUNK_BYTES = 1 << 16
"""The maximum size of the records that are compressed together, and the size of the region."""

_FRAME_HEADER = struct.Struct("<IIQ")
_MESSAGE_HEADER = struct.Struct("<BQHIQQ")
_MESSAGE_FIELDS_BYTES = _MESSAGE_HEADER.size - RECORD_HEADER.size
_MESSAGE_OPCODE = int(Opcode.MESSAGE)
_MAX_SEQUENCE = 0xFFFFFFFF
_NO_ID = 1 << 32
"""Larger than the number of any channel or schema."""

_Result = TypeVar("_Result")


@dataclass(frozen=True, slots=True, eq=False)
class ChannelDeclaration:
    """A channel of JSON messages. The file declares the channel before its first message.

    Attributes:
        topic: the topic of the channel.
        schema_name: the name of its schema.
        schema: its JSON schema.
        metadata: what tools show about the channel.
    """

    topic: str
    schema_name: str
    schema: bytes
    metadata: Mapping[str, str]


_Message = tuple[ChannelDeclaration, int, int, bytes, int | None]
"""A message: its channel, its log time and publish time in nanoseconds, its data, and its sequence number.

A plain tuple is created much faster than an object of a class.
"""

_END: _Message = (ChannelDeclaration("", "", b"", {}), 0, 0, b"", None)
"""In the queue, the end of the file."""


class _Parts(NamedTuple):
    """The parts of the file that few messages change.

    Attributes:
        chunk_offset: the offset at which the open chunk will be written; 0 before the head is written.
        offset_checksum: the checksum of this offset, with which the checksum of each record in the region begins.
        chunk_count: the number of chunks in the file.
        schema_count: the number of declared schemas.
        channel_count: the number of declared channels.
    """

    chunk_offset: int = 0
    offset_checksum: int = 0
    chunk_count: int = 0
    schema_count: int = 0
    channel_count: int = 0


class _State(NamedTuple):
    """The content of the file; one assignment replaces the state after each step.

    Attributes:
        last_message: the last message in the file; the end of the file if it is complete.
        sequence: the sequence number of this message.
        chunk_bytes: the size of the records in the open chunk.
        message_count: the number of messages in the open chunk.
        region_bytes: the size of the used part of the region.
        parts: the other parts of the file.
    """

    last_message: _Message | None = None
    sequence: int = 0
    chunk_bytes: int = 0
    message_count: int = 0
    region_bytes: int = 0
    parts: _Parts = _Parts()


class McapFile:
    """A journal's file while it is written. Threads and signal handlers may call all methods at any instant.

    A call writes its message before it returns. Only in a signal handler that has interrupted another call of the same
    thread, the message is queued, and the interrupted call writes it. If the handler raises, the next call writes it.

    Attributes:
        failure: the error that has ended the file early; None if there was none.
    """

    def __init__(self, stream: BinaryIO, metadata: Mapping[str, Mapping[str, str]], files: Mapping[str, bytes]) -> None:
        """Prepare the file. The first call writes its start.

        Args:
            stream: an empty file that supports reading and writing. The end of the file closes it.
            metadata: metadata that tools show about the file. The key is the name of the metadata.
            files: JSON texts to attach to the file. The key is the name of the attachment.
        """
        self.failure: Exception | None = None
        self._stream, self._descriptor = stream, stream.fileno()
        self._head = make_head(metadata, files)
        self._start = self._head.content + RECORD_HEADER.pack(OPEN_CHUNK_OPCODE, CHUNK_BYTES)
        self._lock: Any = threading.RLock()
        self._pending_messages: deque[_Message] = deque()
        self._state = _State()
        # A step may add to these before it is interrupted: only the records that the state counts are valid.
        self._chunk = bytearray()
        self._entries: list[IndexEntry] = []
        self._chunks: list[WrittenChunk] = []
        self._schemas: list[Schema] = []
        self._channels: list[Channel] = []
        self._schema_ids: dict[tuple[str, bytes], int] = {}
        self._channel_ids: dict[ChannelDeclaration, int] = {}

    @property
    def is_over(self) -> bool:
        """Return whether the file is complete or has failed, so that no message is written any more."""
        return self._state.last_message is _END or self.failure is not None

    def add(
        self, channel: ChannelDeclaration, log_ns: int, publish_ns: int, data: bytes, sequence: int | None = None
    ) -> None:
        """Write a message. After this call, the message survives the death of the process.

        Args:
            channel: the channel. Calls for the same channel pass the same object.
            log_ns: the time of the message.
            publish_ns: the time at which the message was published.
            data: the JSON text of the message.
            sequence: the sequence number; by default, the number after that of the last message.

        Raises:
            OSError: if the message cannot be written, or the file was removed, truncated or overwritten. Then `failure`
                is this error.
        """
        self._accept((channel, log_ns, publish_ns, data, sequence))

    def finish(self) -> None:
        """Write the summary, which readers use as an index, clear the region, and close the stream.

        Later messages are not written. A repeated call has no effect.

        Raises:
            OSError: as for `add`.
        """
        self._accept(_END)

    def fail(self, error: Exception) -> None:
        """End the file early, because a message cannot be encoded."""
        self.failure = error
        self._accept(_END)

    def _accept(self, message: _Message) -> None:
        self._pending_messages.append(message)
        # `_is_owned` is what `threading.Condition` uses: it is true in a handler that has interrupted `_write_pending`.
        while self._pending_messages and not self._lock._is_owned():
            with self._lock:  # a handler may queue a message until the lock is released
                self._write_pending()

    def _write_pending(self) -> None:
        try:
            while self._pending_messages:
                message, state = self._pending_messages[0], self._state
                while state.last_message is not message and state.last_message is not _END and self.failure is None:
                    self._state = state = self._next_state(message)
                self._pending_messages.popleft()
        finally:
            if self.failure is not None or self._state.last_message is _END:
                self._close()

    def _next_state(self, message: _Message) -> _State:
        """Take one step towards writing a message, and return the state after the step."""
        state = self._state
        if not state.parts.chunk_offset:
            self._write(self._start + bytes(CHUNK_BYTES), 0)
            return state._replace(parts=_at_offset(state.parts, len(self._start) + CHUNK_BYTES))
        if message is _END:
            return self._end_chunk(state) if state.chunk_bytes else self._finish(state)
        self._check_size(state)
        return self._add_to_chunk(message, state)

    def _add_to_chunk(self, message: _Message, state: _State) -> _State:
        """Add a message to the open chunk and the region. If the region has no room, write the chunk."""
        channel, log_ns, publish_ns, data, sequence = message
        _, last_sequence, chunk_bytes, message_count, region_start, parts = state
        channel_id, declarations = self._channel_ids.get(channel, _NO_ID), b""
        frames = b""
        if channel_id > parts.channel_count:
            records, parts = self._declare(channel, parts)
            channel_id, declarations = parts.channel_count, b"".join(records)
            frames = b"".join([_frame(record, parts) for record in records])
        sequence = last_sequence + 1 if sequence is None else sequence
        numbers = (channel_id, sequence & _MAX_SEQUENCE, log_ns, publish_ns)
        record = _MESSAGE_HEADER.pack(_MESSAGE_OPCODE, _MESSAGE_FIELDS_BYTES + len(data), *numbers) + data
        frames += _frame(record, parts)
        region_bytes = region_start + len(frames)
        if region_bytes > CHUNK_BYTES and chunk_bytes:
            return self._end_chunk(state)
        self._chunk[chunk_bytes:] = declarations + record
        chunk_bytes = len(self._chunk)
        self._entries[message_count:] = [(channel_id, log_ns, chunk_bytes - len(record))]
        following_state = _State(message, sequence, chunk_bytes, message_count + 1, region_bytes, parts)
        if region_bytes > CHUNK_BYTES:  # a message that is larger than the region
            return self._end_chunk(following_state)
        self._write(frames, len(self._start) + region_start)
        return following_state

    def _declare(self, declaration: ChannelDeclaration, parts: _Parts) -> tuple[list[bytes], _Parts]:
        """Return the records that declare a channel and, if it is new, its schema; and the parts with them."""
        records, schema_count, channel_id = list[bytes](), parts.schema_count, parts.channel_count + 1
        schema_key = (declaration.schema_name, declaration.schema)
        schema_id = self._schema_ids.get(schema_key, _NO_ID)
        if schema_id > schema_count:
            self._schema_ids[schema_key] = schema_id = schema_count + 1
            schema = Schema(id=schema_id, data=declaration.schema, encoding="jsonschema", name=declaration.schema_name)
            self._schemas[schema_count:] = [schema]
            records.append(record_bytes(schema))
        channel = Channel(
            id=channel_id,
            topic=declaration.topic,
            message_encoding="json",
            metadata=dict(declaration.metadata),
            schema_id=schema_id,
        )
        self._channel_ids[declaration] = channel_id
        self._channels[parts.channel_count :] = [channel]
        records.append(record_bytes(channel))
        return records, parts._replace(schema_count=max(schema_count, schema_id), channel_count=channel_id)

    def _end_chunk(self, state: _State) -> _State:
        """Write the open chunk of a state, and return the state after it."""
        self._check_file(state)
        parts = state.parts
        records, entries = bytes(self._chunk[: state.chunk_bytes]), self._entries[: state.message_count]
        content, written_chunk = make_chunk(records, entries, parts.chunk_offset)
        self._write(content, parts.chunk_offset)
        self._chunks[parts.chunk_count :] = [written_chunk]
        following_parts = _at_offset(parts, parts.chunk_offset + len(content))._replace(
            chunk_count=parts.chunk_count + 1
        )
        return state._replace(chunk_bytes=0, message_count=0, region_bytes=0, parts=following_parts)

    def _finish(self, state: _State) -> _State:
        self._check_file(state)
        parts = state.parts
        chunks, schemas = self._chunks[: parts.chunk_count], self._schemas[: parts.schema_count]
        channels = self._channels[: parts.channel_count]
        self._write(make_end(parts.chunk_offset, self._head, chunks, schemas, channels), parts.chunk_offset)
        self._write(bytes(CHUNK_BYTES), len(self._start))
        return state._replace(last_message=_END)

    def _check_size(self, state: _State) -> None:
        """Raise an error if the file was truncated; this takes less time than `os.fstat`."""
        if self._call(os.lseek, self._descriptor, 0, os.SEEK_END) < state.parts.chunk_offset:
            self._fail(OSError(errno.EIO, "the file was truncated while it was being written"))

    def _check_file(self, state: _State) -> None:
        """Raise an error if the file was removed, truncated or overwritten, so that further writes would be lost."""
        self._check_size(state)
        if self._call(os.fstat, self._descriptor).st_nlink == 0:
            self._fail(FileNotFoundError(errno.ENOENT, "the file was removed while it was being written"))
        if self._call(os.pread, self._descriptor, len(self._start), 0) != self._start:
            self._fail(OSError(errno.EIO, "the file was overwritten while it was being written"))

    def _write(self, content: bytes, offset: int) -> None:
        written_bytes = self._call(os.pwrite, self._descriptor, content, offset)
        while written_bytes < len(content):
            rest = content[written_bytes:]
            written_bytes += self._call(os.pwrite, self._descriptor, rest, offset + written_bytes)

    def _call(self, function: Callable[..., _Result], *arguments: object) -> _Result:
        """Call a function of the operating system. Its error is the failure of the file."""
        try:
            return function(*arguments)
        except OSError as error:
            is_raised_by_handler = error.__traceback__ is not None and error.__traceback__.tb_next is not None
            if is_raised_by_handler:  # a signal handler may raise any error, for example TimeoutError
                raise
            self._fail(error)

    def _fail(self, error: OSError) -> NoReturn:
        self.failure = error
        raise error

    def _close(self) -> None:
        """Close the stream, and mark the file as no longer being written; a repeated call has no effect."""
        if not self._stream.closed:
            with suppress(OSError):  # a file system without locks
                unlock(self._stream)
            self._call(self._stream.close)


def _at_offset(parts: _Parts, chunk_offset: int) -> _Parts:
    return parts._replace(chunk_offset=chunk_offset, offset_checksum=_checksum_of_offset(chunk_offset))


def _frame(record: bytes, parts: _Parts) -> bytes:
    return _FRAME_HEADER.pack(len(record), crc32(record, parts.offset_checksum), parts.chunk_offset) + record


def _checksum_of_offset(chunk_offset: int) -> int:
    return crc32(chunk_offset.to_bytes(8, "little"))


def parse_region(region: bytes) -> tuple[int, bytes]:
    """Return the content of a file's region: the offset at which its chunk will be written, and its joined records."""
    records, position, chunk_offset = bytearray(), 0, None
    while position + _FRAME_HEADER.size <= len(region):
        length, checksum, offset = _FRAME_HEADER.unpack_from(region, position)
        position += _FRAME_HEADER.size
        record = region[position : position + length]
        is_intact = 0 < length == len(record) and checksum == crc32(record, _checksum_of_offset(offset))
        if not is_intact or offset != (offset if chunk_offset is None else chunk_offset):
            break
        chunk_offset = offset
        records += record
        position += length
    return (0 if chunk_offset is None else chunk_offset, bytes(records))
