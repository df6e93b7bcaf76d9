"""Phase 1: every name that an element refers to is declared, is of the right kind, and can be read there."""

from __future__ import annotations

import re
from collections.abc import Generator, Iterable, Iterator, Mapping
from itertools import chain

from codra_dsl.language.check.conditions.conditions import Role
from codra_dsl.language.check.index.fixes import renaming
from codra_dsl.language.check.index.mentions import (
    Mention,
    mentions_in_preconditions,
    mentions_of,
    references,
    resource_mentions,
    source_mentions,
    unknown,
    used_variables,
)
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import MAIN_EXECUTION, OBSERVER, Silenced, SpecIndex
from codra_dsl.language.check.index.words import NOUNS
from codra_dsl.language.check.names.misspelt import blame, blamed
from codra_dsl.language.check.types.literals import Literal, intended_literal, literal_compared
from codra_dsl.language.diagnostics import Diagnostic, Fix, Place, Related, is_slip
from codra_dsl.language.load.templates.templates import INSTANCE
from codra_dsl.language.load.yaml.names import is_identifier
from codra_dsl.language.model import Access, Agent, Algorithm, Resource, Variable

_UNKNOWN = {
    "context": ("unknown-variable", "context-variable"),
    "resources": ("unknown-resource", "resource"),
    "agents": ("unknown-source", "source"),
}
_SOURCES = {"agents": (OBSERVER, MAIN_EXECUTION)}
_WORD = re.compile(r"\w+")


def unknown_variables(scope: SpecIndex, _: Silenced) -> Iterator[Diagnostic]:
    """Every context-variable that something refers to is declared: one finding per name, with all its mentions."""
    groups = list(unknown(scope, "context", chain(references(scope), mentions_in_preconditions(scope))))
    if not groups:
        return
    plain = [
        group for group in groups if not _is_returned(scope, group[0]) and _intended_literal(scope, group[0]) is None
    ]
    left = yield from _misspelt(scope, "context", plain, _places(scope.world.variables), used_variables(scope))
    settled = {group[0].name for group in plain} - {group[0].name for group in left}
    for first, *others in groups:
        if first.name in settled:
            continue
        if _is_returned(scope, first):
            message = f"'{first.name}' in 'observable_when' of {first.user} is a value that the algorithm returns"
            help = "move the condition to 'accept_when'"
            yield _finding("name-out-of-sight", message, help, first, others)
        else:
            yield _not_declared(scope, "context", first, others, literal=_intended_literal(scope, first))


def unknown_resources(scope: SpecIndex, _: Silenced) -> Iterator[Diagnostic]:
    """Every resource that an algorithm uses is declared."""
    groups = list(unknown(scope, "resources", resource_mentions(scope)))
    if groups:
        used = (mention.name for mention in resource_mentions(scope))
        for first, *others in (yield from _misspelt(scope, "resources", groups, _places(scope.resources), used)):
            yield _not_declared(scope, "resources", first, others)


def unknown_sources(scope: SpecIndex, _: Silenced) -> Iterator[Diagnostic]:
    """Every source is `observer`, `main_execution` or an agent."""
    groups = list(unknown(scope, "agents", source_mentions(scope)))
    if groups:
        places = _places(scope.agents)
        used = (mention.name for mention in source_mentions(scope))
        sources = frozenset({OBSERVER, MAIN_EXECUTION}) | scope.names("agents")
        for first, *others in (yield from _misspelt(scope, "agents", groups, places, used, known=sources)):
            yield _not_declared(scope, "agents", first, others, known=sources)


def unknown_names_in_results(scope: SpecIndex, _: Silenced) -> Iterator[Diagnostic]:
    """`accept_when` and `identifies` read only the values that the algorithm returns."""
    unknown_here: dict[str, dict[str, list[Mention]]] = {}
    for site in scope.sites:
        if site.role in (Role.ACCEPT_WHEN, Role.IDENTIFIES) and scope.readable(*site.owner, "returns"):
            algorithm = site.owner[1]
            returned = scope.returned_types[algorithm]
            for mention in mentions_of(site, [name for name in site.values if name.name not in returned]):
                unknown_here.setdefault(algorithm, {}).setdefault(mention.name, []).append(mention)
    for algorithm, groups in unknown_here.items():
        yield from _unknown_in_results(scope, algorithm, list(groups.values()))


def _unknown_in_results(scope: SpecIndex, algorithm: str, groups: list[list[Mention]]) -> Iterator[Diagnostic]:
    plain = [group for group in groups if not _is_something_else(scope, group[0])]
    places = {returned.name: returned.place for returned in scope.algorithms[algorithm].returns}
    misspelt = blamed(scope, plain, places, scope.used_values[algorithm])
    for first, *others in groups:
        declared = misspelt.get(first.name)
        if declared is None:
            yield _not_returned(scope, algorithm, first, others)
        else:
            path = f"perception.{algorithm}.returns.{declared}"
            noun, place = "returned value", places[declared]
            rule = "unknown-returned-value"
            yield blame(scope, (algorithm,), declared, (first, *others), rule=rule, noun=noun, place=place, path=path)


