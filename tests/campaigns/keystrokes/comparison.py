"""An editor with a project, and a folder with the same texts, all of them saved: both must have the same findings."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Coroutine, Mapping
from difflib import SequenceMatcher
from pathlib import Path
from random import Random
from typing import Any

from lsprotocol import types
from pygls.exceptions import JsonRpcException, JsonRpcInternalError
from pygls.lsp.client import BaseLanguageClient
from pygls.uris import from_fs_path

from codra_dsl.compiler import lint_paths
from codra_dsl.language.diagnostics import Diagnostic
from tests.campaigns.edits.changes import random_edit
from tests.tooling.language_server.buffers import Buffer
from tests.tooling.language_server.editor import Editor, path_of

Shown = Counter[tuple[str, str, str, str]]
"""How often each finding is shown: its file, its place, its code, and its text."""

_ABOUT_A_FOLDER = "CDR0007"
"""The code of the finding that a project has no spec. It has no place in a file, so editors do not show it."""

MAX_PIECES = 6
"""The number of messages in which an edit is sent."""

Request = Callable[[BaseLanguageClient, types.TextDocumentIdentifier, types.Position], Coroutine[Any, Any, Any]]
REQUESTS: tuple[tuple[str, Request], ...] = (
    ("hover", lambda client, document, at: client.text_document_hover_async(types.HoverParams(document, at))),
    (
        "definition",
        lambda client, document, at: client.text_document_definition_async(types.DefinitionParams(document, at)),
    ),
    (
        "references",
        lambda client, document, at: client.text_document_references_async(
            types.ReferenceParams(types.ReferenceContext(include_declaration=True), document, at)
        ),
    ),
    (
        "completion",
        lambda client, document, at: client.text_document_completion_async(types.CompletionParams(document, at)),
    ),
    (
        "rename",
        lambda client, document, at: client.text_document_rename_async(
            types.RenameParams(text_document=document, position=at, new_name="other")
        ),
    ),
    (
        "symbols",
        lambda client, document, _: client.text_document_document_symbol_async(types.DocumentSymbolParams(document)),
    ),
    (
        "tokens",
        lambda client, document, _: client.text_document_semantic_tokens_full_async(
            types.SemanticTokensParams(document)
        ),
    ),
    (
        "actions",
        lambda client, document, at: client.text_document_code_action_async(
            types.CodeActionParams(document, types.Range(at, at), types.CodeActionContext([]))
        ),
    ),
)


class DifferenceError(Exception):
    """What the editor shows differs from what `codra lint` reports."""


class Comparison:
    """Edits a project in an editor.

    Attributes:
        counts: how often each kind of edit was made, and each kind of request was answered.
    """

    def __init__(self, editor: Editor, initial_files: Mapping[str, str], folder: Path, seed: int) -> None:
        self.counts: Counter[str] = Counter()
        self._editor, self._chance = editor, Random(seed)
        self._folder, self._saved_folder = folder / "edited" / "project", folder / "saved" / "project"
        self._initial_files = self._files = dict(initial_files)
        for file, text in initial_files.items():
            _write(self._folder / file, text)
            _write(self._saved_folder / file, text)
            if file.endswith(".yaml") and self._chance.random() < 0.7:
                self._editor.open(self._uri(file), text)

    def step(self) -> None:
        """Make one edit, as several messages, ask about a random place, and compare.

        Raises:
            DifferenceError: if the findings differ.
            JsonRpcException: if a request fails, other than by refusing to rename.
        """
        name, edit = random_edit(self._files, self._initial_files, self._chance)
        self.counts[name] += 1
        for file, text in edit.items():
            self._change(file, text)
        self._files = {file: text for file, text in {**self._files, **edit}.items() if text is not None}
        self._sometimes_save_or_close()
        self._ask()
        self._compare(f"{name} {edit}")

    def _change(self, file: str, text: str | None) -> None:
        """Bring a file to a text: in its buffer if it is open, otherwise on disk."""
        uri = self._uri(file)
        _write(self._saved_folder / file, text)
        if uri not in self._editor.buffers:
            _write(self._folder / file, text)
            self._editor.report_files((self._folder / file, types.FileChangeType.Changed))
        elif text is None:
            _write(self._folder / file, None)
            self._editor.report_files((self._folder / file, types.FileChangeType.Deleted))
            self._editor.close(uri)
        else:
            for edits in _pieces(self._editor.buffers[uri], text):
                self._editor.send_edit(uri, [edits])

    def _sometimes_save_or_close(self) -> None:
        """Save, close or open one of the files."""
        specs = sorted(file for file in self._files if file.endswith(".yaml"))
        file = self._chance.choice(specs) if specs else ""
        uri, what = self._uri(file), self._chance.random()
        if uri not in self._editor.buffers:
            if file and what < 0.3:
                self._editor.open(uri, (self._folder / file).read_text("utf-8"))
        elif what < 0.3:
            self._editor.save(uri)
            if what < 0.1:
                self._editor.close(uri)

    def _ask(self) -> None:
        """Send a request about a random place."""
        if not self._editor.buffers:
            return
        uri = self._chance.choice(sorted(self._editor.buffers))
        document, buffer = types.TextDocumentIdentifier(uri), self._editor.buffers[uri]
        position = buffer.position(self._chance.randrange(len(buffer.text) + 1))
        name, request = self._chance.choice(REQUESTS)
        try:
            self._editor.wait(request(self._editor.client, document, position))
        except JsonRpcException as error:
            if name != "rename" or error.code == JsonRpcInternalError.CODE:
                raise
        self.counts[f"request {name}"] += 1

    def _compare(self, edit_text: str) -> None:
        self._editor.settle_project(self._folder)
        shown, expected = self._shown(), self._expected()
        if shown != expected:
            raise DifferenceError(f"{edit_text}\nonly shown: {shown - expected}\nnot shown: {expected - shown}")

    def _shown(self) -> Shown:
        return Counter(
            (file, _lines_and_columns(buffer, finding.range), str(finding.code), finding.message)
            for uri, published in self._editor.published.items()
            for file in [path_of(uri).relative_to(self._folder).as_posix()]
            for buffer in [self._editor.buffers.get(uri) or Buffer(_read(self._folder / file))]
            for finding in published.diagnostics
            if finding.code != _ABOUT_A_FOLDER
        )

    def _expected(self) -> Shown:
        diagnostics = lint_paths([self._saved_folder], self._saved_folder).diagnostics
        return Counter(_expected_finding(finding) for finding in diagnostics if finding.code != _ABOUT_A_FOLDER)

    def _uri(self, file: str) -> str:
        return str(from_fs_path(str(self._folder / file)))


def _expected_finding(finding: Diagnostic) -> tuple[str, str, str, str]:
    span = finding.place.span
    place = f"{span.line}:{span.column} to {span.end_line}:{span.end_column}"
    return span.file, place, finding.code, f"{finding.message}\n{finding.help}" if finding.help else finding.message


def _lines_and_columns(buffer: Buffer, place: types.Range) -> str:
    return " to ".join(map("{0[0]}:{0[1]}".format, map(buffer.line_and_column, (place.start, place.end))))


def _pieces(buffer: Buffer, text: str) -> list[types.TextEdit]:
    """Return edits, to be made one after the other, that bring a buffer to a text: at most MAX_PIECES."""
    blocks = [
        (start, end, text[new_start:new_end])
        for tag, start, end, new_start, new_end in SequenceMatcher(
            None, buffer.text, text, autojunk=False
        ).get_opcodes()
        if tag != "equal"
    ]
    if len(blocks) > MAX_PIECES:
        first, last = blocks[0], blocks[-1]
        blocks = [(first[0], last[1], text[first[0] : len(text) - (len(buffer.text) - last[1])])]
    places = [types.Range(buffer.position(start), buffer.position(end)) for start, end, _ in blocks]
    edits = [types.TextEdit(place, new) for place, (_, _, new) in zip(places, blocks, strict=True)]
    return edits[::-1]


def _read(path: Path) -> str:
    return path.read_text("utf-8") if path.exists() else ""


def _write(path: Path, text: str | None) -> None:
    if text is None:
        path.unlink(missing_ok=True)
    else:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, "utf-8")
