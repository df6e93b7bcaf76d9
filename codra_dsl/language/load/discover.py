"""Find the specs, parts and sites at or below given paths."""

from __future__ import annotations

import codecs
import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import field
from pathlib import Path

import yaml

from codra_dsl.language.diagnostics import Diagnostic, Place, Span, is_slip
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.schema.document import KEYS
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.parser_error import Parser
from codra_dsl.language.load.yaml.rules import RULES
from codra_dsl.language.load.yaml.source import AS_ON_DISK, MAX_BYTES, file_place
from codra_dsl.language.project import yaml_files
from codra_dsl.regular_files import OutsideError, UnsuitableFileError, read_beginning, real_path

# Python searches for a pattern that begins with letters 15 times as fast as for one that begins with `\b`.
_NAME_KEY_PATTERN = re.compile(rb"name(?<!\wname)[\"']?[ \t]*:")
_VERSION_KEY_PATTERN = re.compile(rb"^codra[ \t]*:", re.MULTILINE)
_SITE_KEY_PATTERN = re.compile(rb"over(?<!\wover)\w*[\"']?[ \t]*:")
_LANGUAGE_KEYS = frozenset({"codra", "templates", "use", *KEYS})
_UTF16_BYTE_ORDER_MARKS = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


@dataclass(frozen=True, slots=True)
class Files:
    """The specs, parts and sites at and below some paths.

    Attributes:
        specs: the specs, sorted and without duplicates.
        parts: the parts, each with the place of its key `codra`.
        sites: the sites, sorted and without duplicates.
        diagnostics: the findings about folders that cannot be read and paths without a spec.
    """

    specs: tuple[Path, ...] = ()
    parts: Mapping[Path, Place] = field(default_factory=dict)
    sites: tuple[Path, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()

    def unincluded(self, included_files: Iterable[str], root: Path) -> Iterator[Diagnostic]:
        """Yield a finding for each part that no spec includes.

        `included_files` has the files of all specs, relative to the root.
        """
        files = {real_path(root / file) for file in included_files}
        for part, place in self.parts.items():
            if part not in files:
                yield Diagnostic(
                    rule=RULES["unincluded-part"],
                    message=f"no spec includes {shown(place.span.file)}, so it is neither checked nor compiled",
                    place=place,
                    help="list it under 'include' of a spec, add a 'name' to make it a spec or 'overlays' to make it a "
                    "site, or remove it",
                )


def find_files(paths: Sequence[Path], root: Path, texts: Mapping[str, bytes] = AS_ON_DISK) -> Files:
    """Return the specs, parts and sites at or below paths; `texts` has contents that are not read from disk.

    A file given as a path is always treated as a site or a spec, so that `load_spec` reports its mistakes. The sites
    are the files of this language with the key `overlays`. Below a folder, the specs are those YAML files of this
    language that have a `name`. Hidden folders and links to folders are not entered.
    """
    findings = Findings()
    specs: dict[Path, Path] = {}
    sites: dict[Path, Path] = {}
    parts: dict[Path, Place] = {}
    for path in paths:
        if path.is_dir():
            spec_files = list(_specs_below(path, root, texts, parts=parts, sites=sites, findings=findings))
        else:
            is_site = _is_site(_read_beginning(path, root, texts))
            spec_files = [] if is_site else [path]
            sites.update({real_path(path): path} if is_site else {})
        for file in spec_files:
            specs.setdefault(real_path(file), file)
    for file in specs.keys() & parts.keys():
        del parts[file]
    return Files(_sorted_files(specs), parts, _sorted_files(sites), findings.all())


def _sorted_files(files: Mapping[Path, Path]) -> tuple[Path, ...]:
    return tuple(sorted(files.values(), key=lambda file: file.as_posix()))


def _specs_below(
    folder: Path,
    root: Path,
    texts: Mapping[str, bytes],
    *,
    parts: dict[Path, Place],
    sites: dict[Path, Path],
    findings: Findings,
) -> Iterator[Path]:
    """Yield the specs below a folder, and add its parts and sites to `parts` and `sites`."""
    name, has_spec_or_error = _relative_name(folder, root), False
    for file in yaml_files(folder):
        if os.path.isdir(file):  # noqa: PTH112 - it never raises
            place = file_place(_relative_name(file, root))
            message = f"cannot read the folder {shown(place.span.file)}"
            findings.add("cannot-read", message, place, help="check its permissions")
            has_spec_or_error = True
        elif _is_site(data := _read_beginning(file, root, texts)):
            has_spec_or_error = True
            sites.setdefault(real_path(file), file)
        elif _is_spec(data):
            has_spec_or_error = True
            yield file
        elif data and (version_match := _VERSION_KEY_PATTERN.search(data)):
            line = data.count(b"\n", 0, version_match.start()) + 1
            parts[real_path(file)] = Place(Span(_relative_name(file, root), line, 1, line, len("codra") + 1))
    if not has_spec_or_error:
        help_text = "a spec is a YAML file with 'codra: 1' and 'name: ...', a site has 'overlays: ...' instead"
        name = folder.name or name if name == "." else name  # outside of projects, the folder is its own root
        findings.add("no-spec", f"there is no spec in {shown(name)} or below", file_place(name), help=help_text)


def _relative_name(path: Path, root: Path) -> str:
    """Return a path relative to the project's folder; a path outside of this folder stays as it is."""
    try:
        return path.absolute().relative_to(root.absolute()).as_posix()
    except ValueError:
        return path.as_posix()


def is_of_language(file: Path, root: Path, texts: Mapping[str, bytes]) -> bool:
    """Return whether a file is a spec, a part or a site, as a file below a folder would be judged."""
    data = _read_beginning(file, root, texts)
    return _is_site(data) or _is_spec(data) or bool(data and _VERSION_KEY_PATTERN.search(data))


def is_spec_or_site(file: Path, root: Path, texts: Mapping[str, bytes]) -> bool:
    """Return whether a file is a spec or a site, as a file below a folder would be judged."""
    data = _read_beginning(file, root, texts)
    return _is_site(data) or _is_spec(data)


def _read_beginning(file: Path, root: Path, texts: Mapping[str, bytes]) -> bytes | None:
    """Return the first MAX_BYTES + 1 of a file in UTF-8, or no bytes for a pipe or device.

    Return None if the file cannot be read or is a link that leads out of the project.
    """
    try:
        data = texts.get(_relative_name(file, root)) if texts else None
        data = read_beginning(file, MAX_BYTES + 1, within=root) if data is None else data
    except OutsideError:
        return None
    except UnsuitableFileError:
        return b""
    except OSError:
        return None
    return data.decode("utf-16", "replace").encode() if data.startswith(_UTF16_BYTE_ORDER_MARKS) else data


def _is_site(data: bytes | None) -> bool:
    """Return whether to read a file as a site: it has a key of this language, and `overlays`, which may be misspelt."""
    if not data or not _SITE_KEY_PATTERN.search(data):
        return False
    try:
        keys = set(_top_keys(data.decode("utf-8", "replace")))
    except yaml.YAMLError:
        return _VERSION_KEY_PATTERN.search(data) is not None
    return bool(keys & _LANGUAGE_KEYS) and any(key == "overlays" or is_slip(key, "overlays") for key in keys)


def _is_spec(data: bytes | None) -> bool:
    """Return whether to read a file as a spec: it has a `name` and a key of this language, or its keys are unknown."""
    if data is None:
        return True
    if len(data) > MAX_BYTES:  # too large to look for its keys; `load_spec` reports it if it is of this language
        return _VERSION_KEY_PATTERN.search(data) is not None
    if not _NAME_KEY_PATTERN.search(data):
        return False
    keys = set()
    try:
        for key in _top_keys(data.decode("utf-8", "replace")):
            keys.add(key)
            if "name" in keys and keys & _LANGUAGE_KEYS:
                return True
    except yaml.YAMLError:
        return bool(keys & _LANGUAGE_KEYS) or not keys
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
