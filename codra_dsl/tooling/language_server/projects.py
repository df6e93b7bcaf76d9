"""Lint the specs of a project with the texts of open documents.

The findings are those of `codra lint ROOT` on the same texts, where ROOT is the root of the project. A document outside
of projects is linted alone.
"""

from __future__ import annotations

import gc
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from functools import partial
from itertools import chain
from pathlib import Path

from codra_dsl.compiler import Inspection, lint_paths
from codra_dsl.language.check import CheckedSpec
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.load.discover import is_of_language, is_spec_or_site
from codra_dsl.language.model import Spec
from codra_dsl.language.project import is_timeline, project_of, relative_path, yaml_files
from codra_dsl.tooling.language_server.documents import Document, Texts
from codra_dsl.tooling.language_server.index import SpecNames
from codra_dsl.workspace.cache import SpecResults
from codra_dsl.workspace.cache.spec_results import is_outdated as is_outdated_key
from codra_dsl.workspace.timings import UNTIMED, Timings

_LINTS_PER_COLLECTION = 100
"""After how many lints garbage is collected: `lint_paths` moves its values to a generation that hardly ever is."""

Documents = Mapping[str, Document]
"""Open documents by their files, relative to the root."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """The result of linting a project once.

    Attributes:
        documents: the open documents, with the texts that were linted.
        findings: the findings of each file that has findings, and of each open document.
        specs: the names of each spec, and of each spec with the values of a site.
    """

    documents: Documents = field(default_factory=dict)
    findings: Mapping[str, tuple[Diagnostic, ...]] = field(default_factory=dict)
    specs: tuple[SpecNames, ...] = ()

    def build_tables(self) -> None:
        """Build the tables of names before the first request needs them; each of them is built once."""
        for names in self.specs:
            assert names.ranges is not None
            assert names.worst_cases is not None

    @property
    def diagnostics(self) -> tuple[Diagnostic, ...]:
        """All findings."""
        return tuple(chain.from_iterable(self.findings.values()))


class OutdatedError(Exception):
    """The result of linting is not needed any more, because a document has changed."""


class _Stages(Timings):
    """Ends linting at the beginning of a stage if the result is not needed any more."""

    def __init__(self, is_outdated: Callable[[], bool]) -> None:
        super().__init__()
        self._is_outdated = is_outdated

    @contextmanager
    def stage(self, name: str) -> Iterator[None]:
        if self._is_outdated():
            raise OutdatedError(name)
        yield


class Project:
    """The specs of one project, or one document outside of projects.

    Attributes:
        root: the folder to which files are relative.
        checked: the newest result.
        uris: the URIs of files that the client has opened, as it writes them.
    """

    def __init__(self, root: Path, file: Path | None = None) -> None:
        """Initialize. `file` is the document, if it is outside of projects."""
        self.root = root
        self.checked = Checked()
        self.uris: dict[str, str] = {}
        self._file, self._is_spec = file, False
        self._lint_count = 0
        self._results: SpecResults = {}
        self._specs: dict[str, SpecNames] = {}

    @classmethod
    def of(cls, path: Path, known: dict[Path, Project]) -> Project:
        """Return the project of a file; `known` has all earlier projects by root or, outside of projects, by file."""
        root = project_of(path.parent)
        key = path if root is None else root
        if key not in known:
            known[key] = cls(path.parent, path) if root is None else cls(root)
        return known[key]

    def lint(self, documents: Documents, is_outdated: Callable[[], bool] = lambda: False) -> Checked:
        """Lint the project with the texts of open documents. Results of unchanged specs are used again.

        Raises:
            OutdatedError: if `is_outdated` returns true; it is called before each spec is read.
        """
        self._lint_count += 1
        if self._lint_count % _LINTS_PER_COLLECTION == 0:
            gc.collect()
        findings: dict[str, list[Diagnostic]] = {file: [] for file in documents}
        inspect = partial(self._keep_names, Texts(self.root, documents))
        for diagnostic in self._lint(documents, self._results, _Stages(is_outdated), inspect):
            findings.setdefault(diagnostic.place.span.file, []).append(diagnostic)
        return Checked(
            documents=documents,
            findings={file: tuple(of_file) for file, of_file in findings.items()},
            specs=tuple(
                names for key, names in self._specs.items() if names.spec.file in documents or not is_outdated_key(key)
            ),
        )

    def findings_with(self, documents: Documents) -> Sequence[Diagnostic]:
        """Return the findings of the project with some other texts, in addition to those that were linted last."""
        return self._lint({**self.checked.documents, **documents}, dict(self._results))

    def _lint(
        self,
        documents: Documents,
        results: SpecResults,
        timings: Timings = UNTIMED,
        inspect: Inspection | None = None,
    ) -> Sequence[Diagnostic]:
        texts = {file: document.data for file, document in documents.items()}
        paths = self._paths(texts)
        return lint_paths(paths, self.root, texts, timings, results, inspect=inspect).diagnostics if paths else ()

    def _keep_names(self, texts: Texts, key: str, spec: Spec, checked: CheckedSpec | None) -> None:
        """Keep the names of a spec. While its text cannot be read, the names from the last readable text are kept."""
        names = SpecNames(spec, checked, texts)
        if names.is_complete or key not in self._specs or not self._specs[key].is_complete:
            self._specs[key] = names

    def _paths(self, texts: Mapping[str, bytes]) -> list[Path]:
        """Return the paths to lint: the project with specs and sites that were never saved, or the one document.

        A document outside of projects is linted from the moment when it is a spec, so that no keystroke ends this.
        There are no paths after a change of settings that ends a project, or makes the document a part of one.
        """
        if project_of(self.root) != (self.root if self._file is None else None):
            return []
        if self._file is None:
            unsaved = (file for file in map(self.root.joinpath, texts) if not file.exists() and not is_timeline(file))
            return [self.root, *(file for file in unsaved if is_spec_or_site(file, self.root, texts))]
        self._is_spec |= not is_timeline(self._file) and is_of_language(self._file, self.root, texts)
        return [self._file] if self._is_spec else []

    def other_files(self) -> list[str]:
        """Return the sites that were linted, and the timelines of the project."""
        sites = [names.spec.site.file for names in self.checked.specs if names.spec.site is not None]
        timelines = yaml_files(self.root, are_timelines=True) if self._file is None else ()
        return [*sites, *map(self.file_of, timelines)]

    def file_of(self, path: Path) -> str:
        """Return the name of a file in findings."""
        return relative_path(path, self.root)
