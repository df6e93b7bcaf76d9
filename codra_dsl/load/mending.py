"""Slips of punctuation: which letter is missing where, so that one finding says it and the file is read as if it stood.

What is recognised here are the slips that make a file unreadable, or give it another shape, far from where they are: a
':' after a key, a ',' between entries, a bracket, a key before its ':'.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from functools import cache

from codra_dsl.expression.tokens import shown
from codra_dsl.load.complaint import LOOK_AROUND, Complaint, Problem, end_of_line, line_start
from codra_dsl.load.schema import schema
from codra_dsl.load.traps import Openings

NO_KEY = "\ue000"
"""Stands for a key that is missing, which nobody knows."""

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
_LONGEST_ENTRY = 300
"""How many letters two entries without a ',' between them may have."""

_CLOSERS = {"{": "}", "[": "]"}


def colon_between(key: str) -> int | None:
    """Return where in a key, which nothing is the value of, a ':' is missing; None where it is another slip."""
    words = _WORDS.fullmatch(key)
    if words is None or words["value"][0] in "=<>!+*/%" or Openings(key).are_left or words["key"] in _NOT_A_VALUE:
        return None
    return words.end("key") if words["value"].split()[0] not in _NOT_A_VALUE else None


def colon_before_bracket(key: str) -> int | None:
    """Return where in a key that holds a bracket a ':' is missing."""
    found = _KEY_AND_BRACKET.match(key)
    return None if found is None else found.end("key")


def missing_colon(text: str, start: int, at: int) -> Problem:
    """Return the problem that no ':' follows the key between two offsets."""
    key = text[start:at]
    more = bool(text[at : end_of_line(text, at)].strip())
    way_out = f"write '{key}: ...'" if more else f"write '{key}:'"
    return _missing(":", f"a ':' is missing after {shown(key)}", way_out, start=start, end=at, at=at)


def _missing(letter: str, message: str, way_out: str, *, start: int, end: int, at: int) -> Problem:
    return Problem("yaml-syntax", message, way_out, start, end, mend=(at, letter))


def _colon_before_bracket(complaint: Complaint) -> Problem | None:
    """Recognise `door {type: bool, valid_for: 5 s}`, in a block and within braces."""
    text = complaint.text
    if not complaint.in_brackets and "mapping values" in complaint.problem:
        start = line_start(text, complaint.at)
        found = _KEY_AND_BRACKET.match(text, start, end_of_line(text, start))
        return None if found is None else missing_colon(text, found.start("key"), found.end("key"))
    if complaint.letter in ("{", "[") and complaint.in_brackets:
        before = complaint.before()
        key = _NAME_BEFORE.search(before)
        if key is not None and before[: key.start()].rstrip()[-1:] in ("{", ","):
            first = complaint.at - len(before)
            return missing_colon(text, first + key.start("key"), first + key.end("key"))
    return None


def _colon_after_key(complaint: Complaint) -> Problem | None:
    """Recognise a line in a block that holds a key and no ':'; the parser stumbles over a later line."""
    text, at = complaint.text, complaint.at
    if complaint.in_brackets:
        return None
    if "simple key" in complaint.context:
        start = line_start(text, complaint.begun)
    elif "mapping values" in complaint.problem and not re.search(r":[ \t]", complaint.before()):
        start = _first_of_lines_without_colon(text, at)
    elif "document start" in complaint.problem:
        first = re.search(r"^[^\s#]", text, re.MULTILINE)
        start = at if first is None else first.start()
    else:
        return None
    if start >= line_start(text, at):
        return None
    end = end_of_line(text, start)
    glued = _KEY_AND_VALUE.match(text, start, end)
    if glued is not None:
        return missing_blank(text, *glued.span("key"), end)
    found = _KEY_AND_MORE.match(text, start, end)
    if found is not None and found["key"] in _NOT_A_VALUE:
        message, way_out = (
            f"{shown(found['key'])} begins no key",
            "indent the line so that it goes on with the one above",
        )
        return Problem("yaml-syntax", message, way_out, *found.span("key"))
    return None if found is None else missing_colon(text, found.start("key"), found.end("key"))


def colon_without_blank(key: str) -> int | None:
    """Return where in a key, which nothing is the value of, the ':' is that lacks a blank."""
    glued = _KEY_AND_VALUE.fullmatch(key)
    return None if glued is None or not is_known_key(glued["key"]) else glued.end("key")


def missing_blank(text: str, start: int, at: int, end: int) -> Problem:
    """Return the problem that the value follows the ':' of a key without a blank."""
    key = text[start : at + 1]
    message, way_out = f"a blank is missing after {shown(key)}", f"write {shown(f'{key} {text[at + 1 : end]}')}"
    return _missing(" ", message, way_out, start=start, end=at + 1, at=at + 1)


def _first_of_lines_without_colon(text: str, at: int) -> int:
    """Return where the first of the lines begins that lead to the one at `at` and hold no key."""
    start = line_start(text, at)
    while start > 0 and at - start < LOOK_AROUND:
        above = line_start(text, start - 1)
        line = text[above : end_of_line(text, above)]
        if not line.strip() or re.search(r":(?:\s|$)|^\s*#", line):
            break
        start = above
    return start


def _comma_between_entries(complaint: Complaint) -> Problem | None:
    """Recognise `{type: bool source: arm}`, and `{label: "Door" type: bool}`."""
    if not complaint.in_brackets or "expected ','" not in complaint.problem:
        return None
    before = complaint.before()[-_LONGEST_ENTRY:]
    first = complaint.at - len(before)
    if complaint.letter == ":":
        two = _TWO_ENTRIES.search(before)
        if two is None or not _are_entries(before[: two.start("key")], two["value"], two["key"]):
            return None
        return _missing_comma(complaint, first + two.end("value"), two["key"])
    ends = before.rstrip()
    if ends[-1:] in ("'", '"', "}", "]") and complaint.letter not in ("", "}", "]"):
        key = _NEXT_ENTRY.match(complaint.text, complaint.at)
        again = complaint.letter in ("{", "[", ends[-1]) and ends[-1] not in "}]"
        if key is not None or again or (complaint.letter in "{[" and ends[-1] in "}]"):
            word = key[0].rstrip(": \t") if key is not None else complaint.letter
            return _missing_comma(complaint, first + len(ends), word)
    return None


def _are_entries(before: str, value: str, key: str) -> bool:
    """Return whether two words before a ':' are a value and the next key, rather than a text with a ':' in it."""
    if key in _known_keys():
        return True
    is_word = _VALUE_OF_ONE_WORD.fullmatch(value) is not None and value not in _NOT_A_VALUE
    return is_word and _FREE_TEXTS.search(before) is None


def is_known_key(word: str) -> bool:
    """Return whether the schema knows a key, wherever it may stand."""
    return word in _known_keys()


@cache
def _known_keys() -> frozenset[str]:
    """Return every key that the schema knows, wherever it may stand."""
    parts = (schema(), *schema()["$defs"].values())
    return frozenset(key for part in parts for key in part.get("properties", ()))


def _missing_comma(complaint: Complaint, at: int, key: str) -> Problem:
    start = complaint.text.index(key, at)
    message = f"a ',' is missing before {shown(key)}"
    return _missing(",", message, "put ',' between entries", start=start, end=start + len(key), at=at)


def _opening_brace(complaint: Complaint) -> Problem | None:
    """Recognise `door: type: bool, valid_for: 5 s}`, in a block and within braces."""
    text, before = complaint.text, complaint.before()
    if complaint.letter != ":" or not (complaint.in_brackets or "mapping values" in complaint.problem):
        return None
    key = next(reversed(list(re.finditer(r":[ \t]+(?=\S)", before))), None)
    start = line_start(text, complaint.at)
    if key is None or _unclosed(text[start : end_of_line(text, start)]) != "!}":
        return None
    at = complaint.at - len(before) + key.end()
    message = f"a '{{' is missing before {shown(before[key.end() :].strip())}"
    return _missing("{", message, "put it where the mapping begins", start=at, end=complaint.at, at=at)


def _closing_bracket(complaint: Complaint) -> Problem | None:
    """Recognise a line that opens more brackets than it closes, while the next ones are keys of a block again."""
    text, begun = complaint.text, complaint.begun
    if not complaint.in_brackets or complaint.letter in ("{", "["):
        return None
    start = line_start(text, begun)
    end = end_of_line(text, begun)
    closers = _unclosed(text[start:end])
    lines = text[end : end + LOOK_AROUND].splitlines()[1:]
    following = next((line for line in lines if line.strip() and line.strip()[0] != "#"), None)
    is_over = following is None or (_BLOCK_BEGINS.match(following) is not None and "!" not in _unclosed(following))
    if not is_over or not closers or "!" in closers or complaint.at <= end:
        return None
    bracket = text[begun]
    message, way_out = f"the {shown(bracket)} here is never closed", f"add {shown(_CLOSERS[bracket])} where it ends"
    if "{" in text[begun + 1 : end]:  # then it may end before the last entry
        return Problem("yaml-syntax", message, way_out, begun, begun + 1)
    return _missing(closers, message, way_out, start=begun, end=begun + 1, at=end)


def _unclosed(line: str) -> str:
    """Return what closes the brackets that a line leaves open; '!' and a bracket for one that it does not open."""
    if len(line) > LOOK_AROUND:
        return "!"
    opened: list[str] = []
    quote = ""
    for before, letter in zip(" " + line, line, strict=False):
        if quote:
            quote = "" if letter == quote else quote
        elif letter in "\"'" and before in " \t[{,:":
            quote = letter
        elif letter in _CLOSERS:
            opened.append(_CLOSERS[letter])
        elif letter in "]}" and opened[-1:] != [letter]:
            return f"!{letter}"
        elif letter in "]}":
            opened.pop()
    return "".join(reversed(opened)) if not quote else "!"


def _closing_quote(complaint: Complaint) -> Problem | None:
    """Recognise a quote that is not closed on its line, so that the next one closes it, far below."""
    text, at = complaint.text, complaint.at
    quote = text[at - 1 : at]
    if quote not in ("'", '"'):
        return None
    start = text.rfind(quote, 0, at - 1)
    if start < 0 or "\n" not in text[start:at] or text[start - 1 : start].strip(" \t\n[{"):
        return None
    end = end_of_line(text, start)
    message, way_out = "the quote that is opened here is not closed on its line", "close it with the same quote"
    before = text[line_start(text, start) : start]
    if not before.strip() or _unclosed(before) or quote in text[start + 1 : end]:
        return Problem("yaml-syntax", message, way_out, start, start + 1)
    return _missing(quote, message, way_out, start=start, end=start + 1, at=end)


def _key_before_colon(complaint: Complaint) -> Problem | None:
    """Recognise `{: bool}`, and a line that begins with ':'."""
    if complaint.letter != ":" or complaint.text[complaint.at + 1 : complaint.at + 2].strip():
        return None
    if complaint.before().rstrip()[-1:] not in ("", "{", ",", "-"):
        return None
    at = complaint.at
    return _missing(NO_KEY, "a key is missing before ':'", "write 'key: value'", start=at, end=at + 1, at=at)


MENDS: tuple[Callable[[Complaint], Problem | None], ...] = (
    _closing_quote,
    _key_before_colon,
    _colon_before_bracket,
    _comma_between_entries,
    _opening_brace,
    _closing_bracket,
    _colon_after_key,
)
"""What recognises each slip."""
