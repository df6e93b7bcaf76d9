"""A project: its root is the nearest folder upwards whose `pyproject.toml` has a table `[tool.codra]`."""

from __future__ import annotations

import os
import re
import tomllib
from collections.abc import Iterable, Iterator
from pathlib import Path

SETTINGS = "pyproject.toml"
"""The file that makes a folder a project's root, and has its settings."""

_OUR_TABLE = re.compile(rb"^(?:\xef\xbb\xbf)?[ \t]*\[{1,2}[ \t]*tool[ \t]*\.[ \t]*codra[ \t]*[.\]]", re.MULTILINE)

MANIFEST = "manifest.json"
"""The file by which a package is known as one that codra made: it has this text in it."""

MANIFEST_FORMAT = "codra-manifest"

SCHEMA_FILE = Path(__file__).with_name("schema.json")
"""The published schema of a spec."""

SCHEMA_COPY = ".codra/schema.json"
"""Where a project has a copy of it for its editors, from the root, if it has one."""


_SPEC_ENDINGS = (".yaml", ".yml")
_TIMELINE_ENDINGS = (".timeline.yaml", ".timeline.yml")
"""Files that pytest takes for tests: they may stand beside specs."""


def project_of(path: Path) -> Path | None:
    """Return the root of the project that a file or folder belongs to, or None where there is no project."""
    start = path.absolute()
    return next((folder for folder in (start, *start.parents) if _is_project(folder)), None)


def root_of(path: Path) -> Path:
    """Return the folder that the paths of specs are relative to: the project's root, else the folder of the spec."""
    return project_of(path) or (path.absolute() if path.is_dir() else path.absolute().parent)


def straight(path: Path) -> Path:
    """Return an existing path without `..`: the folder above `a/..` is that of `a`, not `a`."""
    if ".." not in path.parts:
        return path
    short = Path(os.path.normpath(path.absolute()))
    return short if short.exists() and short.samefile(path) else path.resolve()  # `..` behind a link leads elsewhere


def relative(path: Path, root: Path) -> str:
    """Return a path as findings name it: from a project's root, with `/`."""
    return Path(os.path.relpath(path.absolute(), root.absolute())).as_posix()


def covers(paths: Iterable[str], file: str) -> bool:
    """Return whether a file is one of some paths or stands in one of them; all are relative to the root."""
    return any(path in (".", file) or file.startswith(f"{path}/") for path in paths)


def yaml_files(folder: Path) -> Iterator[Path]:
    """Yield the YAML files in or below a folder, sorted, then each folder that cannot be looked into.

    Timelines are left out. Hidden folders and links to folders are not entered.
    """
    shut: list[OSError] = []
    for around, folders, files in os.walk(folder, onerror=shut.append):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        wanted = (name for name in files if name.endswith(_SPEC_ENDINGS) and not name.endswith(_TIMELINE_ENDINGS))
        yield from (Path(around, name) for name in sorted(wanted))
    yield from (Path(error.filename) for error in shut)


def has_stale_schema(root: Path) -> bool:
    """Return whether a project has a copy of the schema that is not the one of this version."""
    copy = root / SCHEMA_COPY
    if copy.is_symlink() or copy.parent.is_symlink():  # it leads elsewhere, and what is there is not ours
        return False
    try:
        return copy.read_bytes() != SCHEMA_FILE.read_bytes()
    except OSError:  # none there
        return False


def settings_in(folder: Path) -> bytes | None:
    """Return what a folder's `pyproject.toml` holds, or None where there is no such file that can be read."""
    file = folder / SETTINGS
    try:
        return file.read_bytes() if file.is_file() else None  # a pipe would let us wait for ever
    except OSError:
        return None


def _is_project(folder: Path) -> bool:
    data = settings_in(folder)
    if data is None:
        return False
    try:
        settings = tomllib.loads(data.decode("utf-8"))
    except (ValueError, RecursionError):
        return _OUR_TABLE.search(data) is not None  # what is wrong with it is a finding, not a reason to look elsewhere
    tool = settings.get("tool")
    return isinstance(tool, dict) and "codra" in tool
