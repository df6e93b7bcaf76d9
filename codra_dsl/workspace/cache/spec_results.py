"""Results of single specs. After an edit, only the specs whose results depend on the edited files are compiled again.

The results are the same in memory, for several runs of one process, and in the cache folder.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, MutableMapping
from dataclasses import field
from pathlib import Path
from typing import Any

from codra_dsl.language.diagnostics import Diagnostic, Place
from codra_dsl.language.file_queries import Answers
from codra_dsl.language.frozen import dataclass
from codra_dsl.workspace.cache.records import (
    answers_from,
    finding_from,
    place_from,
    place_record,
    record_of,
    record_of_answers,
    text_from,
    texts_from,
)


@dataclass(frozen=True, slots=True, kw_only=True)
class SpecResult:
    """The result of loading and checking one spec, before findings are triaged together with those of other specs.

    Attributes:
        diagnostics: the findings of load, then those of check.
        answers: the queries about files on which the result depends, with their answers.
        name: the name of the spec; None if its file could not be read as a spec.
        place: the place of the name; None without a name.
        file: the file of the spec, relative to the root; empty without a name.
        files: the files of the spec and its parts, relative to the root.
        modules: files of Python modules that were read or were missing, relative to the root.
        tree_files: files of behaviour trees that were read or were missing, relative to the root.
        output_digests: the digests of the generated files, by path in the output folder; empty if none was generated.
    """

    diagnostics: tuple[Diagnostic, ...]
    answers: Answers
    name: str | None = None
    place: Place | None = None
    file: str = ""
    files: tuple[str, ...] = ()
    modules: tuple[str, ...] = ()
    tree_files: tuple[str, ...] = ()
    output_digests: Mapping[str, str] = field(default_factory=dict)


SpecResults = MutableMapping[str, SpecResult]
"""The last results of specs, by the paths of the spec and of the site; see `result_key`."""


def result_key(path: Path, root: Path, site: Path | None = None) -> str:
    """Return the key of the result of the spec in a file, alone or with the values of a site.

    `root` is the folder of the project.
    """
    return "\0".join(str(part.absolute()) for part in (root, path, *([] if site is None else [site])))


def is_outdated(key: str) -> bool:
    """Return whether the file of a spec, or of a site, does not exist any more."""
    return not all(map(os.path.lexists, key.split("\0")[1:]))


def record_of_result(result: SpecResult) -> dict[str, object]:
    """Return a result as plain data."""
    return {
        "diagnostics": [record_of(diagnostic) for diagnostic in result.diagnostics],
        "answers": record_of_answers(result.answers),
        "name": result.name,
        "place": None if result.place is None else place_record(result.place),
        "file": result.file,
        "files": result.files,
        "modules": result.modules,
        "tree_files": result.tree_files,
        "outputs": dict(result.output_digests),
    }


def result_from(record: Any) -> SpecResult:
    """Return a result from plain data.

    Raises:
        TypeError, ValueError, LookupError, AttributeError: if the data does not describe a result.
    """
    return SpecResult(
        diagnostics=tuple(map(finding_from, record["diagnostics"])),
        answers=answers_from(record["answers"]),
        name=None if record["name"] is None else text_from(record["name"]),
        place=None if record["place"] is None else place_from(record["place"]),
        file=text_from(record["file"]),
        files=texts_from(record["files"]),
        modules=texts_from(record["modules"]),
        tree_files=texts_from(record["tree_files"]),
        output_digests={text_from(path): text_from(digest) for path, digest in record["outputs"].items()},
    )
