"""Translate a YAML parser's error into a problem for authors of specs, with the range of text that causes it.

If a trap for conditions makes a file unreadable, the problem has the range to mask so that the rest can be read. If a
letter is missing, the problem has that letter, so that the rest can be read with it.
"""

from __future__ import annotations

import re
from collections.abc import Callable

from yaml import MarkedYAMLError, YAMLError

from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.yaml.parser_error import (
    LOOK_AROUND,
    ParserError,
    Problem,
    end_in_brackets,
    end_of_line,
    line_start,
)
from codra_dsl.language.load.yaml.repair import PUNCTUATION_MISTAKES, is_known_key
from codra_dsl.language.load.yaml.traps import (
    Openings,
    Trap,
    cut_off_by_comment,
    read_as_block,
    read_as_quoted,
    read_as_tag,
    torn_at_colon,
    torn_at_comma,
    torn_call,
    torn_condition,
    torn_mapping,
)

_QUOTED_BEFORE = re.compile(r"""(?<![^\s\[{,])(?P<quoted>"(?:[^"\\]|\\.)*"|'(?:[^']|'')*')[ \t]*$""")
_KEY_BEFORE = re.compile(r"""(?<![^\s{,\[])(?:"[^"]*"|'[^']*'|[^\s"'#{,\[][^#{,\[]*?):[ \t]+(?=\S)""")
_HIDDEN_BRACKET = re.compile(
    r"(?:[\[{,]|:[ \t])[ \t]*(?P<value>(?:(?!:[ \t])[^\[{,\r\n#])*?[ \t]#[^\r\n]*?)[\]}][\]}, \t]*$", re.MULTILINE
)
_KEY_AND_VALUE = re.compile(r"(?P<indent>[ ]*)(?:- )?[\w$()]+:[ \t]+[^\s{\[\"'|>&!#]")
_MAPPINGS = frozenset({"identifies", "returns", "with", "uses"})
_TEXTS = frozenset({"label", "description"})
_MAX_PIECES = 50
_PIECE_BEGINS = re.compile(r"(?:[\[{,]|:[ \t])[ \t]*")
_WORD = re.compile(r"[^\s,\[\]{}:]+")


def explain(text: str, error: YAMLError) -> Problem:
    """Return the problem behind a parser's error about a text."""
    at, begun = _offset(error, "problem_mark", text), _offset(error, "context_mark", text)
    at = len(text) if at is None else at
    complaint = ParserError(
        text=text,
        problem=str(getattr(error, "problem", None) or "it cannot be read"),
        context=str(getattr(error, "context", None) or ""),
        at=at,
        begun=at if begun is None else begun,
    )
    problems = (recognise(complaint) for recognise in _TRAPS)
    return next((problem for problem in problems if problem is not None), None) or _plain(complaint)


def _offset(error: YAMLError, name: str, text: str) -> int | None:
    mark = getattr(error, name, None) if isinstance(error, MarkedYAMLError) else None
    return None if mark is None else min(int(mark.index), len(text))


def _trapped(trap: Trap, start: int, end: int) -> Problem | None:
    return Problem(trap.rule, trap.message, trap.help, start, end, (start, end), trap) if end > start else None


def _block_head(complaint: ParserError) -> Problem | None:
    """Recognise `x: > 3`."""
    text, begun, at = complaint.text, complaint.begun, complaint.at
    if "block scalar" in complaint.context and text[begun : begun + 1] in (">", "|"):
        end = end_of_line(text, begun)
        return _trapped(read_as_block(text[begun:end]), begun, end)
    if "start any token" in complaint.problem and complaint.letter in (">", "|"):
        end = end_in_brackets(text, at)
        return _trapped(read_as_block(text[at:end]), at, end)
    return None


def _negation(complaint: ParserError) -> Problem | None:
    """Recognise `{x: !known(y)}`."""
    text, start = complaint.text, complaint.begun
    if text[start : start + 1] != "!" or "tag" not in complaint.context:
        return None
    end = end_in_brackets(text, start)
    return _trapped(read_as_tag(text[start:end], ""), start, end)


