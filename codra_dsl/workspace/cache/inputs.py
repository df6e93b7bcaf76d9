"""The inputs that determine the result of a run. The modification times of files are never used."""

from __future__ import annotations

import hashlib
import sys
from collections.abc import Sequence
from contextlib import suppress
from functools import cache
from importlib.util import find_spec
from os import walk
from pathlib import Path

from codra_dsl.language.file_queries import MAX_SPEC_BYTES, Answers, read_file, real_path, recorded_queries
from codra_dsl.language.project import SETTINGS, relative_path, yaml_files

_LIBRARIES = ("yaml", "jsonschema", "jsonschema_rs", "networkx", "jinja2", "rosbags")
_EXCLUDED_FOLDERS = frozenset({"__pycache__", "cli", "integrations", "runtime"})


def answers_about(root: Path, paths: Sequence[Path]) -> Answers | None:
    """Return the answers to queries about the settings of a project, and about each file at or below some paths.

    All YAML files below a folder are included, whether or not they are specs. Return None if a file cannot be read,
    unless it is missing: such a run is not stored.
    """
    requested_files = [file for path in paths for file in (yaml_files(path) if path.is_dir() else (path,))]
    with recorded_queries() as answers:
        try:
            for file in requested_files:
                real_path(file)
                with suppress(FileNotFoundError):
                    read_file(file, MAX_SPEC_BYTES, root, relative_path(file, root))
            with suppress(FileNotFoundError):
                read_file(root / SETTINGS, MAX_SPEC_BYTES, Path(root.anchor))  # it may be a link to any place
        except OSError:
            return None
    return answers


@cache
def compiler_digest() -> str:
    """Return a digest of everything that turns inputs into results: the compiler's files, its libraries, and Python."""
    package = Path(__file__).parents[2]
    digest = hashlib.sha256(sys.version.encode())
    for folder, subfolders, files in walk(package):
        subfolders[:] = sorted(name for name in subfolders if name not in _EXCLUDED_FOLDERS)
        for name in sorted(files):
            file = Path(folder, name)
            digest.update(f"{file.relative_to(package).as_posix()}\0".encode())
            digest.update(hashlib.sha256(file.read_bytes()).digest())
    for library in _LIBRARIES:  # the first module of a library is read, not run; not all of them contain a version
        spec = find_spec(library)
        if spec is not None and spec.origin is not None:
            first_module = Path(spec.origin)
            digest.update(hashlib.sha256(first_module.read_bytes()).digest())
            versions = sorted(file.name for file in first_module.parents[1].glob(f"{library}-*-info"))
            digest.update("\0".join(versions).encode())
    return digest.hexdigest()
