"""Read the index of an MCAP file, and its chunks, without more memory than a limit allows.

Sizes that a chunk declares are never trusted: the decompression itself stops at the limit.

The summary at the end of a finished file states which chunks have messages of which channels, with a checksum. So a
question needs only few chunks. A file without an intact summary, such as the file of a program that still runs, has to
be read from its start.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass
from io import BytesIO
from typing import BinaryIO
from zlib import crc32

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema

from codra_dsl.runtime.journal.file_creation import MAGIC
from codra_dsl.runtime.journal.limits import MAX_RECORD_BYTES, MAX_SUMMARY_SECTION_BYTES
from codra_dsl.runtime.journal.mcap_records import FOOTER_FIELDS, RECORD_HEADER

_MESSAGE_FIELDS = struct.Struct("<HIQQ")
_CHECKSUM = struct.Struct("<I")
_END_BYTES = FOOTER_FIELDS.size + _CHECKSUM.size + len(MAGIC)
_DATA_END_BYTES = RECORD_HEADER.size + _CHECKSUM.size
_CHUNK_FIELDS = struct.Struct("<QQQQI")
_BYTE_COUNT = struct.Struct("<Q")
_MESSAGE_INDEX_OFFSET = struct.Struct("<HQ")
_MAX_CHUNK_BYTES = RECORD_HEADER.size + MAX_RECORD_BYTES


class TooLargeError(ValueError):
    """A chunk has more bytes than `MAX_RECORD_BYTES` after decompression."""


def decompress(chunk: Chunk) -> bytes:
    """Return the records of a chunk.

    Raises:
        TooLargeError: if they exceed the limit.
        ValueError: if the compression is unknown, or the size or checksum differs from the declared one. The libraries
            for compression have further errors.
    """
    max_bytes = min(chunk.uncompressed_size, MAX_RECORD_BYTES) + 1
    match chunk.compression:
        case "":
            records = chunk.data
        case "zstd":
            decompressor = zstandard.ZstdDecompressor(max_window_size=MAX_RECORD_BYTES)
            records = decompressor.stream_reader(chunk.data).read(max_bytes)
        case "lz4":
            records = lz4.frame.LZ4FrameDecompressor().decompress(chunk.data, max_length=max_bytes)
        case _:
            raise ValueError(f"the compression {chunk.compression[:20]!r} is unknown")
    if len(records) > MAX_RECORD_BYTES:
        raise TooLargeError(f"more than {MAX_RECORD_BYTES:,} bytes, which is the limit for a chunk")
    if len(records) != chunk.uncompressed_size:
        raise ValueError(f"it has not the size that it declares, {chunk.uncompressed_size:,} bytes")
    if chunk.uncompressed_crc not in (0, crc32(records)):
        raise ValueError("its checksum does not match")
    return records


def split_records(records: bytes) -> Iterator[Schema | Channel | Message]:
    """Yield the schemas, channels and messages among concatenated records.

    Raises:
        ValueError, EndOfFile, struct.error: if a record is damaged; the records before it have been yielded.
    """
    position = 0
    while position < len(records):
        opcode, length = RECORD_HEADER.unpack_from(records, position)
        start = position + RECORD_HEADER.size
        position = start + length
        if position > len(records):
            raise ValueError("its last record is incomplete")
        if opcode == Opcode.MESSAGE:
            data = records[start + _MESSAGE_FIELDS.size : position]
            channel_id, sequence, log_time, publish_time = _MESSAGE_FIELDS.unpack_from(records, start)
            yield Message(channel_id, log_time, data, publish_time, sequence)
        elif opcode == Opcode.CHANNEL:
            yield Channel.read(ReadDataStream(BytesIO(records[start:position])))
        elif opcode == Opcode.SCHEMA:
            yield Schema.read(ReadDataStream(BytesIO(records[start:position])))


def select_messages(records: bytes, channel_ids: frozenset[int]) -> Iterator[tuple[int, Message]]:
    """Yield the messages of some channels, each with its number among all messages; stop at a damaged record.

    Most messages are of other channels. For them, no object is created.
    """
    position, number = 0, 0
    while position + RECORD_HEADER.size < len(records):
        opcode, length = RECORD_HEADER.unpack_from(records, position)
        start = position + RECORD_HEADER.size
        position = start + length
        if opcode == Opcode.MESSAGE:
            if position > len(records) or length < _MESSAGE_FIELDS.size:
                return
            channel_id, sequence, log_time, publish_time = _MESSAGE_FIELDS.unpack_from(records, start)
            if channel_id in channel_ids:
                data = records[start + _MESSAGE_FIELDS.size : position]
                yield number, Message(channel_id, log_time, data, publish_time, sequence)
            number += 1


@dataclass(frozen=True, slots=True)
class IndexedChunk:
    """A chunk in an index.

    Attributes:
        offset: the offset of the chunk in the file.
        byte_count: the size of its record; without a meaning for a chunk that is only in the region.
        start_s: the instant of its first message, to the microsecond.
        channel_ids: the channels of its messages.
    """

    offset: int
    byte_count: int
    start_s: float
    channel_ids: frozenset[int]


def read_summary_section(stream: BinaryIO, file_byte_count: int) -> tuple[int, bytes] | None:
    """Return the records at the end of a finished file, with their offset; None if there are none, or damaged ones."""
    if file_byte_count < _END_BYTES:
        return None
    stream.seek(file_byte_count - _END_BYTES)
    end = stream.read(_END_BYTES)
    opcode, _, start, _ = FOOTER_FIELDS.unpack_from(end)
    section_byte_count = file_byte_count - _END_BYTES - start
    if (
        opcode != Opcode.FOOTER
        or not end.endswith(MAGIC)
        or not start
        or not 0 < section_byte_count <= MAX_SUMMARY_SECTION_BYTES
    ):
        return None
    stream.seek(start)
    section = stream.read(section_byte_count)
    (checksum,) = _CHECKSUM.unpack_from(end, FOOTER_FIELDS.size)
    return (start, section) if checksum == crc32(end[: FOOTER_FIELDS.size], crc32(section)) else None


def indexed_chunks(summary_section: bytes, first_offset: int, section_offset: int) -> list[IndexedChunk]:
    """Return the chunks of a file, in order, from the records at its end.

    Args:
        summary_section: the records at the end of the file.
        first_offset: the offset of the first chunk.
        section_offset: the offset of `summary_section`.

    Raises:
        ValueError, struct.error: if a record is damaged, or if the chunks overlap or leave a part of the file out.
    """
    chunks, chunk_offset, position = list[IndexedChunk](), first_offset, 0
    while position < len(summary_section):
        opcode, length = RECORD_HEADER.unpack_from(summary_section, position)
        start, position = position + RECORD_HEADER.size, position + RECORD_HEADER.size + length
        if opcode == Opcode.CHUNK_INDEX:
            start_ns, _, offset, byte_count, map_byte_count = _CHUNK_FIELDS.unpack_from(summary_section, start)
            map_start = start + _CHUNK_FIELDS.size
            map_end = map_start + map_byte_count
            (message_index_byte_count,) = _BYTE_COUNT.unpack_from(summary_section, map_end)
            if map_end > position or offset != chunk_offset or not RECORD_HEADER.size <= byte_count <= _MAX_CHUNK_BYTES:
                raise ValueError("the index of a chunk is damaged")
            chunk_offset += byte_count + message_index_byte_count
            message_indexes = _MESSAGE_INDEX_OFFSET.iter_unpack(summary_section[map_start:map_end])
            channel_ids = frozenset(channel_id for channel_id, _ in message_indexes)
            chunks.append(IndexedChunk(offset, byte_count, start_ns / 1e9, channel_ids))
    if chunk_offset + _DATA_END_BYTES != section_offset:
        raise ValueError("the index does not have all chunks")
    return chunks
