"""Find the positions of a scalar's letters in the file, even with quotes, escapes, folded lines and parameters."""

from __future__ import annotations

from codra_dsl.language.load.yaml.nodes import LetterRuns, ScalarNode, Style

_BLANKS = " \t\r\n"
_ESCAPE_WIDTHS = {"x": 4, "u": 6, "U": 10}


def letter_runs(node: ScalarNode, text: str) -> LetterRuns:
    """Return the positions of a scalar's letters in its file's text; empty if they cannot be matched."""
    if node.filled_text is not None:
        return node.filled_text.letters()
    if node.style is Style.PLAIN and node.end - node.start == len(node.text):
        return ((0, node.start, 1),)
    if node.style in (Style.SINGLE_QUOTED, Style.DOUBLE_QUOTED):
        if node.end - node.start - 2 == len(node.text):
            return ((0, node.start + 1, 1),)
        return _align(node, text, node.start + 1, node.end - 1)
    start = node.start if node.style is Style.PLAIN else text.find("\n", node.start, node.end) + 1
    return _align(node, text, start, node.end)


def cut(letters: LetterRuns, start: int, end: int, offset: int) -> LetterRuns:
    """Return the positions of the letters [start, end) of a text, for another text in which they begin at `offset`."""
    runs: list[tuple[int, int, int]] = []
    for index, (first, position, width) in enumerate(letters):
        after = letters[index + 1][0] if index + 1 < len(letters) else end
        begin = max(first, start)
        if begin < min(after, end):
            moved = position + begin - first if width == 1 else position
            runs.append((begin - start + offset, moved, width))
    return tuple(runs)


def _align(node: ScalarNode, text: str, start: int, end: int) -> LetterRuns:
    """Match a scalar with its written form letter by letter; only blanks may differ."""
    runs: list[tuple[int, int, int]] = []
    position = start
    for offset, letter in enumerate(node.text):
        if letter in _BLANKS:
            position = _skip_blank(node, text, position, end)
            continue
        while position < end and (text[position] in _BLANKS or _is_line_continued(node, text, position)):
            position += 1
        width = _width(node, text, position)
        if position >= end or (width == 1 and text[position] != letter):
            return ()
        if not runs or width != 1 or runs[-1][2] != 1 or runs[-1][1] + offset - runs[-1][0] != position:
            runs.append((offset, position, width))
        position += width
    return tuple(runs)


def _skip_blank(node: ScalarNode, text: str, position: int, end: int) -> int:
    if (
        position < end
        and text[position] == "\\"
        and node.style is Style.DOUBLE_QUOTED
        and not _is_line_continued(node, text, position)
    ):
        return position + _width(node, text, position)
    return position + 1 if position < end and text[position] in " \t" else position


def _is_line_continued(node: ScalarNode, text: str, at: int) -> bool:
    return node.style is Style.DOUBLE_QUOTED and text[at : at + 1] == "\\" and text[at + 1 : at + 2] in ("\r", "\n")


def _width(node: ScalarNode, text: str, at: int) -> int:
    """Return how many letters in the file, from `at` on, represent one letter of the scalar."""
    if node.style is Style.SINGLE_QUOTED:
        return 2 if text[at : at + 2] == "''" else 1
    if node.style is Style.DOUBLE_QUOTED and text[at : at + 1] == "\\":
        return _ESCAPE_WIDTHS.get(text[at + 1 : at + 2], 2)
    return 1
