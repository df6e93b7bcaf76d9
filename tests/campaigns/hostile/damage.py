"""Damage to texts, bytes and JSON: at the level of tokens, lines, numbers, encodings and structure."""

from __future__ import annotations

import json
import re
from collections.abc import Callable, Sequence
from copy import deepcopy
from random import Random
from typing import Any

from tests.campaigns.hostile.texts import NAMES, NUMBERS, ODD_NAMES, TEXTS

_TOKEN = re.compile(r"\"(?:[^\"\\\n]|\\.)*\"|'[^'\n]*'|[A-Za-z_][\w.-]*|[+-]?\d[\d.eE+-]*|[^\s\w]|\s+")
_NUMBER = re.compile(r"(?<![\w.])[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?")
_WORD = re.compile(r"[A-Za-z_]\w*")
_MAX_TEXT = 200_000
CONTROLS = (
    "\x00",
    "\x01",
    "\x08",
    "\x0b",
    "\x0c",
    "\r",
    "\x1b",
    "\x7f",
    "\x85",
    "\u2028",
    "\u202e",
    "\ufeff",
    "\ufffe",
)


def damaged(chance: Random, text: str, edits: Sequence[int] = (1, 1, 1, 2, 4, 8)) -> str:
    """Return a text with a few edits."""
    for _ in range(chance.choice(edits)):
        text = chance.choices(_EDITS, _EDIT_WEIGHTS)[0](chance, text)[:_MAX_TEXT]
    return text


def encoded(chance: Random, text: str) -> bytes:
    """Return a text in UTF-8, or sometimes in another encoding or with damaged bytes."""
    data, kind = text.encode("utf-8", "surrogatepass"), chance.random()
    if kind > 0.06:
        return data
    if kind < 0.03:
        return chance.choice(_RECODINGS)(text)
    if kind < 0.05:
        old, new = chance.choice(_REPLACED_BYTES)
        return data.replace(old, new, chance.choice((1, -1)))
    return chance.choice((b"", data + bytes(1000), data * 2, data * 50, damaged_bytes(chance, data)))


def damaged_bytes(chance: Random, data: bytes) -> bytes:
    """Return bytes with some of them flipped, cut off, repeated, or replaced by noise."""
    array = bytearray(data)
    for _ in range(chance.choice((1, 2, 5, 20))):
        if not array:
            break
        place, kind = chance.randrange(len(array)), chance.random()
        if kind < 0.5:
            array[place] = chance.choice((0, 1, 0x7F, 0x80, 0xFE, 0xFF, chance.randrange(256)))
        elif kind < 0.65:
            del array[place : place + chance.choice((1, 4, 8, 100))]
        elif kind < 0.8:
            array[place:place] = array[place : place + chance.choice((1, 8, 1000))]
        elif kind < 0.9:
            array[place:place] = chance.randbytes(chance.choice((1, 8, 64)))
        else:
            del array[place:]
    return bytes(array)


def _edit_token(chance: Random, text: str) -> str:
    """Delete, double or replace a token, also by another token of the text."""
    matches = _matches(chance, _TOKEN, text)
    if not matches:
        return text
    one, other = chance.choice(matches), chance.choice(matches)
    replacement = chance.choice(("", one.group() * 2, other.group(), f"{one.group()} {other.group()}"))
    return text[: one.start()] + replacement + text[one.end() :]


def _edit_number(chance: Random, text: str) -> str:
    return _replace(chance, _NUMBER, text, chance.choice(NUMBERS))


def _edit_word(chance: Random, text: str) -> str:
    name = chance.choice((*NAMES, *ODD_NAMES))
    return _replace(chance, _WORD, text, name if len(name) < _MAX_TEXT or chance.random() < 0.02 else "a" * 3000)


def _insert_text(chance: Random, text: str) -> str:
    place = chance.randrange(len(text) + 1)
    inserted = chance.choice((*TEXTS, *CONTROLS, *CONTROLS, chance.choice("{}[]()<>&;:,'\"|#%@!?*-=\\/ \t\n")))
    return text[:place] + inserted + text[place:]


def _edit_lines(chance: Random, text: str) -> str:
    """Delete, double, move or indent a line."""
    lines = text.split("\n")
    place, kind = chance.randrange(len(lines)), chance.randrange(5)
    line = lines[place]
    if kind == 0:
        del lines[place]
    elif kind == 1:
        lines[place:place] = [line] * chance.choice((1, 1, 3, 300))
    elif kind == 2:
        lines.insert(chance.randrange(len(lines)), lines.pop(place))
    elif kind == 3:
        lines[place] = chance.choice((" ", "  ", "\t", "    ")) + line
    else:
        lines[place] = line.strip()
    return "\n".join(lines)


