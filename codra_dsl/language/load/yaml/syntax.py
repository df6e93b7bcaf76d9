"""Translate a YAML parser's error into a `Problem`: a message for authors of specs, with the text range of the error.

If YAML misreads a condition (see `traps.py`) and the file is therefore unreadable, the problem states the range of text
to mask. If text is missing, such as a bracket, the problem states this text. With the mask or the inserted text, the
rest of the file can be read.
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
from codra_dsl.language.load.yaml.repair import PUNCTUATION_RECOGNISERS, is_known_key
from codra_dsl.language.load.yaml.traps import (
    Openings,
    Trap,
    cut_off_by_comment_trap,
    read_as_block_trap,
    read_as_quoted_trap,
    read_as_tag_trap,
    torn_at_colon_trap,
    torn_at_comma_trap,
    torn_call_trap,
    torn_condition_trap,
    torn_mapping_trap,
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


def explain(text: str, yaml_error: YAMLError) -> Problem:
    """Return the problem behind a parser's error about a text."""
    offset, begin = _offset(yaml_error, "problem_mark", text), _offset(yaml_error, "context_mark", text)
    offset = len(text) if offset is None else offset
    error = ParserError(
        text=text,
        problem=str(getattr(yaml_error, "problem", None) or "it cannot be read"),
        context=str(getattr(yaml_error, "context", None) or ""),
        offset=offset,
        context_start=offset if begin is None else begin,
    )
    problems = (recognise(error) for recognise in _TRAPS)
    return next((problem for problem in problems if problem is not None), None) or _plain_problem(error)


def _offset(error: YAMLError, name: str, text: str) -> int | None:
    mark = getattr(error, name, None) if isinstance(error, MarkedYAMLError) else None
    return None if mark is None else min(int(mark.index), len(text))


def _trap_problem(trap: Trap, start: int, end: int) -> Problem | None:
    return Problem(trap.rule, trap.message, trap.help, start, end, (start, end), trap) if end > start else None


def _block_head(error: ParserError) -> Problem | None:
    """Recognise `x: > 3`."""
    text, begin, offset = error.text, error.context_start, error.offset
    if "block scalar" in error.context and text[begin : begin + 1] in (">", "|"):
        end = end_of_line(text, begin)
        return _trap_problem(read_as_block_trap(text[begin:end]), begin, end)
    if "start any token" in error.problem and error.letter in (">", "|"):
        end = end_in_brackets(text, offset)
        return _trap_problem(read_as_block_trap(text[offset:end]), offset, end)
    return None


def _negation(error: ParserError) -> Problem | None:
    """Recognise `{x: !known(y)}`."""
    text, start = error.text, error.context_start
    if text[start : start + 1] != "!" or "tag" not in error.context:
        return None
    end = end_in_brackets(text, start)
    return _trap_problem(read_as_tag_trap(text[start:end], ""), start, end)


def _hidden_bracket(error: ParserError) -> Problem | None:
    """Recognise `[x # y]`: the bracket that closes the list is in a comment."""
    if not error.in_brackets:
        return None
    comment_match = _HIDDEN_BRACKET.search(error.text, error.context_start, error.context_start + LOOK_AROUND)
    if comment_match is None or comment_match.start() > error.offset:
        return None
    value = comment_match["value"].rstrip()
    return _trap_problem(
        cut_off_by_comment_trap(value), comment_match.start("value"), comment_match.start("value") + len(value)
    )


def _quoted_beginning(error: ParserError) -> Problem | None:
    """Recognise `"open" if x else "closed"`."""
    before = error.before()
    first = _QUOTED_BEFORE.search(before)
    if first is None or not error.letter.strip() or error.letter in ",:]}#":
        return None
    start = error.offset - len(before) + first.start("quoted")
    condition_start = _torn_condition_start(error, start) if error.in_brackets else None
    if condition_start is not None:
        end = end_in_brackets(error.text, condition_start)
        return _trap_problem(torn_at_comma_trap(error.text[condition_start:end]), condition_start, end)
    end = error.value_end(start)
    trap = read_as_quoted_trap(first["quoted"], error.text[error.offset : end], error.text[start:end])
    return _trap_problem(trap, start, end)


def _torn_condition_start(error: ParserError, start: int) -> int | None:
    """Return the beginning of the condition that a comma before `start` splits, or None."""
    text = error.text
    pieces = _PIECE_BEGINS.finditer(text, max(error.context_start, start - LOOK_AROUND), start)
    piece_ends = [piece.end() for piece in pieces][-_MAX_PIECES:-1]
    return next((begin for begin in reversed(piece_ends) if Openings(text[begin:start]).is_any_open), None)


