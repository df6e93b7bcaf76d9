"""The server: open documents, when projects are linted, and what is sent to the client.

Requests are answered on the main thread, from the newest complete result. One worker thread lints, so that no request
waits for it. While a project is being linted, newer texts wait; then only the newest of them are linted.
"""

from __future__ import annotations

import asyncio
from collections.abc import Iterable, Mapping, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from lsprotocol import types
from pygls import uris
from pygls.exceptions import JsonRpcException
from pygls.lsp.server import LanguageServer
from pygls.protocol import LanguageServerProtocol

import codra_dsl
from codra_dsl.isolation.error_text import described
from codra_dsl.language.diagnostics import Diagnostic, Edit, Severity, Span, is_safe
from codra_dsl.tooling.language_server.documents import UTF16, Document, Encoding, Texts
from codra_dsl.tooling.language_server.index import Cursor, Index, Range
from codra_dsl.tooling.language_server.projects import Checked, OutdatedError, Project, Projects
from codra_dsl.tooling.language_server.renaming import RefusedError, rename

DEBOUNCE_S = 0.15
"""How long the server waits after a change before it lints: most keystrokes follow each other faster."""

_ENDINGS = (".yaml", ".yml")
_SEVERITIES = {
    Severity.ERROR: types.DiagnosticSeverity.Error,
    Severity.WARNING: types.DiagnosticSeverity.Warning,
}


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


class _Protocol(LanguageServerProtocol):
    """The protocol without a leak of pygls 2.1.1, which keeps a future for each notification that it has handled."""

    def _check_handler_result(self, future: Future[Any]) -> None:
        super()._check_handler_result(future)
        for message_id in [number for number, handled in self._request_futures.items() if handled is future]:
            del self._request_futures[message_id]


