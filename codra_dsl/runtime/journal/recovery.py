"""Write a complete journal with the content of a torn one."""

from __future__ import annotations

import errno
import os
from dataclasses import dataclass
from pathlib import Path

from codra_dsl.runtime.journal.mcap_file import ChannelDeclaration, McapFile
from codra_dsl.runtime.journal.reader import Damage, JournalReader, RawMessage


@dataclass(frozen=True, slots=True, kw_only=True)
class Recovery:
    """The result of a recovery.

    Attributes:
        message_count: the number of messages.
        start_s: the instant at which the first message was written; 0 if the journal has no messages.
        end_s: the instant at which the last message was written.
        damage: the missing and unreadable parts of the torn journal.
        is_live: whether a program was still writing the torn journal.
    """

    message_count: int
    start_s: float
    end_s: float
    damage: Damage
    is_live: bool


def recover(path: Path, target: Path) -> Recovery:
    """Write a complete journal with all content of another journal.

    The result is the same, byte for byte, as if the writer of the other journal had finished it after its last event.

    Args:
        path: the other journal, torn or not; it is not changed.
        target: the file to write; an existing regular file is replaced.

    Raises:
        JournalError: if the file is not a journal.
        OSError: if the journal cannot be read, or the target cannot be written or is not a regular file.
    """
    if target.exists() and not target.is_file():
        raise OSError(errno.EINVAL, f"'{target}' is not a regular file")
    with JournalReader(path, skips_large_chunks=True) as reader:
        reader.header()
        temporary_path = target.with_name(f"{target.name}.{os.getpid()}.part")
        stream = temporary_path.open("x+b")  # neither follows a link nor overwrites a file
        try:
            with stream:
                message_count, first_ns, last_ns = _copy(reader, McapFile(stream, reader.metadata, reader.files))
            temporary_path.replace(target)
        except BaseException:
            temporary_path.unlink(missing_ok=True)
            raise
    return Recovery(
        message_count=message_count,
        start_s=first_ns / 1e9,
        end_s=last_ns / 1e9,
        damage=reader.damage,
        is_live=reader.is_live,
    )


def _copy(reader: JournalReader, file: McapFile) -> tuple[int, int, int]:
    """Copy all messages and finish the file; return the number of messages, and the times of the first and the last."""
    channels: dict[int, ChannelDeclaration] = {}
    message_count, first_ns, last_ns = 0, 0, 0
    for raw_message in reader.raw_messages():
        message = raw_message.message
        if message.channel_id not in channels:
            channels[message.channel_id] = _declaration_of(raw_message)
        channel = channels[message.channel_id]
        file.add(channel, message.log_time, message.publish_time, message.data, message.sequence)
        first_ns, last_ns = first_ns if message_count else message.log_time, message.log_time
        message_count += 1
    file.finish()
    return message_count, first_ns, last_ns


def _declaration_of(raw_message: RawMessage) -> ChannelDeclaration:
    schema, channel = raw_message.schema, raw_message.channel
    return ChannelDeclaration(channel.topic, schema.name, schema.data, channel.metadata)
