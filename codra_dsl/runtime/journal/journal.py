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
from codra_dsl.runtime.journal.opening import opened, unlock
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
        """Make the file; a finished journal that is there is replaced, and an unfinished one moved aside.

        Args:
            path: of the file.
            limit: how many events are kept in memory at least.

        Raises:
            OSError: if the file cannot be made, or another file is there that is no journal.
        """
        super().__init__(limit)
        self.path = Path(path)
        self.failure: str | None = None
        self._stream: BinaryIO = opened(self.path)
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
        self._finish = weakref.finalize(self, _finish, self._stream, self._writer, self.path, os.getpid())

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
        self.failure = self._finish() or self.failure

    def _fail(self, error: Exception) -> None:
        """Write no more; what the file holds can be recovered."""
        self._writer = None
        self._finish.detach()
        self.failure = _told(self.path, error)
        with contextlib.suppress(OSError):
            self._stream.close()


def _finish(stream: BinaryIO, writer: JournalWriter, path: Path, writing_process: int) -> str | None:
    """Finish a file, unless this process only inherited it; return why that cannot be done."""
    try:
        with stream:
            if os.getpid() == writing_process:
                writer.finish()
                unlock(stream)
    except OSError as error:
        return _told(path, error)
    return None


def _told(path: Path, error: Exception) -> str:
    failure = f"{type(error).__name__}: {error}"
    _LOGGER.error("the journal %s ends here: %s", path, failure)
    return failure
