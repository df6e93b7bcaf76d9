"""The names of a spec: where each of them is declared, and every place that uses it.

The checks collect most uses. The index adds the places of declarations, the parameters of templates, the members of
enums, and the words of fuzzy rules.
"""

from __future__ import annotations

import os
import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

from codra_dsl.language.check import CheckedSpec
from codra_dsl.language.check.conditions.conditions import KNOWLEDGE_ROLES, RESULT_ROLES, Site
from codra_dsl.language.check.index.mentions import Mention, references, resource_mentions, source_mentions
from codra_dsl.language.check.index.spec_index import SpecIndex
from codra_dsl.language.check.knowledge.mentions import edge_mentions, end_mentions, node_mentions, type_mentions
from codra_dsl.language.check.latency import worst_cases
from codra_dsl.language.check.loops.names import references_in_loops
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.expression import Choice, Compare, Fallback, In, Node, Text, names_in
from codra_dsl.language.expression.tree import parts
from codra_dsl.language.load.schema.document import SECTIONS
from codra_dsl.language.model import AnyName, Members, Spec, ValueType
from codra_dsl.language.model.mape import ADAPTER, ANALYST
from codra_dsl.tooling.language_server.documents import Document, Move, Texts
from codra_dsl.tooling.language_server.other_files import VALUES, other_file

RETURNS = "returns"
"""The section of the values that algorithms return."""

PARAMETERS = "parameters"
"""The section of the parameters of templates."""

_IN_RULE = re.compile(r"\b(?P<name>\w+)\s+is(?:\s+not)?\s+(?P<term>\w+)")


class Symbol(NamedTuple):
    """Something with a name.

    Attributes:
        section: its section, such as `context`; `returns`, `values`, `templates`, `parameters` and `use` are sections
            here.
        owner: the algorithm that returns a value, the template of a parameter, or the variable of a member of an enum,
            ALGORITHM.VALUE for a returned value; empty in other sections.
    """

    section: str
    name: str
    owner: str = ""


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


_Named = Iterator[tuple[Symbol, Place]]


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
    def declarations(self) -> Mapping[Symbol, Place]:
        """The place of each declaration."""
        return dict(self._declared())

    def declares_same(self, symbol: Symbol, other: SpecNames) -> bool:
        """Return whether a symbol has one declaration in two specs."""
        return symbol in self.declarations and self.declarations[symbol] == other.declarations.get(symbol)

    def members(self, owner: str) -> Sequence[str]:
        """Return the members of an enum: of a variable, or of a returned value ALGORITHM.VALUE."""
        variable = self.tables.variables.get(owner)
        if variable is not None:
            return variable.type.values
        return [symbol.name for symbol in self.declarations if (symbol.section, symbol.owner) == (VALUES, owner)]

    def _declared(self) -> _Named:
        spec = self.spec
        yield Symbol("spec", spec.name), spec.place
        for section in SECTIONS:
            for element in getattr(spec, section):
                if not getattr(element, "is_derived", False) and element.place != spec.place:  # else it is implicit
                    yield Symbol(section, element.name), element.place
        for variable in spec.context:
            yield from _members(variable.type, variable.name)
        for algorithm in spec.perception:
            for value in algorithm.returns:
                yield Symbol(RETURNS, value.name, algorithm.name), value.place
                yield from _members(value.type, f"{algorithm.name}.{value.name}")
        for template in spec.templates:
            yield Symbol("templates", template.name), template.place
            for parameter in template.parameters:
                yield Symbol(PARAMETERS, parameter.name, template.name), parameter.place
        for use in spec.uses:
            yield Symbol("use", use.instance), use.place

    def _used(self) -> _Named:
        yield from self._mentioned("context", references(self.tables))
        yield from self._mentioned("resources", resource_mentions(self.tables))
        loop_agents = {ANALYST, ADAPTER}  # codra adds them as writers; a spec names them nowhere
        sources = (mention for mention in source_mentions(self.tables) if mention.name not in loop_agents)
        yield from self._mentioned("agents", sources)
        yield from self._in_knowledge()
        for section, _, reference, _ in references_in_loops(self.tables):
            yield Symbol(section, reference.name), reference.place
        for site in self.tables.sites:
            yield from self._in_condition(site)
        yield from self._in_fuzzy_rules()
        for algorithm in self.spec.perception:
            for entry in algorithm.identifies:
                for member, _ in entry.by.cases if isinstance(entry.by, Members) else ():
                    yield from self._member(member.name, entry.variable.name, member.place)
        yield from self._in_templates()

    def _mentioned(self, section: str, mentions: Iterable[Mention]) -> _Named:
        return ((self.symbol(section, mention.name), mention.place) for mention in mentions)

    def _member(self, name: str, owner: str, place: Place) -> _Named:
        """Yield a text or a word, if it is a member of the owner's enum."""
        symbol = self.symbol(VALUES, name, owner)
        yield from ((symbol, place),) if symbol in self.declarations else ()

    def symbol(self, section: str, name: str, owner: str = "") -> Symbol:
        """Return the symbol with a name in a section.

        Metrics and courses are also context-variables, the members of courses are actions, and tasks are nodes.
        """
        if section == "nodes" and name in self.tables.declared_graph.tasks:
            return Symbol("tasks", name)
        variable = self.tables.variables.get(owner if section == VALUES else name)
        if section in ("context", VALUES) and variable is not None and variable.is_derived:
            if section == VALUES:
                return Symbol("actions", name)
            tables = (("metrics", self.spec.metrics), ("adaptation", self.spec.adaptation))
            declaring = (other for other, elements in tables if any(element.name == name for element in elements))
            return Symbol(next(declaring, section), name)
        return Symbol(section, name, owner)

    def _in_knowledge(self) -> _Named:
        tables, graph = self.tables, self.tables.declared_graph
        yield from self._mentioned("types", type_mentions(tables))
        yield from self._mentioned("nodes", node_mentions(tables))
        for mention in edge_mentions(tables):
            yield from ((Symbol("edges", edge.name), mention.place) for edge in graph.edges_of_word(mention.name))
        for mention in end_mentions(tables):
            yield Symbol("nodes" if mention.name in graph.nodes else "types", mention.name), mention.place
        for node in self.spec.nodes:
            yield Symbol("types", node.type.name), node.type.place
        for agent in self.spec.agents:
            for reference in (*agent.conduct.owns, *agent.conduct.reads):
                element = graph.element_named(reference.name)
                if element is not None:
                    yield self.symbol(element.section, element.name), reference.place

    def _in_condition(self, site: Site) -> _Named:
        algorithm = site.owner[1] if site.role in RESULT_ROLES else ""
        for name in (name for name in site.names if name.pose_comparison is None):
            symbol = self.symbol("context", name.name)
            if algorithm:
                symbol = Symbol(RETURNS, name.name, algorithm)
            elif site.role in KNOWLEDGE_ROLES:
                element = self.tables.declared_graph.element_read_by(name.name)
                if element is None or element.section != "context":
                    continue  # the checks of knowledge mention nodes
                symbol = self.symbol("context", element.name)
            yield symbol, site.condition.place_of(name)
        for owner, text in _texts(site.condition.tree, site.variable or "", f"{algorithm}." if algorithm else ""):
            yield from self._member(text.value, owner, site.condition.place_of(text))

    def _in_fuzzy_rules(self) -> _Named:
        for (section, output), rules in self.tables.parsed_rules.rules.items():
            for phrase in (rule.phrase for rule in rules):
                for match in _IN_RULE.finditer(phrase.text):
                    name = match["name"]
                    symbol = Symbol(section, name) if name == output else self.symbol("context", name)
                    yield symbol, phrase.place_between(*match.span("name"))
                    yield from self._member(match["term"], name, phrase.place_between(*match.span("term")))

    def _in_templates(self) -> _Named:
        for template in self.spec.templates:
            for parameter in template.parameters:
                symbol = Symbol(PARAMETERS, parameter.name, template.name)
                yield from ((symbol, place) for place in parameter.mentions)
        for use in self.spec.uses:
            yield Symbol("templates", use.template), use.template_place
            yield from ((Symbol(PARAMETERS, one.name, use.template), one.place) for one in use.arguments)

    @cached_property
    def ranges(self) -> Mapping[str, tuple[Range, ...]]:
        """The declarations and uses in each file, as ranges of the texts that were loaded."""
        ranges: dict[str, list[Range]] = {}
        for symbol, place in dict.fromkeys((*self.declarations.items(), *self._used())):
            is_declaration = self.declarations.get(symbol) == place
            name_range = _range(symbol, place, self.texts.document(place.span.file), is_declaration=is_declaration)
            ranges.setdefault(place.span.file, []).append(name_range)
        return {file: tuple(of_file) for file, of_file in ranges.items()}


