"""What a YAML parser's complaint means, in words for readers of specs, with the range of text that spoils the file.

Where a trap for conditions makes a file unreadable, the range that it spoils is told, so that the rest can be read
with that range blotted out.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass

from yaml import MarkedYAMLError, YAMLError

from codra_dsl.expression.tokens import shown
from codra_dsl.load.traps import (
    Openings,
    Trap,
    cut_off_by_comment,
    read_as_block,
    read_as_quoted,
    read_as_tag,
    torn_at_colon,
    torn_at_comma,
)

_LOOK_AROUND = 2000
"""How many letters of a text are searched for what spoiled it."""

_QUOTED_BEFORE = re.compile(r"""(?<![^\s\[{,])(?P<quoted>"(?:[^"\\]|\\.)*"|'(?:[^']|'')*')[ \t]*$""")
_KEY_BEFORE = re.compile(r"""(?<![^\s{,\[])(?:"[^"]*"|'[^']*'|[^\s"'#{,\[][^#{,\[]*?):[ \t]+(?=\S)""")
_HIDDEN_BRACKET = re.compile(
    r"(?:[\[{,]|:[ \t])[ \t]*(?P<value>(?:(?!:[ \t])[^\[{,\r\n#])*?[ \t]#[^\r\n]*?)[\]}][\]}, \t]*$", re.MULTILINE
)
_LINE_BEFORE_COMMENT = re.compile(r"(?:(?!\s#)[^\r\n])*")
_MAX_PIECES = 50
_PIECE_BEGINS = re.compile(r"(?:[\[{,]|:[ \t])[ \t]*")
_WORD = re.compile(r"[^\s,\[\]{}:]+")


@dataclass(frozen=True, slots=True)
class Problem:
    """Why a text is no YAML.

    Attributes:
        start: with `end` the range to underline.
        blot: the range that must be blotted out so that the rest can be read; None where nothing helps.
    """

    rule: str
    message: str
    help: str
    start: int
    end: int
    blot: tuple[int, int] | None = None


def explain(text: str, error: YAMLError) -> Problem:
    """Return what a parser's complaint about a text means."""
    at, begun = _offset(error, "problem_mark", text), _offset(error, "context_mark", text)
    at = len(text) if at is None else at
    complaint = _Complaint(
        text=text,
        problem=str(getattr(error, "problem", None) or "it cannot be read"),
        context=str(getattr(error, "context", None) or ""),
        at=at,
        begun=at if begun is None else begun,
    )
    found = (recognise(complaint) for recognise in _TRAPS)
    return next((problem for problem in found if problem is not None), None) or _plain(complaint)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Complaint:
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
        """Return what stands before `at` on its line, at most _LOOK_AROUND letters."""
        line = max(self.text.rfind("\n", 0, self.at), self.text.rfind("\r", 0, self.at)) + 1
        return self.text[max(line, self.at - _LOOK_AROUND) : self.at]

    def line(self, offset: int) -> int:
        """Return the number of an offset's line."""
        return self.text.count("\n", 0, offset) + 1

    def value_end(self, start: int) -> int:
        """Return where the value ends that begins at `start`."""
        return _end_in_brackets(self.text, start) if self.in_brackets else _end_of_line(self.text, start)


def _offset(error: YAMLError, name: str, text: str) -> int | None:
    mark = getattr(error, name, None) if isinstance(error, MarkedYAMLError) else None
    return None if mark is None else min(int(mark.index), len(text))


def _end_of_line(text: str, start: int) -> int:
    """Return where a value ends that goes to the end of its line: before a comment and trailing blanks."""
    match = _LINE_BEFORE_COMMENT.match(text, start)
    return start + len(match[0].rstrip()) if match else start


def _end_in_brackets(text: str, start: int) -> int:
    """Return where a condition in brackets ends: before the `,` or bracket that closes it, or with its line."""
    depth, quote, end = 0, "", _end_of_line(text, start)
    for offset in range(start, end):
        letter = text[offset]
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'":
            quote = letter
        elif letter in "()":
            depth += 1 if letter == "(" else -1
        elif letter in "]}" or (letter == "," and depth <= 0):
            return start + len(text[start:offset].rstrip())
    return end


