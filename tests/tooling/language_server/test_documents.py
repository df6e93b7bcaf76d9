"""Positions in every encoding, changes by the client, and ranges after changes."""

from __future__ import annotations

import io

from hypothesis import given
from hypothesis import strategies as st
from lsprotocol import types

from codra_dsl.language.diagnostics import Span
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.source import accept
from codra_dsl.tooling.language_server.documents import Document, Encoding, Move

ENCODINGS: tuple[tuple[Encoding, str, int], ...] = (
    (types.PositionEncodingKind.Utf8, "utf-8", 1),
    (types.PositionEncodingKind.Utf16, "utf-16-le", 2),
    (types.PositionEncodingKind.Utf32, "utf-32-le", 4),
)
_texts = st.text(alphabet="ab: \t\r\n\u00e9\u4e16\U0001f600\ufeff\u2028\x0c", max_size=30)


def lines_of(text: str) -> list[str]:
    """Return the lines of a text with their line breaks; the last line has none."""
    lines = [*io.StringIO(text, newline="")]
    return lines if lines and not lines[-1].endswith(("\r", "\n")) else [*lines, ""]


@given(_texts, st.sampled_from(ENCODINGS), st.data())
def test_a_position_has_the_units_of_the_text_before_it_on_its_line(
    text: str, encoding: tuple[Encoding, str, int], data: st.DataObject
) -> None:
    kind, codec, unit_bytes = encoding
    lines = lines_of(text)
    number = data.draw(st.integers(0, len(lines) - 1))
    column = data.draw(st.integers(0, len(lines[number].rstrip("\r\n"))))
    offset = sum(map(len, lines[:number])) + column
    position = types.Position(number, len(lines[number][:column].encode(codec)) // unit_bytes)
    document = Document(text, kind)

    assert document.position_at(offset) == position
    assert document.offset_at(position) == offset


def test_a_position_after_the_end_of_a_line_or_text_is_its_end() -> None:
    document = Document("ab\r\n\U0001f600")

    assert document.offset_at(types.Position(0, 9)) == 2
    assert document.offset_at(types.Position(1, 1)) == 4  # within the two units of one character
    assert document.offset_at(types.Position(1, 9)) == 5
    assert document.offset_at(types.Position(7, 0)) == 5


@given(st.sampled_from(("", "\ufeff")), st.text(alphabet="a \r\n\u00e9\U0001f600", max_size=20), st.data())
def test_a_span_of_the_compiler_is_the_same_text_in_the_document(mark: str, text: str, data: st.DataObject) -> None:
    source = accept(mark + text, "a.yaml", Findings())
    assert source is not None
    start = data.draw(st.integers(0, len(text)))
    end = data.draw(st.integers(start, len(text)))
    document = Document(mark + text)
    first, last = document.offsets_of(source.span(start, end))

    assert document.text[first:last] == text[start:end]
    assert document.offsets_of(document.span("a.yaml", first, last)) == (first, last)


def test_a_span_beyond_the_text_is_its_end() -> None:
    assert Document("ab").offsets_of(Span("a.yaml", 7, 1, 9, 3)) == (2, 2)


@given(_texts, _texts, st.sampled_from(ENCODINGS), st.data())
def test_a_change_replaces_its_range(
    text: str, new_text: str, encoding: tuple[Encoding, str, int], data: st.DataObject
) -> None:
    document = Document(text, encoding[0])
    offsets = [offset for offset in range(len(text) + 1) if text[offset - 1 : offset + 1] != "\r\n"]
    start, end = sorted(data.draw(st.lists(st.sampled_from(offsets), min_size=2, max_size=2)))
    change = types.TextDocumentContentChangePartial(document.range_between(start, end), new_text)

    assert document.after(change).text == text[:start] + new_text + text[end:]
    assert document.after(types.TextDocumentContentChangeWholeDocument(new_text)).text == new_text


@given(st.text("ab\n", max_size=20), st.text("ab\n", max_size=20), st.data())
def test_a_moved_range_has_the_same_text_and_the_same_neighbours(before: str, after: str, data: st.DataObject) -> None:
    start = data.draw(st.integers(0, len(before)))
    end = data.draw(st.integers(start, len(before)))
    moved = Move(before, after).range(start, end)

    if before == after:
        assert moved == (start, end)
    elif moved is not None:
        assert after[moved[0] : moved[1]] == before[start:end]
        assert (moved == (start, end) and after[end : end + 1] == before[end : end + 1]) or (
            after[moved[0] - 1] == before[start - 1]
        )


def test_a_range_that_a_change_touches_has_no_place() -> None:
    assert Move("a door b", "a door_x b").range(2, 6) is None
    assert Move("a door b", "a xdoor b").range(2, 6) is None
    assert Move("a door b", "a  door b").range(2, 6) is None
    assert Move("a door b", "ab door b").range(2, 6) == (3, 7)
    assert Move("a door b", "a door c").range(2, 6) == (2, 6)
