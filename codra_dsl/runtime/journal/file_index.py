"""The chunks of a journal's file, with the topics of their messages, so that a question needs only few chunks.

The summary at the end of a finished file has this index, with a checksum. A file without an intact summary, such as the
file of a program that still runs, is read once from its start.
"""

from __future__ import annotations

import struct
from dataclasses import dataclass
from typing import BinaryIO
from zlib import crc32

from mcap.opcode import Opcode

from codra_dsl.runtime.journal.file_creation import MAGIC
from codra_dsl.runtime.journal.limits import MAX_SUMMARY_SECTION_BYTES
from codra_dsl.runtime.journal.mcap_records import FOOTER_FIELDS, RECORD_HEADER

_CHECKSUM = struct.Struct("<I")
_END_BYTES = FOOTER_FIELDS.size + _CHECKSUM.size + len(MAGIC)
_CHUNK_FIELDS = struct.Struct("<QQQQI")
_MESSAGE_INDEX_OFFSET = struct.Struct("<HQ")


@dataclass(frozen=True, slots=True)
class IndexedChunk:
    """A chunk in an index.

    Attributes:
        offset: the offset of the chunk in the file.
        start_s: the instant of its first message, to the microsecond.
        channel_ids: the channels of its messages.
    """

    offset: int
    start_s: float
    channel_ids: frozenset[int]


def read_summary_section(stream: BinaryIO, file_byte_count: int) -> bytes | None:
    """Return the records at the end of a finished file; None if the file has none, or if they are damaged."""
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
    return section if checksum == crc32(end[: FOOTER_FIELDS.size], crc32(section)) else None


def indexed_chunks(summary_section: bytes) -> list[IndexedChunk]:
    """Return the chunks of a file, in order, from the records at its end.

    Raises:
        ValueError, struct.error: if a record is damaged.
    """
    chunks, position = list[IndexedChunk](), 0
    while position < len(summary_section):
        opcode, length = RECORD_HEADER.unpack_from(summary_section, position)
        start, position = position + RECORD_HEADER.size, position + RECORD_HEADER.size + length
        if opcode == Opcode.CHUNK_INDEX:
            start_ns, _, offset, _, map_byte_count = _CHUNK_FIELDS.unpack_from(summary_section, start)
            map_start = start + _CHUNK_FIELDS.size
            message_indexes = _MESSAGE_INDEX_OFFSET.iter_unpack(summary_section[map_start : map_start + map_byte_count])
            chunks.append(
                IndexedChunk(offset, start_ns / 1e9, frozenset(channel_id for channel_id, _ in message_indexes))
            )
    return sorted(chunks, key=lambda chunk: chunk.offset)
