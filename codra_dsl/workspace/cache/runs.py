"""Store the results of runs and of specs in a folder of the project, and look them up."""

from __future__ import annotations

import hashlib
import os
from collections.abc import Mapping, Sequence
from dataclasses import field
from pathlib import Path
from typing import Any

from codra_dsl.language.diagnostics import Diagnostic, Severity
from codra_dsl.language.file_queries import Answers, PresentAnswers
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.project import project_of
from codra_dsl.workspace.cache.inputs import answers_about
from codra_dsl.workspace.cache.records import (
    answers_from,
    finding_from,
    record_of,
    record_of_answers,
    text_from,
    texts_from,
)
from codra_dsl.workspace.cache.signatures import user_secret
from codra_dsl.workspace.cache.spec_results import SpecResult, SpecResults, is_outdated, record_of_result, result_from
from codra_dsl.workspace.cache.stored_files import FOLDER, StoredFile, remove_oldest_files

_FORMAT = "codra-cache-3"
_RESULTS_FILE = "specs.json"


@dataclass(frozen=True, slots=True, kw_only=True)
class Run:
    """The results of a run that a command shows.

    Attributes:
        specs: the files of the specs, relative to the project's root.
        answers: the queries about files on which the results of the specs depend, with their answers.
        fail_on: the lowest severity that makes a command fail, from the project's settings.
        output_digests: a mapping from the path of each generated file in the output folder to the digest of the file.
        covered_paths: the files and folders that were compiled, relative to the root.
    """

    diagnostics: tuple[Diagnostic, ...]
    specs: tuple[str, ...]
    answers: Answers
    fail_on: Severity
    output_digests: Mapping[str, str] = field(default_factory=dict)
    covered_paths: tuple[str, ...] = ()


def cache_of(root: Path, command: str, paths: Sequence[Path], sites: Sequence[Path] = ()) -> Cache | None:
    """Return the cache for a command, its paths and its sites. Outside of a project, nothing is stored: return None.

    The result is also None in CI (if the environment variable `CI` is set), if the cache folder is a link, and if no
    secret of the user can be kept outside of the project. In these cases the cache could be part of the change that is
    checked.
    """
    is_trusted = not os.environ.get("CI") and not (root / FOLDER).is_symlink()
    if not is_trusted or project_of(root) != root:
        return None
    secret = user_secret(root)
    command_with_sites = f"{command} --site {len(sites)}" if sites else command
    return None if secret is None else Cache(root, command_with_sites, [*paths, *sites], secret)


class Cache:
    """The cache for one command and the paths with which it was called."""

    def __init__(self, root: Path, command: str, paths: Sequence[Path], secret: bytes) -> None:
        """Ask for the present contents of the paths; `store` stores a run with these answers."""
        self._root = root
        self._paths = tuple(paths)
        key = "\0".join([_FORMAT, command, *(os.path.relpath(path, root) for path in paths)])
        name = hashlib.sha256(key.encode(errors="surrogateescape")).hexdigest()[:32]
        self._run_file = StoredFile(root, secret, f"run-{name}.json", key)
        self._results_file = StoredFile(root, secret, _RESULTS_FILE, _FORMAT)
        self._loaded_results: SpecResults = {}
        self._initial_answers = answers_about(root, paths)

    def load(self) -> Run | None:
        """Return the stored run, or None if anything that it depends on has changed since."""
        record = self._run_file.read()
        if record is None or self._initial_answers is None:
            return None
        try:
            initial_answers, run = answers_from(record["inputs"]), _run_from(record["run"])
        except (ValueError, TypeError, LookupError, AttributeError):
            return None
        present_answers = PresentAnswers()
        present_answers.add(self._initial_answers)
        is_up_to_date = initial_answers == self._initial_answers and present_answers.agree_with(run.answers)
        return run if is_up_to_date else None

    def store(self, run: Run, results: SpecResults) -> None:
        """Store the results of specs, and a run, unless its inputs have changed in the meantime.

        Results of specs that do not exist any more are left out.
        """
        if results != self._loaded_results:
            records = {key: record_of_result(result) for key, result in results.items() if not is_outdated(key)}
            self._results_file.write({"results": records})
        initial_answers = self._initial_answers
        if initial_answers is not None and initial_answers == answers_about(self._root, self._paths):
            self._run_file.write({"inputs": record_of_answers(initial_answers), "run": _record_of_run(run)})
            remove_oldest_files(self._root, _RESULTS_FILE)

    def load_results(self) -> dict[str, SpecResult]:
        """Return the stored results of specs, which may be out of date."""
        record = self._results_file.read()
        try:
            results = {} if record is None else {key: result_from(data) for key, data in record["results"].items()}
        except (ValueError, TypeError, LookupError, AttributeError):
            results = {}
        self._loaded_results = dict(results)
        return results


def _record_of_run(run: Run) -> dict[str, object]:
    return {
        "diagnostics": [record_of(diagnostic) for diagnostic in run.diagnostics],
        "specs": run.specs,
        "answers": record_of_answers(run.answers),
        "fail_on": run.fail_on,
        "outputs": dict(run.output_digests),
        "covered": run.covered_paths,
    }


def _run_from(record: Mapping[str, Any]) -> Run:
    outputs = record["outputs"]
    diagnostics = record["diagnostics"]
    if not isinstance(outputs, dict) or not isinstance(diagnostics, list):
        raise TypeError
    return Run(
        diagnostics=tuple(map(finding_from, diagnostics)),
        specs=texts_from(record["specs"]),
        answers=answers_from(record["answers"]),
        fail_on=Severity(text_from(record["fail_on"])),
        output_digests={text_from(path): text_from(digest) for path, digest in outputs.items()},
        covered_paths=texts_from(record["covered"]),
    )
