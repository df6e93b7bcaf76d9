"""The files of a new project: contents and paths. Existing files are not changed. All files are written, or none."""

from __future__ import annotations

import os
from collections.abc import Iterable, Iterator, Mapping
from pathlib import Path, PurePosixPath

from codra_dsl.language.project import SCHEMA_COPY, SCHEMA_FILE

_TEMPLATE_FOLDER = Path(__file__).parent / "project"
_TEMPLATE_SUFFIX = ".in"
_NAME_PLACEHOLDER = "@NAME@"
_CODRA_PLACEHOLDER = "@CODRA@"


def starter_texts(name: str, requirement: str) -> dict[str, str]:
    """Return a mapping from the path of each file of a new project, with `/`, to its text, in alphabetical order.

    Args:
        name: the name of the spec, an identifier.
        requirement: the requirement with which pip installs codra, see `codra_dsl.tooling.installation`.
    """
    texts = {SCHEMA_COPY: SCHEMA_FILE.read_text("utf-8")}
    for template in sorted(_TEMPLATE_FOLDER.rglob(f"*{_TEMPLATE_SUFFIX}")):
        path = template.relative_to(_TEMPLATE_FOLDER).as_posix().removesuffix(_TEMPLATE_SUFFIX)
        text = template.read_text(encoding="utf-8")
        texts[path.replace(_NAME_PLACEHOLDER, name)] = text.replace(_NAME_PLACEHOLDER, name).replace(
            _CODRA_PLACEHOLDER, requirement
        )
    return dict(sorted(texts.items()))


def conflicts(paths: Iterable[str], folder: Path) -> tuple[str, ...]:
    """Return the existing paths in a folder that prevent new files, sorted.

    A path is in the result if a new file would have this path and something exists there already, or if a folder of a
    new file would have this path and a link or a file exists there.
    """
    return tuple(sorted({conflicting_path for path in paths for conflicting_path in _conflicting_paths(path, folder)}))


def write_new_files(texts: Mapping[str, str], folder: Path) -> None:
    """Write new files. If one of them cannot be written, remove all files and folders that were created before.

    Raises:
        OSError: if a file exists already or cannot be written.
    """
    created_paths: list[Path] = []
    try:
        for path, text in texts.items():
            _make_folders((folder / path).parent, created_paths)
            with (folder / path).open("x", encoding="utf-8", newline="\n") as file:
                created_paths.append(folder / path)
                file.write(text)
    except BaseException as error:
        if isinstance(error, OSError) and error.filename is None:  # writing to an open file names no file
            error.filename = str(created_paths[-1] if created_paths else folder)
        for created_path in reversed(created_paths):
            created_path.rmdir() if created_path.is_dir() else created_path.unlink()
        raise


def _conflicting_paths(path: str, folder: Path) -> Iterator[str]:
    for parent in reversed(PurePosixPath(path).parents):
        parent_path = folder / parent
        if parent.name and os.path.lexists(parent_path) and (parent_path.is_symlink() or not parent_path.is_dir()):
            yield parent.as_posix()
            return
    if os.path.lexists(folder / path):
        yield path


def _make_folders(folder: Path, created_paths: list[Path]) -> None:
    """Create a folder and its missing parents, and append them to `created_paths`."""
    if not folder.is_dir():
        _make_folders(folder.parent, created_paths)
        folder.mkdir()
        created_paths.append(folder)
