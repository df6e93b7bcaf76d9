"""The limits of a reader for a journal's file, so that a forged file cannot occupy the machine.

A journal may be as long as a run. Therefore the limits on its whole content grow with the size of its file. A journal
that codra writes has about 4 bytes of messages for each byte of the file, one message for 30 bytes, and one JSON value
for 5 bytes, because the file has an index entry for each message. A forged file can reach 30,000 bytes for each byte.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

MEBIBYTE = 1 << 20

MAX_RECORD_BYTES = 16 * MEBIBYTE
"""The maximum size of one record, and of one chunk after decompression. The chunks that codra writes have 64 KiB, or
one larger message."""

MAX_START_BYTES = 16 * MEBIBYTE
"""The maximum size of the part of a file before its messages."""

MAX_SUMMARY_BYTES = 4 * MEBIBYTE
"""The maximum size of the attached spec summary; the summary of a spec with 100 variables has about 100 KB."""

MAX_SUMMARY_SECTION_BYTES = 16 * MEBIBYTE
"""The maximum size of the records at the end of a file; for a longer index, the whole file is read."""

MAX_CONDITIONS_LENGTH = 256 * 1024
"""The maximum length of all conditions in a spec summary, in characters of their Python text."""

MAX_MESSAGE_VALUES = 1_000_000
"""The maximum number of JSON values in one message. A change of a knowledge graph is one message."""

MAX_UNREADABLE_PARTS = 10_000
"""The maximum number of messages and chunks that a reader skips because they cannot be read."""


class JournalError(Exception):
    """The file is not a journal, no part of it can be read, or it exceeds a limit of readers."""


@dataclass(frozen=True, slots=True, eq=False)
class _Limit:
    noun: str
    base: int
    per_file_byte: float

    def of_file(self, file_byte_count: int) -> int:
        return self.base + int(self.per_file_byte * file_byte_count)


_BYTES = _Limit("bytes of decompressed messages", 16 * MEBIBYTE, 32)
_MESSAGES = _Limit("messages", 50_000, 0.125)
_VALUES = _Limit("JSON values in messages", MAX_MESSAGE_VALUES, 2)


class ReadingBudget:
    """Counts what has been read from one file, and stops a reader at the limits.

    Attributes:
        file_byte_count: the present size of the file, which grows while a program writes it.
    """

    def __init__(self, path: Path, file_byte_count: int) -> None:
        self.file_byte_count = file_byte_count
        self._path = path
        self._counts = {_BYTES: 0, _MESSAGES: 0, _VALUES: 0}
        self._max_message_count = 0

    def add_bytes(self, byte_count: int) -> None:
        """Count decompressed bytes."""
        self._add(_BYTES, byte_count)

    def add_chunk(self, records: bytes) -> None:
        """Count the bytes and JSON values of a chunk, before its records are read."""
        self._add(_BYTES, len(records))
        self._add(_VALUES, value_count(records))
        self._max_message_count = _MESSAGES.of_file(self.file_byte_count)

    def add_message(self) -> None:
        """Count a message."""
        self._counts[_MESSAGES] += 1
        if self._counts[_MESSAGES] > self._max_message_count:
            self._add(_MESSAGES, 0)

    def _add(self, limit: _Limit, count: int) -> None:
        self._counts[limit] += count
        maximum = limit.of_file(self.file_byte_count)
        if self._counts[limit] > maximum:
            raise JournalError(
                f"{self._path} has more than {maximum:,} {limit.noun}: the limit is {limit.base:,}, "
                f"and {limit.per_file_byte:g} for each of the {self.file_byte_count:,} bytes of the file"
            )


def value_count(data: bytes) -> int:
    """Return about the number of JSON values in messages: each comma and each opening bracket counts as one value."""
    return len(data) - len(data.translate(None, b",[{"))  # faster than three counts
