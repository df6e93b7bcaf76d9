"""The parser of YAML, its error, and the problem behind it: why a text is invalid, and how the rest can be read."""

from __future__ import annotations

import re
from contextlib import suppress
from typing import Any

import yaml

from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.yaml.traps import Trap

Parser: Any = getattr(yaml, "CSafeLoader", yaml.SafeLoader)
"""Parses a text into events. Without libyaml, the parser is slower and gives the same result."""

LOOK_AROUND = 2000
"""The number of letters of a text that are searched for the cause of an error."""

_LINE_BEFORE_COMMENT = re.compile(r"(?:(?!\s#)[^\r\n])*")


@dataclass(frozen=True, slots=True)
class Problem:
    """Why a text is not valid YAML.

    Attributes:
        start: the beginning of the range to underline.
        end: the end of the range to underline.
        mask: the range to mask so that the rest can be read; None if masking does not help.
        trap: the trap for conditions that is the cause, if any.
        insertion: an offset and the text that is missing there. With this text, the file can be read as intended. None
            if the missing text is unknown.
    """

    rule: str
    message: str
    help: str
    start: int
    end: int
    mask: tuple[int, int] | None = None
    trap: Trap | None = None
    insertion: tuple[int, str] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ParserError:
    """A parser's error: the parser stopped at `offset`, and the text that it was reading begins at `context_start`."""

    text: str
    problem: str
    context: str
    offset: int
    context_start: int

    @property
    def letter(self) -> str:
        """The character at which the parser stopped, or an empty text at the end."""
        return self.text[self.offset : self.offset + 1]

    @property
    def in_brackets(self) -> bool:
        """Whether the parser was reading something in brackets or braces."""
        return "flow" in self.context

    def innermost_open_bracket(self) -> int:
        """Return the offset of the innermost bracket that is open where the parser stopped; `context_start` if none."""
        open_brackets: list[int] = []
        with suppress(yaml.YAMLError):
            for token in yaml.scan(self.text, Loader=Parser):
                if isinstance(token, (yaml.FlowSequenceStartToken, yaml.FlowMappingStartToken)):
                    open_brackets.append(token.start_mark.index)
                elif isinstance(token, (yaml.FlowSequenceEndToken, yaml.FlowMappingEndToken)):
                    del open_brackets[-1:]
        return (open_brackets or [self.context_start])[-1]

    def before(self) -> str:
        """Return the text before `offset` on its line, at most LOOK_AROUND letters."""
        return self.text[max(line_start(self.text, self.offset), self.offset - LOOK_AROUND) : self.offset]

    def line(self, offset: int) -> int:
        """Return the number of an offset's line."""
        return self.text.count("\n", 0, offset) + 1

    def value_end(self, start: int) -> int:
        """Return the end of the value that begins at `start`."""
        return end_in_brackets(self.text, start) if self.in_brackets else end_of_line(self.text, start)


def line_start(text: str, offset: int) -> int:
    """Return the beginning of an offset's line."""
    return max(text.rfind("\n", 0, offset), text.rfind("\r", 0, offset)) + 1


def end_of_line(text: str, start: int) -> int:
    """Return the end of a value that extends to the end of its line: before a comment and trailing blanks."""
    match = _LINE_BEFORE_COMMENT.match(text, start)
    return start + len(match[0].rstrip()) if match else start


def end_in_brackets(text: str, start: int) -> int:
    """Return the end of a condition in brackets: before the `,` or bracket that ends it, or at the end of its line."""
    depth, quote, end = 0, "", end_of_line(text, start)
    for offset in range(start, end):
        letter = text[offset]
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'" and not text[offset - 1 : offset].isalnum():
            quote = letter
        elif letter in "()":
            depth += 1 if letter == "(" else -1
        elif letter in "]}" or (letter == "," and depth <= 0):
            return start + len(text[start:offset].rstrip())
    return end
