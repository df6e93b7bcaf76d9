"""The names of a spec: where each of them is declared, and every place that uses it.

The checks collect most uses. The index adds the places of declarations, and the words of fuzzy rules.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from codra_dsl.language.check import CheckedSpec
from codra_dsl.language.check.conditions.conditions import KNOWLEDGE_ROLES, RESULT_ROLES
from codra_dsl.language.check.index.mentions import Mention, references, resource_mentions, source_mentions
from codra_dsl.language.check.index.spec_index import SpecIndex
from codra_dsl.language.check.knowledge.mentions import edge_mentions, end_mentions, node_mentions, type_mentions
from codra_dsl.language.check.latency import worst_cases
from codra_dsl.language.check.loops.names import references_in_loops
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.load.schema.document import SECTIONS
from codra_dsl.language.model import AnyName, Spec
from codra_dsl.language.model.mape import ADAPTER, ANALYST
from codra_dsl.tooling.language_server.documents import Document, Move, Texts
from codra_dsl.tooling.language_server.other_files import names_in

RETURNS = "returns"
"""The section of the values that algorithms return."""

_NAMED_IN_RULE = re.compile(r"\b(?P<name>\w+)\s+is\b")


class Symbol(NamedTuple):
    """Something with a name.

    Attributes:
        section: its section, such as `context`; `returns`, `templates` and `use` are sections here.
        owner: the algorithm that returns a value; empty in other sections.
    """

    section: str
    name: str
    owner: str = ""


class Occurrence(NamedTuple):
    """A place that declares or uses a symbol."""

    symbol: Symbol
    place: Place
    is_declaration: bool = False


class Range(NamedTuple):
    """An occurrence as a range of the text of a file.

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
    def is_whole(self) -> bool:
        """Whether all names of the spec could be read."""
        return not any(isinstance(names, AnyName) for names in self.spec.damaged.values())

    @cached_property
    def tables(self) -> SpecIndex:
        """The spec with its names in tables."""
        return SpecIndex(self.spec)

    @cached_property
    def worst_cases(self) -> Mapping[str, float]:
        """The worst-case time until each variable is known, in seconds; empty while the spec has errors."""
        return {} if self.checked is None else worst_cases(self.checked)

    @cached_property
    def occurrences(self) -> tuple[Occurrence, ...]:
        """Every place that declares or uses a name."""
        return tuple(dict.fromkeys((*self._declarations(), *self._uses())))

    @cached_property
    def declarations(self) -> Mapping[Symbol, Place]:
        """The place of each declaration."""
        return {symbol: place for symbol, place, is_declaration in self.occurrences if is_declaration}

    def declares_same(self, symbol: Symbol, other: SpecNames) -> bool:
        """Return whether a symbol has one declaration in two specs."""
        return symbol in self.declarations and self.declarations[symbol] == other.declarations.get(symbol)

    def _declarations(self) -> Iterator[Occurrence]:
        spec = self.spec
        yield Occurrence(Symbol("spec", spec.name), spec.place, is_declaration=True)
        for section in SECTIONS:
            for element in getattr(spec, section):
                if not getattr(element, "is_derived", False) and element.place != spec.place:  # else it is implicit
                    yield Occurrence(Symbol(section, element.name), element.place, is_declaration=True)
        for algorithm in spec.perception:
            for value in algorithm.returns:
                yield Occurrence(Symbol(RETURNS, value.name, algorithm.name), value.place, is_declaration=True)
        for template in spec.templates:
            yield Occurrence(Symbol("templates", template.name), template.place, is_declaration=True)
        for use in spec.uses:
            yield Occurrence(Symbol("use", use.instance), use.place, is_declaration=True)
            yield Occurrence(Symbol("templates", use.template), use.template_place)

    def _uses(self) -> Iterator[Occurrence]:
        tables = self.tables
        yield from self._mentioned("context", references(tables))
        yield from self._mentioned("resources", resource_mentions(tables))
        loop_agents = {ANALYST, ADAPTER}  # codra adds them as writers; a spec names them nowhere
        yield from self._mentioned("agents", (use for use in source_mentions(tables) if use.name not in loop_agents))
        yield from self._mentioned("types", type_mentions(tables))
        yield from self._mentioned("nodes", node_mentions(tables))
        for mention in edge_mentions(tables):
            for edge in tables.declared_graph.edges_of_word(mention.name):
                yield Occurrence(Symbol("edges", edge.name), mention.place)
        for mention in end_mentions(tables):
            section = "nodes" if mention.name in tables.declared_graph.nodes else "types"
            yield Occurrence(Symbol(section, mention.name), mention.place)
        for node in self.spec.nodes:
            yield Occurrence(Symbol("types", node.type.name), node.type.place)
        for section, _, reference, _ in references_in_loops(tables):
            yield Occurrence(Symbol(section, reference.name), reference.place)
        yield from self._in_conditions()
        yield from self._in_fuzzy_rules()
        yield from self._of_agents()

    def _mentioned(self, section: str, mentions: Iterable[Mention]) -> Iterator[Occurrence]:
        return (Occurrence(self.symbol(section, mention.name), mention.place) for mention in mentions)

    def symbol(self, section: str, name: str) -> Symbol:
        """Return the symbol with a name in a section. Metrics and courses are also context-variables, tasks nodes."""
        if section == "nodes" and name in self.tables.declared_graph.tasks:
            return Symbol("tasks", name)
        variable = self.tables.variables.get(name) if section == "context" else None
        if variable is not None and variable.is_derived:
            tables = (("metrics", self.spec.metrics), ("adaptation", self.spec.adaptation))
            declaring = (other for other, elements in tables if any(element.name == name for element in elements))
            return Symbol(next(declaring, section), name)
        return Symbol(section, name)

    def _in_conditions(self) -> Iterator[Occurrence]:
        for site in self.tables.sites:
            for name in (name for name in site.names if name.pose_comparison is None):
                symbol = self.symbol("context", name.name)
                if site.role in RESULT_ROLES:
                    symbol = Symbol(RETURNS, name.name, site.owner[1])
                elif site.role in KNOWLEDGE_ROLES:
                    element = self.tables.declared_graph.element_read_by(name.name)
                    if element is None or element.section != "context":
                        continue  # the checks of knowledge mention nodes
                    symbol = self.symbol("context", element.name)
                yield Occurrence(symbol, site.condition.place_of(name))

    def _in_fuzzy_rules(self) -> Iterator[Occurrence]:
        for (section, name), rules in self.tables.parsed_rules.rules.items():
            for rule in rules:
                for match in _NAMED_IN_RULE.finditer(rule.phrase.text):
                    symbol = Symbol(section, name) if match["name"] == name else self.symbol("context", match["name"])
                    yield Occurrence(symbol, rule.phrase.place_between(*match.span("name")))

    def _of_agents(self) -> Iterator[Occurrence]:
        """Yield what agents own and read."""
        for agent in self.spec.agents:
            for reference in (*agent.conduct.owns, *agent.conduct.reads):
                element = self.tables.declared_graph.element_named(reference.name)
                if element is not None:
                    yield Occurrence(self.symbol(element.section, element.name), reference.place)

    @cached_property
    def ranges(self) -> Mapping[str, tuple[Range, ...]]:
        """The occurrences in each file, as ranges of the texts that were loaded."""
        ranges: dict[str, list[Range]] = {}
        for occurrence in self.occurrences:
            file = occurrence.place.span.file
            ranges.setdefault(file, []).append(self._range(occurrence, self.texts.document(file)))
        return {file: tuple(of_file) for file, of_file in ranges.items()}

    def _range(self, occurrence: Occurrence, document: Document) -> Range:
        """Return the range of the name itself: quotes, and the rest of an expression with poses, are left out."""
        symbol, place, is_declaration = occurrence
        start, end = document.offsets_of(place.span)
        written = document.text[start:end]
        words = [] if "$(" in written else list(re.finditer(rf"\b{re.escape(symbol.name)}\b", written))
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
        found = [
            (names, name_range)
            for names in self.specs
            for name_range in self._in_file(names, cursor.file)
            if name_range.start <= cursor.offset <= name_range.end
        ]
        shortest = min((name_range.end - name_range.start for _, name_range in found), default=0)
        return [(names, name_range) for names, name_range in found if name_range.end - name_range.start == shortest]

    def symbols(self, cursor: Cursor) -> list[tuple[SpecNames, Symbol]]:
        """Return the symbols at a cursor, and those of other specs with the same declarations, in shared parts."""
        return list(
            dict.fromkeys(
                (names, name_range.symbol)
                for found_names, name_range in self.at(cursor)
                for names in self.specs
                if names is found_names or names.declares_same(name_range.symbol, found_names)
            )
        )

    def ranges(self, symbols: Iterable[tuple[SpecNames, Symbol]], other_files: Iterable[str] = ()) -> list[Range]:
        """Return every occurrence of symbols in specs, and in those of other files that are sites or timelines."""
        wanted = set(symbols)
        found = [
            name_range
            for names in dict.fromkeys(names for names, _ in wanted)
            for file in (*names.ranges, *other_files)
            for name_range in self._in_file(names, file)
            if (names, name_range.symbol) in wanted
        ]
        places = {(name_range.file, name_range.start, name_range.end): name_range for name_range in found}
        return sorted(places.values(), key=lambda name_range: (name_range.file, name_range.start))

    def definitions(self, cursor: Cursor) -> list[Range]:
        """Return where the names at a cursor are declared; for the path of a file, the beginning of this file."""
        found = [name_range for name_range in self.ranges(self.symbols(cursor)) if name_range.is_declaration]
        path = cursor.document.path_at(cursor.offset)
        file = os.path.normpath(os.path.join(os.path.dirname(cursor.file), path))  # noqa: PTH118, PTH120 - a name
        if found or not path or not (self.texts.root / file).is_file():
            return found
        return [Range(Symbol("file", path), file, 0, 0, is_declaration=True, is_written=True)]

    def references(self, cursor: Cursor, other_files: Iterable[str]) -> list[Range]:
        """Return every occurrence of the names at a cursor."""
        symbols = self.symbols(cursor)
        return self.ranges(symbols, other_files if symbols else ())

    def in_file(self, file: str) -> list[Range]:
        """Return the occurrences in a file, in the order of its text."""
        found = [name_range for names in self.specs for name_range in self._in_file(names, file)]
        return sorted(found, key=lambda name_range: (name_range.start, name_range.end))

    def _in_file(self, names: SpecNames, file: str) -> Iterator[Range]:
        for name_range in names.ranges.get(file, ()):
            moved = self.move(names, file).range(name_range.start, name_range.end)
            if moved is not None:
                yield name_range._replace(start=moved[0], end=moved[1])
        spec, other_names = names_in(self.texts.document(file), file)
        for section, name, start, end in other_names if spec == names.spec.name else ():
            symbol = names.symbol(section, name)
            if symbol in names.declarations:
                yield Range(symbol, file, start, end, is_declaration=False, is_written=True)

    def move(self, names: SpecNames, file: str) -> Move:
        """Return how a text that was loaded has changed since."""
        key = id(names), file
        if key not in self._moves:
            self._moves[key] = Move(names.texts.document(file).text, self.texts.document(file).text)
        return self._moves[key]
