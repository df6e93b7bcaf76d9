"""Rules of phase 1: every name in an element is declared, has the right kind, and can be read in this place."""

from __future__ import annotations

import re
from collections.abc import Generator, Iterable, Iterator, Mapping
from itertools import chain

from codra_dsl.language.check.conditions.conditions import RESULT_ROLES, Role
from codra_dsl.language.check.index.fixes import renaming_fix
from codra_dsl.language.check.index.mentions import (
    Mention,
    mentions_in_preconditions,
    mentions_of,
    resource_mentions,
    source_mentions,
    undeclared_references,
    unknown_mentions,
    used_variables,
)
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import MAIN_EXECUTION, OBSERVER, FaultyElements, SpecIndex
from codra_dsl.language.check.index.words import NOUNS, declaration_help
from codra_dsl.language.check.names.misspelt import find_misspelt_declarations, misspelt_finding
from codra_dsl.language.check.types.literals import LiteralHelp, compared_literal_help, intended_literal_help
from codra_dsl.language.diagnostics import Diagnostic, Fix, Place, Related, is_slip
from codra_dsl.language.expression import is_identifier
from codra_dsl.language.load.templates.templates import INSTANCE
from codra_dsl.language.load.yaml.traps import is_derivation
from codra_dsl.language.model import ADAPTER, ANALYST, Access, Agent, Algorithm, Resource, Variable

_RULES_AND_NOUNS = {
    "context": ("unknown-variable", "context-variable"),
    "resources": ("unknown-resource", "resource"),
    "agents": ("unknown-source", "source"),
}
GRAPH_FUNCTIONS = {
    "count": "count(PATH)",
    "exists": "exists(PATH)",
    "distance": "distance(a, b)",
    "in_view": "in_view(node, camera)",
}
"""The functions of the knowledge graph, with arguments. A variable may have the name of such a function."""

OPERATOR = "operator"
"""The source of overrides while a robot runs. A spec can use this name neither as a source nor for an agent."""

_SOURCES = {"agents": (OBSERVER, MAIN_EXECUTION)}
_WORD = re.compile(r"\w+")


