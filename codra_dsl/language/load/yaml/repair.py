"""Find missing punctuation, so that it is reported once and the file is read as if nothing were missing.

This module recognises mistakes that make a file unreadable, or change its shape, far from the mistake itself: a missing
':' after a key, a missing ',' between entries, a missing bracket or quote, or a missing key before a ':'.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache

from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.schema_file import schema
from codra_dsl.language.load.yaml.parser_error import LOOK_AROUND, ParserError, Problem, end_of_line, line_start
from codra_dsl.language.load.yaml.traps import Openings

NO_KEY = "\ue000"
"""Placeholder for a missing key."""

_NAME = r"[A-Za-z_$][\w$()]*"
_KEY_AND_BRACKET = re.compile(rf"[ \t]*(?:-[ \t]+)?(?P<key>{_NAME})[ \t]+(?P<value>[{{\[])")
_KEY_AND_MORE = re.compile(
    rf"[ \t]*(?:-[ \t]+)?(?P<key>{_NAME}|\"[^\"]+\"|'[^']+')(?:[ \t]+(?P<value>[^\s:=<>!#].*))?$"
)
_KEY_AND_VALUE = re.compile(rf"[ \t]*(?:-[ \t]+)?(?P<key>{_NAME}):[^\s:/].*$")
_WORDS = re.compile(rf"(?P<key>{_NAME})[ \t]+(?P<value>\S.*)", re.DOTALL)
_NAME_BEFORE = re.compile(rf"(?P<key>{_NAME})[ \t]*$")
_TWO_ENTRIES = re.compile(rf"(?:^|[{{,]|:[ \t])[ \t]*(?P<value>[^{{}},:]*?[^{{}},:\s])[ \t]+(?P<key>{_NAME})[ \t]*$")
_NEXT_ENTRY = re.compile(rf"{_NAME}[ \t]*:[ \t]")
_BLOCK_BEGINS = re.compile(rf"[ \t]*(?:-[ \t]+\S|(?:-[ \t]+)?(?:{_NAME}|\"[^\"]*\"|'[^']*'):(?:[ \t]|$))")
_VALUE_OF_ONE_WORD = re.compile(r"[\w$().%°/*^+-]+|-?[0-9.]+[ \t]+[\w/*^%°]+")
_FREE_TEXTS = re.compile(r"(?:label|description|title)[ \t]*:[^,:]*$")
_NOT_A_VALUE = frozenset({"not", "and", "or", "in", "if", "else"})
_MAX_ENTRIES_LENGTH = 300
"""The maximum length of two entries without a ',' between them."""

_CLOSERS = {"{": "}", "[": "]"}


def colon_between(key: str) -> int | None:
    """Return the offset at which a ':' is missing in a key without a value; None for another mistake."""
    words = _WORDS.fullmatch(key)
    if words is None or words["value"][0] in "=<>!+*/%" or Openings(key).is_any_open or words["key"] in _NOT_A_VALUE:
        return None
    return words.end("key") if words["value"].split()[0] not in _NOT_A_VALUE else None


def colon_before_bracket(key: str) -> int | None:
    """Return the offset at which a ':' is missing in a key that contains a bracket."""
    match = _KEY_AND_BRACKET.match(key)
    return None if match is None else match.end("key")


def missing_colon(text: str, start: int, offset: int) -> Problem:
    """Return the problem of a missing ':' after the key between two offsets."""
    key = text[start:offset]
    has_more_text = bool(text[offset : end_of_line(text, offset)].strip())
    help_text = f"write '{key}: ...'" if has_more_text else f"write '{key}:'"
    return _insertion_problem(
        ":", f"a ':' is missing after {shown(key)}", help_text, start=start, end=offset, offset=offset
    )


def _insertion_problem(letter: str, message: str, help_text: str, *, start: int, end: int, offset: int) -> Problem:
    return Problem("yaml-syntax", message, help_text, start, end, insertion=(offset, letter))


def _colon_before_bracket(error: ParserError) -> Problem | None:
    """Recognise `door {type: bool, valid_for: 5 s}`, in a block and within braces."""
    text = error.text
    if not error.in_brackets and "mapping values" in error.problem:
        start = line_start(text, error.offset)
        match = _KEY_AND_BRACKET.match(text, start, end_of_line(text, start))
        return None if match is None else missing_colon(text, match.start("key"), match.end("key"))
    if error.letter in ("{", "[") and error.in_brackets:
        before = error.before()
        key = _NAME_BEFORE.search(before)
        if key is not None and before[: key.start()].rstrip()[-1:] in ("{", ","):
            before_offset = error.offset - len(before)
            return missing_colon(text, before_offset + key.start("key"), before_offset + key.end("key"))
    return None


def _colon_after_key(error: ParserError) -> Problem | None:
    """Recognise a line in a block that has a key but no ':'. The parser stops only at a later line."""
    text, offset = error.text, error.offset
    if error.in_brackets:
        return None
    if "simple key" in error.context:
        start = line_start(text, error.context_start)
    elif "mapping values" in error.problem and not re.search(r":[ \t]", error.before()):
        start = _first_of_lines_without_colon(text, offset)
    elif "document start" in error.problem:
        first = re.search(r"^[^\s#]", text, re.MULTILINE)
        start = offset if first is None else first.start()
    else:
        return None
    if start >= line_start(text, offset):
        return None
    end = end_of_line(text, start)
    key_and_value = _KEY_AND_VALUE.match(text, start, end)
    if key_and_value is not None:
        return missing_blank(text, *key_and_value.span("key"), end)
    match = _KEY_AND_MORE.match(text, start, end)
    if match is not None and match["key"] in _NOT_A_VALUE:
        message, help_text = (
            f"{shown(match['key'])} cannot begin a key",
            "indent the line so that it continues the one above",
        )
        return Problem("yaml-syntax", message, help_text, *match.span("key"))
    return None if match is None else missing_colon(text, match.start("key"), match.end("key"))


def colon_without_blank(key: str) -> int | None:
    """Return the offset of a ':' without a blank after it, in a key without a value; None if there is no such ':'."""
    key_and_value = _KEY_AND_VALUE.fullmatch(key)
    return None if key_and_value is None or not is_known_key(key_and_value["key"]) else key_and_value.end("key")


def missing_blank(text: str, start: int, offset: int, end: int) -> Problem:
    """Return the problem of a missing blank between the ':' of a key and its value."""
    key = text[start : offset + 1]
    message, help_text = f"a blank is missing after {shown(key)}", f"write {shown(f'{key} {text[offset + 1 : end]}')}"
    return _insertion_problem(" ", message, help_text, start=start, end=offset + 1, offset=offset + 1)


def _first_of_lines_without_colon(text: str, offset: int) -> int:
    """Return the beginning of the first line in the unbroken sequence of lines without a ':' that ends at `offset`."""
    start = line_start(text, offset)
    while start > 0 and offset - start < LOOK_AROUND:
        above = line_start(text, start - 1)
        line = text[above : end_of_line(text, above)]
        if not line.strip() or re.search(r":(?:\s|$)|^\s*#", line):
            break
        start = above
    return start


def _comma_between_entries(error: ParserError) -> Problem | None:
    """Recognise `{type: bool source: arm}`, and `{label: "Door" type: bool}`."""
    if not error.in_brackets or "expected ','" not in error.problem:
        return None
    before = error.before()[-_MAX_ENTRIES_LENGTH:]
    before_offset = error.offset - len(before)
    if error.letter == ":":
        entries_match = _TWO_ENTRIES.search(before)
        if entries_match is None or not _are_entries(
            before[: entries_match.start("key")], entries_match["value"], entries_match["key"]
        ):
            return None
        return _missing_comma(error, before_offset + entries_match.end("value"), entries_match["key"])
    stripped_text = before.rstrip()
    if stripped_text[-1:] in ("'", '"', "}", "]") and error.letter not in ("", "}", "]"):
        key = _NEXT_ENTRY.match(error.text, error.offset)
        is_value_next = error.letter in ("{", "[", stripped_text[-1]) and stripped_text[-1] not in "}]"
        if key is not None or is_value_next or (error.letter in "{[" and stripped_text[-1] in "}]"):
            word = key[0].rstrip(": \t") if key is not None else error.letter
            return _missing_comma(error, before_offset + len(stripped_text), word)
    return None


def _are_entries(before: str, value: str, key: str) -> bool:
    """Return whether two words before a ':' are a value and the next key, rather than a text that contains a ':'."""
    if key in _known_keys():
        return True
    is_word = _VALUE_OF_ONE_WORD.fullmatch(value) is not None and value not in _NOT_A_VALUE
    return is_word and _FREE_TEXTS.search(before) is None


def is_known_key(word: str) -> bool:
    """Return whether a word is a key anywhere in the schema."""
    return word in _known_keys()


@cache
def _known_keys() -> frozenset[str]:
    """Return all keys of the schema."""
    parts = (schema(), *schema()["$defs"].values())
    return frozenset(key for part in parts for key in part.get("properties", ()))


def _missing_comma(error: ParserError, offset: int, key: str) -> Problem:
    start = error.text.index(key, offset)
    message = f"a ',' is missing before {shown(key)}"
    return _insertion_problem(",", message, "put ',' between entries", start=start, end=start + len(key), offset=offset)


def _opening_brace(error: ParserError) -> Problem | None:
    """Recognise `door: type: bool, valid_for: 5 s}`, in a block and within braces."""
    text, before = error.text, error.before()
    if error.letter != ":" or not (error.in_brackets or "mapping values" in error.problem):
        return None
    key = next(reversed(list(re.finditer(r":[ \t]+(?=\S)", before))), None)
    start = line_start(text, error.offset)
    if key is None or _missing_closers(text[start : end_of_line(text, start)]) != "!}":
        return None
    offset = error.offset - len(before) + key.end()
    message = f"a '{{' is missing before {shown(before[key.end() :].strip())}"
    return _insertion_problem(
        "{", message, "put '{' where the mapping begins", start=offset, end=error.offset, offset=offset
    )


def _closing_bracket(error: ParserError) -> Problem | None:
    """Recognise a line that opens more brackets than it closes, although the next line begins an entry of a block."""
    text, begin = error.text, error.context_start
    if not error.in_brackets or error.letter in ("{", "["):
        return None
    start = line_start(text, begin)
    end = end_of_line(text, begin)
    closers = _missing_closers(text[start:end])
    lines = text[end : end + LOOK_AROUND].splitlines()[1:]
    next_line = next((line for line in lines if line.strip() and line.strip()[0] != "#"), None)
    is_block_next = next_line is None or (
        _BLOCK_BEGINS.match(next_line) is not None and "!" not in _missing_closers(next_line)
    )
    if not is_block_next or not closers or "!" in closers or error.offset <= end:
        return None
    bracket = text[begin]
    message, help_text = f"the {shown(bracket)} here is never closed", f"add {shown(_CLOSERS[bracket])} where it ends"
    if "{" in text[begin + 1 : end]:  # the missing bracket may then belong before the last entry
        return Problem("yaml-syntax", message, help_text, begin, begin + 1)
    return _insertion_problem(closers, message, help_text, start=begin, end=begin + 1, offset=end)


def _missing_closers(line: str) -> str:
    """Return the closing brackets that a line lacks.

    If a closing bracket was not opened, return '!' and this bracket. If the line cannot be judged, return '!'.
    """
    if len(line) > LOOK_AROUND:
        return "!"
    closers: list[str] = []
    quote = ""
    for before, letter in zip(" " + line, line, strict=False):
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'" and before in " \t[{,:":
            quote = letter
        elif letter in _CLOSERS:
            closers.append(_CLOSERS[letter])
        elif letter in "]}" and closers[-1:] != [letter]:
            return f"!{letter}"
        elif letter in "]}":
            closers.pop()
    return "".join(reversed(closers)) if not quote else "!"


def _closing_quote(error: ParserError) -> Problem | None:
    """Recognise a quote that is not closed on its line, so that the next quote far below closes it."""
    text, offset = error.text, error.offset
    quote = text[offset - 1 : offset]
    if quote not in ("'", '"'):
        return None
    start = text.rfind(quote, 0, offset - 1)
    if start < 0 or "\n" not in text[start:offset] or text[start - 1 : start].strip(" \t\n[{"):
        return None
    end = end_of_line(text, start)
    message, help_text = "the quote that is opened here is not closed on its line", "close it with the same quote"
    before = text[line_start(text, start) : start]
    if not before.strip() or _missing_closers(before) or quote in text[start + 1 : end]:
        return Problem("yaml-syntax", message, help_text, start, start + 1)
    return _insertion_problem(quote, message, help_text, start=start, end=start + 1, offset=end)


def _key_before_colon(error: ParserError) -> Problem | None:
    """Recognise `{: bool}`, and a line that begins with ':'."""
    if error.letter != ":" or error.text[error.offset + 1 : error.offset + 2].strip():
        return None
    before = error.before()
    if before.rstrip()[-1:] not in ("", "{", ",", "-") or before.endswith("-"):  # YAML reads '-:' as the key '-'
        return None
    offset = error.offset
    return _insertion_problem(
        NO_KEY, "a key is missing before ':'", "write 'key: value'", start=offset, end=offset + 1, offset=offset
    )


PUNCTUATION_RECOGNISERS: tuple[Callable[[ParserError], Problem | None], ...] = (
    _closing_quote,
    _key_before_colon,
    _colon_before_bracket,
    _comma_between_entries,
    _opening_brace,
    _closing_bracket,
    _colon_after_key,
)
"""The functions that recognise the mistakes, in the order in which they are tried."""
