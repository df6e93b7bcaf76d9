"""Parts of an MCAP file as bytes: its head, its chunks with their indexes, and its end. Nothing is written here."""

from __future__ import annotations

import struct
import zlib
from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import LIBRARY_IDENTIFIER, MCAP0_MAGIC

from codra_dsl.runtime.journal.limits import value_count

MAX_COMPRESSION = 24
"""The records of a chunk are at most this many times larger than the chunk in the file. Readers accept 32."""

_NUMBER_BYTES = 8
_INDEX_ENTRY_BYTES = 2 * _NUMBER_BYTES

RECORD_HEADER = struct.Struct("<BQ")
_MESSAGE_INDEX_HEADER = struct.Struct("<BQHI")
FOOTER_FIELDS = struct.Struct("<BQQQ")
_FOOTER_FIELDS_BYTES = 20


IndexEntry = tuple[int, int, int]
"""A message in a chunk: the number of its channel, its time in nanoseconds, and its position in the chunk."""


@dataclass(frozen=True, slots=True)
class Head:
    """The start of a file, before all messages.

    Attributes:
        content: its bytes.
        metadata_indexes: the index of each metadata record.
        attachment_indexes: the index of each attachment.
    """

    content: bytes
    metadata_indexes: tuple[MetadataIndex, ...]
    attachment_indexes: tuple[AttachmentIndex, ...]


@dataclass(frozen=True, slots=True)
class WrittenChunk:
    """A chunk that is in the file.

    Attributes:
        index: the index of the chunk.
        message_counts: the number of messages of each channel. The key is the number of the channel.
    """

    index: ChunkIndex
    message_counts: Mapping[int, int]


def record_bytes(*records: McapRecord) -> bytes:
    """Return concatenated records."""
    builder: Any = RecordBuilder()
    for record in records:
        record.write(builder)
    content: bytes = builder.end()
    return content


def make_head(metadata: Mapping[str, Mapping[str, str]], files: Mapping[str, bytes]) -> Head:
    """Return the start of a file with metadata and JSON texts as attachments. The keys are their names."""
    content = bytearray(MCAP0_MAGIC + record_bytes(Header(profile="", library=LIBRARY_IDENTIFIER)))
    metadata_indexes, attachment_indexes = [], []
    for name, entries in metadata.items():
        record = record_bytes(Metadata(name=name, metadata=dict(entries)))
        metadata_indexes.append(MetadataIndex(offset=len(content), length=len(record), name=name))
        content += record
    for name, data in files.items():
        fields: dict[str, Any] = {"create_time": 0, "log_time": 0, "name": name, "media_type": "application/json"}
        record = record_bytes(Attachment(**fields, data=data))
        attachment_indexes.append(
            AttachmentIndex(**fields, offset=len(content), length=len(record), data_size=len(data))
        )
        content += record
    return Head(bytes(content), tuple(metadata_indexes), tuple(attachment_indexes))


