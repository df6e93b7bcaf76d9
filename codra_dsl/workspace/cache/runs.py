"""Store runs in a folder of the project, and look them up."""

from __future__ import annotations

import hashlib
import hmac
import json
import os
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path

from codra_dsl.language.diagnostics import Diagnostic, Severity, has_errors
from codra_dsl.language.project import project_of
from codra_dsl.regular_files import read_regular_file
from codra_dsl.workspace.cache.inputs import compiler_digest, digests_of
from codra_dsl.workspace.cache.records import finding_from, record_of, text_from, texts_from
from codra_dsl.workspace.cache.signatures import signature, user_secret

FOLDER = ".codra_cache"
"""The name of the cache folder in a project's root."""

_FORMAT = "codra-cache-2"

_MAX_BYTES = 64 * 1024 * 1024
"""The maximum size of a stored run. A larger file is ignored."""

_CALL_NOT_FOUND_RULE = "call-not-found"
"""The rule whose findings suggest names of modules. Suggestions depend on which files exist, not only on contents."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """The results of a run that a command shows.

    Attributes:
        specs: the files of the specs, relative to the project's root.
        files: the files of the specs, of their parts, of the Python modules with which calls were compared, and of
            behaviour trees, relative to the root.
        fail_on: the lowest severity that makes a command fail, from the project's settings.
        output_digests: a mapping from the path of each generated file in the output folder to the digest of the file.
        covered_paths: the files and folders that were compiled, relative to the root.
    """

    diagnostics: tuple[Diagnostic, ...]
    specs: tuple[str, ...]
    files: tuple[str, ...]
    fail_on: Severity
    output_digests: Mapping[str, str] = field(default_factory=dict)
    covered_paths: tuple[str, ...] = ()


def cache_of(root: Path, command: str, paths: Sequence[Path]) -> Cache | None:
    """Return the cache for a command and its paths. Outside of a project, nothing is stored: return None.

    The result is also None in CI (if the environment variable `CI` is set), if the cache folder is a link, and if no
    secret of the user can be kept outside of the project. In these cases the cache could be part of the change that is
    checked.
    """
    is_trusted = not os.environ.get("CI") and not (root / FOLDER).is_symlink()
    if not is_trusted or project_of(root) != root:
        return None
    secret = user_secret(root)
    return None if secret is None else Cache(root, command, paths, secret)


class Cache:
    """The cache for one command and the paths with which it was called."""

    def __init__(self, root: Path, command: str, paths: Sequence[Path], secret: bytes) -> None:
        """Compute digests of the present contents of the paths; `store` stores a run with these digests."""
        self._root = root
        self._paths = tuple(paths)
        self._secret = secret
        key_parts = [_FORMAT, command, *(os.path.relpath(path, root) for path in paths)]
        self._key = "\0".join([os.path.realpath(root), *key_parts])
        name = hashlib.sha256("\0".join(key_parts).encode(errors="surrogateescape")).hexdigest()[:32]
        self._file = root / FOLDER / f"{name}.json"
        self._initial_digests = digests_of(root, paths)

    def load(self) -> Run | None:
        """Return the stored run, or None if anything that it depends on has changed since."""
        try:
            written_signature, _, data = read_regular_file(self._file, _MAX_BYTES).partition(b"\n")
            if not hmac.compare_digest(written_signature, signature(self._secret, self._key, data)):
                return None
            stored_record = json.loads(data)
            run = _run_from(stored_record["run"])
            is_up_to_date = stored_record["made_with"] == compiler_digest() and stored_record[
                "inputs"
            ] == self._input_digests(run.files)
        except (OSError, ValueError, TypeError, LookupError, AttributeError, RecursionError):
            return None
        return run if is_up_to_date else None

    def store(self, run: Run) -> None:
        """Store a run, unless it found an error or its inputs have changed in the meantime."""
        if self._initial_digests != digests_of(self._root, self._paths) or has_errors(run.diagnostics):
            return
        if any(diagnostic.rule.name == _CALL_NOT_FOUND_RULE for diagnostic in run.diagnostics):
            return
        input_digests = self._input_digests(run.files)
        if input_digests is None:
            return
        record = {"made_with": compiler_digest(), "inputs": input_digests, "run": _record_of_run(run)}
        try:
            data = json.dumps(record).encode("ascii")
            _write(self._file, signature(self._secret, self._key, data) + b"\n" + data)
        except OSError:
            return

    def _input_digests(self, files: Iterable[str]) -> dict[str, str] | None:
        """Return the initial digests of the command's paths, and the present digests of all other files of a run.

        Return None if the digests cannot be computed.
        """
        initial_digests = self._initial_digests
        other_digests = digests_of(
            self._root, [self._root / file for file in files if file not in (initial_digests or ())]
        )
        return None if initial_digests is None or other_digests is None else {**other_digests, **initial_digests}


def _write(file: Path, data: bytes) -> None:
    """Write a file atomically, in a folder that git ignores."""
    folder = file.parent
    folder.mkdir(exist_ok=True)
    gitignore = folder / ".gitignore"
    if not os.path.lexists(gitignore):
        gitignore.write_text("*\n", "ascii")
    with tempfile.NamedTemporaryFile("wb", dir=folder, delete=False) as temporary_file:
        try:
            temporary_file.write(data)
            temporary_file.close()
            Path(temporary_file.name).replace(file)
        except OSError:
            Path(temporary_file.name).unlink(missing_ok=True)
            raise


def _record_of_run(run: Run) -> dict[str, object]:
    return {
        "diagnostics": [record_of(diagnostic) for diagnostic in run.diagnostics],
        "specs": run.specs,
        "files": run.files,
        "fail_on": run.fail_on,
        "outputs": dict(run.output_digests),
        "covered": run.covered_paths,
    }


def _run_from(record: Mapping[str, object]) -> Run:
    outputs = record["outputs"]
    diagnostics = record["diagnostics"]
    if not isinstance(outputs, dict) or not isinstance(diagnostics, list):
        raise TypeError
    return Run(
        diagnostics=tuple(map(finding_from, diagnostics)),
        specs=texts_from(record["specs"]),
        files=texts_from(record["files"]),
        fail_on=Severity(text_from(record["fail_on"])),
        output_digests={text_from(path): text_from(digest) for path, digest in outputs.items()},
        covered_paths=texts_from(record["covered"]),
    )
