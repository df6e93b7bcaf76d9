"""Sessions of an editor as text files: what a person does, and the complete answer of the server.

The first lines of a file state the behaviour. Then come steps: a line `--- COMMAND ARGUMENTS`, the lines of its input,
and after a line `=>` the complete answer. A step about a place quotes the text there, with `|` at the cursor, or at
both ends of a selection. A step that changes files or texts is answered by the findings about all files.
"""

from __future__ import annotations

import json
import re
import shutil
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from lsprotocol import types
from pygls.exceptions import JsonRpcException
from pygls.uris import from_fs_path

from codra_dsl.compiler import lint_paths
from tests.tooling.language_server.answers import Answers, edits_by_uri
from tests.tooling.language_server.buffers import Buffer
from tests.tooling.language_server.editor import Editor, path_of

PROJECTS = Path(__file__).with_name("projects")

_STEP = re.compile(r"^--- (?P<command>[a-z-]+)(?: (?P<arguments>.*))?\n(?P<body>(?:(?!--- ).*\n)*)", re.MULTILINE)


@dataclass(frozen=True, slots=True)
class Step:
    """One thing that a person or an editor does.

    Attributes:
        body: the lines below the command, without the answer.
    """

    command: str
    arguments: str
    body: str

    def text(self, answer: str | None) -> str:
        """Return the step as in a file, with its answer."""
        head = f"--- {self.command}{' ' if self.arguments else ''}{self.arguments}\n{self.body}"
        return head if answer is None else f"{head}=>\n{answer}\n"


@dataclass(frozen=True, slots=True)
class Script:
    """A session as its file states it."""

    behaviour: str
    steps: tuple[Step, ...]

    @classmethod
    def read(cls, text: str) -> Script:
        """Read a file."""
        behaviour, rest = text[: (start := text.index("--- "))], text[start:]
        matches = list(_STEP.finditer(rest))
        assert "".join(match[0] for match in matches) == rest, "a line belongs to no step"
        bodies = [re.split("^=>\n", match["body"], maxsplit=1, flags=re.MULTILINE)[0] for match in matches]
        steps = (
            Step(match["command"], match["arguments"] or "", body) for match, body in zip(matches, bodies, strict=True)
        )
        return cls(behaviour, tuple(steps))


