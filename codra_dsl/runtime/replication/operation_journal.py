"""The journal of a replica: its own commits and those of others, from which it recovers after a crash."""

from __future__ import annotations

import fcntl
import os
from collections.abc import Iterable
from pathlib import Path
from typing import BinaryIO, Protocol

from codra_dsl.regular_files import replace_file


class OperationJournal(Protocol):
    """Stores the lines of a replica. An appended line survives a crash."""

    def lines(self) -> list[bytes]:
        """Return all lines, the oldest first."""

    def append(self, line: bytes) -> None:
        """Append a line; when the call returns, the line is stored."""

    def replace(self, lines: Iterable[bytes]) -> None:
        """Replace all lines completely or not at all."""


class OperationFile:
    """A journal in a file, with one line for each record. The file belongs to one program at a time."""

    def __init__(self, path: Path) -> None:
        """Open the file, or create it. An incomplete last line, which was never acknowledged, is removed.

        Raises:
            BlockingIOError: if another program has the file open.
            OSError: if the file cannot be read or written.
        """
        self._path = path
        self._stream = self._open()
        self._stream.truncate(self._stream.read().rfind(b"\n") + 1)

    def lines(self) -> list[bytes]:
        """Return all lines, the oldest first."""
        self._stream.seek(0)
        return self._stream.read().splitlines()

    def append(self, line: bytes) -> None:
        """Append a line; when the call returns, the line is on the disk."""
        self._stream.write(line + b"\n")
        self._stream.flush()
        os.fsync(self._stream.fileno())

    def replace(self, lines: Iterable[bytes]) -> None:
        """Replace all lines completely or not at all."""
        replace_file(self._path, b"".join(line + b"\n" for line in lines))
        self._stream.close()
        self._stream = self._open()

    def close(self) -> None:
        """Close the file."""
        self._stream.close()

    def _open(self) -> BinaryIO:
        stream = self._path.open("ab+")
        try:
            fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
            _synchronize_folder(self._path.parent)
        except OSError:
            stream.close()
            raise
        stream.seek(0)
        return stream


def _synchronize_folder(folder: Path) -> None:
    """Store the names of the files; otherwise a loss of power could bring back a file that was replaced."""
    descriptor = os.open(folder, os.O_RDONLY)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
