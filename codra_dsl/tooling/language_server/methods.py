"""The methods of the protocol that the server offers."""

from __future__ import annotations

import logging
import os
import sys
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from lsprotocol import types
from pygls.exceptions import JsonRpcException

from codra_dsl.tooling.language_server.completion import completions
from codra_dsl.tooling.language_server.describing import TOKEN_TYPES, hover, semantic_tokens, symbols
from codra_dsl.tooling.language_server.index import Cursor, Range
from codra_dsl.tooling.language_server.projects import Project
from codra_dsl.tooling.language_server.renaming import RefusedError, renameable
from codra_dsl.tooling.language_server.server import CodraServer

_WATCHED_FILES = ("**/*.{yaml,yml,xml,py}", "**/pyproject.toml")

Answer = Callable[[Project, Cursor, Any], Any]
"""A function that answers a request about a position or a complete document."""


def _locations(cursor: Cursor, ranges: Iterable[Range]) -> list[types.Location]:
    return [cursor.index.texts.location(one.file, one.start, one.end) for one in ranges]


def _references(project: Project, cursor: Cursor, params: Any) -> list[types.Location]:
    symbols_here = cursor.index.symbols(cursor)
    ranges = cursor.index.ranges(symbols_here, project.other_files() if symbols_here else ())
    wanted = (
        name_range for name_range in ranges if params.context.include_declaration or not name_range.is_declaration
    )
    return _locations(cursor, wanted)


_ANSWERS: Mapping[str, tuple[Answer, Any]] = {
    types.TEXT_DOCUMENT_HOVER: (lambda _, cursor, __: hover(cursor), None),
    types.TEXT_DOCUMENT_COMPLETION: (
        lambda _, cursor, __: completions(cursor),
        types.CompletionOptions(trigger_characters=list('{[,: "$(')),
    ),
    types.TEXT_DOCUMENT_DEFINITION: (lambda _, cursor, __: _locations(cursor, cursor.index.definitions(cursor)), None),
    types.TEXT_DOCUMENT_REFERENCES: (_references, None),
    types.TEXT_DOCUMENT_DOCUMENT_SYMBOL: (lambda _, cursor, __: symbols(cursor), None),
    types.TEXT_DOCUMENT_SEMANTIC_TOKENS_FULL: (
        lambda _, cursor, __: semantic_tokens(cursor),
        types.SemanticTokensLegend(list(TOKEN_TYPES), []),
    ),
    types.TEXT_DOCUMENT_PREPARE_RENAME: (
        lambda _, cursor, __: _locations(cursor, [renameable(cursor)])[0].range,
        None,
    ),
}
"""The answer to each request about a position or a complete document, and the options of the method."""


def make_server() -> CodraServer:
    """Return a server with all methods of the protocol that it offers."""
    server = CodraServer()
    for method, (answer, options) in _ANSWERS.items():
        _add_answer(server, method, answer, options)

    notifications: Mapping[str, Callable[[Any], None]] = {
        types.INITIALIZED: lambda _: _watch_files(server),
        types.TEXT_DOCUMENT_DID_OPEN: lambda params: server.open(params.text_document),
        types.TEXT_DOCUMENT_DID_CHANGE: lambda params: server.change(params),  # noqa: PLW0108 - pygls sets attributes
        types.TEXT_DOCUMENT_DID_CLOSE: lambda params: server.close(params.text_document.uri),
        types.TEXT_DOCUMENT_DID_SAVE: lambda _: server.schedule_all(),
        types.WORKSPACE_DID_CHANGE_WATCHED_FILES: lambda _: server.schedule_all(),
        types.SHUTDOWN: lambda _: setattr(server, "is_shut_down", True),
    }
    for method, notify in notifications.items():
        server.feature(method)(notify)

    @server.feature(
        types.TEXT_DOCUMENT_CODE_ACTION, types.CodeActionOptions(code_action_kinds=[types.CodeActionKind.QuickFix])
    )
    def _(params: types.CodeActionParams) -> list[types.CodeAction]:
        return server.quick_fixes(params.text_document.uri, params.range)

    @server.feature(types.TEXT_DOCUMENT_RENAME, types.RenameOptions(prepare_provider=True))
    async def _(params: types.RenameParams) -> types.WorkspaceEdit:
        try:
            return await server.rename(params)
        except RefusedError as error:
            raise _refusal(error) from error

    return server


def _add_answer(server: CodraServer, method: str, answer: Answer, options: Any) -> None:
    @server.feature(method, options)
    async def _(params: Any) -> Any:
        await server.wait_for_names(params.text_document.uri)
        located = server.cursor(params.text_document.uri, getattr(params, "position", None))
        try:
            return None if located is None else answer(*located, params)
        except RefusedError as error:
            raise _refusal(error) from error


def _refusal(error: RefusedError) -> JsonRpcException:
    return JsonRpcException(str(error), types.LSPErrorCodes.RequestFailed)


def _watch_files(server: CodraServer) -> None:
    """Ask the client to report changes of files on disk, if it can."""
    if server.can("workspace.did_change_watched_files.dynamic_registration"):
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
