"""Read and replace files in folders that a repository or a stranger may have filled.

Only regular files are read, and at most a stated number of bytes. A file is replaced completely or not at all. A
project can contain a link to `/dev/zero`, a pipe without a writer, or a file of any size. Reading such a file must
neither block nor fill the memory, and opening a device can have effects. All code of codra that reads files of a
project reads them with `read_regular_file`.
"""

from __future__ import annotations

import errno
import os
import secrets
import stat
from contextlib import suppress
from pathlib import Path


class UnsuitableFileError(OSError):
    """Raised for a file that is not regular, or that is outside of the folder in which it must be.

    `strerror` states the reason, and `filename` names the file.
    """


class OutsideError(UnsuitableFileError):
    """Raised for a link that leads out of the folder in which a file must be."""


class TooLargeError(OSError):
    """Raised for a file that has more bytes than are allowed."""


def read_regular_file(path: Path | str, max_bytes: int, *, within: Path | None = None) -> bytes:
    """Return the content of a regular file.

    Args:
        path: the file; links are followed.
        max_bytes: the largest allowed size of the file.
        within: the folder in which the file must be after all links are followed; None for any place.

    Raises:
        UnsuitableFileError: if the file is a folder, a device, a pipe or a socket.
        OutsideError: if the file is not in the folder `within`. Such a file is not opened.
        TooLargeError: if the file has more bytes.
        OSError: if the file cannot be read. `filename` names the file for this and the other errors.
    """
    data = _read_checked(path, max_bytes + 1, within, max_size=max_bytes)
    _require_size(len(data), max_bytes, path)  # some files of the system have more bytes than their size states
    return data


def read_beginning(path: Path | str, byte_count: int, *, within: Path | None = None) -> bytes:
    """Return the first bytes of a regular file of any size. Arguments and errors are those of `read_regular_file`."""
    return _read_checked(path, byte_count, within, max_size=None)


def replace_file(path: Path, data: bytes) -> None:
    """Replace a file completely or not at all. A link at the path is replaced, not followed.

    The data are written to a temporary file in the same folder, with an unpredictable name. The new file gets
    the owner and the permissions of the regular file that it replaces; if there is none, it gets the permissions that
    every new file of the process gets.

    Raises:
        OSError: if the file cannot be replaced. `filename` names the file.
    """
    try:
        temporary_file, replaced_status = path.parent / f".codra-{secrets.token_hex(8)}", _status_of_regular_file(path)
        permissions = 0o666 if replaced_status is None else 0o600
        descriptor = os.open(temporary_file, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, permissions)
        try:
            with os.fdopen(descriptor, "wb") as stream:
                stream.write(data)
                stream.flush()
                os.fsync(stream.fileno())
            if replaced_status is not None:
                _set_owner_and_permissions(temporary_file, replaced_status)
            temporary_file.replace(path)
        except BaseException:
            with suppress(OSError):
                temporary_file.unlink()
            raise
    except OSError as error:
        error.filename, error.filename2 = str(path), None
        raise


def _status_of_regular_file(path: Path) -> os.stat_result | None:
    try:
        status = path.lstat()
    except OSError:
        return None
    return status if stat.S_ISREG(status.st_mode) else None


def _set_owner_and_permissions(path: Path, status: os.stat_result) -> None:
    with suppress(OSError):  # only the superuser can change the owner of a file
        os.chown(path, status.st_uid, status.st_gid)
    path.chmod(stat.S_IMODE(status.st_mode))


def _read_checked(path: Path | str, byte_count: int, within: Path | None, max_size: int | None) -> bytes:
    try:
        if within is not None and not leads_into(path, within):
            raise OutsideError(errno.EXDEV, "it is a link that leads out of the project", str(path))
        _require_regular(Path(path).stat(), path)  # to open a device can have effects, such as starting a watchdog
        descriptor = os.open(path, os.O_RDONLY | os.O_NONBLOCK | os.O_NOCTTY)
        try:
            status = os.fstat(descriptor)
            _require_regular(status, path)
            if max_size is not None:
                _require_size(status.st_size, max_size, path)
            return _read(descriptor, byte_count)
        except OSError as error:
            error.filename = error.filename or str(path)
            raise
        finally:
            os.close(descriptor)
    except ValueError as error:  # the path has a null character, or characters that no file name can have
        raise OSError(errno.EINVAL, "the path is not valid", str(path)) from error


def real_path(path: Path | str) -> Path:
    """Return an absolute path with all links followed; unlike `Path.resolve`, this accepts links that form a circle."""
    return Path(os.path.realpath(path))


def leads_into(path: Path | str, folder: Path) -> bool:
    """Return whether a path is in a folder after all links of both are followed. Links that form a circle lead nowhere.

    A path that does not exist is in the folder if its name is.
    """
    followed_path, followed_folder = os.path.realpath(path), os.path.realpath(folder)
    return followed_path == followed_folder or followed_path.startswith(followed_folder.rstrip("/") + "/")


def _require_regular(status: os.stat_result, path: Path | str) -> None:
    if stat.S_ISDIR(status.st_mode):
        raise UnsuitableFileError(errno.EISDIR, "it is a folder", str(path))
    if not stat.S_ISREG(status.st_mode):
        raise UnsuitableFileError(errno.EINVAL, "it is not a regular file", str(path))


def _require_size(size: int, max_size: int, path: Path | str) -> None:
    if size > max_size:
        raise TooLargeError(errno.EFBIG, f"it has more than {_size_text(max_size)}", str(path))


def _read(descriptor: int, byte_count: int) -> bytes:
    """Return at most some bytes. A read that would block raises an OSError, because the descriptor does not block."""
    chunks: list[bytes] = []
    while byte_count > 0 and (chunk := os.read(descriptor, min(byte_count, 1 << 24))):
        chunks.append(chunk)
        byte_count -= len(chunk)
    return b"".join(chunks)


def _size_text(byte_count: int) -> str:
    return f"{byte_count >> 20} MiB" if byte_count >= 1 << 20 else f"{byte_count >> 10} KiB"
