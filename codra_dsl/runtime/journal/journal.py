"""An event log that is also written to a file during the run."""

from __future__ import annotations

import logging
import weakref
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING, BinaryIO

from codra_dsl.runtime.journal.event_log import DEFAULT_EVENT_LIMIT, EventLog
from codra_dsl.runtime.journal.events import Event, Kind
from codra_dsl.runtime.journal.file_creation import create_locked_file

if TYPE_CHECKING:
    from codra_dsl.runtime.journal.run_header import RunHeader
    from codra_dsl.runtime.journal.writer import JournalWriter

_LOGGER = logging.getLogger(__name__)


class Journal(EventLog):
    """An event log that is written to a file, event by event: pass it to `start(..., record=Journal(path))`.

    The file is in MCAP format. The journal finishes the file when the context manager is closed, or at the latest when
    the program ends. If the program is killed, the end of the file is missing, and at most one event is lost: the event
    that was being written. Repair such a file with `codra journal recover`.

    Signal handlers may use the context manager and may raise, at any instant: each exception of a handler propagates,
    and the journal stays intact. An event of a handler that has interrupted the writing of another event is written
    immediately after the handler returns. If the handler raises, the next event or the end of the journal writes it.

    If the file can no longer be written, or was removed, truncated or overwritten, the journal ends, but the run
    continues. In a child process of the program, nothing is written.

    Attributes:
        path: the path of the file.
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
        self._stream: BinaryIO = create_locked_file(self.path)
        self._writer: JournalWriter | None = None
        self._is_ended = False
        self._finalizer: weakref.finalize[..., Journal] = weakref.finalize(self, self._stream.close)

    @property
    def failure(self) -> str | None:
        """Return why the file ended early; None if it is being written, or if it is complete."""
        error = None if self._writer is None else self._writer.failure
        return None if error is None else _failure_text(error)

    def begin(self, make_header: Callable[[], RunHeader]) -> None:
        """Write the run header.

        Raises:
            ValueError: if this object is already the journal of another run.
        """
        from codra_dsl.runtime.journal.writer import JournalWriter  # noqa: PLC0415 - 60 ms, for journals only

        if not self._finalizer.alive or self._writer is not None:
            raise ValueError(f"{self.path} is the journal of another run")
        writer = self._writer = JournalWriter(self._stream, make_header())
        unused_finalizer, self._finalizer = self._finalizer, weakref.finalize(self, _finish_file, writer, self.path)
        unused_finalizer.detach()
        _report_failure(writer, self.path, writer.write_header)

    def add(self, event: Event) -> None:
        """Add an event. After this call, the event survives the death of the process."""
        if event.kind is not Kind.INPUT:
            super().add(event)
        writer = self._writer
        if writer is not None and not self._is_ended:
            try:
                writer.add(event)
            except Exception as error:
                if error is not writer.failure:  # raised by a signal handler
                    raise
                self._is_ended = True
                _log_failure(self.path, error)  # a full disk must not stop a robot

    def end(self) -> None:
        """Finish the file; later events are kept in memory only."""
        self._is_ended = True
        if self._writer is None:
            self._finalizer()
            return
        _finish_file(self._writer, self.path)
        if self._writer.is_over:  # otherwise a call that this call has interrupted finishes the file
            self._finalizer.detach()


def _finish_file(writer: JournalWriter, path: Path) -> None:
    """Finish a file, unless this process inherited it from its parent."""
    _report_failure(writer, path, writer.finish)


def _report_failure(writer: JournalWriter, path: Path, write: Callable[[], None]) -> None:
    """Write, and log the failure if the file ends early here."""
    try:
        write()
    except OSError as error:
        if error is not writer.failure:  # raised by a signal handler
            raise
        _log_failure(path, error)


def _log_failure(path: Path, error: Exception) -> None:
    _LOGGER.error("the journal %s ends here: %s", path, _failure_text(error))


def _failure_text(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
