"""The names of specs in the texts of an editor: where they are declared and used, also after changes of the texts."""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from codra_dsl.language.check import CheckedSpec
from codra_dsl.language.check.index.spec_index import SpecIndex
from codra_dsl.language.check.latency import worst_cases
from codra_dsl.language.check.symbols import PARAMETERS, VALUES, Symbol, Uses, declarations
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.model import AnyName, Spec
from codra_dsl.tooling.language_server.documents import Document, Move, Texts
from codra_dsl.tooling.language_server.other_files import other_file


class Range(NamedTuple):
    """A place that declares or uses a symbol, as a range of the text of a file.

    Attributes:
        is_written: whether the range has the name as it is; otherwise a parameter makes the name, or a part of it.
    """

    symbol: Symbol
    file: str
    start: int
    end: int
    is_declaration: bool
    is_written: bool


@dataclass(frozen=True, eq=False)
class SpecNames:
    """The names of one spec.

    Attributes:
        checked: None if an error prevents planning.
        texts: the texts of the spec's files when it was loaded.
    """

    spec: Spec
    checked: CheckedSpec | None
    texts: Texts

    @property
    def is_complete(self) -> bool:
        """Whether all names of the spec could be read."""
        return not any(isinstance(names, AnyName) for names in self.spec.damaged.values())

    @cached_property
    def tables(self) -> SpecIndex:
        """The spec with its names in tables."""
        return SpecIndex(self.spec)

    @cached_property
    def uses(self) -> Uses:
        """The uses of names."""
        return Uses(self.tables)

    @cached_property
    def worst_cases(self) -> Mapping[str, float]:
        """The worst-case time until each variable is known, in seconds; empty while the spec has errors."""
        return {} if self.checked is None else worst_cases(self.checked)

    @cached_property
    def declarations(self) -> Mapping[Symbol, Place]:
        """The place of each declaration."""
        return dict(declarations(self.spec))

    def declares_same(self, symbol: Symbol, other: SpecNames) -> bool:
        """Return whether a symbol has one declaration in two specs."""
        return symbol in self.declarations and self.declarations[symbol] == other.declarations.get(symbol)

    def members(self, owner: str) -> Sequence[str]:
        """Return the members of an enum: of a variable, or of a returned value ALGORITHM.VALUE."""
        variable = self.tables.variables.get(owner)
        if variable is not None:
            return variable.type.values
        return [symbol.name for symbol in self.declarations if (symbol.section, symbol.owner) == (VALUES, owner)]

    @cached_property
    def ranges(self) -> Mapping[str, tuple[Range, ...]]:
        """The declarations and uses in each file, as ranges of the texts that were loaded."""
        ranges: dict[str, list[Range]] = {}
        for symbol, place in dict.fromkeys((*self.declarations.items(), *self.uses.all())):
            is_declaration = self.declarations.get(symbol) == place
            name_range = _range(symbol, place, self.texts.document(place.span.file), is_declaration=is_declaration)
            ranges.setdefault(place.span.file, []).append(name_range)
        return {file: tuple(of_file) for file, of_file in ranges.items()}


def _range(symbol: Symbol, place: Place, document: Document, *, is_declaration: bool) -> Range:
    """Return the range of the name itself: quotes, and the rest of an expression with poses, are left out."""
    start, end = document.offsets_of(place.span)
    written = document.text[start:end]
    is_made = "$(" in written and symbol.section != PARAMETERS
    words = [] if is_made else list(re.finditer(rf"(?<!\w){re.escape(symbol.name)}(?!\w)", written))
    if len(words) == 1:
        start, end = start + words[0].start(), start + words[0].end()
    return Range(symbol, place.span.file, start, end, is_declaration, is_written=len(words) == 1)


@dataclass(frozen=True, slots=True)
class Cursor:
    """A position in the newest text of a file."""

    index: Index
    file: str
    offset: int

    @property
    def document(self) -> Document:
        """The text of the file."""
        return self.index.texts.document(self.file)


