"""The server: open documents, when projects are linted, and the messages to the client.

Requests are answered on the main thread, from the newest complete result. One worker thread lints, so that no request
waits for it. While a project is being linted, newer texts wait; then only the newest of them are linted.
"""

from __future__ import annotations

import asyncio
from collections.abc import Mapping
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

from lsprotocol import types
from pygls import uris
from pygls.capabilities import get_capability
from pygls.exceptions import JsonRpcException
from pygls.lsp.server import LanguageServer
from pygls.protocol import LanguageServerProtocol

import codra_dsl
from codra_dsl.isolation.error_text import described
from codra_dsl.language.diagnostics import Diagnostic, Severity, is_safe
from codra_dsl.tooling.language_server.documents import UTF16, Document, Texts
from codra_dsl.tooling.language_server.index import Cursor, Index
from codra_dsl.tooling.language_server.projects import Checked, OutdatedError, Project
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

    project: Project
    file: str
    document: Document


class _Protocol(LanguageServerProtocol):
    """The protocol with corrections of pygls 2.1.1.

    pygls keeps a future for each notification that it has handled, and answers no request with invalid parameters.
    """

    def _check_handler_result(self, future: Future[Any]) -> None:
        super()._check_handler_result(future)
        for message_id in [number for number, handled in self._request_futures.items() if handled is future]:
            del self._request_futures[message_id]

    def structure_message(self, data: dict[str, Any]) -> Any:
        try:
            return super().structure_message(data)
        except JsonRpcException as error:
            if "id" in data and "method" in data:
                self._send_response(data["id"], error=error.to_response_error())
            raise