def _trapped(trap: Trap, start: int, end: int) -> Problem | None:
    return Problem(trap.rule, trap.message, trap.help, start, end, (start, end)) if end > start else None


def _block_head(complaint: _Complaint) -> Problem | None:
    """Recognise `x: > 3`."""
    text, begun, at = complaint.text, complaint.begun, complaint.at
    if "block scalar" in complaint.context and text[begun : begun + 1] in (">", "|"):
        end = _end_of_line(text, begun)
        return _trapped(read_as_block(text[begun:end]), begun, end)
    if "start any token" in complaint.problem and complaint.letter in (">", "|"):
        end = _end_in_brackets(text, at)
        return _trapped(read_as_block(text[at:end]), at, end)
    return None


def _negation(complaint: _Complaint) -> Problem | None:
    """Recognise `{x: !known(y)}`."""
    text, start = complaint.text, complaint.begun
    if text[start : start + 1] != "!" or "tag" not in complaint.context:
        return None
    end = _end_in_brackets(text, start)
    return _trapped(read_as_tag(text[start:end], ""), start, end)


def _hidden_bracket(complaint: _Complaint) -> Problem | None:
    """Recognise `[x # y]`: the bracket that closes the list stands in a comment."""
    if not complaint.in_brackets:
        return None
    hidden = _HIDDEN_BRACKET.search(complaint.text, complaint.begun, complaint.begun + _LOOK_AROUND)
    if hidden is None or hidden.start() > complaint.at:
        return None
    value = hidden["value"].rstrip()
    return _trapped(cut_off_by_comment(value), hidden.start("value"), hidden.start("value") + len(value))


def _quoted_beginning(complaint: _Complaint) -> Problem | None:
    """Recognise `"open" if x else "closed"`."""
    before = complaint.before()
    first = _QUOTED_BEFORE.search(before)
    if first is None or not complaint.letter.strip() or complaint.letter in ",:]}#":
        return None
    start = complaint.at - len(before) + first.start("quoted")
    torn = _torn_before(complaint, start) if complaint.in_brackets else None
    if torn is not None:
        end = _end_in_brackets(complaint.text, torn)
        return _trapped(torn_at_comma(complaint.text[torn:end]), torn, end)
    end = complaint.value_end(start)
    trap = read_as_quoted(first["quoted"], complaint.text[complaint.at : end], complaint.text[start:end])
    return _trapped(trap, start, end)


def _torn_before(complaint: _Complaint, start: int) -> int | None:
    """Return where the condition begins that a comma before `start` tears apart; None where there is none."""
    text = complaint.text
    pieces = _PIECE_BEGINS.finditer(text, max(complaint.begun, start - _LOOK_AROUND), start)
    begins = [piece.end() for piece in pieces][-_MAX_PIECES:-1]
    return next((begin for begin in reversed(begins) if Openings(text[begin:start]).are_left), None)


def _second_colon(complaint: _Complaint) -> Problem | None:
    """Recognise `x: a: b`."""
    before = complaint.before()
    keys = list(_KEY_BEFORE.finditer(before))
    refused = "mapping values are not allowed" in complaint.problem
    if not keys or not (refused or (complaint.in_brackets and complaint.letter == ":")):
        return None
    start = complaint.at - len(before) + keys[-1].end()
    end = complaint.value_end(start)
    return _trapped(torn_at_colon(complaint.text[start:end]), start, end)


_TRAPS: tuple[Callable[[_Complaint], Problem | None], ...] = (
    _block_head,
    _negation,
    _hidden_bracket,
    _quoted_beginning,
    _second_colon,
)

