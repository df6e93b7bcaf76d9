"""Edits on bytes: bytes that no edit covers stay the same."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.language.diagnostics import Edit, Span
from codra_dsl.workspace.suppression.edits import editable_text, splices_of

LETTERS = st.sampled_from(["a", "b", "\t", " ", "ä", "😀", "\n", "\r\n", "\r"])
TEXTS = st.lists(LETTERS, max_size=20).map("".join)


def position(text: str, offset: int) -> tuple[int, int]:
    """Return line and column of an offset, by counting; a line ends with LF, CR or CR LF."""
    line, column = 1, 1
    for index, letter in enumerate(text[:offset]):
        ends = letter == "\n" or (letter == "\r" and text[index + 1 : index + 2] != "\n")
        line, column = (line + 1, 1) if ends else (line, column + 1)
    return line, column


def edit(text: str, start: int, end: int, new: str) -> Edit:
    return Edit(Span("f", *position(text, start), *position(text, end)), new)


@given(TEXTS, st.data(), st.booleans())
def test_only_edited_ranges_change(text: str, data: st.DataObject, has_mark: bool) -> None:
    cuts = sorted(
        data.draw(
            st.lists(st.integers(0, len(text)), min_size=2, max_size=6, unique=True).filter(
                lambda offsets: len(offsets) % 2 == 0
            )
        )
        if len(text) > 1
        else []
    )
    inside = [at for at in cuts if not (text[at - 1 : at] == "\r" and text[at : at + 1] == "\n")]
    pairs = list(zip(inside[::2], inside[1::2], strict=False))
    mark = "\N{ZERO WIDTH NO-BREAK SPACE}" if has_mark else ""
    before = editable_text((mark + text).encode())
    assert before is not None

    splices = splices_of([edit(text, start, end, "NEW") for start, end in pairs], before)

    expected, at = mark, 0
    for start, end in pairs:
        expected += f"{text[at:start]}NEW"
        at = end
    assert splices is not None
    assert before.apply(splices) == (expected + text[at:]).encode()


def test_added_lines_end_as_the_first_line_does() -> None:
    text = editable_text(b"a\r\nb\n")
    assert text is not None

    splices = splices_of([Edit(Span("f", 1, 1, 1, 1), "codra: 1\n")], text)

    assert text.apply(splices or ()) == b"codra: 1\r\na\r\nb\n"


def test_overlapping_edits_are_refused() -> None:
    text = editable_text(b"abcdef\n")
    assert text is not None

    def at(start: int, end: int) -> Edit:
        return Edit(Span("f", 1, start, 1, end), "x")

    assert splices_of([at(1, 3), at(2, 4)], text) is None
    assert splices_of([at(2, 2), at(2, 2)], text) is None
    assert splices_of([at(1, 3), at(3, 3)], text) is None
    assert splices_of([at(1, 3), at(3, 5)], text) is not None


def test_edits_beyond_the_text_are_refused() -> None:
    text = editable_text(b"ab\ncd")
    assert text is not None

    assert splices_of([Edit(Span("f", 1, 5, 1, 6), "")], text) is None
    assert splices_of([Edit(Span("f", 3, 1, 3, 1), "")], text) is None
    assert splices_of([Edit(Span("f", 2, 2, 1, 1), "")], text) is None
    assert splices_of([Edit(Span("f", 2, 3, 2, 3), "")], text) is not None


def test_bytes_that_are_not_utf_8_cannot_be_edited() -> None:
    assert editable_text(b"\xff\xfe") is None
