"""Making a whole journal of what a torn one holds."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from codra_dsl.runtime.journal.mcap_file import McapFile
from codra_dsl.runtime.journal.reading import Damage, JournalReader, Note


@dataclass(frozen=True, slots=True, kw_only=True)
class Recovery:
    """What came of a recovery.

    Attributes:
        messages: how many there are.
        from_s: when the first was written; 0 if there are none.
        to_s: when the last was.
        damage: what the torn journal lacks.
        is_live: whether its program still wrote it.
    """

    messages: int
    from_s: float
    to_s: float
    damage: Damage
    is_live: bool


def recover(path: Path, target: Path) -> Recovery:
    """Write a whole journal with all that another holds.

    It is the same, byte for byte, as if the writer had finished it after the last event that is there.

    Args:
        path: the journal, torn or not; it stays as it is.
        target: the file to write; it is replaced when it is there.

    Raises:
        JournalError: if it is no journal.
        OSError: if it cannot be read, or the target cannot be written.
    """
    made = target.with_name(f"{target.name}.part")
    try:
        with JournalReader(path) as reader, made.open("w+b") as stream:
            reader.head()
            count, first_ns, last_ns = _copy(reader, McapFile(stream, reader.metadata, reader.files))
        made.replace(target)
    except BaseException:
        made.unlink(missing_ok=True)
        raise
    return Recovery(
        messages=count,
        from_s=first_ns / 1e9,
        to_s=last_ns / 1e9,
        damage=reader.damage,
        is_live=reader.is_live,
    )


def _copy(reader: JournalReader, file: McapFile) -> tuple[int, int, int]:
    """Copy all messages and finish; return how many there are, and the times of the first and the last."""
    schemas: dict[int, int] = {}
    channels: dict[int, int] = {}
    count, first_ns, last_ns = 0, 0, 0
    for note in reader.notes():
        one = note.message
        channel = _channel(note, file, schemas, channels)
        file.add(channel, one.log_time, one.publish_time, one.sequence, one.data)
        first_ns, last_ns = first_ns if count else one.log_time, one.log_time
        count += 1
    file.finish()
    return count, first_ns, last_ns


def _channel(note: Note, file: McapFile, schemas: dict[int, int], channels: dict[int, int]) -> int:
    schema, channel = note.schema, note.channel
    if channel.id not in channels:
        if schema.id not in schemas:
            schemas[schema.id] = file.schema(schema.name, schema.data)
        channels[channel.id] = file.channel(channel.topic, schemas[schema.id], channel.metadata)
    return channels[channel.id]
