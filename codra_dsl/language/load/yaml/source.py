"""Bytes -> text with line numbers. Refuses unreadable text before the YAML parser sees it."""

from __future__ import annotations

import re
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import field
from itertools import accumulate
from pathlib import Path
from types import MappingProxyType

from codra_dsl.language.diagnostics import Place, Span
from codra_dsl.language.file_queries import MAX_SPEC_BYTES, read_file
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.regular_files import OutsideError, TooLargeError, UnsuitableFileError

MAX_BYTES = MAX_SPEC_BYTES
"""The maximum size of a file."""

_BYTE_ORDER_MARK = "\N{ZERO WIDTH NO-BREAK SPACE}"
_REFUSED_CHARACTER = re.compile("[\x00-\x08\x0b\x0c\x0e-\x1f\x7f-\x9f\u2028\u2029\ufeff\ufffe\uffff\ud800-\udfff]")
_UTF16_AND_UTF32_MARKS = (b"\xff\xfe", b"\xfe\xff", b"\x00\x00\xfe\xff")


@dataclass(frozen=True, slots=True)
class Source:
    """The text of one file.

    Attributes:
        file: the path relative to the project root, with `/`; `-` for standard input.
        line_starts: the offset of each line's first character, in code points.
    """

    file: str
    text: str = field(repr=False)
    line_starts: tuple[int, ...] = field(repr=False)

    def span(self, start: int, end: int) -> Span:
        """Return the span of a range of the text."""
        line_starts = self.line_starts
        line = bisect_right(line_starts, start)
        if line == len(line_starts) or end <= line_starts[line]:
            begin = line_starts[line - 1]
            return Span(self.file, line, start - begin + 1, line, end - begin + 1)
        last_line = bisect_right(line_starts, end)
        return Span(self.file, line, start - line_starts[line - 1] + 1, last_line, end - line_starts[last_line - 1] + 1)

    def place(self, start: int, end: int) -> Place:
        """Return the place of a range of the text, outside of any use of a template."""
        return Place(self.span(start, end))

    def line_end(self, offset: int) -> int:
        """Return the offset of the line break after an offset, or of the text's end."""
        line = bisect_right(self.line_starts, offset)
        end = self.line_starts[line] if line < len(self.line_starts) else len(self.text)
        while end > offset and self.text[end - 1] in "\r\n":
            end -= 1
        return end


def file_place(file: str) -> Place:
    """Return the place of a complete file: its beginning."""
    return Place(Span(file, 1, 1, 1, 1))


AS_ON_DISK: Mapping[str, bytes] = MappingProxyType({})
"""An empty mapping, the default of `texts`: every file is read from disk."""


def read(
    path: Path, file: str, root: Path, findings: Findings, texts: Mapping[str, bytes] | None = AS_ON_DISK
) -> Source | None:
    """Return the text of a file, or None after a finding if it cannot be read as text.

    Args:
        path: the file.
        file: the path relative to the root, as findings show it.
        root: the folder of the project. A link that leads out of it is not followed.
        findings: where findings are added.
        texts: the contents of files that are not read from disk; None if the file is always read from disk.
    """
    try:
        data = read_file(path, MAX_BYTES, root, "" if texts is None else file, texts)
    except TooLargeError:
        _report_too_large(file, findings)
    except OutsideError:
        message = f"'{file}' is a link that leads out of the project"
        help_text = "copy the file into the project, or remove the link; only files of the project are read"
        findings.add("cannot-read", message, file_place(file), help=help_text)
    except UnsuitableFileError:
        help_text = "write the path of a regular file"
        findings.add("cannot-read", f"'{file}' is not a file", file_place(file), help=help_text)
    except OSError as error:
        message = f"cannot read '{file}': {error.strerror}"
        findings.add("cannot-read", message, file_place(file), help="check path and permissions")
    else:
        return decode(data, file, findings)
    return None


def _report_too_large(file: str, findings: Findings) -> None:
    message = f"'{file}' has more than {MAX_BYTES // 1024 // 1024} MiB"
    findings.add("file-too-large", message, file_place(file), help="split it into parts, or use templates")


def decode(data: bytes, file: str, findings: Findings) -> Source | None:
    """Return bytes as text, or None if there are too many bytes or they are not a text."""
    if len(data) > MAX_BYTES:
        _report_too_large(file, findings)
        return None
    try:
        text = data.decode("utf-8")
    except UnicodeDecodeError as error:
        _report_encoding(data, error.start, file, findings)
        return None
    return accept(text, file, findings)


def accept(text: str, file: str, findings: Findings) -> Source | None:
    """Return a text as a source, or None if it contains characters that are not allowed in a spec."""
    if text.startswith(_BYTE_ORDER_MARK):
        message = "the file begins with a byte order mark"
        findings.add("byte-order-mark", message, file_place(file), help="save it as UTF-8 without byte order mark")
        text = text[1:]
    source = Source(file, text, _line_starts(text))
    refused_match = _REFUSED_CHARACTER.search(text)
    if refused_match is None:
        return source
    findings.add(
        "control-character",
        f"the character U+{ord(refused_match[0]):04X} is invisible and not allowed",
        source.place(refused_match.start(), refused_match.end()),
        help="remove it; in a text in double quotes, write an escape such as \\n",
    )
    return None


def _line_starts(text: str) -> tuple[int, ...]:
    if "\r" in text:
        return (0, *(line_break.end() for line_break in re.finditer(r"\r\n|\r|\n", text)))
    return (0, *accumulate(len(line) + 1 for line in text.split("\n")[:-1]))


def _report_encoding(data: bytes, offset: int, file: str, findings: Findings) -> None:
    before = data[:offset].decode("utf-8")
    span = Source(file, before, _line_starts(before)).span(len(before), len(before))
    place = Place(Span(file, span.line, span.column, span.line, span.column + 1))
    if data.startswith(_UTF16_AND_UTF32_MARKS):
        message = "the file is UTF-16 or UTF-32, not UTF-8"
    else:
        message = f"the byte 0x{data[offset]:02x} is not valid UTF-8"
    findings.add("not-utf-8", message, place, help="save the file as UTF-8")
