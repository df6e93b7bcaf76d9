"""Edit the bytes of a file. Bytes that no edit covers stay the same."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from itertools import pairwise

from codra_dsl.language.diagnostics import Edit
from codra_dsl.language.frozen import dataclass

_BYTE_ORDER_MARK = "\N{ZERO WIDTH NO-BREAK SPACE}"
_LINE_BREAK = re.compile(r"\r\n|\r|\n")


@dataclass(frozen=True, slots=True, order=True)
class Splice:
    """A range of a text, in code points, and the text that replaces it."""

    start: int
    end: int
    text: str

    def conflicts_with(self, other: Splice) -> bool:
        """Return whether two splices overlap or insert at the same place."""
        if self.start == self.end or other.start == other.end:
            return self.start <= other.end and other.start <= self.end
        return self.start < other.end and other.start < self.end


@dataclass(frozen=True, slots=True)
class EditableText:
    """A file's text, in which findings give places by line and column. A byte order mark is not part of a line.

    Attributes:
        line_starts: the offset of the first character of each line.
        line_break: the line break of the first line; the text of edits gets the same line breaks.
    """

    text: str
    line_starts: tuple[int, ...]
    line_break: str

    def splice(self, edit: Edit) -> Splice | None:
        """Return the range of an edit; None if the text has no such range."""
        start = self._offset(edit.span.line, edit.span.column)
        end = self._offset(edit.span.end_line, edit.span.end_column)
        if start is None or end is None or end < start:
            return None
        return Splice(start, end, edit.text.replace("\n", self.line_break))

    def _offset(self, line: int, column: int) -> int | None:
        if not 1 <= line <= len(self.line_starts) or column < 1:
            return None
        end = self.line_starts[line] if line < len(self.line_starts) else len(self.text)
        offset = self.line_starts[line - 1] + column - 1
        return offset if offset <= end else None

    def apply(self, splices: Iterable[Splice]) -> bytes:
        """Return the file's bytes after splices that do not overlap."""
        pieces: list[str] = []
        position = 0
        for splice in sorted(splices):
            pieces += [self.text[position : splice.start], splice.text]
            position = splice.end
        return "".join([*pieces, self.text[position:]]).encode()


def editable_text(data: bytes) -> EditableText | None:
    """Return a file's bytes as an editable text; None if they are not UTF-8."""
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError:
        return None
    text_start = len(_BYTE_ORDER_MARK) if text.startswith(_BYTE_ORDER_MARK) else 0
    line_breaks = list(_LINE_BREAK.finditer(text))
    line_starts = (text_start, *(line_break.end() for line_break in line_breaks))
    return EditableText(text, line_starts, line_breaks[0][0] if line_breaks else "\n")


def splices_of(edits: Sequence[Edit], text: EditableText) -> tuple[Splice, ...] | None:
    """Return the ranges of edits of one file; None if the text lacks one of them, or if two of them overlap."""
    optional_splices = [text.splice(edit) for edit in edits]
    splices = sorted(splice for splice in optional_splices if splice is not None)
    if len(splices) < len(edits):
        return None
    has_overlap = any(first.conflicts_with(second) for first, second in pairwise(splices))
    return None if has_overlap else tuple(splices)