def _hidden_bracket(complaint: ParserError) -> Problem | None:
    """Recognise `[x # y]`: the bracket that closes the list is in a comment."""
    if not complaint.in_brackets:
        return None
    hidden = _HIDDEN_BRACKET.search(complaint.text, complaint.begun, complaint.begun + LOOK_AROUND)
    if hidden is None or hidden.start() > complaint.at:
        return None
    value = hidden["value"].rstrip()
    return _trapped(cut_off_by_comment(value), hidden.start("value"), hidden.start("value") + len(value))


def _quoted_beginning(complaint: ParserError) -> Problem | None:
    """Recognise `"open" if x else "closed"`."""
    before = complaint.before()
    first = _QUOTED_BEFORE.search(before)
    if first is None or not complaint.letter.strip() or complaint.letter in ",:]}#":
        return None
    start = complaint.at - len(before) + first.start("quoted")
    torn = _torn_before(complaint, start) if complaint.in_brackets else None
    if torn is not None:
        end = end_in_brackets(complaint.text, torn)
        return _trapped(torn_at_comma(complaint.text[torn:end]), torn, end)
    end = complaint.value_end(start)
    trap = read_as_quoted(first["quoted"], complaint.text[complaint.at : end], complaint.text[start:end])
    return _trapped(trap, start, end)


def _torn_before(complaint: ParserError, start: int) -> int | None:
    """Return the beginning of the condition that a comma before `start` splits, or None."""
    text = complaint.text
    pieces = _PIECE_BEGINS.finditer(text, max(complaint.begun, start - LOOK_AROUND), start)
    begins = [piece.end() for piece in pieces][-_MAX_PIECES:-1]
    return next((begin for begin in reversed(begins) if Openings(text[begin:start]).are_left), None)


def _second_colon(complaint: ParserError) -> Problem | None:
    """Recognise `x: a: b`."""
    before = complaint.before()
    keys = list(_KEY_BEFORE.finditer(before))
    refused = "mapping values are not allowed" in complaint.problem
    if not keys or not (refused or (complaint.in_brackets and complaint.letter == ":")):
        return None
    start = complaint.at - len(before) + keys[-1].end()
    end = complaint.value_end(start)
    key, written = keys[-1][0].rstrip(": \t"), complaint.text[start:end]
    if key == "call":
        trap = torn_call
    elif key in _MAPPINGS or (is_known_key(before[keys[-1].end() :].strip()) and key not in _TEXTS):
        trap = torn_mapping
    else:
        trap = torn_at_colon if key in _TEXTS else torn_condition
    return _trapped(trap(written), start, end)


_TRAPS: tuple[Callable[[ParserError], Problem | None], ...] = (
    _block_head,
    _negation,
    _hidden_bracket,
    *PUNCTUATION_MISTAKES,
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
        "a ':' is not allowed here, because no key can be here",
        "check the indentation; quote a text that contains ': '",
    ),
    (
        "mapping keys are not allowed",
        "yaml-syntax",
        "a '?' is not allowed here, because no key can be here",
        "quote a text that begins with '?'",
    ),
    (
        "block sequence entries are not allowed",
        "yaml-syntax",
        "a list cannot begin here",
        "begin a list on a line of its own; quote a text that begins with '- '",
    ),
    (
        "expected ',' or ']'",
        "yaml-syntax",
        "the list that '[' begins on line {line} cannot continue with {letter}",
        "write ',' between items and ']' after the last; quote texts that contain brackets or quotes",
    ),
    (
        "expected ',' or '}'",
        "yaml-syntax",
        "the mapping that '{{' begins on line {line} cannot continue with {letter}",
        "write ',' between entries and '}' after the last; quote texts that contain brackets or quotes",
    ),
    (
        "'-' indicator",
        "yaml-syntax",
        "this does not fit the list that begins on line {line}",
        "begin every item with '- ' in the same column; quote all of a text that contains quotes",
    ),
    (
        "did not find expected key",
        "yaml-syntax",
        "this does not fit the mapping that begins on line {line}",
        "indent the keys of a mapping alike; quote all of a text that contains quotes",
    ),
    ("simple key", "yaml-syntax", "a key has no ':'", "write 'key: value'; check the indentation"),
    ("start any token", "yaml-syntax", "a value cannot begin with {letter}", "put the value in quotes"),
    ("escape", "yaml-syntax", "double quotes do not support this escape", _ESCAPE),
    ("hexdecimal", "yaml-syntax", "double quotes do not support this escape", _ESCAPE),
    (
        "expected node content",
        "yaml-syntax",
        "a value is missing before {letter}",
        "write a value; quote a text that begins like this",
    ),
    (
        "document start",
        "yaml-syntax",
        "the document has ended before this",
        "remove the rest, or check its indentation",
    ),
)