class Index:
    """The names of a project in its newest texts.

    Attributes:
        specs: the names of each spec, from the last texts that could be read.
        texts: the newest texts.
    """

    def __init__(self, specs: Sequence[SpecNames], texts: Texts) -> None:
        self.specs, self.texts = specs, texts
        self._moves: dict[tuple[int, str], Move] = {}

    def is_current(self, names: SpecNames) -> bool:
        """Return whether the names of a spec are those of its newest texts."""
        return all(names.texts.document(file).text == self.texts.document(file).text for file in names.spec.files)

    def at(self, cursor: Cursor) -> list[tuple[SpecNames, Range]]:
        """Return the names at a cursor. The text of a template can have a name of each of its uses."""
        matches = [
            (names, name_range)
            for names in self.specs
            for name_range in self._in_file(names, cursor.file)
            if name_range.start <= cursor.offset <= name_range.end
        ]
        shortest = min((name_range.end - name_range.start for _, name_range in matches), default=0)
        return [(names, name_range) for names, name_range in matches if name_range.end - name_range.start == shortest]

    def symbols(self, cursor: Cursor) -> list[tuple[SpecNames, Symbol]]:
        """Return the symbols at a cursor, and those of other specs with the same declarations, in shared parts."""
        return list(
            dict.fromkeys(
                (names, name_range.symbol)
                for names_at_cursor, name_range in self.at(cursor)
                for names in self.specs
                if names is names_at_cursor or names.declares_same(name_range.symbol, names_at_cursor)
            )
        )

    def ranges(self, symbols: Iterable[tuple[SpecNames, Symbol]], other_files: Iterable[str] = ()) -> list[Range]:
        """Return every place of symbols in specs, and in those of other files that are sites or timelines."""
        wanted = set(symbols)
        name_ranges = [
            name_range
            for names in dict.fromkeys(names for names, _ in wanted)
            for file in (*names.ranges, *other_files)
            for name_range in self._in_file(names, file)
            if (names, name_range.symbol) in wanted
        ]
        places = {(name_range.file, name_range.start, name_range.end): name_range for name_range in name_ranges}
        return sorted(places.values(), key=lambda name_range: (name_range.file, name_range.start))

    def definitions(self, cursor: Cursor) -> list[Range]:
        """Return where the names at a cursor are declared; for the path of a file, the beginning of this file."""
        name_ranges = [name_range for name_range in self.ranges(self.symbols(cursor)) if name_range.is_declaration]
        path = cursor.document.path_at(cursor.offset)
        file = os.path.normpath(os.path.join(os.path.dirname(cursor.file), path))  # noqa: PTH118, PTH120 - a name
        if name_ranges or not path or not (self.texts.root / file).is_file():
            return name_ranges
        return [Range(Symbol("file", path), file, 0, 0, is_declaration=True, is_written=True)]

    def in_file(self, file: str) -> list[Range]:
        """Return the names in a file, in the order of its text."""
        name_ranges = [name_range for names in self.specs for name_range in self._in_file(names, file)]
        return sorted(name_ranges, key=lambda name_range: (name_range.start, name_range.end))

    def _in_file(self, names: SpecNames, file: str) -> Iterator[Range]:
        for name_range in names.ranges.get(file, ()):
            moved = self.move(names, file).range(name_range.start, name_range.end)
            if moved is not None:
                yield name_range._replace(start=moved[0], end=moved[1])
        other = other_file(self.texts.document(file), file)
        for section, name, owner, start, end in other.names if other.spec == names.spec.name else ():
            symbol = names.uses.symbol(section, name, owner)
            if symbol in names.declarations:
                yield Range(symbol, file, start, end, is_declaration=False, is_written=True)

    def move(self, names: SpecNames, file: str) -> Move:
        """Return how a text that was loaded has changed since."""
        key = id(names), file
        if key not in self._moves:
            self._moves[key] = Move(names.texts.document(file).text, self.texts.document(file).text)
        return self._moves[key]
