"""Files in the cache folder of a project, signed with the user's secret."""

from __future__ import annotations

import hmac
import json
import os
import tempfile
from collections.abc import Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from codra_dsl.regular_files import read_regular_file
from codra_dsl.workspace.cache.inputs import compiler_digest
from codra_dsl.workspace.cache.signatures import signature

FOLDER = ".codra_cache"
"""The name of the cache folder in a project's root."""

_MAX_BYTES = 64 * 1024 * 1024
"""The maximum size of a stored file. A larger file is neither written nor read."""

_MAX_FILES = 100
"""The number of files beyond which the oldest ones are removed."""


class StoredFile:
    """A file in the cache folder. Only what this version of codra has stored there for its user is read."""

    def __init__(self, root: Path, secret: bytes, name: str, key: str) -> None:
        """Initialize; `key` states the purpose of the file. A file for another project or key is not read."""
        self._file = root / FOLDER / name
        self._secret = secret
        self._key = f"{os.path.realpath(root)}\0{key}"

    def read(self) -> Mapping[str, Any] | None:
        """Return the stored record, or None if there is none, or if another user or another version stored it."""
        try:
            written_signature, _, data = read_regular_file(self._file, _MAX_BYTES).partition(b"\n")
            if not hmac.compare_digest(written_signature, signature(self._secret, self._key, data)):
                return None
            record: Mapping[str, Any] = json.loads(data)
            return record if record["made_with"] == compiler_digest() else None
        except (OSError, ValueError, TypeError, LookupError, RecursionError):
            return None

    def write(self, record: Mapping[str, object]) -> None:
        """Store a record. A record that is too large or cannot be written is not stored."""
        try:
            data = json.dumps({"made_with": compiler_digest(), **record}).encode("ascii")
            data = signature(self._secret, self._key, data) + b"\n" + data
            if len(data) <= _MAX_BYTES:
                _write(self._file, data)
        except OSError:
            return


def remove_oldest_files(root: Path, kept_name: str) -> None:
    """Remove the oldest files of the cache folder if it has more than `_MAX_FILES`, but not the file `kept_name`.

    These are results for other arguments of commands, and what interrupted runs and older versions have left there.
    """
    with suppress(OSError):  # another run may remove the same files meanwhile
        files = [file for file in (root / FOLDER).glob("[!.]*") if file.name != kept_name]
        for file in sorted(files, key=lambda file: file.lstat().st_mtime_ns)[:-_MAX_FILES]:
            file.unlink()


def _write(file: Path, data: bytes) -> None:
    """Write a file atomically, in a folder that git ignores."""
    folder = file.parent
    folder.mkdir(exist_ok=True)
    gitignore = folder / ".gitignore"
    if not os.path.lexists(gitignore):
        gitignore.write_text("*\n", "ascii")
    with tempfile.NamedTemporaryFile("wb", dir=folder, delete=False) as temporary_file:
        try:
            temporary_file.write(data)
            temporary_file.close()
            Path(temporary_file.name).replace(file)
        except BaseException:
            Path(temporary_file.name).unlink(missing_ok=True)
            raise
