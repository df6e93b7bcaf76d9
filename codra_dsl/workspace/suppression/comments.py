"""Find the comments in YAML and XML texts.

In YAML, the contents of a scalar are text, even if the contents look like a comment.
PyYAML does not report comments, but it reports the start and the end of each scalar. Comments are between scalars, and
after the head of a block scalar.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import yaml

from codra_dsl.language.load.yaml.parser_error import Parser

_COMMENT_BETWEEN_SCALARS = re.compile(
    r"[&*!][^\s,\[\]{}]*|^%[^\s#]*(?:[ \t]+[^\s#][^\s]*)*|(?P<comment>#[^\r\n]*)", re.MULTILINE
)
_COMMENT_AFTER_BLOCK_HEAD = re.compile(r"[|>][-+0-9]*[ \t]+(?P<comment>#[^\r\n]*)")
_COMMENT_IN_INVALID_TEXT = re.compile(r"(?:^|(?<=\s))(?P<comment>#[^\r\n]*)", re.MULTILINE)


def comments(text: str) -> Iterator[tuple[int, int]]:
    """Yield the range of each comment, from `#` to the end of its line.

    If a text is not valid YAML, scalars after the last scalar before the error are not known. There, each
    `#` at the beginning of a line or after a blank begins a comment.
    """
    position = 0
    parser = Parser(text)
    try:
        while (event := parser.get_event()) is not None:
            if isinstance(event, yaml.ScalarEvent) and event.start_mark and event.end_mark:
                start, end = event.start_mark.index, event.end_mark.index
                yield from _comment_spans(_COMMENT_BETWEEN_SCALARS, text, position, start)
                if event.style in ("|", ">"):
                    start = max(text.find(event.style, start, end), start)  # after a tag or an anchor
                    head_match = _COMMENT_AFTER_BLOCK_HEAD.match(text, start, end)
                    yield from [head_match.span("comment")] if head_match else ()
                position = max(position, end)
    except yaml.YAMLError:
        yield from _comment_spans(_COMMENT_IN_INVALID_TEXT, text, position, len(text))
        return
    finally:
        parser.dispose()
    yield from _comment_spans(_COMMENT_BETWEEN_SCALARS, text, position, len(text))


XML_START = "<!--"
XML_END = "-->"
_COMMENT_OR_CDATA_START = re.compile(r"<!--|<!\[CDATA\[")


def xml_comments(text: str) -> Iterator[tuple[int, int]]:
    """Yield the range of each comment in an XML text, without `-->`; comments of several lines are left out."""
    position = 0
    while (start_match := _COMMENT_OR_CDATA_START.search(text, position)) is not None:
        end_mark = XML_END if start_match[0] == XML_START else "]]>"
        end = text.find(end_mark, start_match.end())
        if end < 0:
            return  # an unclosed comment is not valid XML; the rest of the text is not searched
        if end_mark == XML_END and "\n" not in text[start_match.start() : end]:
            yield start_match.start(), end
        position = end + len(end_mark)


def _comment_spans(pattern: re.Pattern[str], text: str, start: int, end: int) -> Iterator[tuple[int, int]]:
    for match in pattern.finditer(text, start, end):
        if match["comment"] is not None:
            yield match.span("comment")
