"""The texts of files, and the conversion of places between codra and clients.

Codra counts columns in code points from 1, and a byte order mark has no column. The protocol counts from 0 in units of
an encoding that the client chooses (UTF-16, UTF-8 or UTF-32), and a byte order mark is a character like any other. Both
break lines only at CRLF, CR and LF.
"""

from __future__ import annotations

import re
from bisect import bisect_left, bisect_right
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from itertools import accumulate
from pathlib import Path
from types import MappingProxyType
from typing import Any

from lsprotocol import types
from pygls import uris
from pygls.workspace import PositionCodec

from codra_dsl.language.diagnostics import Edit, Span
from codra_dsl.language.file_queries import MAX_SPEC_BYTES
from codra_dsl.regular_files import read_regular_file

_LINE_BREAK = re.compile(r"\r\n|\r|\n")
_PATH = re.compile(r"[\w.-]+(?:/[\w.-]+)*\.\w+")
_BYTE_ORDER_MARK = "\N{ZERO WIDTH NO-BREAK SPACE}"

Encoding = types.PositionEncodingKind | str
UTF16 = types.PositionEncodingKind.Utf16


@dataclass(frozen=True)
class Document:
    """The text of one file.

    Attributes:
        encoding: the unit of positions.
        uri: the URI of the file, as the client writes it.
        version: the version that the client has given to the text; None for the text of a file on disk.
    """

    text: str = field(repr=False)
    encoding: Encoding = UTF16
    uri: str = ""
    version: int | None = None

    @cached_property
    def line_starts(self) -> tuple[int, ...]:
        """The offset of the first character of each line."""
        return (0, *(line_break.end() for line_break in _LINE_BREAK.finditer(self.text)))

    @cached_property
    def data(self) -> bytes:
        """The content of the file. A lone surrogate, which no file can contain, gives bytes that are not UTF-8."""
        return self.text.encode("utf-8", "surrogatepass")

    @cached_property
    def _codec(self) -> PositionCodec:
        return PositionCodec(self.encoding)

    def _units(self, text: str) -> int:
        return len(text) if text.isascii() else self._codec.client_num_units(text)

    def line(self, number: int) -> str:
        """Return a line without its line break; the first line has the number 0."""
        start = self.line_starts[number]
        end = self.line_starts[number + 1] if number + 1 < len(self.line_starts) else len(self.text)
        return self.text[start:end].rstrip("\r\n")

    def offset_at(self, position: types.Position) -> int:
        """Return the offset of a position; after the end of a line or of the text, this end."""
        if position.line >= len(self.line_starts):
            return len(self.text)
        ends = list(accumulate(map(self._units, self.line(position.line))))
        return self.line_starts[position.line] + bisect_right(ends, position.character)

    def position_at(self, offset: int) -> types.Position:
        """Return the position of an offset."""
        line = bisect_right(self.line_starts, offset) - 1
        return types.Position(line, self._units(self.text[self.line_starts[line] : offset]))

    def offsets_of(self, span: Span) -> tuple[int, int]:
        """Return the range of a span as offsets; beyond the text, the end of the text."""
        return self._offset_of(span.line, span.column), self._offset_of(span.end_line, span.end_column)

    def _offset_of(self, line: int, column: int) -> int:
        if line > len(self.line_starts):
            return len(self.text)
        return min(self.line_starts[line - 1] + (self.mark_length if line == 1 else 0) + column - 1, len(self.text))

    @property
    def mark_length(self) -> int:
        """The length of the byte order mark: 1 or 0."""
        return int(self.text.startswith(_BYTE_ORDER_MARK))

    def span(self, file: str, start: int, end: int) -> Span:
        """Return the span of a range between two offsets; `file` is the name of the file."""
        first, last = (bisect_right(self.line_starts, offset) for offset in (start, end))
        columns = [offset - self._offset_of(line, 1) + 1 for line, offset in ((first, start), (last, end))]
        return Span(file, first, columns[0], last, columns[1])

    def range_between(self, start: int, end: int) -> types.Range:
        """Return the range between two offsets."""
        return types.Range(self.position_at(start), self.position_at(end))

    def path_at(self, offset: int) -> str:
        """Return the path around an offset; empty if there is none."""
        number = bisect_right(self.line_starts, offset) - 1
        column = offset - self.line_starts[number]
        paths = _PATH.finditer(self.line(number))
        return next((match[0] for match in paths if match.start() <= column <= match.end()), "")

    @property
    def line_break(self) -> str:
        """The first line break of the text."""
        match = _LINE_BREAK.search(self.text)
        return "\n" if match is None else match[0]

    def end_of_entry(self, offset: int) -> int:
        """Return the end of the YAML entry that begins at an offset: before the next line that is not indented more."""
        first = last = bisect_right(self.line_starts, offset) - 1
        indent = offset - self.line_starts[first]
        for number in range(first + 1, len(self.line_starts)):
            line = self.line(number)
            if line.strip() and len(line) - len(line.lstrip(" ")) <= indent:
                break
            last = number
        return self.line_starts[last] + len(self.line(last))

    def after(self, change: types.TextDocumentContentChangeEvent) -> Document:
        """Return the document after a change by the client."""
        if not isinstance(change, types.TextDocumentContentChangePartial):
            return replace(self, text=change.text)
        start, end = self.offset_at(change.range.start), self.offset_at(change.range.end)
        return replace(self, text=f"{self.text[:start]}{change.text}{self.text[max(start, end) :]}")


