"""The server: the methods of the protocol, and when projects are linted.

Requests are answered on the main thread, from the newest complete result. One worker thread lints, so that no request
waits for it. While a project is being linted, newer texts wait; then only the newest of them are linted.
"""

from __future__ import annotations

import asyncio
import os
import sys
from collections.abc import Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path

from lsprotocol import types
from pygls import uris
from pygls.lsp.server import LanguageServer

import codra_dsl
from codra_dsl.isolation.error_text import described
from codra_dsl.language.diagnostics import Diagnostic, Severity
from codra_dsl.tooling.language_server.documents import Document, Encoding
from codra_dsl.tooling.language_server.projects import Checked, OutdatedError, Project, Projects, Texts

DEBOUNCE_S = 0.15
"""How long the server waits after a change before it lints: most keystrokes follow each other faster."""

_ENDINGS = (".yaml", ".yml")


@dataclass(frozen=True, slots=True)
class OpenDocument:
    """A document that the client has open.

    Attributes:
        file: the name of the file in findings.
    """

    uri: str
    version: int | None
    project: Project
    file: str
    document: Document


class CodraServer(LanguageServer):
    """A language server for specs.

    Attributes:
        worker: the thread that lints.
        is_shut_down: whether the client has asked the server to shut down.
    """

    def __init__(self) -> None:
        super().__init__("codra", codra_dsl.__version__)
        self.is_shut_down = False
        self.worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="lint")
        self._open_documents: dict[str, OpenDocument] = {}
        self._uris: dict[tuple[Project, str], str] = {}
        self._projects = Projects()
        self._linters: dict[Project, _Linter] = {}

    @property
    def encoding(self) -> Encoding:
        """The encoding of positions that the client has chosen."""
        return self.workspace.position_encoding or types.PositionEncodingKind.Utf16

    def open(self, item: types.TextDocumentItem) -> None:
        """Add a document; files that are not YAML are ignored."""
        path_text = uris.to_fs_path(item.uri)
        path = None if path_text is None else Path(path_text)
        if path is None or not path.is_absolute() or path.suffix not in _ENDINGS:
            return
        project = self._projects.project_of(path)
        document = Document(item.text, self.encoding)
        opened = OpenDocument(item.uri, item.version, project, project.file_of(path), document)
        self._open_documents[item.uri] = opened
        self._uris[project, opened.file] = item.uri
        self.schedule(project, 0.0)

    def change(self, params: types.DidChangeTextDocumentParams) -> None:
        """Change the text of a document."""
        opened = self._open_documents.get(params.text_document.uri)
        if opened is None:
            return
        document = opened.document
        for change in params.content_changes:
            document = document.after(change)
        changed = replace(opened, version=params.text_document.version, document=document)
        self._open_documents[opened.uri] = changed
        self.schedule(opened.project, DEBOUNCE_S)

    def close(self, uri: str) -> None:
        """Remove a document; from now on, the file on disk is linted."""
        closed = self._open_documents.pop(uri, None)
        if closed is not None:
            self.schedule(closed.project, 0.0)

    def schedule(self, project: Project, delay_s: float) -> None:
        """Lint a project after a delay, with the texts that its documents have then."""
        if project not in self._linters:
            self._linters[project] = _Linter(self, project)
        self._linters[project].schedule(delay_s)

    def schedule_all(self) -> None:
        """Lint all projects, because files on disk may have changed."""
        for project in list(self._linters):
            self.schedule(project, DEBOUNCE_S)

    def documents_of(self, project: Project) -> dict[str, OpenDocument]:
        """Return the open documents of a project by file."""
        return {opened.file: opened for opened in self._open_documents.values() if opened.project is project}

    def uri_of(self, project: Project, file: str) -> str:
        """Return the URI of a file, as the client wrote it when it opened the file."""
        return self._uris.get((project, file)) or uris.from_fs_path(str(project.root / file)) or ""

    def publish(self, project: Project, before: Checked, versions: Mapping[str, int | None]) -> None:
        """Send the findings about open documents, and those about other files that have changed."""
        texts = Texts(project, project.checked.documents, self.encoding)
        for file in sorted({*before.findings, *project.checked.findings}):
            findings = project.checked.findings.get(file, ())
            if file in versions or findings != before.findings.get(file, ()):
                diagnostics = [self._diagnostic(project, finding, texts) for finding in findings]
                uri = self.uri_of(project, file)
                self.text_document_publish_diagnostics(
                    types.PublishDiagnosticsParams(uri, diagnostics, versions.get(file))
                )

    def _diagnostic(self, project: Project, finding: Diagnostic, texts: Texts) -> types.Diagnostic:
        related = [
            types.DiagnosticRelatedInformation(
                types.Location(self.uri_of(project, part.place.span.file), texts.range_of(part.place.span)),
                part.message,
            )
            for part in finding.related
        ]
        return types.Diagnostic(
            range=texts.range_of(finding.place.span),
            severity=_SEVERITIES[finding.severity],
            code=finding.code,
            source="codra",
            message=f"{finding.message}\n{finding.help}" if finding.help else finding.message,
            related_information=related or None,
        )


