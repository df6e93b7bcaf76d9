"""Find the places of keys and values in a TOML text, which Python's `tomllib` does not report.

Each occurrence of the text is replaced in turn. The occurrence whose replacement changes exactly the key or value in
question of the parsed document is its place.
"""

from __future__ import annotations

import re
import tomllib
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from itertools import islice
from typing import Any

from codra_dsl.language.diagnostics import Place, Span

Steps = tuple[str | int, ...]

MAX_TRIES = 500
"""The maximum number of occurrences that are tried; beyond it, the place is the beginning of the file."""

_ELSE = "codra-looks-for-this"
_QUOTES = "\"'"


@dataclass(frozen=True, slots=True)
class TomlPlaces:
    """The places of the keys and values of a TOML file."""

    file: str
    text: str

    def key(self, *steps: str | int) -> Place:
        """Return the place of a key, by the steps that lead to it; for an item of a list, the place of the list."""
        *table, key = [step for step in steps if isinstance(step, str)]
        start, end = self._sought(key, _ELSE, lambda document: _ELSE in _at(document, table)) or (0, 0)
        return self._place(start, end)

    def value(self, *steps: str | int) -> Place:
        """Return the place of a value, otherwise of its key."""
        value = _at(tomllib.loads(self.text), steps)
        written = value if isinstance(value, str) else str(value).lower()
        instead = _ELSE if isinstance(value, str) else f"'{_ELSE}'"
        span = self._sought(written, instead, lambda document: _at(document, steps) == _ELSE)
        return self.key(*steps) if span is None else self._place(*span)

    def _sought(self, written: str, instead: str, is_it: Callable[[dict[str, object]], bool]) -> tuple[int, int] | None:
        """Return the occurrence of a text whose replacement passes the test `is_it` in the parsed document."""
        for match in islice(re.finditer(re.escape(written), self.text), MAX_TRIES):
            start, end = match.span()
            try:
                if is_it(tomllib.loads(self.text[:start] + instead + self.text[end:])):
                    is_quoted = start > 0 and self.text[start - 1] in _QUOTES
                    return (start - 1, end + 1) if is_quoted else (start, end)
            except (tomllib.TOMLDecodeError, RecursionError):
                continue
        return None

    def _place(self, start: int, end: int) -> Place:
        before = self.text[:start]
        line, first = before.count("\n") + 1, start - before.rfind("\n")
        last, end_first = line + self.text.count("\n", start, end), end - self.text.rfind("\n", 0, end)
        return Place(Span(self.file, line, first, last, end_first))


def _at(document: Any, steps: Sequence[str | int]) -> Any:
    """Return the value at the end of the steps, or an empty table if it does not exist."""
    for step in steps:
        try:
            document = document[step]
        except (LookupError, TypeError):
            return {}
    return document
