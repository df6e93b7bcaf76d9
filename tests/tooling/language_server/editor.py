"""An editor without a screen: pygls' client over stdio, the open buffers, and the findings that were published."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections.abc import Callable, Coroutine, Iterable, Sequence
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeVar

from lsprotocol import types
from pygls.exceptions import JsonRpcMethodNotFound
from pygls.lsp.client import BaseLanguageClient
from pygls.uris import from_fs_path, to_fs_path

from tests.tooling.language_server.buffers import Buffer

Result = TypeVar("Result")

SERVER = (sys.executable, "-m", "codra_dsl", "language-server")
SERVER_WITHOUT_PAUSE = (
    sys.executable,
    "-c",
    "from codra_dsl.tooling.language_server import methods, server; server.DEBOUNCE_S = 0.0; methods.serve()",
)
"""The server, without its pause after a keystroke."""

PATIENCE_S = 60.0
"""A request that needs more time hangs."""

CAPABILITIES = types.ClientCapabilities(
    workspace=types.WorkspaceClientCapabilities(
        did_change_watched_files=types.DidChangeWatchedFilesClientCapabilities(dynamic_registration=True),
        workspace_edit=types.WorkspaceEditClientCapabilities(document_changes=True),
        workspace_folders=True,
    ),
    text_document=types.TextDocumentClientCapabilities(
        publish_diagnostics=types.PublishDiagnosticsClientCapabilities(
            related_information=True, version_support=True, code_description_support=True, data_support=True
        ),
        hover=types.HoverClientCapabilities(content_format=[types.MarkupKind.Markdown]),
        document_symbol=types.DocumentSymbolClientCapabilities(hierarchical_document_symbol_support=True),
        code_action=types.CodeActionClientCapabilities(
            code_action_literal_support=types.ClientCodeActionLiteralOptions(
                types.ClientCodeActionKindOptions(["quickfix"])
            ),
            is_preferred_support=True,
            data_support=True,
        ),
        rename=types.RenameClientCapabilities(prepare_support=True),
    ),
)


class Editor:
    """One client and the server process that it started.

    Attributes:
        buffers: the open documents, by their URI.
        published: the findings that the server published last, by the URI of their file.
        capabilities: what the server offers.
    """

    capabilities: types.ServerCapabilities

    def __init__(self, command: Sequence[str] = SERVER, client: BaseLanguageClient | None = None) -> None:
        self.buffers: dict[str, Buffer] = {}
        self.published: dict[str, types.PublishDiagnosticsParams] = {}
        self.published_count = 0
        self.client = client or _new_client()
        self.client.feature(types.TEXT_DOCUMENT_PUBLISH_DIAGNOSTICS)(partial(Editor._on_published, self))
        self._barrier_count = 0
        self._command = command
        self._loop = asyncio.new_event_loop()
        self._errors = bytearray()

    def start(self, *folders: Path, encodings: Sequence[types.PositionEncodingKind] = ()) -> None:
        """Start a server for some folders of the workspace."""
        self.wait(self.client.start_io(*self._command))
        self._reading_errors = self._loop.create_task(self._read_errors())
        general = types.GeneralClientCapabilities(position_encodings=encodings or None)
        params = types.InitializeParams(
            capabilities=replace_general(CAPABILITIES, general),
            process_id=None,
            workspace_folders=[types.WorkspaceFolder(from_fs_path(str(path)) or "", path.name) for path in folders],
        )
        self.capabilities = self.wait(self.client.initialize_async(params)).capabilities
        self.client.initialized(types.InitializedParams())

    def stop(self) -> int:
        """Shut the server down, and return its exit code."""
        self.wait(self.client.shutdown_async(None))
        self.client.exit(None)
        return self.wait_for_end()

    def wait_for_end(self) -> int:
        """Return the exit code of the server once it has ended; nothing may remain of it."""
        process = self.process
        self.wait(process.wait())
        self.wait(self._reading_errors)
        self.wait(self.client.stop())
        self._loop.close()
        assert process.returncode is not None
        return process.returncode

    @property
    def process(self) -> asyncio.subprocess.Process:
        """The process of the server."""
        process = self.client._server
        assert process is not None
        return process

    @property
    def errors(self) -> str:
        """What the server has written to standard error."""
        return self._errors.decode()

    def wait(self, coroutine: Coroutine[Any, Any, Result] | asyncio.Task[Result]) -> Result:
        """Return the result of a request.

        Raises:
            TimeoutError: if there is none within PATIENCE_S.
        """
        return self._loop.run_until_complete(asyncio.wait_for(coroutine, PATIENCE_S))

    def request(self, method: str, params: object) -> Any:
        """Return the answer to any request."""

        async def answer() -> Any:
            return await self.client.protocol.send_request_async(method, params)

        return self.wait(answer())

    def open(self, uri: str, text: str) -> None:
        """Open a document with a text that may not be saved, and wait for its findings."""
        self.buffers[uri] = Buffer(text)
        document = types.TextDocumentItem(uri, "yaml", 1, text)
        self.client.text_document_did_open(types.DidOpenTextDocumentParams(document))
        self.settle(uri)

    def edit(self, uri: str, edits: Iterable[types.TextEdit]) -> None:
        """Change a document by edits with ranges in its present text, in one message, and wait for its findings."""
        self.send_edit(uri, edits)
        self.settle(uri)

    def send_edit(self, uri: str, edits: Iterable[types.TextEdit]) -> None:
        """Change a document without waiting."""
        # The protocol applies one change after the other: from the last to the first, none moves another.
        ordered = sorted(edits, key=lambda edit: (edit.range.start.line, edit.range.start.character), reverse=True)
        self.buffers[uri] = self.buffers[uri].edited(ordered)
        changes = [types.TextDocumentContentChangePartial(edit.range, edit.new_text) for edit in ordered]
        document = types.VersionedTextDocumentIdentifier(version=self.buffers[uri].version, uri=uri)
        self.client.text_document_did_change(types.DidChangeTextDocumentParams(document, changes))

    def replace_all(self, uri: str, text: str) -> None:
        """Change a document to another text, sent in full, and wait for its findings."""
        self.buffers[uri] = replace(self.buffers[uri], text=text, version=self.buffers[uri].version + 1)
        document = types.VersionedTextDocumentIdentifier(version=self.buffers[uri].version, uri=uri)
        changes = [types.TextDocumentContentChangeWholeDocument(text)]
        self.client.text_document_did_change(types.DidChangeTextDocumentParams(document, changes))
        self.settle(uri)

    def save(self, uri: str) -> None:
        """Write a document to its file, and tell the server."""
        path_of(uri).write_bytes(self.buffers[uri].text.encode())
        self.client.text_document_did_save(types.DidSaveTextDocumentParams(types.TextDocumentIdentifier(uri)))

    def close(self, uri: str) -> None:
        """Close a document; what is not saved is lost."""
        del self.buffers[uri]
        self.client.text_document_did_close(types.DidCloseTextDocumentParams(types.TextDocumentIdentifier(uri)))

    def report_files(self, *events: tuple[Path, types.FileChangeType]) -> None:
        """Tell the server about files that were created, changed or deleted on disk."""
        changes = [types.FileEvent(from_fs_path(str(path)) or "", kind) for path, kind in events]
        self.client.workspace_did_change_watched_files(types.DidChangeWatchedFilesParams(changes))

    def wait_for_lint(self, act: Callable[[], None], folder: Path) -> None:
        """Do something in a folder that changes the version of no document, and wait for the findings that follow.

        The server publishes the findings about an open document whenever it has linted its project.
        """
        before = self.published_count
        act()
        if self.buffers:
            self.wait(self._published_after(before))
            self.settle()
        else:
            self.settle_project(folder)

    async def _published_after(self, count: int) -> None:
        while self.published_count == count:
            await asyncio.sleep(0.002)

    def settle_project(self, folder: Path) -> None:
        """Wait until the server has linted the project of a folder after everything that it was told, also about files.

        A document that is not a spec is opened: the findings about it are part of such a result.
        """
        self._barrier_count += 1
        uri = str(from_fs_path(str(folder / f"barrier-{self._barrier_count}.yaml")))
        self.open(uri, "")
        self.close(uri)
        del self.published[uri]

    async def _published_version(self, uri: str, version: int) -> None:
        while (published := self.published.get(uri)) is None or published.version != version:
            await asyncio.sleep(0.002)

    def settle(self, uri: str | None = None) -> None:
        """Wait until all messages are handled, and findings about the present version of a document are published."""
        self.wait(self._settled(uri))

    async def _settled(self, uri: str | None) -> None:
        if uri is not None and uri.startswith("file:"):
            await self._published_version(uri, self.buffers[uri].version)
        with contextlib.suppress(JsonRpcMethodNotFound):  # the answer shows that the messages before it are handled
            await self.client.protocol.send_request_async("codra/nothing", None)

    def _on_published(self, params: types.PublishDiagnosticsParams) -> None:
        self.published[params.uri] = params
        self.published_count += 1

    async def _read_errors(self) -> None:
        """Read what the server writes to standard error: if nobody did, the server would wait once the pipe is full."""
        stream = self.process.stderr
        assert stream is not None
        while data := await stream.read(65536):
            self._errors += data


def _new_client() -> BaseLanguageClient:
    """Return a client that answers the requests of servers."""
    client = BaseLanguageClient("sessions", "1")
    client.feature(types.CLIENT_REGISTER_CAPABILITY)(lambda _: None)
    return client


def replace_general(
    capabilities: types.ClientCapabilities, general: types.GeneralClientCapabilities
) -> types.ClientCapabilities:
    """Return the same capabilities with other general ones."""
    return types.ClientCapabilities(
        workspace=capabilities.workspace, text_document=capabilities.text_document, general=general
    )


def path_of(uri: str) -> Path:
    """Return the path of a file's URI."""
    path = to_fs_path(uri)
    assert path is not None, uri
    return Path(path)
