"""A record that is also written to a file as it goes."""

from __future__ import annotations

import contextlib
import logging
import os
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.record import KEPT, Record

if TYPE_CHECKING:
    from codra_dsl.runtime.journal.head import Head
    from codra_dsl.runtime.journal.writing import JournalWriter

_LOGGER = logging.getLogger(__name__)


class Journal(Record):
    """A record that is written to a file, event by event: hand it to `start(..., record=Journal(path))`.

    The file is MCAP. It is finished when the context manager is closed, or else when the program ends. If the program
    is killed, the file lacks its end and no event but the one that was being written: `codra journal recover`.

    A file that cannot be written any more costs the journal, never the run.

    Attributes:
        path: of the file.
        failure: why the file is not written any more; None while it is.
    """

    takes_inputs = True

    def __init__(self, path: Path | str, limit: float = KEPT) -> None:
        """Make the file; one that is there is replaced, but an unfinished journal is moved aside.

        Args:
            path: of the file.
            limit: how many events are kept in memory at least.

        Raises:
            OSError: if the file cannot be made.
        """
        super().__init__(limit)
        self.path = Path(path)
        self.failure: str | None = None
        _move_unfinished_aside(self.path)
        self._stream: BinaryIO = self.path.open("w+b")
        self._writer: JournalWriter | None = None
        self._finish: weakref.finalize[..., Journal] = weakref.finalize(self, self._stream.close)

    def begin(self, head: Callable[[], Head]) -> None:
        """Write what runs.

        Raises:
            ValueError: if it is the journal of another run already.
        """
        from codra_dsl.runtime.journal.writing import JournalWriter  # noqa: PLC0415 - 60 ms that only journals cost

        if not self._finish.alive or self._writer is not None:
            raise ValueError(f"{self.path} is the journal of another run")
        about = head()
        try:
            self._writer = JournalWriter(self._stream, about)
        except OSError as error:
            self._fail(error)
            return
        self._finish.detach()
        self._finish = weakref.finalize(self, _finish, self._stream, self._writer, os.getpid())

    def add(self, event: Event) -> None:
        """Add an event; when this returns, no death of the process takes it away."""
        if event.kind is not Kind.INPUT:
            super().add(event)
        if self._writer is not None:
            try:
                self._writer.add(event)
            except Exception as error:  # noqa: BLE001 - a full disk is no reason to stop a robot
                self._fail(error)

    def end(self) -> None:
        """Finish the file; what happens later is in memory only."""
        self._writer = None
        try:
            self._finish()
        except OSError as error:
            self._fail(error)

    def _fail(self, error: Exception) -> None:
        """Write no more; what the file holds can be recovered."""
        self._writer = None
        self._finish.detach()
        self.failure = f"{type(error).__name__}: {error}"
        _LOGGER.error("the journal %s ends here: %s", self.path, self.failure)
        with contextlib.suppress(OSError):
            self._stream.close()


def _finish(stream: BinaryIO, writer: JournalWriter, writing_process: int) -> None:
    """Finish a file, unless this process only inherited it."""
    with stream:
        if os.getpid() == writing_process:
            writer.finish()


def _move_unfinished_aside(path: Path) -> None:
    """Keep a journal whose writer was killed: the same program may start anew with the same path."""
    if not path.is_file() or path.stat().st_size == 0 or _is_finished(path):
        return
    numbers = range(1, 1_000_000)
    free = (path.with_name(f"{path.stem}.unfinished-{number}{path.suffix}") for number in numbers)
    path.rename(next(other for other in free if not other.exists()))


def _is_finished(path: Path) -> bool:
    """Return whether a file is no journal, or one with its end."""
    magic = b"\x89MCAP0\r\n"
    with path.open("rb") as stream:
        if stream.read(len(magic)) != magic:
            return True
        stream.seek(-len(magic), 2)
        return stream.read() == magic
