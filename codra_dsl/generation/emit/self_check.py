"""Prove that emitted text is valid Python or JSON, without compiling equal parts more than once.

Compiling all of a large output takes longer than generating it, although most of its parts differ only in names and
strings. So a module is cut into pieces that are complete by themselves: the statements between blank lines, and the
items of long tuples. Among pieces that differ only in plain strings and in names that the emitter chooses, only one is
compiled. A module that cannot be cut safely is compiled as a whole: cutting can make a proof slower, but never weaker.
"""

from __future__ import annotations

import json
import keyword
import re
from collections.abc import Iterator, Mapping

_PLAIN_TEXT = r"[ !#-\[\]-~]*"  # printable ASCII without quotes and backslashes
_PLAIN_DOCSTRING = re.compile(f'"""{_PLAIN_TEXT}"""')
_PLAIN_STRING = re.compile(f'"{_PLAIN_TEXT}"')
_MISLEADING_MARKS = ("'", "\\", "#", "\0", *(f'{prefix}""' for prefix in "bBfFrRuU"))
"""If one of these marks is left after plain strings are removed, a removed match may not have been a plain string."""

_WORDS_ACROSS_PIECES = ("__future__", "global")
"""Words of statements that can be valid or invalid depending on other pieces."""

_CHOSEN_NAME_PATTERNS = tuple(
    re.compile(before + r"([A-Za-z][A-Za-z0-9_]*)\b") for before in ("\ndef ", r"branch\(", "build=")
)
_ALGORITHM_NAME_PATTERN = re.compile(r"\n([A-Za-z][A-Za-z0-9_]*) = Algorithm\(")
_LONG_TUPLE = re.compile(r"\w+: tuple\[\w+, \.\.\.\] = \(\n    \w+\(")
_NEXT_ITEM = re.compile(r"\n    (?![ )])")


class BrokenOutputError(Exception):
    """Emitted text is neither Python nor JSON: a bug of the emitter, detected before any file is replaced."""


def prove(files: Mapping[str, str]) -> None:
    """Parse the text of every path: with Python's compiler if the path ends in `.py`, otherwise as JSON.

    Raises:
        BrokenOutputError: if a text cannot be parsed, with the first such path and the error.
    """
    proven_pieces: set[str] = set()
    for path, text in files.items():
        try:
            if not path.endswith(".py"):
                json.loads(text)
            elif not _is_proven_in_pieces(text, proven_pieces):
                compile(text, path, "exec", dont_inherit=True)
        except (SyntaxError, ValueError, RecursionError) as error:
            raise BrokenOutputError(f"{path}: {error}") from error


def _is_proven_in_pieces(text: str, proven_pieces: set[str]) -> bool:
    """Compile the pieces of a module that are not in `proven_pieces`; return whether this proves the whole module."""
    code_before_docstring, _, rest = text.partition('"""')
    docstring, closing, statements = rest.partition('"""')
    docstring_line = docstring.replace("\n", "")
    is_plain = docstring_line.isascii() and docstring_line.isprintable() and "\\" not in docstring_line
    if code_before_docstring or not closing or not is_plain or not statements.startswith("\n"):
        return False
    shape = _shape(statements)
    if shape is None:
        return False
    for piece in _pieces(shape):
        if piece not in proven_pieces:
            try:
                compile(piece, "", "exec", dont_inherit=True)
            except (SyntaxError, ValueError, RecursionError):
                return False
            proven_pieces.add(piece)
    return True


def _shape(statements: str) -> str | None:
    """Return statements without the parts in which pieces may differ, or None if these parts cannot be recognised."""
    shape = _PLAIN_DOCSTRING.sub('""', statements)
    if '"""' in shape:
        return None
    shape = _PLAIN_STRING.sub('""', shape)
    if any(mark in shape for mark in (*_MISLEADING_MARKS, *_WORDS_ACROSS_PIECES)):
        return None
    for pattern in _CHOSEN_NAME_PATTERNS:
        shape = pattern.sub(_replace_name, shape)
    return _ALGORITHM_NAME_PATTERN.sub(_replace_name, shape)


def _replace_name(match: re.Match[str]) -> str:
    """Return a match whose name is replaced by a fixed name, unless the name is a keyword."""
    return match[0] if keyword.iskeyword(match[1]) else match[0].replace(match[1], "name", 1)


def _pieces(shape: str) -> Iterator[str]:
    """Yield the pieces of a module. The module compiles if each piece compiles."""
    for piece in shape.split("\n\n"):
        opening, *items = _NEXT_ITEM.split(piece.rstrip("\n").removesuffix("\n)"))
        is_closed = piece.rstrip("\n").endswith(",\n)") and all(item.endswith(",") for item in items)
        if is_closed and _LONG_TUPLE.match(piece.lstrip("\n")):
            yield f"{opening}\n)"
            yield from (f"(\n    {item}\n)" for item in items)
        else:
            yield piece
