"""The inputs that determine the result of a run, as digests, never as times."""

from __future__ import annotations

import hashlib
import os
import stat
import sys
from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from codra_dsl.language.project import SETTINGS, yaml_files

MAX_BYTES = 64 * 1024 * 1024
"""Runs on larger files are not stored."""

_LIBRARIES = ("yaml", "jsonschema", "jsonschema_rs", "networkx", "jinja2")
_NOT_THE_COMPILER = frozenset({"__pycache__", "cli", "integrations", "runtime"})
_ABSENT = "absent"


def digests_of(root: Path, paths: Sequence[Path]) -> dict[str, str] | None:
    """Return digests by path of the files at or below some paths; None if a path is not a file or is too large.

    All YAML files below a folder count, whether or not they are specs; the project's settings always count.
    """
    asked = [file for path in paths for file in (yaml_files(path) if path.is_dir() else (path,))]
    digests: dict[str, str] = {}
    for file in (*asked, root / SETTINGS):
        name = os.path.relpath(file, root)
        if name not in digests:
            digest = _digest(file, root)
            if digest is None:
                return None
            digests[name] = digest
    return digests


def _digest(file: Path, root: Path) -> str | None:
    """Return the digest of a file's bytes and of its location after links are followed."""
    try:
        about = file.stat()
        if not stat.S_ISREG(about.st_mode) or about.st_size > MAX_BYTES:
            return None
        data = file.read_bytes()
    except FileNotFoundError:
        return _ABSENT
    except OSError:
        return None
    where = os.path.relpath(os.path.realpath(file), os.path.realpath(root))
    return hashlib.sha256(os.fsencode(where) + b"\0" + data).hexdigest()


@cache
def made_with() -> str:
    """Return a digest of everything that turns inputs into results: the compiler's files, its libraries, and Python."""
    package = Path(__file__).parents[2]
    digest = hashlib.sha256(sys.version.encode())
    for around, folders, files in os.walk(package):
        folders[:] = sorted(name for name in folders if name not in _NOT_THE_COMPILER)
        for name in sorted(files):
            file = Path(around, name)
            digest.update(f"{file.relative_to(package).as_posix()}\0".encode())
            digest.update(hashlib.sha256(file.read_bytes()).digest())
    for library in _LIBRARIES:  # their first module contains their version; it is read, not run
        spec = find_spec(library)
        if spec is not None and spec.origin is not None:
            digest.update(hashlib.sha256(Path(spec.origin).read_bytes()).digest())
    return digest.hexdigest()
