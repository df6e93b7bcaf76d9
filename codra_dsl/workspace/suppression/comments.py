"""Find the comments of a text, above all in YAML: the contents of a scalar are text, even if they look like a comment.

PyYAML's events carry no comments, but they contain the start and end of scalars. Comments are between scalars, and
after the head of a block scalar.
"""

from __future__ import annotations

import re
from collections.abc import Iterator

import yaml

from codra_dsl.language.load.yaml.compose import Parser

_BETWEEN = re.compile(r"[&*!][^\s,\[\]{}]*|^%[^\s#]*(?:[ \t]+[^\s#][^\s]*)*|(?P<comment>#[^\r\n]*)", re.MULTILINE)
_AFTER_HEAD = re.compile(r"[|>][-+0-9]*[ \t]+(?P<comment>#[^\r\n]*)")
_UNREADABLE = re.compile(r"(?:^|(?<=\s))(?P<comment>#[^\r\n]*)", re.MULTILINE)


def comments(text: str) -> Iterator[tuple[int, int]]:
    """Yield the range of each comment, from `#` to the end of its line.

    If a text is not valid YAML, everything from the error on that follows blanks and `#` counts as a comment.
    """
    at = 0
    parser = Parser(text)
    try:
        while (event := parser.get_event()) is not None:
            if isinstance(event, yaml.ScalarEvent) and event.start_mark and event.end_mark:
                start, end = event.start_mark.index, event.end_mark.index
                yield from _comment_spans(_BETWEEN, text, at, start)
                if event.style in ("|", ">"):
                    start = max(text.find(event.style, start, end), start)  # after a tag or an anchor
                    head = _AFTER_HEAD.match(text, start, end)
                    yield from [head.span("comment")] if head else ()
                at = max(at, end)
    except yaml.YAMLError:
        yield from _comment_spans(_UNREADABLE, text, at, len(text))
        return
    finally:
        parser.dispose()
    yield from _comment_spans(_BETWEEN, text, at, len(text))


XML_START = "<!--"
XML_END = "-->"
_OPENING = re.compile(r"<!--|<!\[CDATA\[")


def xml_comments(text: str) -> Iterator[tuple[int, int]]:
    """Yield the range of each comment of an XML text that is on one line, without `-->`."""
    at = 0
    while (opening := _OPENING.search(text, at)) is not None:
        closing = XML_END if opening[0] == XML_START else "]]>"
        end = text.find(closing, opening.end())
        if end < 0:
            return  # an unclosed comment is not XML; the text is not searched twice
        if closing == XML_END and "\n" not in text[opening.start() : end]:
            yield opening.start(), end
        at = end + len(closing)


def _comment_spans(pattern: re.Pattern[str], text: str, start: int, end: int) -> Iterator[tuple[int, int]]:
    for match in pattern.finditer(text, start, end):
        if match["comment"] is not None:
            yield match.span("comment")