class CodraServer(LanguageServer):
    """A language server for specs.

    Attributes:
        worker: the thread that lints.
        is_shut_down: whether the client has asked the server to shut down.
    """

    def __init__(self) -> None:
        super().__init__("codra", codra_dsl.__version__, protocol_cls=_Protocol)
        self.is_shut_down = False
        self.worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="lint")
        self._open_documents: dict[str, OpenDocument] = {}
        self._uris: dict[tuple[Project, str], str] = {}
        self._projects = Projects()
        self._linters: dict[Project, _Linter] = {}

    @property
    def encoding(self) -> Encoding:
        """The encoding of positions that the client has chosen."""
        return self.workspace.position_encoding or UTF16

    # Documents

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
        if opened is not None:
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

    def opened_in(self, project: Project) -> dict[str, OpenDocument]:
        """Return the open documents of a project by file."""
        return {opened.file: opened for opened in self._open_documents.values() if opened.project is project}

    # Linting

    def schedule(self, project: Project, delay_s: float) -> None:
        """Lint a project after a delay, with the texts that its documents have then."""
        if project not in self._linters:
            self._linters[project] = _Linter(self, project)
        self._linters[project].schedule(delay_s)

    def schedule_all(self) -> None:
        """Lint all projects, because files on disk may have changed."""
        for project in self._linters:
            self.schedule(project, DEBOUNCE_S)

    def publish(self, project: Project, before: Checked, versions: Mapping[str, int | None]) -> None:
        """Send the findings about open documents, and those about other files that have changed."""
        texts = Texts(project.root, project.checked.documents, self.encoding)
        for file in sorted({*before.findings, *project.checked.findings}):
            findings = project.checked.findings.get(file, ())
            if findings and file not in versions and not (project.root / file).is_file():
                continue  # a finding about a folder has no text in which an editor could show it
            if file in versions or findings != before.findings.get(file, ()):
                diagnostics = [self._diagnostic(project, finding, texts) for finding in findings]
                params = types.PublishDiagnosticsParams(self._uri(project, file), diagnostics, versions.get(file))
                self.text_document_publish_diagnostics(params)

    def _diagnostic(self, project: Project, finding: Diagnostic, texts: Texts) -> types.Diagnostic:
        def location(span: Span) -> types.Location:
            return types.Location(self._uri(project, span.file), texts.document(span.file).range_of(span))

        return types.Diagnostic(
            range=location(finding.place.span).range,
            severity=_SEVERITIES[finding.severity],
            code=finding.code,
            source="codra",
            message=f"{finding.message}\n{finding.help}" if finding.help else finding.message,
            related_information=[
                types.DiagnosticRelatedInformation(location(related.place.span), related.message)
                for related in finding.related
            ],
        )

    # Answers

    def cursor(self, uri: str, position: types.Position | None) -> tuple[Project, Cursor] | None:
        """Return a position in an open document; None for other documents. No position is the beginning."""
        opened = self._open_documents.get(uri)
        if opened is None:
            return None
        documents = {file: other.document for file, other in self.opened_in(opened.project).items()}
        index = Index(opened.project.checked.specs, Texts(opened.project.root, documents, self.encoding))
        offset = 0 if position is None else opened.document.offset_at(position)
        return opened.project, Cursor(index, opened.file, offset)

    def locations(self, project: Project, cursor: Cursor, ranges: Iterable[Range]) -> list[types.Location]:
        """Return the locations of ranges."""
        texts = cursor.index.texts
        return [
            types.Location(self._uri(project, file), texts.document(file).range_between(start, end))
            for _, file, start, end, *_ in ranges
        ]

    def quick_fixes(self, uri: str, wanted: types.Range) -> list[types.CodeAction]:
        """Return the fixes of findings that touch a range, if the texts are those in which the findings were found."""
        located = self.cursor(uri, wanted.start)
        if located is None:
            return []
        project, cursor = located
        texts, document = cursor.index.texts, cursor.document
        end = document.offset_at(wanted.end)
        actions = []
        for finding in project.checked.findings.get(cursor.file, ()):
            first, last = document.offsets_of(finding.place.span)
            if finding.fix is not None and first <= end and cursor.offset <= last and project.is_checked(texts):
                edit = self._edit(project, texts, finding.fix.edits)
                diagnostics = [self._diagnostic(project, finding, texts)]
                kind = types.CodeActionKind.QuickFix
                action = types.CodeAction(finding.fix.message, kind, diagnostics, is_safe(finding), edit=edit)
                actions.append(action)
        return actions

    async def rename(self, params: types.RenameParams) -> types.WorkspaceEdit | None:
        """Return the edits that rename the name at a position, after the newest texts have been linted.

        Raises:
            JsonRpcException: with the reason, if the name cannot be changed.
        """
        opened = self._open_documents.get(params.text_document.uri)
        if opened is None:
            return None
        self.schedule(opened.project, 0.0)  # files on disk may have changed
        await self._linters[opened.project].settle()
        located = self.cursor(opened.uri, params.position)
        if located is None or self._open_documents.get(opened.uri) is not opened:
            raise JsonRpcException("the text has changed in the meantime", types.LSPErrorCodes.ContentModified)
        project, cursor = located
        try:
            work = partial(rename, project, cursor, params.new_name)
            edits = await asyncio.get_running_loop().run_in_executor(self.worker, work)
        except RefusedError as error:
            raise JsonRpcException(str(error), types.LSPErrorCodes.RequestFailed) from error
        return self._edit(project, cursor.index.texts, edits)

    def _edit(self, project: Project, texts: Texts, edits: Sequence[Edit]) -> types.WorkspaceEdit:
        """Return edits of files. A client that knows versions applies them only to the versions that they are for."""
        edits_by_file: dict[str, list[types.TextEdit]] = {}
        for edit in edits:
            document = texts.document(edit.span.file)
            text = edit.text.replace("\n", document.line_break)
            text_edit = types.TextEdit(document.range_of(edit.span), text)
            edits_by_file.setdefault(edit.span.file, []).append(text_edit)
        workspace = self.client_capabilities.workspace
        if workspace is None or workspace.workspace_edit is None or not workspace.workspace_edit.document_changes:
            return types.WorkspaceEdit(
                {self._uri(project, file): list(of_file) for file, of_file in edits_by_file.items()}
            )
        opened = self.opened_in(project)
        versions = {file: opened[file].version if file in opened else None for file in edits_by_file}
        return types.WorkspaceEdit(
            document_changes=[
                types.TextDocumentEdit(
                    types.OptionalVersionedTextDocumentIdentifier(self._uri(project, file), versions[file]),
                    list[types.TextEdit | types.AnnotatedTextEdit | types.SnippetTextEdit](of_file),
                )
                for file, of_file in edits_by_file.items()
            ]
        )

    def _uri(self, project: Project, file: str) -> str:
        """Return the URI of a file, as the client wrote it when it opened the file."""
        return self._uris.get((project, file)) or uris.from_fs_path(str(project.root / file)) or ""


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

    async def settle(self) -> None:
        """Wait until the newest texts have been linted."""
        while self._timer is not None or (self._task is not None and not self._task.done()):
            if self._timer is not None:
                self._timer.cancel()
                self._start()
            assert self._task is not None
            await asyncio.wait([self._task])

    def _start(self) -> None:
        self._timer = None
        if self._task is None or self._task.done():
            self._task = asyncio.ensure_future(self._lint())

    async def _lint(self) -> None:
        """Lint until the result belongs to the newest texts."""
        project, server = self._project, self._server
        while self._is_outdated and self._timer is None:
            self._is_outdated = False
            opened = server.opened_in(project)
            documents = {file: document.document for file, document in opened.items()}
            lint = partial(project.lint, documents, lambda: self._is_outdated)
            try:
                checked = await asyncio.get_running_loop().run_in_executor(server.worker, lint)
            except OutdatedError:
                continue
            except Exception as error:  # noqa: BLE001 - a bug of codra must not end the server
                text = f"codra: internal error: {described(error)}; this is a bug of codra, not of your spec"
                server.window_log_message(types.LogMessageParams(types.MessageType.Error, text))
                continue
            if not self._is_outdated:
                before, project.checked = project.checked, checked
                server.publish(project, before, {file: document.version for file, document in opened.items()})
                asyncio.get_running_loop().call_later(DEBOUNCE_S, self._prepare_answers, checked)

    def _prepare_answers(self, checked: Checked) -> None:
        """Build tables for the next requests, unless there is a newer text, which is linted first."""
        if not self._is_outdated:
            self._server.worker.submit(checked.build_tables)
