"""The file of a new journal: what stands at its path already is not lost, and no two programs write into one file."""

from __future__ import annotations

import errno
import fcntl
import logging
import os
from pathlib import Path
from typing import BinaryIO

_LOGGER = logging.getLogger(__name__)

MAGIC = b"\x89MCAP0\r\n"
_MARK = b"codra-journal"
_MARK_WITHIN_BYTES = 4096


def opened(path: Path) -> BinaryIO:
    """Return a new, empty file at a path, locked for this program.

    A finished journal that is there is replaced. An unfinished one is moved aside, to `NAME.unfinished-1.mcap`; if its
    writer still lives, that goes on writing there.

    Raises:
        OSError: if the file cannot be made, or what is there is no journal.
    """
    path = path.resolve()
    while True:
        try:
            stream = path.open("x+b")
        except FileExistsError:
            _make_way(path)
            continue
        if _lock(stream) and _stands_at(path, stream):
            return stream
        stream.close()  # another program began at the same time and took it for an old one


def unlock(stream: BinaryIO) -> None:
    """Say that nobody writes a file any more, also where a child of this program still has it open."""
    fcntl.flock(stream, fcntl.LOCK_UN)


def is_being_written(stream: BinaryIO) -> bool:
    """Return whether a program that lives writes a file which another has opened to read it."""
    try:
        fcntl.flock(stream, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:  # a file system without locks
        return False
    unlock(stream)
    return False


def check_is_there(stream: BinaryIO) -> None:
    """Raise an error if the file has no name any more: what is written into it cannot be found."""
    if os.fstat(stream.fileno()).st_nlink == 0:
        raise FileNotFoundError(errno.ENOENT, "the file was removed while it was being written")


def _make_way(path: Path) -> None:
    """Remove a finished journal, move aside an unfinished one, and refuse anything else."""
    if not path.is_file():
        if path.exists():
            raise OSError(errno.EINVAL, "it is no ordinary file, and a journal needs one", str(path))
        return
    try:
        old = path.open("rb")
    except FileNotFoundError:  # another program has just moved it
        return
    with old:
        is_free = _lock(old)
        if not _stands_at(path, old):
            return
        if is_free and _is_over(path, old):
            path.unlink()
        else:
            _move_aside(path)


def _is_over(path: Path, old: BinaryIO) -> bool:
    """Return whether a file may go: it is empty, or a finished journal."""
    start = old.read(_MARK_WITHIN_BYTES)
    if not start:
        return True
    if not start.startswith(MAGIC[: len(start)]) or (len(start) > len(MAGIC) and _MARK not in start):
        raise FileExistsError(errno.EEXIST, "it is there already and no journal: take another path", str(path))
    if len(start) <= len(MAGIC):
        return False
    old.seek(-len(MAGIC), os.SEEK_END)
    return old.read() == MAGIC


def _move_aside(path: Path) -> None:
    """Keep a journal whose writer was killed, or lives: the same program may start again with the same path."""
    numbers = range(1, 1_000_000)
    free = (path.with_name(f"{path.stem}.unfinished-{number}{path.suffix}") for number in numbers)
    aside = next(other for other in free if not other.exists())
    path.rename(aside)
    _LOGGER.warning("the journal %s was not finished: it is %s now", path, aside.name)


def _lock(stream: BinaryIO) -> bool:
    """Lock a file for this program; return False if another has."""
    try:
        fcntl.flock(stream, fcntl.LOCK_EX | fcntl.LOCK_NB)
    except BlockingIOError:
        return False
    except OSError:  # a file system without locks
        return True
    return True


def _stands_at(path: Path, stream: BinaryIO) -> bool:
    try:
        there = path.stat()
    except FileNotFoundError:
        return False
    return os.path.samestat(there, os.fstat(stream.fileno()))
