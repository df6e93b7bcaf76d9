"""A file in MCAP format (https://mcap.dev/spec) that loses nothing when its writer is killed.

Messages go into compressed chunks. Until a chunk is full, it exists only in memory. Therefore each record of this chunk
is also written to a region of the file that lies before all chunks, by one call of the operating system. The region is
as large as one chunk. When the chunk itself is written, the region is filled from its start again. The region is one
record. Its opcode is one of those that MCAP reserves for applications, so every reader skips the record. In a finished
file, the region is empty.

In the region, the length of a record, a checksum, and the offset at which the chunk will be written precede each
record. If the file holds a complete chunk at that offset, readers ignore the region.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Mapping
from typing import Any, BinaryIO

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import Channel, McapRecord, Schema
from mcap.writer import Writer

from codra_dsl.runtime.journal.file_creation import check_exists

OPEN_CHUNK_OPCODE = 0x80
"""The opcode of the region. The region is a record that holds the chunk until it is full."""

CHUNK_BYTES = 1 << 16
"""The maximum size of the records that are compressed together, and the size of the region."""

RECORD_HEADER = struct.Struct("<BQ")
_FRAME_HEADER = struct.Struct("<IIQ")
_MESSAGE_HEADER = struct.Struct("<BQHIQQ")
_MESSAGE_FIELDS_BYTES = _MESSAGE_HEADER.size - RECORD_HEADER.size
_UNLIMITED_CHUNK_BYTES = 1 << 62  # so large that the MCAP writer never ends a chunk by itself


class McapFile:
    """A journal's file while it is written."""

    def __init__(self, stream: BinaryIO, metadata: Mapping[str, Mapping[str, str]], files: Mapping[str, bytes]) -> None:
        """Write the start of the file, before all messages.

        Args:
            stream: an empty file that supports reading, writing and seeking.
            metadata: metadata that tools show about the file. The key is the name of the metadata.
            files: JSON texts to attach to the file. The key is the name of the attachment.
        """
        self._stream = stream
        writer: Any = Writer(stream, chunk_size=_UNLIMITED_CHUNK_BYTES)
        self._writer = writer
        self._writer.start(profile="")
        for name, metadata_entries in metadata.items():
            self._writer.add_metadata(name, dict(metadata_entries))
        for name, data in files.items():
            self._writer.add_attachment(0, 0, name, "application/json", data)
        stream.write(RECORD_HEADER.pack(OPEN_CHUNK_OPCODE, CHUNK_BYTES))
        self._region_offset = stream.tell()
        stream.write(bytes(CHUNK_BYTES))
        stream.flush()
        self._chunk_offset = stream.tell()
        self._used_region_bytes = 0
        self._chunk_message_count = 0

    def open_channel(self, topic: str, schema_id: int, metadata: Mapping[str, str]) -> int:
        """Open a channel of JSON messages; return the number of the channel."""
        channel_id: int = self._writer.register_channel(topic, "json", schema_id, dict(metadata))
        record = Channel(
            id=channel_id, topic=topic, message_encoding="json", metadata=dict(metadata), schema_id=schema_id
        )
        self._write_to_region(_record_bytes(record))
        return channel_id

    def add_schema(self, name: str, text: bytes) -> int:
        """Declare a JSON schema; return the number of the schema."""
        schema_id: int = self._writer.register_schema(name, "jsonschema", text)
        self._write_to_region(_record_bytes(Schema(id=schema_id, data=text, encoding="jsonschema", name=name)))
        return schema_id

    def add(self, channel_id: int, log_ns: int, publish_ns: int, sequence: int, data: bytes) -> None:
        """Write a message. After this call, the message survives the death of the process.

        Raises:
            OSError: if the message cannot be written, or the file was removed.
        """
        record = (
            _MESSAGE_HEADER.pack(
                Opcode.MESSAGE, _MESSAGE_FIELDS_BYTES + len(data), channel_id, sequence, log_ns, publish_ns
            )
            + data
        )
        if not self._has_room(record) and self._chunk_message_count:
            self._end_chunk()
        self._writer.add_message(channel_id, log_ns, data, publish_ns, sequence)
        self._chunk_message_count += 1
        self._write_to_region(record)

    def finish(self) -> None:
        """Write the summary, which readers use as an index, and clear the region.

        Raises:
            OSError: if the summary cannot be written, or the file was removed.
        """
        self._writer.finish()
        self._stream.flush()
        os.pwrite(self._stream.fileno(), bytes(CHUNK_BYTES), self._region_offset)
        check_exists(self._stream)

    def _write_to_region(self, record: bytes) -> None:
        """Put a record of the open chunk into the region. If there is no room, end the chunk as soon as possible."""
        if self._has_room(record):
            frame = _FRAME_HEADER.pack(len(record), _checksum(self._chunk_offset, record), self._chunk_offset) + record
            os.pwrite(self._stream.fileno(), frame, self._region_offset + self._used_region_bytes)
            self._used_region_bytes += len(frame)
        elif self._chunk_message_count:
            self._end_chunk()
        else:
            self._used_region_bytes = CHUNK_BYTES

    def _has_room(self, record: bytes) -> bool:
        return self._used_region_bytes + _FRAME_HEADER.size + len(record) <= CHUNK_BYTES

    def _end_chunk(self) -> None:
        check_exists(self._stream)
        self._writer.flush()
        self._chunk_offset, self._used_region_bytes, self._chunk_message_count = self._stream.tell(), 0, 0


def _record_bytes(record: McapRecord) -> bytes:
    builder: Any = RecordBuilder()
    record.write(builder)
    record_bytes: bytes = builder.end()
    return record_bytes


def _checksum(chunk_offset: int, record: bytes) -> int:
    return zlib.crc32(record, zlib.crc32(chunk_offset.to_bytes(8, "little")))


def parse_region(region: bytes) -> tuple[int, bytes]:
    """Return the content of a file's region: the offset at which its chunk will be written, and its joined records."""
    records, position, chunk_offset = bytearray(), 0, None
    while position + _FRAME_HEADER.size <= len(region):
        length, checksum, offset = _FRAME_HEADER.unpack_from(region, position)
        position += _FRAME_HEADER.size
        record = region[position : position + length]
        is_intact = 0 < length == len(record) and checksum == _checksum(offset, record)
        if not is_intact or offset != (offset if chunk_offset is None else chunk_offset):
            break
        chunk_offset = offset
        records += record
        position += length
    return (0 if chunk_offset is None else chunk_offset, bytes(records))
