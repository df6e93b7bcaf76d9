"""Create the file of a new journal: no unfinished journal is lost, and no two programs write to one file."""

from __future__ import annotations

import errno
import fcntl
import logging
import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO

from codra_dsl.runtime.forks import new_lock

_LOGGER = logging.getLogger(__name__)

MAGIC = b"\x89MCAP0\r\n"
_JOURNAL_MARK = b"codra-journal"
_MAX_MARK_OFFSET_BYTES = 4096
_creation_lock = new_lock()
_locked_folders: set[Path] = set()


def create_locked_file(path: Path) -> BinaryIO:
    """Return a new, empty file at a path, locked for this program.

    A finished journal at the path is replaced. An unfinished journal is renamed to `NAME.unfinished-1.mcap`. If the
    program that writes this journal is still running, it continues to write to the renamed file.

    Raises:
        OSError: if the file cannot be created, or the existing file is not a journal.
    """
    path = path.resolve()
    with _lock_folder(path.parent):
        while True:
            try:
                stream = path.open("x+b")
            except FileExistsError:
                with suppress(FileNotFoundError):  # a program without the folder's lock was faster
                    _clear_path(path)
                continue
            if _lock(stream) and _is_file_at(path, stream):
                return stream
            stream.close()  # a program without the folder's lock treated this new file as an old journal


def unlock(stream: BinaryIO) -> None:
    """Mark a file as no longer being written, even if a child of this program still has it open."""
    fcntl.flock(stream, fcntl.LOCK_UN)


def is_being_written(stream: BinaryIO) -> bool:
    """Return whether a running program is still writing the file, which the caller has opened for reading."""
    try:
        fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # a file system without locks
        return False
    unlock(stream)
    return False


@contextmanager
def _lock_folder(folder: Path) -> Iterator[None]:
    """Let programs and threads that create journals in one folder take turns.

    Between looking at the file at a path and removing or renaming it, another program could put its own file there.
    A signal handler that creates a journal while this program creates one does not wait for the program.
    """
    with _creation_lock:
        if folder in _locked_folders:
            yield
            return
        folder_descriptor = os.open(folder, os.O_RDONLY | os.O_DIRECTORY)
        try:
            with suppress(OSError):  # a file system without locks
                fcntl.flock(folder_descriptor, fcntl.LOCK_EX)
            _locked_folders.add(folder)
            yield
        finally:
            _locked_folders.discard(folder)
            os.close(folder_descriptor)


def _clear_path(path: Path) -> None:
    """Remove a finished journal at a path, rename an unfinished one, and raise an error for any other file."""
    if not path.is_file():
        if path.exists():
            raise OSError(
                errno.EINVAL,
                "the path is not a regular file: choose another path",
                str(path),
            )
        return
    try:
        old_file = path.open("rb")
    except FileNotFoundError:  # another program has just removed or renamed the file
        return
    with old_file:
        is_unlocked = _lock(old_file)
        if not _is_file_at(path, old_file):
            return
        if is_unlocked and _is_replaceable(path, old_file):
            path.unlink()
        else:
            _rename_unfinished(path)


def _is_replaceable(path: Path, old_file: BinaryIO) -> bool:
    """Return whether a file may be replaced, because it is empty or a finished journal."""
    first_bytes = old_file.read(_MAX_MARK_OFFSET_BYTES)
    if not first_bytes:
        return True
    if not first_bytes.startswith(MAGIC[: len(first_bytes)]) or (
        len(first_bytes) > len(MAGIC) and _JOURNAL_MARK not in first_bytes
    ):
        raise FileExistsError(errno.EEXIST, "the file exists and is not a journal: choose another path", str(path))
    if len(first_bytes) <= len(MAGIC):
        return False
    old_file.seek(-len(MAGIC), os.SEEK_END)
    return old_file.read() == MAGIC


def _rename_unfinished(path: Path) -> None:
    """Rename an unfinished journal, so that it is not overwritten when a program starts again with the same path."""
    suffix_numbers = range(1, 1_000_000)
    candidate_paths = (path.with_name(f"{path.stem}.unfinished-{number}{path.suffix}") for number in suffix_numbers)
    new_path = next(candidate_path for candidate_path in candidate_paths if not candidate_path.exists())
    path.rename(new_path)
    _LOGGER.warning("the journal %s was not finished; it was renamed to %s", path, new_path.name)


def _lock(stream: BinaryIO) -> bool:
    """Lock a file for this program; return False if another program has locked it."""
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return True
    return True


def _is_file_at(path: Path, stream: BinaryIO) -> bool:
    try:
        path_status = path.stat()
    except FileNotFoundError:
        return False
    return os.path.samestat(path_status, os.fstat(stream.fileno()))
