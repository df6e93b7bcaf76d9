"""A secret of the user, with which stored runs are signed.

A cache folder can be part of a repository or of an archive, with results that its author has chosen. Only the user's
own runs know the secret, so only results that they have stored are used.
"""

from __future__ import annotations

import hashlib
import hmac
import os
import stat
import tempfile
from pathlib import Path

from codra_dsl.regular_files import leads_into, read_regular_file

SECRET_FILE = "codra/cache-secret"
"""The path of the secret in the user's cache folder."""

_SECRET_BYTES = 32


def user_secret(project_root: Path) -> bytes | None:
    """Return the user's secret, and create it if there is none. Return None if no secret can be kept.

    The secret is a file that only its owner can read. A file that others can read or that has another size is replaced.

    Args:
        project_root: the root of the project. A secret inside of it could come from the project, so it is not used.
    """
    try:
        file = _user_cache_folder() / SECRET_FILE
        if leads_into(file, project_root):
            return None
        return _read_secret(file) or _create_secret(file)
    except (OSError, RuntimeError):  # there is no home folder, or nothing can be written there
        return None


def signature(secret: bytes, key: str, data: bytes) -> bytes:
    """Return the signature of a stored run, as hexadecimal digits; `key` states the project, the command and its paths.

    A run that is moved to another project, or to other arguments, has another signature.
    """
    key_digest = hashlib.sha256(key.encode(errors="surrogateescape")).digest()
    return hmac.digest(secret, key_digest + data, "sha256").hex().encode()


def _user_cache_folder() -> Path:
    folder = Path(os.environ.get("XDG_CACHE_HOME", ""))
    return folder if folder.is_absolute() else Path.home() / ".cache"


def _read_secret(file: Path) -> bytes | None:
    try:
        status = file.lstat()
        is_private = stat.S_ISREG(status.st_mode) and not stat.S_IMODE(status.st_mode) & 0o077
        if not is_private or status.st_uid != os.geteuid():
            return None
        secret = read_regular_file(file, _SECRET_BYTES)
    except OSError:
        return None
    return secret if len(secret) == _SECRET_BYTES else None


def _create_secret(file: Path) -> bytes:
    """Write a new secret. The file is complete at the instant at which it gets its name."""
    secret = os.urandom(_SECRET_BYTES)
    file.parent.mkdir(mode=0o700, parents=True, exist_ok=True)
    descriptor, temporary_name = tempfile.mkstemp(prefix=".codra-", dir=file.parent)  # only the owner can read it
    try:
        with os.fdopen(descriptor, "wb") as stream:
            stream.write(secret)
            stream.flush()
            os.fsync(stream.fileno())
        Path(temporary_name).replace(file)
    except OSError:
        Path(temporary_name).unlink(missing_ok=True)
        raise
    return secret