def make_chunk(records: bytes, entries: Sequence[IndexEntry], offset: int) -> tuple[bytes, WrittenChunk]:
    """Return a chunk with the indexes of its messages, as bytes, and the entries of the summary about the chunk.

    Args:
        records: the concatenated records of the chunk.
        entries: the messages of the chunk, at least one.
        offset: the offset at which the chunk will be written.
    """
    times_ns = [log_ns for _, log_ns, _ in entries]
    compression, stored_records = _compress(records, index_bytes=_INDEX_ENTRY_BYTES * len(entries))
    fields: dict[str, Any] = {
        "compression": compression,
        "message_start_time": min(times_ns),
        "message_end_time": max(times_ns),
        "uncompressed_size": len(records),
    }
    content = bytearray(record_bytes(Chunk(**fields, data=stored_records, uncompressed_crc=zlib.crc32(records))))
    chunk_length, index_offsets, numbers_by_channel = len(content), dict[int, int](), dict[int, list[int]]()
    for channel_id, log_ns, position in entries:  # the order of the channels is that of their first messages
        numbers_by_channel.setdefault(channel_id, []).extend((log_ns, position))
    for channel_id, numbers in numbers_by_channel.items():
        index_offsets[channel_id] = offset + len(content)
        byte_count = _NUMBER_BYTES * len(numbers)
        content += _MESSAGE_INDEX_HEADER.pack(Opcode.MESSAGE_INDEX, 6 + byte_count, channel_id, byte_count)
        content += struct.pack(f"<{len(numbers)}Q", *numbers)
    index = ChunkIndex(
        **fields,
        chunk_start_offset=offset,
        chunk_length=chunk_length,
        message_index_offsets=index_offsets,
        message_index_length=len(content) - chunk_length,
        compressed_size=len(stored_records),
    )
    message_counts = {channel_id: len(numbers) // 2 for channel_id, numbers in numbers_by_channel.items()}
    return bytes(content), WrittenChunk(index, message_counts)


def _compress(records: bytes, index_bytes: int) -> tuple[str, bytes]:
    """Return the compression of a chunk, and its data.

    Readers refuse a file whose content is too large for its size. Therefore records that would become too small, for
    example because they repeat a long text, are not compressed.
    """
    compressed_records = zstandard.compress(records)
    file_bytes = len(compressed_records) + index_bytes
    is_accepted = len(records) <= MAX_COMPRESSION * file_bytes and value_count(records) <= file_bytes
    return ("zstd", compressed_records) if is_accepted else ("", records)


def make_end(
    offset: int, head: Head, chunks: Sequence[WrittenChunk], schemas: Sequence[Schema], channels: Sequence[Channel]
) -> bytes:
    """Return the end of a file, with the summary that readers use as an index; `offset` is where it will be written."""
    data_end = record_bytes(DataEnd(data_section_crc=0))
    summary_offset, summary, group_offsets = offset + len(data_end), bytearray(), bytearray()
    groups: Mapping[Opcode, Sequence[McapRecord]] = {
        Opcode.SCHEMA: schemas,
        Opcode.CHANNEL: channels,
        Opcode.STATISTICS: [_make_statistics(head, chunks, schemas, channels)],
        Opcode.CHUNK_INDEX: [chunk.index for chunk in chunks],
        Opcode.ATTACHMENT_INDEX: head.attachment_indexes,
        Opcode.METADATA_INDEX: head.metadata_indexes,
    }
    for opcode, records in groups.items():
        group, group_start = record_bytes(*records), summary_offset + len(summary)
        summary += group
        group_offsets += record_bytes(
            SummaryOffset(group_opcode=opcode, group_start=group_start, group_length=len(group))
        )
    group_offsets_start = summary_offset + len(summary)
    summary += group_offsets
    footer_fields = FOOTER_FIELDS.pack(Opcode.FOOTER, _FOOTER_FIELDS_BYTES, summary_offset, group_offsets_start)
    footer = Footer(
        summary_start=summary_offset,
        summary_offset_start=group_offsets_start,
        summary_crc=zlib.crc32(footer_fields, zlib.crc32(summary)),
    )
    return data_end + bytes(summary) + record_bytes(footer) + MCAP0_MAGIC


def _make_statistics(
    head: Head, chunks: Sequence[WrittenChunk], schemas: Sequence[Schema], channels: Sequence[Channel]
) -> Statistics:
    message_counts: Counter[int] = Counter()
    for chunk in chunks:
        message_counts.update(chunk.message_counts)
    return Statistics(
        attachment_count=len(head.attachment_indexes),
        channel_count=len(channels),
        channel_message_counts=dict(message_counts),
        chunk_count=len(chunks),
        message_count=message_counts.total(),
        metadata_count=len(head.metadata_indexes),
        message_start_time=min((chunk.index.message_start_time for chunk in chunks), default=0),
        message_end_time=max((chunk.index.message_end_time for chunk in chunks), default=0),
        schema_count=len(schemas),
    )