def _misspelt(
    scope: SpecIndex,
    section: str,
    groups: list[list[Mention]],
    places: Mapping[str, Place],
    used: Iterable[str],
    *,
    known: frozenset[str] = frozenset(),
) -> Generator[Diagnostic, None, list[list[Mention]]]:
    """Yield findings about misspelt declarations; return the remaining names to report.

    Names without a similar declaration are not reported if at least as many elements have unreadable names.
    """
    rule, noun = _UNKNOWN[section]
    plain = [group for group in groups if scope.other_kind(group[0].name, section) is None]
    undeclared = {group[0].name for group in plain}
    misspelt = blamed(scope, plain, places, used)
    for group in groups:
        declared = misspelt.get(group[0].name)
        if declared is not None:
            place, path = places[declared], f"{section}.{declared}"
            yield blame(scope, section, declared, group, rule=rule, noun=noun, place=place, path=path)
    left = [group for group in groups if group[0].name not in misspelt]
    candidates = known or scope.names(section)
    unknown_names = [group[0].name for group in left if group[0].name in undeclared]
    nameless = scope.nameless(section)
    near = ((name, scope.nearest(name, section, candidates)) for name in unknown_names)
    without_suggestion = {
        name for name, nearest in near if nearest is None or (nameless and not is_slip(name, nearest))
    }
    written = {group[0].place.span for group in left if group[0].name in without_suggestion}
    return left if len(written) > nameless else [group for group in left if group[0].name not in without_suggestion]


def _places(declared: Mapping[str, Variable] | Mapping[str, Resource] | Mapping[str, Agent]) -> dict[str, Place]:
    return {name: element.place for name, element in declared.items()}


def _is_returned(scope: SpecIndex, mention: Mention) -> bool:
    """Return whether a name in a precondition is a returned value of its algorithm."""
    site = mention.site
    if site is None or site.owner[0] != "perception":
        return False
    return mention.name in scope.returned_types[site.owner[1]]


def _intended_literal(scope: SpecIndex, mention: Mention) -> Literal | None:
    return None if mention.site is None else intended_literal(scope, mention.site, mention.name)


def _is_something_else(scope: SpecIndex, mention: Mention) -> bool:
    """Return whether a name in a condition over a result names another element, or is intended as a literal."""
    is_named = scope.declares("context", mention.name) or scope.other_kind(mention.name, "context") is not None
    return is_named or _intended_literal(scope, mention) is not None


def names_in_expectations(scope: SpecIndex, _: Silenced) -> Iterator[Diagnostic]:
    """The expectations of skills compare variables with literals."""
    for site in scope.sites:
        if site.role is Role.MONITOR:
            for mention in mentions_of(site, site.values):
                if mention.name != site.variable:
                    message = f"'{mention.name}' is not a value that {mention.user} can expect of '{site.variable}'"
                    literal_help = literal_compared(scope, mention) or "write a literal"
                    literal = intended_literal(scope, site, mention.name) or Literal(literal_help)
                    yield _finding("name-out-of-sight", message, literal.help, mention, (), fix=literal.fix((mention,)))


def reserved_agents(scope: SpecIndex, _: Silenced) -> Iterator[Diagnostic]:
    """No agent has the name of one of the two sources that every spec has."""
    for agent in scope.spec.agents:
        if agent.name in (OBSERVER, MAIN_EXECUTION):
            message = f"agent '{agent.name}' has the name of a source that every spec has"
            path = f"agents.{agent.name}"
            yield finding("reserved-agent", message, agent.place, path=path, help="choose another name")


def ambiguous_arguments(scope: SpecIndex, _: Silenced) -> Iterator[Diagnostic]:
    """No two arguments of a perception function have the same name, and none is called `job`."""
    for algorithm in scope.spec.perception:
        taken = {"job": "the job itself"}
        for name, key, place in _arguments(algorithm):
            if name in taken:
                message = (
                    f"argument '{name}' of algorithm '{algorithm.name}' from '{key}' has the same name as {taken[name]}"
                )
                path = f"perception.{algorithm.name}.{key}"
                yield finding("ambiguous-argument", message, place, path=path, help="rename one of the two")
            taken[name] = f"one from '{key}'"


