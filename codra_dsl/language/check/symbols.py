"""The names of a spec: its declarations, and every place that uses a name.

The modules of single topics collect most uses, for their checks. This module adds the parameters of templates, the
members of enums, and the words of fuzzy rules. Editors need all of them.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import NamedTuple

from codra_dsl.language.check.conditions.conditions import KNOWLEDGE_ROLES, RESULT_ROLES, Site
from codra_dsl.language.check.index.mentions import Mention, references, resource_mentions, source_mentions
from codra_dsl.language.check.index.spec_index import SpecIndex
from codra_dsl.language.check.knowledge.mentions import edge_mentions, end_mentions, node_mentions, type_mentions
from codra_dsl.language.check.loops.names import references_in_loops
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.expression import Choice, Compare, Fallback, In, Node, Text, names_in
from codra_dsl.language.expression.tree import parts
from codra_dsl.language.load.schema.document import SECTIONS
from codra_dsl.language.model import Members, Spec, ValueType
from codra_dsl.language.model.mape import ADAPTER, ANALYST

RETURNS = "returns"
"""The section of the values that algorithms return."""

PARAMETERS = "parameters"
"""The section of the parameters of templates."""

VALUES = "values"
"""The section of the members of enums."""

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


Places = Iterator[tuple[Symbol, Place]]
"""Symbols with places that declare or use them."""


def declarations(spec: Spec) -> Places:
    """Yield everything that a spec declares, with the places of the declarations."""
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


class Uses:
    """The uses of names in one spec."""

    def __init__(self, tables: SpecIndex) -> None:
        self._tables, self._spec = tables, tables.spec
        self._declared = frozenset(symbol for symbol, _ in declarations(tables.spec))

    def all(self) -> Places:
        """Yield every use of a name, in conditions, keys, fuzzy rules and templates."""
        yield from self._mentioned("context", references(self._tables))
        yield from self._mentioned("resources", resource_mentions(self._tables))
        loop_agents = {ANALYST, ADAPTER}  # codra adds them as writers; a spec names them nowhere
        sources = (mention for mention in source_mentions(self._tables) if mention.name not in loop_agents)
        yield from self._mentioned("agents", sources)
        yield from self._in_knowledge()
        for section, _, reference, _ in references_in_loops(self._tables):
            yield Symbol(section, reference.name), reference.place
        for site in self._tables.sites:
            yield from self._in_condition(site)
        yield from self._in_fuzzy_rules()
        for algorithm in self._spec.perception:
            for entry in algorithm.identifies:
                for member, _ in entry.by.cases if isinstance(entry.by, Members) else ():
                    yield from self._member(member.name, entry.variable.name, member.place)
        yield from self._in_templates()

    def _mentioned(self, section: str, mentions: Iterable[Mention]) -> Places:
        return ((self.symbol(section, mention.name), mention.place) for mention in mentions)

    def _member(self, name: str, owner: str, place: Place) -> Places:
        """Yield a text or a word, if it is a member of the owner's enum."""
        symbol = self.symbol(VALUES, name, owner)
        yield from ((symbol, place),) if symbol in self._declared else ()

    def symbol(self, section: str, name: str, owner: str = "") -> Symbol:
        """Return the symbol with a name in a section.

        Metrics and courses are also context-variables, the members of courses are actions, and tasks are nodes.
        """
        if section == "nodes" and name in self._tables.declared_graph.tasks:
            return Symbol("tasks", name)
        variable = self._tables.variables.get(owner if section == VALUES else name)
        if section in ("context", VALUES) and variable is not None and variable.is_derived:
            if section == VALUES:
                return Symbol("actions", name)
            tables = (("metrics", self._spec.metrics), ("adaptation", self._spec.adaptation))
            declaring = (other for other, elements in tables if any(element.name == name for element in elements))
            return Symbol(next(declaring, section), name)
        return Symbol(section, name, owner)

    def _in_knowledge(self) -> Places:
        tables, graph = self._tables, self._tables.declared_graph
        yield from self._mentioned("types", type_mentions(tables))
        yield from self._mentioned("nodes", node_mentions(tables))
        for mention in edge_mentions(tables):
            yield from ((Symbol("edges", edge.name), mention.place) for edge in graph.edges_of_word(mention.name))
        for mention in end_mentions(tables):
            yield Symbol("nodes" if mention.name in graph.nodes else "types", mention.name), mention.place
        for node in self._spec.nodes:
            yield Symbol("types", node.type.name), node.type.place
        for agent in self._spec.agents:
            for reference in (*agent.conduct.owns, *agent.conduct.reads):
                element = graph.element_named(reference.name)
                if element is not None:
                    yield self.symbol(element.section, element.name), reference.place

    def _in_condition(self, site: Site) -> Places:
        algorithm = site.owner[1] if site.role in RESULT_ROLES else ""
        for name in (name for name in site.names if name.pose_comparison is None):
            symbol = self.symbol("context", name.name)
            if algorithm:
                symbol = Symbol(RETURNS, name.name, algorithm)
            elif site.role in KNOWLEDGE_ROLES:
                element = self._tables.declared_graph.element_read_by(name.name)
                if element is None or element.section != "context":
                    continue  # the checks of knowledge mention nodes
                symbol = self.symbol("context", element.name)
            yield symbol, site.condition.place_of(name)
        for owner, text in _texts(site.condition.tree, site.variable or "", f"{algorithm}." if algorithm else ""):
            yield from self._member(text.value, owner, site.condition.place_of(text))

    def _in_fuzzy_rules(self) -> Places:
        for (section, output), rules in self._tables.parsed_rules.rules.items():
            for phrase in (rule.phrase for rule in rules):
                for match in _IN_RULE.finditer(phrase.text):
                    name = match["name"]
                    symbol = Symbol(section, name) if name == output else self.symbol("context", name)
                    yield symbol, phrase.place_between(*match.span("name"))
                    yield from self._member(match["term"], name, phrase.place_between(*match.span("term")))

    def _in_templates(self) -> Places:
        for template in self._spec.templates:
            for parameter in template.parameters:
                symbol = Symbol(PARAMETERS, parameter.name, template.name)
                yield from ((symbol, place) for place in parameter.mentions)
        for use in self._spec.uses:
            yield Symbol("templates", use.template), use.template_place
            yield from ((Symbol(PARAMETERS, one.name, use.template), one.place) for one in use.arguments)


def _members(value_type: ValueType, owner: str) -> Places:
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
