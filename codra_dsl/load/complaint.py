"""A YAML parser's complaint, and what it comes to: why a text is no YAML, and how the rest can be read all the same."""

from __future__ import annotations

import re
from dataclasses import dataclass

from codra_dsl.load.traps import Trap

LOOK_AROUND = 2000
"""How many letters of a text are searched for what spoiled it."""

_LINE_BEFORE_COMMENT = re.compile(r"(?:(?!\s#)[^\r\n])*")


@dataclass(frozen=True, slots=True)
class Problem:
    """Why a text is no YAML.

    Attributes:
        start: with `end` the range to underline.
        blot: the range that must be blotted out so that the rest can be read; None where nothing helps.
        trap: the trap for conditions that it is; None for others.
        mend: where which text is missing, so that with it the file is read as it was meant; None where nobody knows.
    """

    rule: str
    message: str
    help: str
    start: int
    end: int
    blot: tuple[int, int] | None = None
    trap: Trap | None = None
    mend: tuple[int, str] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Complaint:
    """What the parser said: `at` is where it gave up, `begun` where what it was reading began."""

    text: str
    problem: str
    context: str
    at: int
    begun: int

    @property
    def letter(self) -> str:
        """The character that the parser stumbled over, or an empty text at the end."""
        return self.text[self.at : self.at + 1]

    @property
    def in_brackets(self) -> bool:
        """Whether it was reading something in brackets or braces."""
        return "flow" in self.context

    def before(self) -> str:
        """Return what stands before `at` on its line, at most LOOK_AROUND letters."""
        return self.text[max(line_start(self.text, self.at), self.at - LOOK_AROUND) : self.at]

    def line(self, offset: int) -> int:
        """Return the number of an offset's line."""
        return self.text.count("\n", 0, offset) + 1

    def value_end(self, start: int) -> int:
        """Return where the value ends that begins at `start`."""
        return end_in_brackets(self.text, start) if self.in_brackets else end_of_line(self.text, start)


def line_start(text: str, offset: int) -> int:
    """Return where the line begins that an offset stands in."""
    return max(text.rfind("\n", 0, offset), text.rfind("\r", 0, offset)) + 1


def end_of_line(text: str, start: int) -> int:
    """Return where a value ends that goes to the end of its line: before a comment and trailing blanks."""
    match = _LINE_BEFORE_COMMENT.match(text, start)
    return start + len(match[0].rstrip()) if match else start


def end_in_brackets(text: str, start: int) -> int:
    """Return where a condition in brackets ends: before the `,` or bracket that closes it, or with its line."""
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
