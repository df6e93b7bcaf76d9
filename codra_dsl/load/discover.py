"""Which files at or below some paths are specs."""

from __future__ import annotations

import os
import re
from collections.abc import Iterator, Sequence
from pathlib import Path

import yaml

from codra_dsl.diagnostics import Diagnostic
from codra_dsl.expression.tokens import shown
from codra_dsl.load.compose import Parser
from codra_dsl.load.document import SECTIONS
from codra_dsl.load.findings import Findings
from codra_dsl.load.source import MAX_BYTES, file_place

_SUFFIXES = (".yaml", ".yml")
_MAY_HAVE_NAME = re.compile(rb"\bname[\"']?[ \t]*:")
_OURS = frozenset({"codra", "templates", "use", *SECTIONS})


def spec_files(paths: Sequence[Path], root: Path) -> tuple[tuple[Path, ...], tuple[Diagnostic, ...]]:
    """Return the specs at or below paths, sorted, each once.

    A file that is named is taken as it is, so that `load_spec` says what is wrong with it. Below a folder, specs are
    the YAML files of this language with a `name`; hidden folders and links to folders are not entered.
    """
    findings = Findings()
    found: dict[Path, Path] = {}
    for path in paths:
        name = _shown(path, root)
        if path.is_dir():
            below = [file for file in _yaml_files(path) if _is_spec(file)]
            if not below:
                way_out = "a spec is a YAML file with 'codra: 1' and 'name: ...'"
                findings.add("no-spec", f"there is no spec in {shown(name)} or below", file_place(name), help=way_out)
        else:
            below = [path]
        for file in below:
            found.setdefault(file.resolve(), file)
    return tuple(sorted(found.values(), key=lambda file: file.as_posix())), findings.all()


def _shown(path: Path, root: Path) -> str:
    """Return a path relative to the project's folder, if it is in there."""
    try:
        return path.absolute().relative_to(root.absolute()).as_posix()
    except ValueError:
        return path.as_posix()


def _yaml_files(folder: Path) -> Iterator[Path]:
    for around, folders, files in os.walk(folder):
        folders[:] = sorted(name for name in folders if not name.startswith("."))
        yield from (Path(around, name) for name in sorted(files) if name.endswith(_SUFFIXES))


def _is_spec(file: Path) -> bool:
    """Return whether a file is to be read as a spec: it has a `name` and is of this language, or nobody can tell."""
    try:
        with file.open("rb") as stream:
            data = stream.read(MAX_BYTES)
    except OSError:
        return True
    if not _MAY_HAVE_NAME.search(data):
        return False
    keys = set()
    try:
        for key in _top_keys(data.decode("utf-8", "replace")):
            keys.add(key)
            if "name" in keys and keys & _OURS:
                return True
    except yaml.YAMLError:
        return bool(keys & _OURS) or not keys
    return False


def _top_keys(text: str) -> Iterator[str]:
    """Yield the keys of a document's outermost mapping."""
    depth, is_key = 0, True
    parser = Parser(text)
    try:
        while (event := parser.get_event()) is not None:
            if isinstance(event, yaml.CollectionStartEvent):
                depth += 1
            elif isinstance(event, yaml.CollectionEndEvent):
                depth -= 1
            if depth == 1 and isinstance(event, (yaml.ScalarEvent, yaml.AliasEvent, yaml.CollectionEndEvent)):
                if is_key and isinstance(event, yaml.ScalarEvent):
                    yield event.value
                is_key = not is_key
    finally:
        parser.dispose()