class CodraServer(LanguageServer):
    """A language server for specs.

    Attributes:
        worker: the thread that lints.
        is_shut_down: whether the client has asked the server to shut down. Then nothing is linted any more.
    """

    def __init__(self) -> None:
        super().__init__("codra", codra_dsl.__version__, protocol_cls=_Protocol)
        for method in (types.TEXT_DOCUMENT_DID_OPEN, types.TEXT_DOCUMENT_DID_CHANGE, types.TEXT_DOCUMENT_DID_CLOSE):
            # pygls would keep a second copy of each text, and report a change of a text that is not open as an error
            del self.protocol.fm.builtin_features[method]
        self.is_shut_down = False
        self.worker = ThreadPoolExecutor(max_workers=1, thread_name_prefix="lint")
        self._open_documents: dict[str, OpenDocument] = {}
        self._projects: dict[Path, Project] = {}
        self._linters: dict[Project, _Linter] = {}

    # Documents

    def open(self, item: types.TextDocumentItem) -> None:
        """Add a document; files that are not YAML are ignored."""
        path_text = uris.to_fs_path(item.uri)
        path = None if path_text is None else Path(path_text)
        if path is None or not path.is_absolute() or path.suffix not in _ENDINGS:
            return
        document = Document(item.text, self.workspace.position_encoding or UTF16, item.uri, item.version)
        self._assign(document, path)
        self.schedule(self._open_documents[item.uri].project, 0.0)

    def _assign(self, document: Document, path: Path) -> None:
        """Add a document to the project of its file."""
        project = Project.of(path, self._projects)
        file = project.file_of(path)
        project.uris[file] = document.uri
        self._open_documents[document.uri] = OpenDocument(project, file, document)

    def change(self, params: types.DidChangeTextDocumentParams) -> None:
        """Change the text of a document."""
        opened = self._open_documents.get(params.text_document.uri)
        if opened is not None:
            document = replace(opened.document, version=params.text_document.version)
            for change in params.content_changes:
                document = document.after(change)
            self._open_documents[document.uri] = replace(opened, document=document)
            self.schedule(opened.project, DEBOUNCE_S)

    def close(self, uri: str) -> None:
        """Remove a document; from now on, the file on disk is linted."""
        closed = self._open_documents.pop(uri, None)
        if closed is not None:
            self.schedule(closed.project, 0.0)

    def documents(self, project: Project) -> dict[str, Document]:
        """Return the open documents of a project by file."""
        return {opened.file: opened.document for opened in self._open_documents.values() if opened.project is project}

    # Linting

    def schedule(self, project: Project, delay_s: float) -> None:
        """Lint a project after a delay, with the texts that its documents have then."""
        if project not in self._linters:
            self._linters[project] = _Linter(self, project)
        self._linters[project].schedule(delay_s)

    def schedule_all(self) -> None:
        """Lint all projects, because files on disk may have changed, also those that make a folder a project."""
        for opened in list(self._open_documents.values()):
            self._assign(opened.document, opened.project.root / opened.file)
        for project in {**self._linters, **dict.fromkeys(opened.project for opened in self._open_documents.values())}:
            self.schedule(project, DEBOUNCE_S)

    def publish(self, project: Project, before: Checked) -> None:
        """Send the findings about open documents, and those about other files that have changed."""
        documents, after = project.checked.documents, project.checked.findings
        texts = self._texts(project, documents)
        for file in sorted({*before.findings, *after}):
            findings = after.get(file, ())
            if findings and file not in documents and not (project.root / file).is_file():
                continue  # a finding about a folder has no text in which an editor could show it
            if file in documents or findings != before.findings.get(file, ()):
                document = texts.document(file)
                if file not in documents and document.uri in self._open_documents:
                    continue  # the document belongs to another project, which has its newest text
                diagnostics = [_diagnostic(finding, texts) for finding in findings]
                params = types.PublishDiagnosticsParams(document.uri, diagnostics, document.version)
                self.text_document_publish_diagnostics(params)
        if self.can("workspace.semantic_tokens.refresh_support"):
            self.workspace_semantic_tokens_refresh(None)  # clients may have asked before the names were known

    def _texts(self, project: Project, documents: Mapping[str, Document]) -> Texts:
        return Texts(project.root, documents, self.workspace.position_encoding or UTF16, project.uris)

    # Answers

    def can(self, capability: str) -> bool:
        """Return whether the client has a capability, such as `workspace.workspace_edit.document_changes`."""
        return bool(get_capability(self.client_capabilities, capability))

    async def wait_for_names(self, uri: str) -> None:
        """Wait until a document has been linted for the first time; clients ask at once for its symbols."""
        opened = self._open_documents.get(uri)
        if opened is not None and opened.file not in opened.project.checked.documents:
            await self._linters[opened.project].settle()

    def cursor(self, uri: str, position: types.Position | None) -> tuple[Project, Cursor] | None:
        """Return a position in an open document; None for other documents. No position is the beginning."""
        opened = self._open_documents.get(uri)
        if opened is None:
            return None
        project = opened.project
        index = Index(project.checked.specs, self._texts(project, self.documents(project)))
        return project, Cursor(index, opened.file, 0 if position is None else opened.document.offset_at(position))

    def quick_fixes(self, uri: str, wanted: types.Range) -> list[types.CodeAction]:
        """Return the fixes of findings that touch a range, if the texts are those in which the findings were found."""
        located = self.cursor(uri, wanted.start)
        if located is None:
            return []
        project, cursor = located
        texts, document = cursor.index.texts, cursor.document
        if texts.opened != project.checked.documents:
            return []
        end = document.offset_at(wanted.end)
        actions = []
        for finding in project.checked.findings.get(cursor.file, ()):
            first, last = document.offsets_of(finding.place.span)
            if finding.fix is not None and first <= end and cursor.offset <= last:
                edit = texts.workspace_edit(finding.fix.edits, has_versions=self._has_versions)
                kind, diagnostics = types.CodeActionKind.QuickFix, [_diagnostic(finding, texts)]
                actions.append(types.CodeAction(finding.fix.message, kind, diagnostics, is_safe(finding), edit=edit))
        return actions

    async def rename(self, params: types.RenameParams) -> types.WorkspaceEdit:
        """Return the edits that rename the name at a position, after the newest texts have been linted.

        Raises:
            RefusedError: if the name cannot be changed.
            JsonRpcException: if the text has changed in the meantime.
        """
        uri = params.text_document.uri
        opened = self._open_documents.get(uri)
        if opened is None:
            raise RefusedError("the document is not open, or is not a YAML file")
        self.schedule(opened.project, 0.0)  # files on disk may have changed
        await self._linters[opened.project].settle()
        located = self.cursor(uri, params.position)
        if located is None or self._open_documents.get(uri) is not opened:
            raise JsonRpcException("the text has changed in the meantime", types.LSPErrorCodes.ContentModified)
        project, cursor = located
        work = partial(rename, project, cursor, params.new_name)
        edits = await asyncio.get_running_loop().run_in_executor(self.worker, work)
        return cursor.index.texts.workspace_edit(edits, has_versions=self._has_versions)

    @property
    def _has_versions(self) -> bool:
        """Whether the client applies edits only to the versions for which they were computed."""
        return self.can("workspace.workspace_edit.document_changes")


def _diagnostic(finding: Diagnostic, texts: Texts) -> types.Diagnostic:
    return types.Diagnostic(
        range=texts.location_of(finding.place.span).range,
        severity=_SEVERITIES[finding.severity],
        code=finding.code,
        source="codra",
        message=f"{finding.message}\n{finding.help}" if finding.help else finding.message,
        related_information=[
            types.DiagnosticRelatedInformation(texts.location_of(related.place.span), related.message)
            for related in finding.related
        ],
    )


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
        project, server, loop = self._project, self._server, asyncio.get_running_loop()
        while self._is_outdated and self._timer is None:
            self._is_outdated = False
            lint = partial(project.lint, server.documents(project), lambda: self._is_outdated or server.is_shut_down)
            try:
                checked = await loop.run_in_executor(server.worker, lint)
            except OutdatedError:
                continue
            except Exception as error:  # noqa: BLE001 - a bug of codra must not end the server
                text = f"codra: internal error: {described(error)}; this is a bug of codra, not of your spec"
                server.window_log_message(types.LogMessageParams(types.MessageType.Error, text))
                continue
            if not self._is_outdated:
                before, project.checked = project.checked, checked
                server.publish(project, before)
                loop.call_later(DEBOUNCE_S, self._prepare_answers, checked)

    def _prepare_answers(self, checked: Checked) -> None:
        """Build tables for the next requests, unless there is a newer text, which is linted first."""
        if not self._is_outdated:
            self._server.worker.submit(checked.build_tables)
