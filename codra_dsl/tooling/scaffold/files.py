"""The files of a new project: what they hold, and where they go. Nothing that is there is touched; all or none."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from importlib.metadata import PackageNotFoundError, distribution
from pathlib import Path, PurePosixPath

from codra_dsl import __version__
from codra_dsl.language.project import SCHEMA_COPY, SCHEMA_FILE

_TEMPLATES = Path(__file__).parent / "project"
_ENDING = ".in"
_NAME = "@NAME@"
_CODRA = "@CODRA@"
_PACKAGE = "codra-dsl"


def starter_texts(name: str, requirement: str) -> dict[str, str]:
    """Return the files of a new project by path, with `/`, in alphabetical order.

    Args:
        name: of the spec; an identifier.
        requirement: how pip is told to install codra, e.g. `codra-dsl==0.1.0`.
    """
    texts = {SCHEMA_COPY: SCHEMA_FILE.read_text("utf-8")}
    for template in sorted(_TEMPLATES.rglob(f"*{_ENDING}")):
        path = template.relative_to(_TEMPLATES).as_posix().removesuffix(_ENDING)
        text = template.read_text(encoding="utf-8")
        texts[path.replace(_NAME, name)] = text.replace(_NAME, name).replace(_CODRA, requirement)
    return dict(sorted(texts.items()))


def installed_requirement() -> str:
    """Return the requirement that installs this codra: a git or https address, or the version."""
    try:
        origin = distribution(_PACKAGE).read_text("direct_url.json")
    except PackageNotFoundError:  # run from source
        origin = None
    return requirement_from(origin)


def requirement_from(origin: str | None) -> str:
    """Return the requirement for what pip has noted on where a package came from (`direct_url.json`), if anything.

    A folder or file of this machine says nothing to others: then the version has to do.
    """
    noted = json.loads(origin) if origin else {}
    url = noted.get("url", "")
    if not url.startswith(("https://", "ssh://")):
        return f"{_PACKAGE}=={__version__}"
    vcs = noted.get("vcs_info")
    address = f"{vcs['vcs']}+{url}@{vcs['commit_id']}" if vcs else url
    below = f"#subdirectory={noted['subdirectory']}" if noted.get("subdirectory") else ""
    return f"{_PACKAGE} @ {address}{below}"


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
