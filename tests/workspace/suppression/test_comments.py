"""Comments, compared with the comments that PyYAML's own scanner skips."""

from __future__ import annotations

import re
from typing import Any

import pytest
import yaml
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from yaml.composer import Composer
from yaml.constructor import SafeConstructor
from yaml.parser import Parser
from yaml.reader import Reader
from yaml.resolver import Resolver
from yaml.scanner import Scanner

from codra_dsl.workspace.suppression.comments import comments

COMMENT = re.compile(r"#[^\r\n]*")


class WatchedLoader(Reader, Scanner, Parser, Composer, SafeConstructor, Resolver):
    """PyYAML in Python; it records the comments that its scanner skips."""

    def __init__(self, text: str) -> None:
        Reader.__init__(self, text)
        Scanner.__init__(self)
        Parser.__init__(self)
        self.seen: set[tuple[int, int]] = set()
        self.text = text

    def note(self, start: int) -> None:
        self.seen |= {match.span() for match in COMMENT.finditer(self.text, start, self.index)}

    def scan_to_next_token(self) -> Any:
        start = self.index
        super().scan_to_next_token()
        self.note(start)

    def scan_block_scalar_ignored_line(self, start_mark: Any) -> Any:
        start = self.index
        super().scan_block_scalar_ignored_line(start_mark)
        self.note(start)


def expected(text: str) -> list[str]:
    loader = WatchedLoader(text)
    while loader.check_event():
        loader.get_event()
    return [text[start:end] for start, end in sorted(loader.seen)]


def comment_texts(text: str) -> list[str]:
    return [text[start:end] for start, end in comments(text)]


@pytest.mark.parametrize(
    ("text", "wanted"),
    [
        ("a: b # c\n", ["# c"]),
        ("# c\na: b#no\n", ["# c"]),
        ('a: "# no" # c\n', ["# c"]),
        ("a: 'it''s # no' # c\n", ["# c"]),
        ("a: it's # c\n", ["# c"]),
        ('a: "x\n  # no\n  y" # c\n', ["# c"]),
        ("a: |  # c\n  # no\n  x\n# d\nb: 1\n", ["# c", "# d"]),
        ("a: >-\n  # no\n\n # c\n\n# d", ["# c", "# d"]),
        ("a: [1, # c\n  '#', 2] # d\n", ["# c", "# d"]),
        ('a: ["x"]# c\n', ["# c"]),
        ("a: b\r\n# c\r\nd: 'e' # f\r\n", ["# c", "# f"]),
        ("äöü: '😀 # no' # c\n", ["# c"]),
        ("", []),
        ("# c", ["# c"]),
    ],
)
def test_comments_are_outside_of_scalars(text: str, wanted: list[str]) -> None:
    assert comment_texts(text) == wanted
    assert expected(text) == wanted


PIECES = st.sampled_from(
    [
        *("a", "b: ", "- ", "[", "]", "{", "}", ", ", ": ", "\n", "\n  ", "\n    ", " ", "# c", " # d", "#"),
        *("'", '"', "''", '\\"', "|", ">", "|2", ">-", "|\n", ">+\n", "x # y", "'# z'", '"# z"', "it's", "ä😀", "\r\n"),
        *("key: value # comment\n", "key: |  # head\n  # text\n", "- 'x' # c\n", "  # alone\n", "a: [b, # c\n  d]\n"),
    ]
)


@settings(max_examples=150)
@given(st.lists(PIECES, max_size=14).map("".join))
def test_comments_are_those_that_the_scanner_of_pyyaml_skips(text: str) -> None:
    try:
        wanted = expected(text)
        list(yaml.parse(text, Loader=yaml.CSafeLoader))
    except yaml.YAMLError:
        assume(False)

    assert comment_texts(text) == wanted


@settings(max_examples=75)
@given(st.lists(PIECES, max_size=14).map("".join), st.lists(PIECES, max_size=8).map("".join))
def test_comments_before_an_error_in_yaml_are_still_recognised(before: str, after: str) -> None:
    text = f"a: 1 # first\n{before}\n\x7f{after}"

    assert comment_texts(text)[:1] == ["# first"]
    assert all(part.startswith("#") for part in comment_texts(text))