def unknown_variables(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """Every context-variable that something refers to is declared. All mentions of a name are in one finding."""
    groups = list(
        unknown_mentions(
            spec_index, "context", chain(undeclared_references(spec_index), mentions_in_preconditions(spec_index))
        )
    )
    if not groups:
        return
    misspelling_candidates = [
        group
        for group in groups
        if not _is_returned(spec_index, group[0]) and _intended_literal_help(spec_index, group[0]) is None
    ]
    remaining_groups = yield from _misspelt_declaration_findings(
        spec_index,
        "context",
        misspelling_candidates,
        _places(spec_index.declared_graph.variables),
        used_variables(spec_index),
    )
    reported_names = {group[0].name for group in misspelling_candidates} - {group[0].name for group in remaining_groups}
    for first, *others in groups:
        if first.name in reported_names:
            continue
        if _is_returned(spec_index, first):
            message = f"'{first.name}' in 'observable_when' of {first.user} is a value that the algorithm returns"
            help = "move the condition to 'accept_when'"
            yield _mention_finding("name-out-of-sight", message, help, first, others)
        else:
            yield _undeclared_name_finding(
                spec_index, "context", first, others, literal=_intended_literal_help(spec_index, first)
            )


def unknown_resources(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """Every resource that an algorithm uses is declared."""
    unknown_resource_mentions = resource_mentions(spec_index, declared=spec_index.resources)
    groups = list(unknown_mentions(spec_index, "resources", unknown_resource_mentions))
    if groups:
        used_names = (mention.name for mention in resource_mentions(spec_index))
        for first, *others in (
            yield from _misspelt_declaration_findings(
                spec_index, "resources", groups, _places(spec_index.resources), used_names
            )
        ):
            yield _undeclared_name_finding(spec_index, "resources", first, others)


def unknown_sources(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """Every source is `observer`, `main_execution` or an agent."""
    groups = list(unknown_mentions(spec_index, "agents", source_mentions(spec_index)))
    if groups:
        places = _places(spec_index.agents)
        used_names = (mention.name for mention in source_mentions(spec_index))
        sources = frozenset({OBSERVER, MAIN_EXECUTION}) | spec_index.names("agents")
        for first, *others in (
            yield from _misspelt_declaration_findings(
                spec_index, "agents", groups, places, used_names, known_names=sources
            )
        ):
            yield _undeclared_name_finding(spec_index, "agents", first, others, known_names=sources)


def unknown_names_in_results(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """`accept_when` and `identifies` read only the values that the algorithm returns."""
    groups_by_algorithm: dict[str, dict[str, list[Mention]]] = {}
    for site in spec_index.sites:
        if site.role in RESULT_ROLES and spec_index.is_readable(*site.owner, "returns"):
            algorithm = site.owner[1]
            returned = spec_index.returned_types[algorithm]
            unknown_names = [name for name in site.values if name.name not in returned]
            for mention in mentions_of(site, unknown_names) if unknown_names else ():
                groups_by_algorithm.setdefault(algorithm, {}).setdefault(mention.name, []).append(mention)
    for algorithm, groups in groups_by_algorithm.items():
        yield from _unknown_in_results(spec_index, algorithm, list(groups.values()))


def _unknown_in_results(spec_index: SpecIndex, algorithm: str, groups: list[list[Mention]]) -> Iterator[Diagnostic]:
    misspelling_candidates = [group for group in groups if not _is_other_element_or_literal(spec_index, group[0])]
    places = {returned.name: returned.place for returned in spec_index.algorithms[algorithm].returns}
    misspelt_declarations = find_misspelt_declarations(
        spec_index, misspelling_candidates, places, spec_index.used_values[algorithm]
    )
    for first, *others in groups:
        declared_name = misspelt_declarations.get(first.name)
        if declared_name is None:
            yield _unknown_returned_value_finding(spec_index, algorithm, first, others)
        else:
            path = f"perception.{algorithm}.returns.{declared_name}"
            noun, place = "returned value", places[declared_name]
            rule = "unknown-returned-value"
            yield misspelt_finding(
                spec_index, (algorithm,), declared_name, (first, *others), rule=rule, noun=noun, place=place, path=path
            )


def _misspelt_declaration_findings(
    spec_index: SpecIndex,
    section: str,
    groups: list[list[Mention]],
    places: Mapping[str, Place],
    used_names: Iterable[str],
    *,
    known_names: frozenset[str] = frozenset(),
) -> Generator[Diagnostic, None, list[list[Mention]]]:
    """Yield findings about misspelt declarations. Return the mentions of the other names that must be reported.

    An undeclared name that resembles no declared name may be the name of an element whose own name is unreadable. If
    the spec has enough such elements for all of these names, their mentions are not returned.
    """
    rule, noun = _RULES_AND_NOUNS[section]
    misspelling_candidates = [group for group in groups if spec_index.kind_elsewhere(group[0].name, section) is None]
    undeclared_names = {group[0].name for group in misspelling_candidates}
    misspelt_declarations = find_misspelt_declarations(spec_index, misspelling_candidates, places, used_names)
    for group in groups:
        declared_name = misspelt_declarations.get(group[0].name)
        if declared_name is not None:
            place, path = places[declared_name], f"{section}.{declared_name}"
            yield misspelt_finding(
                spec_index, section, declared_name, group, rule=rule, noun=noun, place=place, path=path
            )
    remaining_groups = [group for group in groups if group[0].name not in misspelt_declarations]
    candidates = known_names or spec_index.names(section)
    unknown_names = [group[0].name for group in remaining_groups if group[0].name in undeclared_names]
    unnamed_element_count = spec_index.unnamed_element_count(section)
    suggestions = ((name, spec_index.nearest_name(name, section, candidates)) for name in unknown_names)
    unmatched_names = {
        name
        for name, suggestion in suggestions
        if suggestion is None or (unnamed_element_count and not is_slip(name, suggestion))
    }
    spans = {group[0].place.span for group in remaining_groups if group[0].name in unmatched_names}
    return (
        remaining_groups
        if len(spans) > unnamed_element_count
        else [group for group in remaining_groups if group[0].name not in unmatched_names]
    )


def _places(declared: Mapping[str, Variable] | Mapping[str, Resource] | Mapping[str, Agent]) -> dict[str, Place]:
    return {name: element.place for name, element in declared.items()}


def _is_returned(spec_index: SpecIndex, mention: Mention) -> bool:
    """Return whether a name in a precondition is a value that the algorithm of this precondition returns."""
    site = mention.site
    if site is None or site.owner[0] != "perception":
        return False
    return mention.name in spec_index.returned_types[site.owner[1]]


def _intended_literal_help(spec_index: SpecIndex, mention: Mention) -> LiteralHelp | None:
    return None if mention.site is None else intended_literal_help(spec_index, mention.site, mention.name)


def _is_other_element_or_literal(spec_index: SpecIndex, mention: Mention) -> bool:
    """Return whether a name in a condition over a result is the name of an element, or is intended as a literal."""
    is_named = (
        spec_index.declares("context", mention.name) or spec_index.kind_elsewhere(mention.name, "context") is not None
    )
    return is_named or _intended_literal_help(spec_index, mention) is not None


def names_in_expectations(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """The expectations of skills compare variables with literals."""
    for site in spec_index.sites:
        if site.role is Role.MONITOR:
            for mention in mentions_of(site, site.values):
                if mention.name != site.variable:
                    message = f"'{mention.name}' is not a value that {mention.user} can expect of '{site.variable}'"
                    literal_help = compared_literal_help(spec_index, mention) or "write a literal"
                    literal = intended_literal_help(spec_index, site, mention.name) or LiteralHelp(literal_help)
                    yield _mention_finding(
                        "name-out-of-sight", message, literal.help, mention, (), fix=literal.fix((mention,))
                    )


def reserved_agents(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """No agent has the name of one of the sources that every spec has."""
    for agent in spec_index.spec.agents:
        if agent.name in (OBSERVER, MAIN_EXECUTION, OPERATOR):
            message = f"agent '{agent.name}' has the name of a source that every spec has"
            path = f"agents.{agent.name}"
            yield finding("reserved-agent", message, agent.place, path=path, help="choose another name")


def ambiguous_arguments(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """No two arguments of a perception function have the same name, and none has the name `job`."""
    for algorithm in spec_index.spec.perception:
        origin_texts = {"job": "the argument 'job', which every perception function gets"}
        for name, key, place in _arguments(algorithm):
            if name in origin_texts:
                argument_text = f"argument '{name}' of algorithm '{algorithm.name}' from '{key}'"
                message = f"{argument_text} has the same name as {origin_texts[name]}"
                path = f"perception.{algorithm.name}.{key}"
                yield finding("ambiguous-argument", message, place, path=path, help="rename one of the two")
            origin_texts[name] = f"an argument from '{key}'"


NAME_CHECKS = (
    unknown_variables,
    unknown_resources,
    unknown_sources,
    unknown_names_in_results,
    names_in_expectations,
    reserved_agents,
    ambiguous_arguments,
)
"""The rules of this phase."""


def _arguments(algorithm: Algorithm) -> Iterator[tuple[str, str, Place]]:
    """Yield, for each argument, its name, the key under which it is written, and its place."""
    for name, _ in algorithm.parameters:
        yield name, "with", algorithm.places.get(f"with.{name}", algorithm.place)
    for usage in algorithm.uses:
        if usage.access is Access.READ:
            yield usage.resource.name, "uses", usage.resource.place
    for reference in algorithm.given:
        yield reference.name, "given", reference.place


def _undeclared_name_finding(
    spec_index: SpecIndex,
    section: str,
    first: Mention,
    others: list[Mention],
    *,
    literal: LiteralHelp | None = None,
    known_names: frozenset[str] | None = None,
) -> Diagnostic:
    """Return the finding about a name that a section does not declare. `known_names` are the candidates to suggest."""
    kind = spec_index.kind_elsewhere(first.name, section)
    if kind is not None:
        message = f"'{first.name}' in {first.user} is {kind}, not {NOUNS[section]}"
        is_adaptation = section == "agents" and spec_index.declares("adaptation", first.name)
        help = f"write '{ADAPTER}'" if is_adaptation else f"write the name of {NOUNS[section]}"
        return _mention_finding("wrong-kind-of-name", message, help, first, others)
    rule, noun = _RULES_AND_NOUNS[section]
    if section == "agents" and first.path.endswith((".by", ".requesters")):
        noun = "agent"
    message = f"unknown {noun} '{first.name}' in {first.user}"
    if literal is not None:
        return _mention_finding(rule, message, literal.help, first, others, fix=literal.fix((first, *others)))
    candidates = spec_index.names(section) if known_names is None else known_names
    nearest_name = spec_index.nearest_name(first.name, section, candidates)
    if nearest_name is not None and is_slip(first.name, nearest_name):
        spec_index.corrections.add_misspelt_reference(section, first.name, nearest_name)
    fix = _renaming(spec_index, first, others, nearest_name, candidates)
    help = (
        f"did you mean '{nearest_name}'?"
        if nearest_name
        else _declaration_help(spec_index, first, section, spec_index.names(section))
    )
    return _mention_finding(rule, message, help, first, others, fix=fix)


def _renaming(
    spec_index: SpecIndex,
    first: Mention,
    others: Iterable[Mention],
    nearest_name: str | None,
    candidates: Iterable[str],
) -> Fix | None:
    if nearest_name is None:
        return None
    known_names = spec_index.mentioned_words | {OBSERVER, MAIN_EXECUTION}
    return renaming_fix(
        first.name, nearest_name, candidates, [mention.place for mention in (first, *others)], known_names
    )


def _declaration_help(spec_index: SpecIndex, mention: Mention, section: str, declared_names: Iterable[str]) -> str:
    """Return the help for a name without a similar declaration."""
    specific_help = _parameter_help(spec_index, mention) or compared_literal_help(spec_index, mention)
    if specific_help is not None:
        return specific_help
    if mention.site is None and not is_identifier(mention.name):
        return _invalid_name_help(spec_index, mention, section)
    if section == "agents":
        if mention.name == OPERATOR:
            return "remove it: an operator can override every variable, and an agent needs another name"
        sources = [OBSERVER, MAIN_EXECUTION] if mention.path.startswith("context.") else [MAIN_EXECUTION]
        return declaration_help(mention.name, "'agents'", {*sources, *declared_names} - {ANALYST})
    if section == "context" and mention.name in GRAPH_FUNCTIONS:
        return f"write {GRAPH_FUNCTIONS[mention.name]}, in 'derived'"
    return declaration_help(mention.name, f"'{section}'", () if section == "context" else declared_names)


def _invalid_name_help(spec_index: SpecIndex, mention: Mention, section: str) -> str:
    """Return the help for a text that is not a name, e.g. several names without ',', or a name with other text."""
    if mention.path.startswith("context.") and is_derivation(mention.name):
        return f"declare a variable NAME with 'derived: {mention.name}', and write NAME here"
    words = _WORD.findall(mention.name)
    known_names = [word for word in words if word in spec_index.names(section) or word in _SOURCES.get(section, ())]
    if len(known_names) == len(words) > 1:
        return f"write the names as a list: [{', '.join(known_names)}]"
    return f"write only '{known_names[0]}'" if len(known_names) == 1 else "write a name: letters A to Z, digits and '_'"


def _parameter_help(spec_index: SpecIndex, mention: Mention) -> str | None:
    """Return the help for a name in a template that begins with the name of a parameter; None for other names."""
    if mention.place.use is None:
        return None
    words = mention.name.split("_")
    prefixes = ("_".join(words[:count]) for count in range(len(words), 0, -1))
    parameter = next((prefix for prefix in prefixes if prefix == INSTANCE or prefix in spec_index.parameters), "")
    return f"write {mention.name.replace(parameter, f'$({parameter})', 1)}" if parameter else None


def _unknown_returned_value_finding(
    spec_index: SpecIndex, algorithm: str, first: Mention, others: list[Mention]
) -> Diagnostic:
    assert first.site is not None
    key, returned = first.site.role, spec_index.returned_types[algorithm]
    if spec_index.declares("context", first.name):
        message = f"'{first.name}' in '{key}' of {first.user} is a context-variable, which cannot be read there"
        move_help = "use it in 'observable_when'"
        help = move_help if key is Role.ACCEPT_WHEN else f"{move_help}, or pass it to the algorithm with 'given'"
        return _mention_finding("name-out-of-sight", message, help, first, others)
    kind = spec_index.kind_elsewhere(first.name, "context")
    literal = intended_literal_help(spec_index, first.site, first.name)
    if kind is not None and literal is None:
        message = f"'{first.name}' in '{key}' of {first.user} is {kind}, not a value that the algorithm returns"
        return _mention_finding("wrong-kind-of-name", message, "write the name of a returned value", first, others)
    message = f"unknown returned value '{first.name}' in '{key}' of {first.user}"
    if literal is not None:
        fix = literal.fix((first, *others))
        return _mention_finding("unknown-returned-value", message, literal.help, first, others, fix=fix)
    nearest_name = spec_index.nearest_name(first.name, f"returned by {algorithm}", returned)
    if nearest_name is not None and is_slip(first.name, nearest_name):
        spec_index.corrections.add_misspelt_reference((algorithm,), first.name, nearest_name)
    help = (
        f"did you mean '{nearest_name}'?" if nearest_name else _declaration_help(spec_index, first, "returns", returned)
    )
    fix = _renaming(spec_index, first, others, nearest_name, returned)
    return _mention_finding("unknown-returned-value", message, help, first, others, fix=fix)


def _mention_finding(
    rule: str, message: str, help: str, first: Mention, others: Iterable[Mention], *, fix: Fix | None = None
) -> Diagnostic:
    related = tuple(Related(f"also in {mention.user}", mention.place) for mention in others)
    return finding(rule, message, first.place, path=first.path, help=help, related=related, fix=fix)
