"""Keeps runs in a folder of the project and finds them again."""

from __future__ import annotations

import hashlib
import json
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from codra_dsl.language.diagnostics import Diagnostic, Severity, has_errors
from codra_dsl.language.project import project_of
from codra_dsl.workspace.cache.inputs import digests_of, made_with
from codra_dsl.workspace.cache.records import finding_from, record_of, text_from, texts_from

FOLDER = ".codra_cache"
"""The name of the folder, in a project's root."""

_FORMAT = "codra-cache-1"

_ABOUT_FOLDERS = "call-not-found"
"""What names of modules it suggests depends on which files there are, not only on what is in them."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """What a run came to, as far as a command shows it.

    Attributes:
        specs: the files of the specs, relative to the project's root; `files` has those of their parts as well, and of
            the Python modules that calls were compared with.
        fail_on: what the project's settings say about the least severity that makes a command fail.
        outputs: the digest of each file that was made, by its path in the output folder.
        covered: the files and folders that were compiled, relative to the root.
    """

    diagnostics: tuple[Diagnostic, ...]
    specs: tuple[str, ...]
    files: tuple[str, ...]
    fail_on: Severity
    outputs: Mapping[str, str] = field(default_factory=dict)
    covered: tuple[str, ...] = ()


def cache_of(root: Path, command: str, paths: Sequence[Path]) -> Cache | None:
    """Return the cache of one question; None where there is no project, since nothing is written elsewhere.

    None as well where the folder is a link, and where the environment says `CI`: there the folder may have come with
    what is to be judged.
    """
    is_trusted = not os.environ.get("CI") and not (root / FOLDER).is_symlink()
    return Cache(root, command, paths) if is_trusted and project_of(root) == root else None


class Cache:
    """The cache of one question: one command and the paths that it was asked about."""

    def __init__(self, root: Path, command: str, paths: Sequence[Path]) -> None:
        """Begin; what the paths hold now is what `remember` keeps a run for."""
        self._root = root
        self._paths = tuple(paths)
        asked = [_FORMAT, command, *(os.path.relpath(path, root) for path in paths)]
        name = hashlib.sha256("\0".join(asked).encode(errors="surrogateescape")).hexdigest()[:32]
        self._file = root / FOLDER / f"{name}.json"
        self._before = digests_of(root, paths)

    def recall(self) -> Run | None:
        """Return the run that was kept for this question, if nothing that it depends on has changed since."""
        try:
            if not self._file.is_file():
                return None
            kept = json.loads(self._file.read_bytes())
            run = _run_from(kept["run"])
            fresh = kept["made_with"] == made_with() and kept["inputs"] == self._inputs(run.files)
        except (OSError, ValueError, TypeError, LookupError, AttributeError, RecursionError):
            return None
        return run if fresh else None

    def remember(self, run: Run) -> None:
        """Keep a run if it can be kept, unless it found an error or what it read has changed meanwhile."""
        if self._before != digests_of(self._root, self._paths) or has_errors(run.diagnostics):
            return
        if any(found.rule.name == _ABOUT_FOLDERS for found in run.diagnostics):
            return
        inputs = self._inputs(run.files)
        if inputs is None:
            return
        kept = {"made_with": made_with(), "inputs": inputs, "run": _record_of_run(run)}
        try:
            _write(self._file, json.dumps(kept))
        except OSError:
            return

    def _inputs(self, files: Iterable[str]) -> dict[str, str] | None:
        """Return the digests of what the paths held at the beginning, and of a run's parts elsewhere."""
        parts = digests_of(self._root, [self._root / file for file in files if file not in (self._before or ())])
        return None if self._before is None or parts is None else {**parts, **self._before}


def _write(file: Path, text: str) -> None:
    """Write a file at once, in a folder that no repository takes in."""
    folder = file.parent
    folder.mkdir(exist_ok=True)
    ignore = folder / ".gitignore"
    if not os.path.lexists(ignore):
        ignore.write_text("*\n", "ascii")
    with tempfile.NamedTemporaryFile("w", encoding="ascii", dir=folder, delete=False) as temporary:
        try:
            temporary.write(text)
            temporary.close()
            Path(temporary.name).replace(file)
        except OSError:
            Path(temporary.name).unlink(missing_ok=True)
            raise


def _record_of_run(run: Run) -> dict[str, object]:
    return {
        "diagnostics": [record_of(each) for each in run.diagnostics],
        "specs": run.specs,
        "files": run.files,
        "fail_on": run.fail_on,
        "outputs": dict(run.outputs),
        "covered": run.covered,
    }


def _run_from(record: Mapping[str, object]) -> Run:
    outputs = record["outputs"]
    found = record["diagnostics"]
    if not isinstance(outputs, dict) or not isinstance(found, list):
        raise TypeError
    return Run(
        diagnostics=tuple(map(finding_from, found)),
        specs=texts_from(record["specs"]),
        files=texts_from(record["files"]),
        fail_on=Severity(text_from(record["fail_on"])),
        outputs={text_from(path): text_from(digest) for path, digest in outputs.items()},
        covered=texts_from(record["covered"]),
    )