class Texts:
    """The texts of the files of a project: open documents, and files on disk, each of which is read once.

    Attributes:
        root: the folder to which the names of files are relative.
        opened: the open documents by file.
    """

    def __init__(
        self,
        root: Path,
        opened: Mapping[str, Document],
        encoding: Encoding = UTF16,
        known_uris: Mapping[str, str] = MappingProxyType({}),
    ) -> None:
        """Initialize. `known_uris` has the URIs of files that the client has named before."""
        self.root, self.opened = root, opened
        self._encoding, self._known_uris = encoding, known_uris
        self._documents = dict(opened)

    def document(self, file: str) -> Document:
        """Return the text of a file; an empty text if the file cannot be read."""
        if file not in self._documents:
            try:
                data = read_regular_file(self.root / file, MAX_SPEC_BYTES, within=self.root)
            except OSError:
                data = b""
            uri = self._known_uris.get(file) or uris.from_fs_path(str(self.root / file)) or ""
            self._documents[file] = Document(data.decode("utf-8", "replace"), self._encoding, uri)
        return self._documents[file]

    def location(self, file: str, start: int, end: int) -> types.Location:
        """Return the location of a range of a file's text."""
        document = self.document(file)
        return types.Location(document.uri, document.range_between(start, end))

    def location_of(self, span: Span) -> types.Location:
        """Return the location of a span."""
        return self.location(span.file, *self.document(span.file).offsets_of(span))

    def workspace_edit(self, edits: Iterable[Edit], *, has_versions: bool) -> types.WorkspaceEdit:
        """Return edits of files for the client.

        With versions, the client applies the edits only to the texts for which they were computed.
        """
        changes: dict[str, list[Any]] = {}
        for edit in edits:
            text = edit.text.replace("\n", self.document(edit.span.file).line_break)
            text_edit = types.TextEdit(self.location_of(edit.span).range, text)
            changes.setdefault(edit.span.file, []).append(text_edit)
        documents = {self.document(file): text_edits for file, text_edits in changes.items()}
        if not has_versions:
            return types.WorkspaceEdit({document.uri: text_edits for document, text_edits in documents.items()})
        identifier = types.OptionalVersionedTextDocumentIdentifier
        return types.WorkspaceEdit(
            document_changes=[
                types.TextDocumentEdit(identifier(document.uri, document.version), text_edits)
                for document, text_edits in documents.items()
            ]
        )


class Move:
    """Moves ranges from an earlier text to a later one.

    The texts agree up to the first change and after the last one. Ranges between them have no place in the later text.
    """

    def __init__(self, before: str, after: str) -> None:
        self._is_same = before == after
        limit = 0 if self._is_same else min(len(before), len(after))
        self._prefix = _agreement(limit, lambda n: before[:n] == after[:n])
        suffix = _agreement(limit - self._prefix, lambda n: before[-n:] == after[-n:])
        self._suffix_start = len(before) - suffix
        self._added = len(after) - len(before)

    def range(self, start: int, end: int) -> tuple[int, int] | None:
        """Return a range of the earlier text in the later text. A change must not even touch the range."""
        if self._is_same or end < self._prefix:
            return start, end
        return (start + self._added, end + self._added) if start > self._suffix_start else None


def _agreement(limit: int, agrees: Callable[[int], bool]) -> int:
    """Return the largest length up to a limit at which two texts agree, given that they agree at smaller lengths."""
    return bisect_left(range(1, limit + 1), True, key=lambda length: not agrees(length))