_SEVERITIES = {
    Severity.ERROR: types.DiagnosticSeverity.Error,
    Severity.WARNING: types.DiagnosticSeverity.Warning,
}


class _Linter:
    """Lints one project when its texts have changed: always the newest texts, and once at a time."""

    def __init__(self, server: CodraServer, project: Project) -> None:
        self._server, self._project = server, project
        self._timer: asyncio.TimerHandle | None = None
        self._task: asyncio.Task[None] | None = None
        self._is_outdated = False

    def schedule(self, delay_s: float) -> None:
        """Lint after a delay; an earlier request that has not begun is replaced."""
        self._is_outdated = True
        if self._timer is not None:
            self._timer.cancel()
        self._timer = asyncio.get_running_loop().call_later(delay_s, self._start)

    def _start(self) -> None:
        self._timer = None
        if self._task is None or self._task.done():
            self._task = asyncio.ensure_future(self._lint())

    async def _lint(self) -> None:
        """Lint until the result belongs to the newest texts."""
        project, server = self._project, self._server
        while self._is_outdated and self._timer is None:
            self._is_outdated = False
            opened = server.documents_of(project)
            documents = {file: document.document for file, document in opened.items()}
            lint = partial(project.lint, documents, lambda: self._is_outdated)
            try:
                checked = await asyncio.get_running_loop().run_in_executor(server.worker, lint)
            except OutdatedError:
                continue
            except Exception as error:  # noqa: BLE001 - a bug of codra must not end the server
                text = f"codra: internal error: {described(error)}; this is a bug of codra"
                server.window_log_message(types.LogMessageParams(types.MessageType.Error, text))
                continue
            if not self._is_outdated:
                before, project.checked = project.checked, checked
                server.publish(project, before, {file: document.version for file, document in opened.items()})


def make_server() -> CodraServer:
    """Return a server with all methods of the protocol that it offers."""
    server = CodraServer()

    @server.feature(types.SHUTDOWN)
    def _(_: None) -> None:
        server.is_shut_down = True

    @server.feature(types.TEXT_DOCUMENT_DID_OPEN)
    def _(params: types.DidOpenTextDocumentParams) -> None:
        server.open(params.text_document)

    @server.feature(types.TEXT_DOCUMENT_DID_CHANGE)
    def _(params: types.DidChangeTextDocumentParams) -> None:
        server.change(params)

    @server.feature(types.TEXT_DOCUMENT_DID_CLOSE)
    def _(params: types.DidCloseTextDocumentParams) -> None:
        server.close(params.text_document.uri)

    @server.feature(types.TEXT_DOCUMENT_DID_SAVE)
    def _(_: types.DidSaveTextDocumentParams) -> None:
        server.schedule_all()

    @server.feature(types.WORKSPACE_DID_CHANGE_WATCHED_FILES)
    def _(_: types.DidChangeWatchedFilesParams) -> None:
        server.schedule_all()

    return server


def serve() -> bool:
    """Serve a client over standard input and output; return whether it ended the session as the protocol requires."""
    server = make_server()
    server.start_io(stdout=os.fdopen(os.dup(sys.stdout.fileno()), "wb"))  # pygls closes it at the end
    return server.is_shut_down