class Session:
    """Plays a script in a folder, with a server that is running. The folder is a project."""

    def __init__(self, editor: Editor, folder: Path) -> None:
        self._editor, self._folder = editor, folder
        self._offered: Mapping[str, types.CodeAction] = {}
        self._write("pyproject.toml", "[tool.codra]\n")

    def play(self, script: Script) -> str:
        """Return the file of a script with the answers of the server."""
        try:
            return script.behaviour + "".join(step.text(self._answer(step)) for step in script.steps)
        finally:
            for uri in list(self._editor.buffers):
                self._editor.close(uri)
                self._editor.settle_project(self._folder_of(uri))
            self._editor.published.clear()

    def _answer(self, step: Step) -> str | None:
        method: Callable[[str, str], str | None] = getattr(self, f"_{step.command.replace('-', '_')}")
        try:
            return method(step.arguments, step.body)
        except JsonRpcException as error:
            return f"error {error.code}: {error.message}"

    # Files

    def _project(self, name: str, _: str) -> None:
        """Copy one of our projects."""
        shutil.copytree(PROJECTS / name, self._folder, dirs_exist_ok=True)

    def _file(self, arguments: str, body: str) -> None:
        """Write a file; after its path, `crlf` and `bom` change its bytes."""
        path, *forms = arguments.rsplit(" :: ", 1)
        text = body.replace("\n", "\r\n") if "crlf" in forms else body
        self._write(path, f"\ufeff{text}" if "bom" in forms else text)

    def _append(self, arguments: str, body: str) -> None:
        """Append lines to a file several times; `{n}` in them is the number of the time."""
        path, count = arguments.rsplit(" ", 1)
        text = "".join(body.replace("{n}", str(number)) for number in range(1, int(count) + 1))
        with self._path(path).open("a", encoding="utf-8") as file:
            file.write(text)

    def _write_file(self, path: str, body: str) -> str:
        """Let another program write a file."""
        kind = types.FileChangeType.Changed if self._path(path).exists() else types.FileChangeType.Created
        self._write(path, body)
        return self._findings_after(lambda: self._editor.report_files((self._path(path), kind)))

    def _delete_file(self, path: str, _: str) -> str:
        """Let another program delete a file."""
        self._path(path).unlink()
        return self._findings_after(lambda: self._editor.report_files((self._path(path), types.FileChangeType.Deleted)))

    def _move_file(self, arguments: str, _: str) -> str:
        """Let another program rename a file."""
        old, new = map(self._path, arguments.split(" "))
        old.rename(new)
        events = ((old, types.FileChangeType.Deleted), (new, types.FileChangeType.Created))
        return self._findings_after(lambda: self._editor.report_files(*events))

    # Texts

    def _open(self, path: str, body: str) -> str:
        """Open a document with the text of its file, or with a text that is not saved."""
        self._editor.open(self._uri(path), body or self._disk_text(self._uri(path)))
        return self._findings()

    def _change(self, path: str, body: str) -> str:
        """Replace the lines that begin with `-` by those that begin with `+`, in one message."""
        lines = body.splitlines(keepends=True)
        old, new = ("".join(line[1:] for line in lines if line[0] == sign) for sign in "-+")
        buffer = self._editor.buffers[self._uri(path)]
        if "\r\n" in buffer.text:
            old, new = old.replace("\n", "\r\n"), new.replace("\n", "\r\n")
        self._editor.edit(self._uri(path), [types.TextEdit(buffer.place_of(f"|{old}|"), new)])
        return self._findings()

    def _type(self, path: str, body: str) -> str:
        """Type the text of the lines after the first one at the cursor, one message per character."""
        excerpt, text = body.split("\n", 1)
        uri = self._uri(path)
        start = self._editor.buffers[uri].offset(self._editor.buffers[uri].place_of(excerpt).start)
        for offset, character in enumerate(text.removesuffix("\n"), start=start):
            position = self._editor.buffers[uri].position(offset)
            self._editor.send_edit(uri, [types.TextEdit(types.Range(position, position), character)])
        self._editor.settle(uri)
        return self._findings()

    def _save(self, path: str, _: str) -> str:
        return self._findings_after(lambda: self._editor.save(self._uri(path)))

    def _close(self, path: str, _: str) -> str:
        return self._findings_after(lambda: self._editor.close(self._uri(path)))

    # Requests

    def _hover(self, path: str, body: str) -> str:
        answer = self._ask("hover", types.HoverParams(*self._cursor(path, body)))
        return self._answers().hover(self._uri(path), answer)

    def _definition(self, path: str, body: str) -> str:
        return self._answers().locations(self._ask("definition", types.DefinitionParams(*self._cursor(path, body))))

    def _references(self, path: str, body: str) -> str:
        context = types.ReferenceContext(include_declaration=True)
        params = types.ReferenceParams(context, *self._cursor(path, body))
        return self._answers().locations(self._ask("references", params))

    def _completion(self, path: str, body: str) -> str:
        answer = self._ask("completion", types.CompletionParams(*self._cursor(path, body)))
        return self._answers().completion(self._uri(path), answer)

    def _symbols(self, path: str, _: str) -> str:
        answer = self._ask("document_symbol", types.DocumentSymbolParams(self._document(path)))
        return self._answers().symbols(self._uri(path), answer)

    def _tokens(self, path: str, _: str) -> str:
        answer = self._ask("semantic_tokens_full", types.SemanticTokensParams(self._document(path)))
        return self._answers().tokens(self._uri(path), answer)

    def _actions(self, path: str, body: str) -> str:
        """Ask for code actions at a place, with the findings there, as editors do."""
        place = self._buffer(self._uri(path)).place_of(body.rstrip("\n"))
        published = self._editor.published.get(self._uri(path))
        findings = [
            finding for finding in (published.diagnostics if published else ()) if _overlap(finding.range, place)
        ]
        params = types.CodeActionParams(self._document(path), place, types.CodeActionContext(findings))
        actions = self._ask("code_action", params)
        self._offered = {action.title: action for action in actions or ()}
        return self._answers().actions(actions)

    def _apply(self, title: str, _: str) -> str:
        """Apply one of the code actions that the last step showed."""
        self._apply_edit(self._offered[title].edit)
        return self._findings()

    def _prepare(self, path: str, body: str) -> str:
        answer = self._ask("prepare_rename", types.PrepareRenameParams(*self._cursor(path, body)))
        place = getattr(answer, "range", answer)
        return "nothing" if place is None else self._answers().place(self._uri(path), place)

    def _rename(self, arguments: str, body: str) -> str:
        """Rename, and apply the edits; `codra lint` may then find nothing new."""
        path, new_name = arguments.rsplit(" ", 1)
        document, position = self._cursor(path, body)
        edit = self._ask("rename", types.RenameParams(text_document=document, position=position, new_name=new_name))
        shown = self._answers().edits(edit)
        before = self._lint()
        self._apply_edit(edit)
        new_findings = self._lint() - before
        assert not new_findings, f"new after renaming: {new_findings}"
        return shown

    def _request(self, method: str, body: str) -> str:
        """Send any request."""
        params = json.loads(body) if body else None
        if method in types.METHOD_TO_TYPES:
            params = self._editor.client.protocol._converter.structure(params, types.METHOD_TO_TYPES[method][2])
        return self._answers().any(self._editor.request(method, params))

    # Helpers

    def _ask(self, name: str, params: object) -> Any:
        return self._editor.wait(getattr(self._editor.client, f"text_document_{name}_async")(params))

    def _apply_edit(self, edit: types.WorkspaceEdit | None) -> None:
        """Apply edits as editors do: to the buffers of open documents, and to the files of all others."""
        for uri, text_edits in edits_by_uri(edit).items():
            if uri in self._editor.buffers:
                self._editor.edit(uri, text_edits)
            else:
                path_of(uri).write_bytes(self._buffer(uri).edited(text_edits).text.encode())
                self._editor.report_files((path_of(uri), types.FileChangeType.Changed))
                self._editor.settle_project(self._folder_of(uri))

    def _lint(self) -> Counter[tuple[str, str, int]]:
        """Return how often `codra lint` reports each rule in each line, with the texts of the buffers."""
        findings: Counter[tuple[str, str, int]] = Counter()
        for settings in sorted(self._folder.rglob("pyproject.toml")):
            root = settings.parent
            texts = {
                path_of(uri).relative_to(root).as_posix(): buffer.text.encode()
                for uri, buffer in self._editor.buffers.items()
                if not uri.startswith("untitled:") and path_of(uri).is_relative_to(root)
            }
            spans = ((finding.code, finding.place.span) for finding in lint_paths([root], root, texts).diagnostics)
            findings.update((code, f"{root.name}/{span.file}", span.line) for code, span in spans)
        return findings

    def _findings_after(self, act: Callable[[], None]) -> str:
        """Return the findings after something that changes the version of no document."""
        self._editor.wait_for_lint(act, self._folder)
        return self._findings()

    def _findings(self) -> str:
        return self._answers().findings(self._editor.published.values())

    def _answers(self) -> Answers:
        paths = [path for path in self._folder.rglob("*") if path.is_file()]
        texts = {
            uri: self._buffer(uri) for uri in {*self._editor.buffers, *(str(from_fs_path(str(path))) for path in paths)}
        }
        provider = self._editor.capabilities.semantic_tokens_provider
        return Answers(texts, self._shown_path, None if provider is None else provider.legend)

    def _shown_path(self, uri: str) -> str:
        path = None if uri.startswith("untitled:") else path_of(uri)
        return path.relative_to(self._folder).as_posix() if path and path.is_relative_to(self._folder) else uri

    def _folder_of(self, uri: str) -> Path:
        return self._folder if uri.startswith("untitled:") else path_of(uri).parent

    def _cursor(self, path: str, body: str) -> tuple[types.TextDocumentIdentifier, types.Position]:
        return self._document(path), self._buffer(self._uri(path)).place_of(body.rstrip("\n")).start

    def _document(self, path: str) -> types.TextDocumentIdentifier:
        return types.TextDocumentIdentifier(self._uri(path))

    def _buffer(self, uri: str) -> Buffer:
        return self._editor.buffers.get(uri) or Buffer(self._disk_text(uri))

    def _disk_text(self, uri: str) -> str:
        return path_of(uri).read_bytes().decode()

    def _uri(self, path: str) -> str:
        return path if path.startswith("untitled:") else str(from_fs_path(str(self._path(path))))

    def _path(self, path: str) -> Path:
        return self._folder / path

    def _write(self, path: str, text: str) -> None:
        self._path(path).parent.mkdir(parents=True, exist_ok=True)
        self._path(path).write_bytes(text.encode())


def _overlap(one: types.Range, other: types.Range) -> bool:
    """Return whether two ranges have a position in common; their ends count."""
    start, end, other_start, other_end = (
        (position.line, position.character) for position in (one.start, one.end, other.start, other.end)
    )
    return start <= other_end and other_start <= end
