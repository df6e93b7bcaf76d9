"""Find the places of keys and values in a TOML text, which Python's `tomllib` does not report.

The text of a key or value can occur several times. Each occurrence in turn is replaced by a marker, and the text is
parsed. If the marker is then the wanted key or value of the parsed document, this occurrence is the place.
"""

from __future__ import annotations

import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from codra_dsl.language.diagnostics import Place, Span
from codra_dsl.language.project import parse_settings

Steps = tuple[str | int, ...]

MAX_PARSED_CHARACTERS = 512 * 1024
"""The maximum number of characters that are parsed to find places; then each place is the beginning of the file."""

_MARKER = "codra-looks-for-this"
_QUOTES = "\"'"


@dataclass(slots=True)
class TomlPlaces:
    """The places of the keys and values of a TOML file."""

    file: str
    text: str
    _characters_left: int = MAX_PARSED_CHARACTERS

    def key(self, *steps: str | int) -> Place:
        """Return the place of the key to which some steps lead; for an item of a list, the place of the list's key."""
        *table, key = [step for step in steps if isinstance(step, str)]
        start, end = self._find_occurrence(key, _MARKER, lambda document: _MARKER in _value_at(document, table)) or (
            0,
            0,
        )
        return self._place(start, end)

    def value(self, *steps: str | int) -> Place:
        """Return the place of a value, or the place of its key if the value is not found."""
        value = _value_at(parse_settings(self.text), steps)
        text = value if isinstance(value, str) else _literal_text(value)
        if text is None:
            return self.key(*steps)
        replacement = _MARKER if isinstance(value, str) else f"'{_MARKER}'"
        offsets = self._find_occurrence(text, replacement, lambda document: _value_at(document, steps) == _MARKER)
        return self.key(*steps) if offsets is None else self._place(*offsets)

    def _find_occurrence(
        self, text: str, replacement: str, is_wanted: Callable[[dict[str, object]], bool]
    ) -> tuple[int, int] | None:
        """Return the range of the first occurrence whose replacement gives a document that `is_wanted` accepts."""
        start = -1
        while self._characters_left >= len(self.text) and (start := self.text.find(text, start + 1)) >= 0:
            self._characters_left -= len(self.text)
            end = start + len(text)
            try:
                if is_wanted(tomllib.loads(self.text[:start] + replacement + self.text[end:])):
                    is_quoted = start > 0 and self.text[start - 1] in _QUOTES
                    return (start - 1, end + 1) if is_quoted else (start, end)
            except (ValueError, RecursionError):
                continue
        return None

    def _place(self, start: int, end: int) -> Place:
        text_before = self.text[:start]
        line, column = text_before.count("\n") + 1, start - text_before.rfind("\n")
        end_line, end_column = line + self.text.count("\n", start, end), end - self.text.rfind("\n", 0, end)
        return Place(Span(self.file, line, column, end_line, end_column))


def _literal_text(value: object) -> str | None:
    """Return the usual text of a value; None for a hexadecimal number that has too many decimal digits."""
    try:
        return str(value).lower()
    except ValueError:
        return None


def _value_at(document: Any, steps: Sequence[str | int]) -> Any:
    """Return the value to which some steps lead, or an empty table if there is no such value."""
    for step in steps:
        try:
            document = document[step]
        except (LookupError, TypeError):
            return {}
    return document