def _members(value_type: ValueType, owner: str) -> _Named:
    places = ((name, value_type.places.get(f"values.{name}")) for name in value_type.values)
    return ((Symbol(VALUES, name, owner), place) for name, place in places if place is not None)


def _texts(node: Node | None, owner: str, prefix: str) -> Iterator[tuple[str, Text]]:
    """Yield each text in quotes with the owner of the enum of which it is a member.

    `owner` gets the value of the node; the owners of compared values begin with `prefix`.
    """
    if isinstance(node, Text):
        yield owner, node
    elif isinstance(node, Compare | In):
        compared = next((f"{prefix}{name.name}" for name in names_in(node)), "")
        for part in parts(node):
            yield from _texts(part, compared, prefix)
    elif isinstance(node, Choice | Fallback):
        for part in parts(node):
            is_condition = isinstance(node, Choice) and part is node.condition
            yield from _texts(part, "" if is_condition else owner, prefix)
    elif node is not None:
        for part in parts(node):
            yield from _texts(part, "", prefix)


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
        """Return every place of symbols in specs, and in those of other files that are sites or timelines."""
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

    def in_file(self, file: str) -> list[Range]:
        """Return the names in a file, in the order of its text."""
        found = [name_range for names in self.specs for name_range in self._in_file(names, file)]
        return sorted(found, key=lambda name_range: (name_range.start, name_range.end))

    def _in_file(self, names: SpecNames, file: str) -> Iterator[Range]:
        for name_range in names.ranges.get(file, ()):
            moved = self.move(names, file).range(name_range.start, name_range.end)
            if moved is not None:
                yield name_range._replace(start=moved[0], end=moved[1])
        other = other_file(self.texts.document(file), file)
        for section, name, owner, start, end in other.names if other.spec == names.spec.name else ():
            symbol = names.symbol(section, name, owner)
            if symbol in names.declarations:
                yield Range(symbol, file, start, end, is_declaration=False, is_written=True)

    def move(self, names: SpecNames, file: str) -> Move:
        """Return how a text that was loaded has changed since."""
        key = id(names), file
        if key not in self._moves:
            self._moves[key] = Move(names.texts.document(file).text, self.texts.document(file).text)
        return self._moves[key]
