"""Which files at or below some paths are specs, and which are parts."""

from __future__ import annotations

import codecs
import re
import stat
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

import yaml

from codra_dsl.diagnostics import Diagnostic, Place, Span
from codra_dsl.expression.tokens import shown
from codra_dsl.load.compose import Parser
from codra_dsl.load.document import KEYS
from codra_dsl.load.findings import Findings
from codra_dsl.load.rules import RULES
from codra_dsl.load.source import MAX_BYTES, file_place
from codra_dsl.project import yaml_files

_MAY_HAVE_NAME = re.compile(rb"\bname[\"']?[ \t]*:")
_SAYS_CODRA = re.compile(rb"^codra[ \t]*:", re.MULTILINE)
_OURS = frozenset({"codra", "templates", "use", *KEYS})
_WIDE_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


@dataclass(frozen=True, slots=True)
class Files:
    """What is there at and below some paths.

    Attributes:
        specs: sorted, each once.
        parts: with the place where each says that it is of this language.
        diagnostics: what cannot be looked into, and where there is no spec.
    """

    specs: tuple[Path, ...] = ()
    parts: Mapping[Path, Place] = field(default_factory=dict)
    diagnostics: tuple[Diagnostic, ...] = ()

    def unincluded(self, included: Iterable[str], root: Path) -> Iterator[Diagnostic]:
        """Yield a finding for each part that is not among those that specs include, relative to the project's root."""
        files = {(root / file).resolve() for file in included}
        for part, place in self.parts.items():
            if part not in files:
                yield Diagnostic(
                    rule=RULES["unincluded-part"],
                    message=f"no spec includes {shown(place.span.file)}, so nothing in it is checked or compiled",
                    place=place,
                    help="a spec has a 'name', a part is named under 'include' of one; remove what is neither",
                )


def find_files(paths: Sequence[Path], root: Path) -> Files:
    """Return the specs and parts at or below paths.

    A file that is named is taken for a spec, so that `load_spec` says what is wrong with it. Below a folder, specs are
    the YAML files of this language with a `name`; hidden folders and links to folders are not entered.
    """
    findings = Findings()
    specs: dict[Path, Path] = {}
    parts: dict[Path, Place] = {}
    for path in paths:
        below = list(_below(path, root, parts, findings)) if path.is_dir() else [path]
        for file in below:
            specs.setdefault(file.resolve(), file)
    for file in specs.keys() & parts.keys():
        del parts[file]
    return Files(tuple(sorted(specs.values(), key=lambda file: file.as_posix())), parts, findings.all())


def _below(folder: Path, root: Path, parts: dict[Path, Place], findings: Findings) -> Iterator[Path]:
    """Yield the specs below a folder, and add its parts to others."""
    name, found = _shown(folder, root), False
    for file in yaml_files(folder):
        if file.is_dir():
            place = file_place(_shown(file, root))
            message = f"cannot look into {shown(place.span.file)}"
            findings.add("cannot-read", message, place, help="check its permissions")
            found = True
        elif _is_spec(data := _beginning(file)):
            found = True
            yield file
        elif data and (says := _SAYS_CODRA.search(data)):
            line = data.count(b"\n", 0, says.start()) + 1
            parts[file.resolve()] = Place(Span(_shown(file, root), line, 1, line, len("codra") + 1))
    if not found:
        way_out = "a spec is a YAML file with 'codra: 1' and 'name: ...'"
        findings.add("no-spec", f"there is no spec in {shown(name)} or below", file_place(name), help=way_out)


def _shown(path: Path, root: Path) -> str:
    """Return a path relative to the project's folder, if it is in there."""
    try:
        return path.absolute().relative_to(root.absolute()).as_posix()
    except ValueError:
        return path.as_posix()


def _beginning(file: Path) -> bytes | None:
    """Return what a file holds, in UTF-8; nothing of a pipe or device, and None where it cannot be read."""
    try:
        if not stat.S_ISREG(file.stat().st_mode):
            return b""
        with file.open("rb") as stream:
            data = stream.read(MAX_BYTES)
    except OSError:
        return None
    return data.decode("utf-16", "replace").encode() if data.startswith(_WIDE_MARKS) else data


def _is_spec(data: bytes | None) -> bool:
    """Return whether a file is to be read as a spec: it has a `name` and is of this language, or nobody can tell."""
    if data is None:
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
