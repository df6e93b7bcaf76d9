"""Lint the specs of a project with the texts of open documents.

The findings are those of `codra lint ROOT` on the same texts, where ROOT is the root of the project. A document outside
of projects is linted alone.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from lsprotocol import types

from codra_dsl.compiler import lint_paths
from codra_dsl.language.diagnostics import Diagnostic, Span
from codra_dsl.language.load.discover import is_of_language
from codra_dsl.language.load.yaml.source import MAX_BYTES
from codra_dsl.language.project import is_timeline, project_of, relative_path
from codra_dsl.regular_files import read_regular_file
from codra_dsl.tooling.language_server.documents import Document, Encoding
from codra_dsl.workspace.cache import SpecResults
from codra_dsl.workspace.timings import Timings

Documents = Mapping[str, Document]
"""Open documents by their files, relative to the root."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Checked:
    """The result of linting a project once.

    Attributes:
        documents: the open documents, with the texts that were linted.
        findings: the findings of each file that has findings, and of each open document.
    """

    documents: Documents = field(default_factory=dict)
    findings: Mapping[str, tuple[Diagnostic, ...]] = field(default_factory=dict)


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
    """

    def __init__(self, root: Path, file: Path | None = None) -> None:
        """Initialize. `file` is the document, if it is outside of projects."""
        self.root = root
        self.checked = Checked()
        self._file = file
        self._results: SpecResults = {}

    def lint(self, documents: Documents, is_outdated: Callable[[], bool] = lambda: False) -> Checked:
        """Lint the project with the texts of open documents. Results of unchanged specs are used again.

        Raises:
            OutdatedError: if `is_outdated` returns true; it is called before each spec is read.
        """
        texts = {file: document.data for file, document in documents.items()}
        findings: dict[str, list[Diagnostic]] = {file: [] for file in documents}
        paths = [path for path in self._paths(documents) if path == self.root or is_of_language(path, self.root, texts)]
        if paths:
            planned = lint_paths(paths, self.root, texts, _Stages(is_outdated), self._results)
            for diagnostic in planned.diagnostics:
                findings.setdefault(diagnostic.place.span.file, []).append(diagnostic)
        return Checked(documents=documents, findings={file: tuple(of_file) for file, of_file in findings.items()})

    def _paths(self, documents: Documents) -> Iterable[Path]:
        """Return the paths to lint: the project with documents that were never saved, or the one document."""
        if self._file is not None:
            return () if is_timeline(self._file) else (self._file,)
        files = (self.root / file for file in documents)
        return (self.root, *(file for file in files if not file.exists() and not is_timeline(file)))

    def file_of(self, path: Path) -> str:
        """Return the name of a file in findings."""
        return relative_path(path, self.root)


class Texts:
    """The texts of the files of a project: open documents, and files on disk, each of which is read once."""

    def __init__(self, project: Project, documents: Documents, encoding: Encoding) -> None:
        self._root, self._encoding = project.root, encoding
        self._documents = dict(documents)

    def document(self, file: str) -> Document:
        """Return the text of a file; an empty text if the file cannot be read."""
        if file not in self._documents:
            try:
                data = read_regular_file(self._root / file, MAX_BYTES, within=self._root)
            except OSError:
                data = b""
            self._documents[file] = Document(data.decode("utf-8", "replace"), self._encoding)
        return self._documents[file]

    def range_of(self, span: Span) -> types.Range:
        """Return the range of a span in its file."""
        return self.document(span.file).range_of(span)


class Projects:
    """The projects of all documents that were opened."""

    def __init__(self) -> None:
        self._projects: dict[Path, Project] = {}

    def project_of(self, path: Path) -> Project:
        """Return the project of a file."""
        root = project_of(path.parent)
        key = path if root is None else root
        if key not in self._projects:
            self._projects[key] = Project(path.parent, path) if root is None else Project(root)
        return self._projects[key]