def _cut(chance: Random, text: str) -> str:
    return text[: chance.randrange(len(text) + 1)]


def _move_part(chance: Random, text: str) -> str:
    """Copy a part of a text to another place, which often doubles keys and breaks the nesting."""
    first, last, place = sorted(chance.randrange(len(text) + 1) for _ in range(3))
    return text[:place] + text[first : min(last, first + 400)] + text[place:]


def _replace(chance: Random, pattern: re.Pattern[str], text: str, replacement: str) -> str:
    matches = _matches(chance, pattern, text)
    if not matches:
        return text
    match = chance.choice(matches)
    return text[: match.start()] + replacement + text[match.end() :]


def _matches(chance: Random, pattern: re.Pattern[str], text: str) -> list[re.Match[str]]:
    """Return the matches in a part of a text; the search of all of a large text would take most of the time."""
    start = max(0, chance.randrange(len(text) + 1) - 2000) if len(text) > 4000 else 0
    return list(pattern.finditer(text, start, start + 4000))


_EDITS: tuple[Callable[[Random, str], str], ...] = (
    *(_edit_token, _edit_number, _edit_word, _insert_text, _edit_lines, _cut, _move_part),
)
_EDIT_WEIGHTS = (6, 6, 4, 3, 3, 1, 2)

_RECODINGS: tuple[Callable[[str], bytes], ...] = (
    lambda text: text.encode("utf-16", "surrogatepass"),
    lambda text: text.encode("utf-16-be", "surrogatepass"),
    lambda text: text.encode("utf-32", "surrogatepass"),
    lambda text: text.replace("a", "\xe9", 1).encode("latin-1", "replace"),
    lambda text: text.encode("utf-7", "replace"),
    lambda text: text.encode("utf-8-sig", "surrogatepass"),
)
_REPLACED_BYTES = ((b"\n", b"\r\n"), (b"\n", b"\r"), (b"\n", b"\x85"), (b"e", b"\xed\xa0\x80"), (b"e", b"\xc0\xaf"))


# JSON

HOSTILE_VALUES: tuple[Any, ...] = (
    *(None, True, False, 0, -1, 2**31, 2**63, 2**64, 10**400, 0.5, 1e308, -0.0, 5e-324, "", "x", "1", "-1", "nan"),
    *(float("nan"), float("inf"), float("-inf"), [], {}, [[]], [None], {"": {}}, {"type": 0, "value": 1}),
    *("a" * 3000, [0] * 3000, "\x00", "\u202e", "\ud800", "9" * 5000, "1e999", "__proto__", {"a": {"b": {"c": []}}}),
)


def damaged_json(chance: Random, document: Any) -> str:
    """Return JSON with a few values replaced, moved, removed or doubled, also with duplicate keys."""
    for _ in range(chance.choice((1, 1, 2, 5))):
        holders = list(_holders(document))
        if not holders:
            break
        holder, key = chance.choice(holders)
        other_holder, other_key = chance.choice(holders)
        kind = chance.random()
        if kind < 0.5:
            holder[key] = deepcopy(chance.choice(HOSTILE_VALUES))  # a shared list would change for later inputs
        elif kind < 0.7:
            holder[key] = deepcopy(other_holder[other_key])
        elif kind < 0.85:
            holder.pop(key)
        elif isinstance(holder, dict):
            new_key = chance.choice((*NAMES, *NUMBERS[:20], "", "a" * 2000, str(other_key)))
            holder[new_key] = deepcopy(holder[key])
        else:
            holder[key:key] = [holder[key]] * chance.choice((1, 100))
    text = json.dumps(document, ensure_ascii=chance.random() < 0.5, indent=chance.choice((None, 1)))
    return nested(chance, text) if chance.random() < 0.05 else text


def nested(chance: Random, text: str) -> str:
    """Return a JSON text with one value inside very many brackets."""
    matches = _matches(chance, re.compile(r"\"[^\"]*\"(?!\s*:)|\b\d+\b|\[\]|\{\}"), text)
    if not matches:
        return text
    depth, match = chance.choice((30, 100, 5000, 50_000)), chance.choice(matches)
    start, end = chance.choice((("[", "]"), ('{"a":', "}")))
    return text[: match.start()] + start * depth + match.group() + end * depth + text[match.end() :]


def _holders(document: Any) -> Any:
    """Yield each list and object with each of its keys, down to a depth of 12."""
    pending = [(document, 0)]
    while pending:
        holder, depth = pending.pop()
        items = holder.items() if isinstance(holder, dict) else enumerate(holder) if isinstance(holder, list) else ()
        for key, value in items:
            yield holder, key
            if depth < 12:
                pending.append((value, depth + 1))