NAMES = (
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
    """Yield the name of each argument, the key that it comes from, and its place."""
    for name, _ in algorithm.parameters:
        yield name, "with", algorithm.places.get(f"with.{name}", algorithm.place)
    for usage in algorithm.uses:
        if usage.access is Access.READ:
            yield usage.resource.name, "uses", usage.resource.place
    for reference in algorithm.given:
        yield reference.name, "given", reference.place


def _not_declared(
    scope: SpecIndex,
    section: str,
    first: Mention,
    others: list[Mention],
    *,
    literal: Literal | None = None,
    known: frozenset[str] | None = None,
) -> Diagnostic:
    """Return the finding about a name that a section does not declare; `known` are the names to suggest."""
    kind = scope.other_kind(first.name, section)
    if kind is not None:
        message = f"'{first.name}' in {first.user} is {kind}, not {NOUNS[section]}"
        return _finding("wrong-kind-of-name", message, f"name {NOUNS[section]} here", first, others)
    rule, noun = _UNKNOWN[section]
    if section == "agents" and first.path.endswith((".by", ".requesters")):
        noun = "agent"
    message = f"unknown {noun} '{first.name}' in {first.user}"
    if literal is not None:
        return _finding(rule, message, literal.help, first, others, fix=literal.fix((first, *others)))
    candidates = scope.names(section) if known is None else known
    near = scope.nearest(first.name, section, candidates)
    if near is not None and is_slip(first.name, near):
        scope.corrections.use(section, first.name, near)
    fix = _renaming(scope, first, others, near, candidates)
    help = f"did you mean '{near}'?" if near else _declare(scope, first, section)
    return _finding(rule, message, help, first, others, fix=fix)


def _renaming(
    scope: SpecIndex, first: Mention, others: Iterable[Mention], near: str | None, candidates: Iterable[str]
) -> Fix | None:
    if near is None:
        return None
    known = scope.mentioned | {OBSERVER, MAIN_EXECUTION}
    return renaming(first.name, near, candidates, [mention.place for mention in (first, *others)], known)


def _declare(scope: SpecIndex, mention: Mention, section: str) -> str:
    """Return the help for a name without a similar declaration."""
    intended = _intended_parameter(scope, mention) or literal_compared(scope, mention)
    if intended is not None:
        return intended
    if mention.site is None and not is_identifier(mention.name):
        return _apart(scope, mention, section)
    if section == "agents":
        others = "'observer', 'main_execution'" if mention.path.startswith("context.") else "'main_execution'"
        return f"write {others}, or declare it under 'agents'"
    return f"declare '{mention.name}' under '{section}'"


def _apart(scope: SpecIndex, mention: Mention, section: str) -> str:
    """Return the help for a text that is not a name: several names without ',', or a name with other text."""
    words = _WORD.findall(mention.name)
    known = [word for word in words if word in scope.names(section) or word in _SOURCES.get(section, ())]
    if len(known) == len(words) > 1:
        return f"make each an item of a list: [{', '.join(known)}]"
    return f"write only '{known[0]}'" if len(known) == 1 else "write a name: letters A to Z, digits and '_'"


def _intended_parameter(scope: SpecIndex, mention: Mention) -> str | None:
    """Return the help for a name in a template that is, or begins with, the name of a parameter."""
    if mention.place.use is None:
        return None
    words = mention.name.split("_")
    begun = ("_".join(words[:count]) for count in range(len(words), 0, -1))
    parameter = next((prefix for prefix in begun if prefix == INSTANCE or prefix in scope.parameters), "")
    return f"write {mention.name.replace(parameter, f'$({parameter})', 1)}" if parameter else None


def _not_returned(scope: SpecIndex, algorithm: str, first: Mention, others: list[Mention]) -> Diagnostic:
    assert first.site is not None
    key, returned = first.site.role, scope.returned_types[algorithm]
    if scope.declares("context", first.name):
        message = f"'{first.name}' in '{key}' of {first.user} is a context-variable, which cannot be read there"
        moved = "use it in 'observable_when'"
        help = moved if key is Role.ACCEPT_WHEN else f"{moved}, or pass it to the algorithm with 'given'"
        return _finding("name-out-of-sight", message, help, first, others)
    kind = scope.other_kind(first.name, "context")
    literal = intended_literal(scope, first.site, first.name)
    if kind is not None and literal is None:
        message = f"'{first.name}' in '{key}' of {first.user} is {kind}, not a value that the algorithm returns"
        return _finding("wrong-kind-of-name", message, "name a returned value here", first, others)
    message = f"unknown returned value '{first.name}' in '{key}' of {first.user}"
    if literal is not None:
        fix = literal.fix((first, *others))
        return _finding("unknown-returned-value", message, literal.help, first, others, fix=fix)
    near = scope.nearest(first.name, f"returned by {algorithm}", returned)
    if near is not None and is_slip(first.name, near):
        scope.corrections.use((algorithm,), first.name, near)
    help = f"did you mean '{near}'?" if near else _declare(scope, first, "returns")
    fix = _renaming(scope, first, others, near, returned)
    return _finding("unknown-returned-value", message, help, first, others, fix=fix)


def _finding(
    rule: str, message: str, help: str, first: Mention, others: Iterable[Mention], *, fix: Fix | None = None
) -> Diagnostic:
    related = tuple(Related(f"also in {mention.user}", mention.place) for mention in others)
    return finding(rule, message, first.place, path=first.path, help=help, related=related, fix=fix)
