"""Decompress the chunks of an MCAP file, and split them into records, without more memory than a limit allows.

Sizes that a chunk declares are never trusted: the decompression itself stops at the limit.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from io import BytesIO
from zlib import crc32

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Message, Schema

from codra_dsl.runtime.journal.limits import MAX_RECORD_BYTES
from codra_dsl.runtime.journal.mcap_file import RECORD_HEADER

_MESSAGE_FIELDS = struct.Struct("<HIQQ")


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
