"""The methods of the protocol that the server offers."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable, Mapping
from typing import Any

from lsprotocol import types
from pygls.exceptions import JsonRpcException

from codra_dsl.tooling.language_server.completion import completions
from codra_dsl.tooling.language_server.describing import TOKEN_TYPES, hover, semantic_tokens, symbols
from codra_dsl.tooling.language_server.index import Cursor
from codra_dsl.tooling.language_server.projects import Project
from codra_dsl.tooling.language_server.renaming import RefusedError, renameable
from codra_dsl.tooling.language_server.server import CodraServer

_WATCHED_FILES = ("**/*.{yaml,yml,xml,py}", "**/pyproject.toml")


def _definition(server: CodraServer, project: Project, cursor: Cursor, _: Any) -> list[types.Location]:
    return server.locations(project, cursor, cursor.index.definitions(cursor))


def _references(server: CodraServer, project: Project, cursor: Cursor, params: Any) -> list[types.Location]:
    ranges = cursor.index.references(cursor, project.other_files())
    wanted = [found for found in ranges if params.context.include_declaration or not found.is_declaration]
    return server.locations(project, cursor, wanted)


def _prepare_rename(server: CodraServer, project: Project, cursor: Cursor, _: Any) -> types.Range:
    try:
        return server.locations(project, cursor, [renameable(cursor)])[0].range
    except RefusedError as error:
        raise JsonRpcException(str(error), types.LSPErrorCodes.RequestFailed) from error


_ANSWERS: Mapping[str, tuple[Callable[[CodraServer, Project, Cursor, Any], Any], Any]] = {
    types.TEXT_DOCUMENT_HOVER: (lambda _, __, cursor, ___: hover(cursor), None),
    types.TEXT_DOCUMENT_COMPLETION: (
        lambda _, __, cursor, ___: completions(cursor),
        types.CompletionOptions(trigger_characters=list('{[,: "')),
    ),
    types.TEXT_DOCUMENT_DEFINITION: (_definition, None),
    types.TEXT_DOCUMENT_REFERENCES: (_references, None),
    types.TEXT_DOCUMENT_PREPARE_RENAME: (_prepare_rename, None),
    types.TEXT_DOCUMENT_DOCUMENT_SYMBOL: (lambda _, __, cursor, ___: symbols(cursor), None),
    types.TEXT_DOCUMENT_SEMANTIC_TOKENS_FULL: (
        lambda _, __, cursor, ___: semantic_tokens(cursor),
        types.SemanticTokensLegend(list(TOKEN_TYPES), []),
    ),
}
"""For each request about a position or a complete document, the function that answers it, and the options."""


def make_server() -> CodraServer:
    """Return a server with all methods of the protocol that it offers."""
    server = CodraServer()
    for method, (function, options) in _ANSWERS.items():
        _add_answer(server, method, function, options)

    notifications: Mapping[str, Callable[[Any], None]] = {
        types.INITIALIZED: lambda _: _watch_files(server),
        types.TEXT_DOCUMENT_DID_OPEN: lambda params: server.open(params.text_document),
        types.TEXT_DOCUMENT_DID_CLOSE: lambda params: server.close(params.text_document.uri),
        types.TEXT_DOCUMENT_DID_SAVE: lambda _: server.schedule_all(),
        types.WORKSPACE_DID_CHANGE_WATCHED_FILES: lambda _: server.schedule_all(),
    }
    for method, notify in notifications.items():
        server.feature(method)(notify)

    @server.feature(types.TEXT_DOCUMENT_DID_CHANGE)
    def _(params: types.DidChangeTextDocumentParams) -> None:
        server.change(params)

    @server.feature(types.SHUTDOWN)
    def _(_: Any) -> None:
        server.is_shut_down = True

    @server.feature(
        types.TEXT_DOCUMENT_CODE_ACTION, types.CodeActionOptions(code_action_kinds=[types.CodeActionKind.QuickFix])
    )
    def _(params: types.CodeActionParams) -> list[types.CodeAction]:
        return server.quick_fixes(params.text_document.uri, params.range)

    @server.feature(types.TEXT_DOCUMENT_RENAME, types.RenameOptions(prepare_provider=True))
    async def _(params: types.RenameParams) -> types.WorkspaceEdit | None:
        return await server.rename(params)

    return server


def _add_answer(server: CodraServer, method: str, function: Callable[..., Any], options: Any) -> None:
    @server.feature(method, options)
    def _(params: Any) -> Any:
        located = server.cursor(params.text_document.uri, getattr(params, "position", None))
        return None if located is None else function(server, *located, params)


def _watch_files(server: CodraServer) -> None:
    """Ask the client to report changes of files on disk, if it can."""
    workspace = server.client_capabilities.workspace
    capability = workspace and workspace.did_change_watched_files
    if capability and capability.dynamic_registration:
        watchers = [types.FileSystemWatcher(pattern) for pattern in _WATCHED_FILES]
        options = types.DidChangeWatchedFilesRegistrationOptions(watchers)
        registration = types.Registration("files", types.WORKSPACE_DID_CHANGE_WATCHED_FILES, options)
        server.client_register_capability(types.RegistrationParams([registration]))


def serve() -> bool:
    """Serve a client over standard input and output; return whether it ended the session as the protocol requires."""
    logging.getLogger("pygls").setLevel(logging.CRITICAL)  # it would print a traceback for each refused request
    server = make_server()
    server.start_io(stdout=os.fdopen(os.dup(sys.stdout.fileno()), "wb"))  # pygls closes it at the end
    return server.is_shut_down
