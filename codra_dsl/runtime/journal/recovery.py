"""Write a complete journal with the content of a torn one."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from codra_dsl.runtime.journal.mcap_file import McapFile
from codra_dsl.runtime.journal.reader import Damage, JournalReader, RawMessage


@dataclass(frozen=True, slots=True, kw_only=True)
class Recovery:
    """The result of a recovery.

    Attributes:
        messages: the number of messages.
        from_s: the instant at which the first message was written; 0 if the journal has no messages.
        to_s: the instant at which the last message was written.
        damage: the missing and unreadable parts of the torn journal.
        is_live: whether its program was still writing the torn journal.
    """

    messages: int
    from_s: float
    to_s: float
    damage: Damage
    is_live: bool


def recover(path: Path, target: Path) -> Recovery:
    """Write a complete journal with all content of another journal.

    The result equals, byte for byte, the file of a writer that finished after the last event in the other journal.

    Args:
        path: the journal, torn or not; it is not changed.
        target: the file to write; an existing file is replaced.

    Raises:
        JournalError: if the file is not a journal.
        OSError: if it cannot be read, or the target cannot be written.
    """
    part = target.with_name(f"{target.name}.part")
    try:
        with JournalReader(path) as reader, part.open("w+b") as stream:
            reader.header()
            count, first_ns, last_ns = _copy(reader, McapFile(stream, reader.metadata, reader.files))
        part.replace(target)
    except BaseException:
        part.unlink(missing_ok=True)
        raise
    return Recovery(
        messages=count,
        from_s=first_ns / 1e9,
        to_s=last_ns / 1e9,
        damage=reader.damage,
        is_live=reader.is_live,
    )


def _copy(reader: JournalReader, file: McapFile) -> tuple[int, int, int]:
    """Copy all messages and finish the file; return their number, and the times of the first and the last."""
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    count, first_ns, last_ns = 0, 0, 0
    for note in reader.notes():
        message = note.message
        channel = _channel(note, file, schemas, channels)
        file.add(channel, message.log_time, message.publish_time, message.sequence, message.data)
        first_ns, last_ns = first_ns if count else message.log_time, message.log_time
        count += 1
    file.finish()
    return count, first_ns, last_ns


def _channel(note: RawMessage, file: McapFile, schemas: dict[int, int], channels: dict[int, int]) -> int:
    schema, channel = note.schema, note.channel
    if channel.id not in channels:
        if schema.id not in schemas:
            schemas[schema.id] = file.schema(schema.name, schema.data)
        channels[channel.id] = file.channel(channel.topic, schemas[schema.id], channel.metadata)
    return channels[channel.id]
