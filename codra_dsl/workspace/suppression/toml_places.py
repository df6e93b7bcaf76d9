"""Where keys and values stand in a TOML text, which Python's `tomllib` does not tell.

So it is asked another way: what stands there is the one whose change changes just that key or value of the document.
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
"""How many occurrences of a text are tried; past them a key or value stands at the file's beginning."""

_ELSE = "codra-looks-for-this"
_QUOTES = "\"'"


@dataclass(frozen=True, slots=True)
class TomlPlaces:
    """The places of the keys and values of a TOML file."""

    file: str
    text: str

    def key(self, *steps: str | int) -> Place:
        """Return the place of a key, by the steps that lead to it; of a list's item, that of the list."""
        *table, key = [step for step in steps if isinstance(step, str)]
        start, end = self._sought(key, _ELSE, lambda document: _ELSE in _at(document, table)) or (0, 0)
        return self._place(start, end)

    def value(self, *steps: str | int) -> Place:
        """Return the place of a value, or else of its key."""
        value = _at(tomllib.loads(self.text), steps)
        written = value if isinstance(value, str) else str(value).lower()
        instead = _ELSE if isinstance(value, str) else f"'{_ELSE}'"
        found = self._sought(written, instead, lambda document: _at(document, steps) == _ELSE)
        return self.key(*steps) if found is None else self._place(*found)

    def _sought(self, written: str, instead: str, is_it: Callable[[dict[str, object]], bool]) -> tuple[int, int] | None:
        """Return the occurrence of a text that is it: the document tells when something else stands in its place."""
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
    """Return what the steps lead to; an empty table where they lead nowhere."""
    for step in steps:
        try:
            document = document[step]
        except (LookupError, TypeError):
            return {}
    return document
