"""An event log that is also written to a file during the run."""

from __future__ import annotations

import contextlib
import logging
import os
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from codra_dsl.runtime.journal.event_log import DEFAULT_EVENT_LIMIT, EventLog
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.file_creation import create_locked_file, unlock

if TYPE_CHECKING:
    from codra_dsl.runtime.journal.run_header import RunHeader
    from codra_dsl.runtime.journal.writer import JournalWriter

_LOGGER = logging.getLogger(__name__)


class Journal(EventLog):
    """An event log that is written to a file, event by event: pass it to `start(..., record=Journal(path))`.

    The file is in MCAP format. The journal finishes the file when the context manager is closed, or at the latest when
    the program ends. If the program is killed, the end of the file is missing, and at most one event is lost: the event
    that was being written. Repair such a file with `codra journal recover`.

    If the file can no longer be written, the journal ends, but the run continues.

    Attributes:
        path: the path of the file.
        failure: why the file is no longer written; None while it is being written.
    """

    accepts_inputs = True

    def __init__(self, path: Path | str, limit: float = DEFAULT_EVENT_LIMIT) -> None:
        """Create the file; replace a finished journal at its path, and rename an unfinished one.

        Args:
            path: the path of the file.
            limit: at least this many of the newest events are kept in memory.

        Raises:
            OSError: if the file cannot be created, or a file that is not a journal exists at its path.
        """
        super().__init__(limit)
        self.path = Path(path)
        self.failure: str | None = None
        self._stream: BinaryIO = create_locked_file(self.path)
        self._writer: JournalWriter | None = None
        self._finalizer: weakref.finalize[..., Journal] = weakref.finalize(self, self._stream.close)

    def begin(self, make_header: Callable[[], RunHeader]) -> None:
        """Write the run header.

        Raises:
            ValueError: if this object is already the journal of another run.
        """
        from codra_dsl.runtime.journal.writer import JournalWriter  # noqa: PLC0415 - 60 ms, for journals only

        if not self._finalizer.alive or self._writer is not None:
            raise ValueError(f"{self.path} is the journal of another run")
        header = make_header()
        try:
            self._writer = JournalWriter(self._stream, header)
        except OSError as error:
            self._fail(error)
            return
        self._finalizer.detach()
        self._finalizer = weakref.finalize(self, _finish_file, self._stream, self._writer, self.path, os.getpid())

    def add(self, event: Event) -> None:
        """Add an event. After this call, the event survives the death of the process."""
        if event.kind is not Kind.INPUT:
            super().add(event)
        if self._writer is not None:
            try:
                self._writer.add(event)
            except Exception as error:  # noqa: BLE001 - a full disk must not stop a robot
                self._fail(error)

    def end(self) -> None:
        """Finish the file; later events are kept in memory only."""
        self._writer = None
        self.failure = self._finalizer() or self.failure

    def _fail(self, error: Exception) -> None:
        """Stop writing; the events in the file can be recovered."""
        self._writer = None
        self._finalizer.detach()
        self.failure = _log_failure(self.path, error)
        with contextlib.suppress(OSError):
            self._stream.close()


def _finish_file(stream: BinaryIO, writer: JournalWriter, path: Path, writing_process_id: int) -> str | None:
    """Finish a file, unless this process inherited it from its parent. If this fails, return the text of the error."""
    try:
        with stream:
            if os.getpid() == writing_process_id:
                writer.finish()
                unlock(stream)
    except OSError as error:
        return _log_failure(path, error)
    return None


def _log_failure(path: Path, error: Exception) -> str:
    failure_text = f"{type(error).__name__}: {error}"
    _LOGGER.error("the journal %s ends here: %s", path, failure_text)
    return failure_text
