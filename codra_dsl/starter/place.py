"""Where a new project goes: nothing that is there is touched, and all of it is written or none."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath


def conflicts(paths: Iterable[str], folder: Path) -> tuple[str, ...]:
    """Return what in a folder stands in the way of new files, sorted: files, and links or files in place of folders."""
    return tuple(sorted({taken for path in paths for taken in _taken(path, folder)}))


def write_new(texts: Mapping[str, str], folder: Path) -> None:
    """Write new files; when one cannot be written, remove what was written before it.

    Raises:
        OSError: if a file is there already or cannot be written.
    """
    made: list[Path] = []
    try:
        for path, text in texts.items():
            _make_folders((folder / path).parent, made)
            with (folder / path).open("x", encoding="utf-8", newline="\n") as file:
                made.append(folder / path)
                file.write(text)
    except BaseException:
        for each in reversed(made):
            each.rmdir() if each.is_dir() else each.unlink()
        raise


def _taken(path: str, folder: Path) -> Iterator[str]:
    for parent in reversed(PurePosixPath(path).parents):
        there = folder / parent
        if parent.name and os.path.lexists(there) and (there.is_symlink() or not there.is_dir()):
            yield parent.as_posix()
            return
    if os.path.lexists(folder / path):
        yield path


def _make_folders(folder: Path, made: list[Path]) -> None:
    """Make a folder and those above it, and add them to what was made."""
    if not folder.is_dir():
        _make_folders(folder.parent, made)
        folder.mkdir()
        made.append(folder)