_DIRECTIVE = "directives are not part of this language"
_ESCAPE = r"write \\ for a backslash, or use single quotes"
_MEANINGS: tuple[tuple[str, str, str, str], ...] = (
    ("directive", "directive", _DIRECTIVE, "remove this line; quote a text that begins with '%'"),
    ("YAML document", "directive", _DIRECTIVE, "remove the line that begins with '%'"),
    ("tag", "tag", "tags are not part of this language", "quote a text that begins with '!'"),
    ("an alias", "anchor", "aliases are not part of this language", "quote a text that begins with '*'"),
    ("an anchor", "anchor", "anchors are not part of this language", "quote a text that begins with '&'"),
    (
        "mapping values are not allowed",
        "yaml-syntax",
        "a ':' stands where no key can stand",
        "check the indentation; quote a text that holds ': '",
    ),
    (
        "mapping keys are not allowed",
        "yaml-syntax",
        "a '?' stands where no key can stand",
        "quote a text that begins with '?'",
    ),
    (
        "block sequence entries are not allowed",
        "yaml-syntax",
        "no list can begin here",
        "begin a list on a line of its own; quote a text that begins with '- '",
    ),
    (
        "expected ',' or ']'",
        "yaml-syntax",
        "the list that '[' begins on line {line} does not go on with {letter}",
        "write ',' between items and ']' after the last; quote texts that hold brackets or quotes",
    ),
    (
        "expected ',' or '}'",
        "yaml-syntax",
        "the mapping that '{{' begins on line {line} does not go on with {letter}",
        "write ',' between entries and '}' after the last; quote texts that hold brackets or quotes",
    ),
    (
        "'-' indicator",
        "yaml-syntax",
        "this does not fit the list that begins on line {line}",
        "begin every item with '- ' in the same column; quote a text with quotes in it as a whole",
    ),
    (
        "did not find expected key",
        "yaml-syntax",
        "this does not fit the mapping that begins on line {line}",
        "indent the keys of a mapping alike; quote a text with quotes in it as a whole",
    ),
    ("simple key", "yaml-syntax", "a key has no ':'", "write 'key: value'; check the indentation"),
    ("start any token", "yaml-syntax", "no value begins with {letter}", "put the value in quotes"),
    ("escape", "yaml-syntax", "double quotes know no such escape", _ESCAPE),
    ("hexdecimal", "yaml-syntax", "double quotes know no such escape", _ESCAPE),
    (
        "expected node content",
        "yaml-syntax",
        "a value is missing before {letter}",
        "write a value; quote a text that begins so",
    ),
    (
        "document start",
        "yaml-syntax",
        "the document has ended before this",
        "remove what follows, or check its indentation",
    ),
)


def _plain(complaint: _Complaint) -> Problem:
    """Return the finding for a complaint that is no trap."""
    problem, at, begun = complaint.problem, complaint.at, complaint.begun
    if "tab" in problem or (complaint.letter == "\t" and not complaint.before().strip()):
        return Problem("yaml-syntax", "a tab indents this line", "indent with blanks", at, at + 1)
    if "end of stream" in problem and "quoted" in complaint.context:
        message = "the quote that is opened here is never closed"
        return Problem("yaml-syntax", message, "close it with the same quote", begun, begun + 1)
    if complaint.in_brackets and not complaint.text[at:].strip():
        bracket = complaint.text[begun : begun + 1]
        way_out = f"add {shown('}' if bracket == '{' else ']')} where it ends"
        return Problem("yaml-syntax", f"the {shown(bracket)} here is never closed", way_out, begun, begun + 1)
    word = _WORD.match(complaint.text, at)
    end = word.end() if word else min(at + 1, len(complaint.text))
    letter = shown(complaint.letter) if complaint.letter.strip() else "the end of the line"
    for words, rule, message, way_out in _MEANINGS:
        if words in problem or words in complaint.context:
            return Problem(rule, message.format(letter=letter, line=complaint.line(begun)), way_out, at, end)
    return Problem("yaml-syntax", f"this is no YAML: {problem}", "check quotes, brackets and indentation", at, end)