def _is_misplaced_item(complaint: ParserError) -> bool:
    """Return whether `- ` begins a line at a column where no list has its items."""
    is_item = complaint.text.startswith(("- ", "-\t"), complaint.at) and not complaint.before().strip()
    return is_item and not complaint.in_brackets and "expected key" in complaint.problem


def _is_indented_further(complaint: ParserError) -> bool:
    """Return whether a key is indented deeper than the one on the line above, which has a value."""
    if "mapping values" not in complaint.problem:
        return False
    start = line_start(complaint.text, complaint.at)
    above = complaint.text[line_start(complaint.text, max(0, start - 1)) : max(0, start - 1)]
    pattern = re.compile(r"(?P<indent>[ ]*)(?:- )?[\w$()]+:?")
    here, there = pattern.fullmatch(complaint.before()), _KEY_AND_VALUE.match(above)
    return here is not None and there is not None and len(here["indent"]) > len(there["indent"])


def _plain(complaint: ParserError) -> Problem:
    """Return the problem of a parser error that is not a trap."""
    problem, at, begun = complaint.problem, complaint.at, complaint.begun
    if "tab" in problem or (complaint.letter == "\t" and not complaint.before().strip()):
        return Problem("yaml-syntax", "a tab indents this line", "indent with blanks", at, at + 1)
    if "end of stream" in problem and "quoted" in complaint.context:
        message = "the quote that is opened here is never closed"
        return Problem("yaml-syntax", message, "close it with the same quote", begun, begun + 1)
    if complaint.in_brackets and not complaint.text[at:].strip():
        bracket = complaint.text[begun : begun + 1]
        help_text = f"add {shown('}' if bracket == '{' else ']')} where it ends"
        return Problem("yaml-syntax", f"the {shown(bracket)} here is never closed", help_text, begun, begun + 1)
    if _is_misplaced_item(complaint):
        message = "this item does not belong to a list"
        help_text = "begin every '- ' of a list in the same column; keys of a mapping have no '- '"
        return Problem("yaml-syntax", message, help_text, at, at + 1)
    if _is_indented_further(complaint):
        start = at - len(complaint.before().lstrip())
        message = f"{shown(complaint.text[start:at])} is indented deeper than the key above, and reads as its value"
        return Problem("yaml-syntax", message, "indent the keys of a mapping alike", start, at)
    if complaint.letter in ("}", "]") and not complaint.in_brackets:
        return Problem("yaml-syntax", f"{shown(complaint.letter)} closes nothing", "remove it", at, at + 1)
    if complaint.letter == "," and "expected key" in problem:
        return Problem("yaml-syntax", "unexpected ',' after the end of a value", "remove it", at, at + 1)
    word = _WORD.match(complaint.text, at)
    end = word.end() if word else min(at + 1, len(complaint.text))
    letter = shown(complaint.letter) if complaint.letter.strip() else "the end of the line"
    for words, rule, message, help_text in _MEANINGS:
        if words in problem or words in complaint.context:
            return Problem(rule, message.format(letter=letter, line=complaint.line(begun)), help_text, at, end)
    return Problem(
        "yaml-syntax", f"this is not valid YAML: {problem}", "check quotes, brackets and indentation", at, end
    )
