"""Digests of the inputs that determine the result of a run. The modification times of files are never used."""

from __future__ import annotations

import hashlib
import os
import sys
from collections.abc import Sequence
from functools import cache
from importlib.util import find_spec
from pathlib import Path

from codra_dsl.language.project import SETTINGS, yaml_files
from codra_dsl.regular_files import read_regular_file

MAX_BYTES = 64 * 1024 * 1024
"""The maximum size of a file in bytes; a run that reads a larger file is not stored."""

_LIBRARIES = ("yaml", "jsonschema", "jsonschema_rs", "networkx", "jinja2")
_EXCLUDED_FOLDERS = frozenset({"__pycache__", "cli", "integrations", "runtime"})
_ABSENT_DIGEST = "absent"


def digests_of(root: Path, paths: Sequence[Path]) -> dict[str, str] | None:
    """Return a mapping from each file at or below some paths to the digest of the file.

    The keys are paths relative to the root. All YAML files below a folder are included, whether or not they are specs.
    The settings of the project are always included. A missing file has the digest `absent`. Return None if a file is
    too large, is not a regular file or cannot be read.
    """
    requested_files = [file for path in paths for file in (yaml_files(path) if path.is_dir() else (path,))]
    digests: dict[str, str] = {}
    for file in (*requested_files, root / SETTINGS):
        name = os.path.relpath(file, root)
        if name not in digests:
            digest = _digest(file, root)
            if digest is None:
                return None
            digests[name] = digest
    return digests


def _digest(file: Path, root: Path) -> str | None:
    """Return a digest of a file's bytes and real path, `absent` for a missing file, or None for an unsuitable one."""
    try:
        data = read_regular_file(file, MAX_BYTES)
    except FileNotFoundError:
        return _ABSENT_DIGEST
    except OSError:
        return None
    real_path = os.path.relpath(os.path.realpath(file), os.path.realpath(root))
    return hashlib.sha256(os.fsencode(real_path) + b"\0" + data).hexdigest()


@cache
def compiler_digest() -> str:
    """Return a digest of everything that turns inputs into results: the compiler's files, its libraries, and Python."""
    package = Path(__file__).parents[2]
    digest = hashlib.sha256(sys.version.encode())
    for folder, subfolders, files in os.walk(package):
        subfolders[:] = sorted(name for name in subfolders if name not in _EXCLUDED_FOLDERS)
        for name in sorted(files):
            file = Path(folder, name)
            digest.update(f"{file.relative_to(package).as_posix()}\0".encode())
            digest.update(hashlib.sha256(file.read_bytes()).digest())
    for library in _LIBRARIES:  # the first module of a library contains its version; the module is read, not run
        spec = find_spec(library)
        if spec is not None and spec.origin is not None:
            digest.update(hashlib.sha256(Path(spec.origin).read_bytes()).digest())
    return digest.hexdigest()