def _second_colon(error: ParserError) -> Problem | None:
    """Recognise `x: a: b`."""
    before = error.before()
    keys = list(_KEY_BEFORE.finditer(before))
    is_mapping_refused = "mapping values are not allowed" in error.problem
    if not keys or not (is_mapping_refused or (error.in_brackets and error.letter == ":")):
        return None
    start = error.offset - len(before) + keys[-1].end()
    end = error.value_end(start)
    key, written = keys[-1][0].rstrip(": \t"), error.text[start:end]
    if key == "call":
        trap = torn_call_trap
    elif key in _MAPPINGS or (is_known_key(before[keys[-1].end() :].strip()) and key not in _TEXTS):
        trap = torn_mapping_trap
    else:
        trap = torn_at_colon_trap if key in _TEXTS else torn_condition_trap
    return _trap_problem(trap(written), start, end)


_TRAPS: tuple[Callable[[ParserError], Problem | None], ...] = (
    _block_head,
    _negation,
    _hidden_bracket,
    *PUNCTUATION_RECOGNISERS,
    _quoted_beginning,
    _second_colon,
)

_DIRECTIVE = "directives are not part of this language"
_ESCAPE = r"write \\ for a backslash, or use single quotes"
_EXPLANATIONS: tuple[tuple[str, str, str, str], ...] = (
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
        "the list that begins with '[' on line {line} cannot continue with {letter}",
        "write ',' between items and ']' after the last; quote texts that contain brackets or quotes",
    ),
    (
        "expected ',' or '}'",
        "yaml-syntax",
        "the mapping that begins with '{{' on line {line} cannot continue with {letter}",
        "write ',' between entries and '}' after the last; quote texts that contain brackets or quotes",
    ),
    (
        "'-' indicator",
        "yaml-syntax",
        "this does not fit the list that begins on line {line}",
        "begin every item with '- ' in the same column; if a text contains quotes, quote all of it",
    ),
    (
        "did not find expected key",
        "yaml-syntax",
        "this does not fit the mapping that begins on line {line}",
        "indent the keys of a mapping alike; if a text contains quotes, quote all of it",
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


def _is_misplaced_item(error: ParserError) -> bool:
    """Return whether `- ` begins a line at a column where no list has its items."""
    is_item = error.text.startswith(("- ", "-\t"), error.offset) and not error.before().strip()
    return is_item and not error.in_brackets and "expected key" in error.problem


def _is_indented_further(error: ParserError) -> bool:
    """Return whether a key is indented deeper than the key on the line above, which has a value."""
    if "mapping values" not in error.problem:
        return False
    start = line_start(error.text, error.offset)
    above = error.text[line_start(error.text, max(0, start - 1)) : max(0, start - 1)]
    pattern = re.compile(r"(?P<indent>[ ]*)(?:- )?[\w$()]+:?")
    key_match, line_above_match = pattern.fullmatch(error.before()), _KEY_AND_VALUE.match(above)
    return (
        key_match is not None
        and line_above_match is not None
        and len(key_match["indent"]) > len(line_above_match["indent"])
    )


def _plain_problem(error: ParserError) -> Problem:
    """Return the problem of a parser error that is not a trap."""
    problem, offset, begin = error.problem, error.offset, error.context_start
    if "tab" in problem or (error.letter == "\t" and not error.before().strip()):
        return Problem("yaml-syntax", "a tab indents this line", "indent with blanks", offset, offset + 1)
    if "end of stream" in problem and "quoted" in error.context:
        message = "the quote that is opened here is never closed"
        return Problem("yaml-syntax", message, "close it with the same quote", begin, begin + 1)
    if error.in_brackets and not error.text[offset:].strip():
        start = error.innermost_open_bracket()
        bracket = error.text[start : start + 1]
        help_text = f"add {shown('}' if bracket == '{' else ']')} where it ends"
        return Problem("yaml-syntax", f"the {shown(bracket)} here is never closed", help_text, start, start + 1)
    if _is_misplaced_item(error):
        message = "this item does not belong to a list"
        help_text = "begin every '- ' of a list in the same column; keys of a mapping have no '- '"
        return Problem("yaml-syntax", message, help_text, offset, offset + 1)
    if _is_indented_further(error):
        start = offset - len(error.before().lstrip())
        message = (
            f"{shown(error.text[start:offset])} is indented deeper than the key above, "
            "so YAML reads it as part of the value of that key"
        )
        return Problem("yaml-syntax", message, "indent the keys of a mapping alike", start, offset)
    if error.letter in ("}", "]") and not error.in_brackets:
        return Problem("yaml-syntax", f"{shown(error.letter)} closes nothing", "remove it", offset, offset + 1)
    if error.letter == "," and "expected key" in problem:
        return Problem("yaml-syntax", "unexpected ',' after the end of a value", "remove it", offset, offset + 1)
    word = _WORD.match(error.text, offset)
    end = word.end() if word else min(offset + 1, len(error.text))
    letter = shown(error.letter) if error.letter.strip() else "the end of the line"
    for key_words, rule, message, help_text in _EXPLANATIONS:
        if key_words in problem or key_words in error.context:
            return Problem(rule, message.format(letter=letter, line=error.line(begin)), help_text, offset, end)
    return Problem(
        "yaml-syntax", f"this is not valid YAML: {problem}", "check quotes, brackets and indentation", offset, end
    )
