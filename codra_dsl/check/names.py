"""Phase 1: every name that an element refers to is declared, is of the right kind, and can be seen from there."""

from __future__ import annotations

import re
from collections.abc import Generator, Iterable, Iterator, Mapping
from itertools import chain

from codra_dsl.check.conditions import Role
from codra_dsl.check.fixes import renaming
from codra_dsl.check.literals import Literal, literal_compared, literal_meant
from codra_dsl.check.mentions import (
    Mention,
    mentions_in_preconditions,
    mentions_of,
    references,
    resource_mentions,
    source_mentions,
    unknown,
    used_variables,
)
from codra_dsl.check.misspelt import blame, blamed
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import MAIN_EXECUTION, OBSERVER, Faults, Scope
from codra_dsl.check.words import NOUNS
from codra_dsl.diagnostics import Diagnostic, Fix, Place, Related, is_slip
from codra_dsl.load.names import is_identifier
from codra_dsl.load.templates import INSTANCE
from codra_dsl.model import Access, Agent, Algorithm, Resource, Variable

_UNKNOWN = {
    "context": ("unknown-variable", "context-variable"),
    "resources": ("unknown-resource", "resource"),
    "agents": ("unknown-source", "source"),
}
_SOURCES = {"agents": (OBSERVER, MAIN_EXECUTION)}
_WORD = re.compile(r"\w+")


def unknown_variables(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """Every context-variable that something refers to is declared: one finding per name, with all its mentions."""
    groups = list(unknown(scope, "context", chain(references(scope), mentions_in_preconditions(scope))))
    if not groups:
        return
    plain = [group for group in groups if not _is_returned(scope, group[0]) and _meant_literal(scope, group[0]) is None]
    left = yield from _misspelt(scope, "context", plain, _places(scope.world.variables), used_variables(scope))
    settled = {group[0].name for group in plain} - {group[0].name for group in left}
    for first, *others in groups:
        if first.name in settled:
            continue
        if _is_returned(scope, first):
            message = f"'{first.name}' in 'observable_when' of {first.user} is what the algorithm returns"
            way_out = "move the condition to 'accept_when'"
            yield _told("name-out-of-sight", message, way_out, first, others)
        else:
            yield _not_declared(scope, "context", first, others, literal=_meant_literal(scope, first))


def unknown_resources(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """Every resource that an algorithm uses is declared."""
    groups = list(unknown(scope, "resources", resource_mentions(scope)))
    if groups:
        used = (mention.name for mention in resource_mentions(scope))
        for first, *others in (yield from _misspelt(scope, "resources", groups, _places(scope.resources), used)):
            yield _not_declared(scope, "resources", first, others)


def unknown_sources(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """A source is `observer`, `main_execution` or an agent."""
    groups = list(unknown(scope, "agents", source_mentions(scope)))
    if groups:
        places = _places(scope.agents)
        used = (mention.name for mention in source_mentions(scope))
        sources = frozenset({OBSERVER, MAIN_EXECUTION}) | scope.names("agents")
        for first, *others in (yield from _misspelt(scope, "agents", groups, places, used, known=sources)):
            yield _not_declared(scope, "agents", first, others, known=sources)


def unknown_names_in_results(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """`accept_when` and `identifies` see what the algorithm returns, and nothing else."""
    unknown_here: dict[str, dict[str, list[Mention]]] = {}
    for site in scope.sites:
        if site.role in (Role.ACCEPT_WHEN, Role.IDENTIFIES) and scope.readable(*site.owner, "returns"):
            algorithm = site.owner[1]
            returned = scope.returned_types[algorithm]
            for mention in mentions_of(site, [name for name in site.values if name.name not in returned]):
                unknown_here.setdefault(algorithm, {}).setdefault(mention.name, []).append(mention)
    for algorithm, groups in unknown_here.items():
        yield from _unknown_in_results(scope, algorithm, list(groups.values()))


def _unknown_in_results(scope: Scope, algorithm: str, groups: list[list[Mention]]) -> Iterator[Diagnostic]:
    plain = [group for group in groups if not _is_something_else(scope, group[0])]
    places = {returned.name: returned.place for returned in scope.algorithms[algorithm].returns}
    found = blamed(scope, plain, places, scope.used_values[algorithm])
    for first, *others in groups:
        declared = found.get(first.name)
        if declared is None:
            yield _not_returned(scope, algorithm, first, others)
        else:
            path = f"perception.{algorithm}.returns.{declared}"
            noun, place = "returned value", places[declared]
            rule = "unknown-returned-value"
            yield blame(scope, (algorithm,), declared, (first, *others), rule=rule, noun=noun, place=place, path=path)


def _misspelt(
    scope: Scope,
    section: str,
    groups: list[list[Mention]],
    places: Mapping[str, Place],
    used: Iterable[str],
    *,
    known: frozenset[str] = frozenset(),
) -> Generator[Diagnostic, None, list[list[Mention]]]:
    """Yield findings about declarations that are misspelt; return the names that are left to be told.

    Names that mean nothing that is declared are not told where as many elements have names that nobody can read.
    """
    rule, noun = _UNKNOWN[section]
    plain = [group for group in groups if scope.other_kind(group[0].name, section) is None]
    told = {group[0].name for group in plain}
    found = blamed(scope, plain, places, used)
    for group in groups:
        declared = found.get(group[0].name)
        if declared is not None:
            place, path = places[declared], f"{section}.{declared}"
            yield blame(scope, section, declared, group, rule=rule, noun=noun, place=place, path=path)
    left = [group for group in groups if group[0].name not in found]
    candidates = known or scope.names(section)
    unknown_names = [group[0].name for group in left if group[0].name in told]
    nameless = scope.nameless(section)
    near = ((name, scope.nearest(name, section, candidates)) for name in unknown_names)
    lonely = {name for name, meant in near if meant is None or (nameless and not is_slip(name, meant))}
    written = {group[0].place.span for group in left if group[0].name in lonely}
    return left if len(written) > nameless else [group for group in left if group[0].name not in lonely]


def _places(declared: Mapping[str, Variable] | Mapping[str, Resource] | Mapping[str, Agent]) -> dict[str, Place]:
    return {name: element.place for name, element in declared.items()}


def _is_returned(scope: Scope, mention: Mention) -> bool:
    """Return whether a name in a precondition is what its algorithm returns."""
    site = mention.site
    if site is None or site.owner[0] != "perception":
        return False
    return mention.name in scope.returned_types[site.owner[1]]


def _meant_literal(scope: Scope, mention: Mention) -> Literal | None:
    return None if mention.site is None else literal_meant(scope, mention.site, mention.name)


def _is_something_else(scope: Scope, mention: Mention) -> bool:
    """Return whether a name in a condition over a result is known, but no returned value, or is meant as a literal."""
    is_named = scope.declares("context", mention.name) or scope.other_kind(mention.name, "context") is not None
    return is_named or _meant_literal(scope, mention) is not None


def names_in_expectations(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """What a skill expects of a variable is stated with literals."""
    for site in scope.sites:
        if site.role is Role.MONITOR:
            for mention in mentions_of(site, site.values):
                if mention.name != site.variable:
                    message = f"'{mention.name}' is no value that {mention.user} can expect of '{site.variable}'"
                    meant = literal_compared(scope, mention) or "state a literal"
                    way_out = literal_meant(scope, site, mention.name) or Literal(meant)
                    yield _told("name-out-of-sight", message, way_out.help, mention, (), fix=way_out.fix((mention,)))


def reserved_agents(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """No agent is called like the two sources that every spec has."""
    for agent in scope.spec.agents:
        if agent.name in (OBSERVER, MAIN_EXECUTION):
            message = f"agent '{agent.name}' has the name of a source that every spec has"
            path = f"agents.{agent.name}"
            yield finding("reserved-agent", message, agent.place, path=path, way_out="choose another name")


def ambiguous_arguments(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """No two arguments of a perception function have the same name, and none is called `job`."""
    for algorithm in scope.spec.perception:
        taken = {"job": "the job itself"}
        for name, key, place in _arguments(algorithm):
            if name in taken:
                message = f"argument '{name}' of algorithm '{algorithm.name}' from '{key}' is named like {taken[name]}"
                path = f"perception.{algorithm.name}.{key}"
                yield finding("ambiguous-argument", message, place, path=path, way_out="rename one of the two")
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
    scope: Scope,
    section: str,
    first: Mention,
    others: list[Mention],
    *,
    literal: Literal | None = None,
    known: frozenset[str] | None = None,
) -> Diagnostic:
    """Return the finding about a name that a section does not declare; `known` are the names that it might mean."""
    kind = scope.other_kind(first.name, section)
    if kind is not None:
        message = f"'{first.name}' in {first.user} is {kind}, not {NOUNS[section]}"
        return _told("wrong-kind-of-name", message, f"name {NOUNS[section]} here", first, others)
    rule, noun = _UNKNOWN[section]
    if section == "agents" and first.path.endswith((".by", ".requesters")):
        noun = "agent"
    message = f"unknown {noun} '{first.name}' in {first.user}"
    if literal is not None:
        return _told(rule, message, literal.help, first, others, fix=literal.fix((first, *others)))
    candidates = scope.names(section) if known is None else known
    near = scope.nearest(first.name, section, candidates)
    if near is not None and is_slip(first.name, near):
        scope.meant_names.use(section, first.name, near)
    fix = _renaming(scope, first, others, near, candidates)
    way_out = f"did you mean '{near}'?" if near else _declare(scope, first, section)
    return _told(rule, message, way_out, first, others, fix=fix)


def _renaming(
    scope: Scope, first: Mention, others: Iterable[Mention], near: str | None, candidates: Iterable[str]
) -> Fix | None:
    if near is None:
        return None
    known = scope.mentioned | {OBSERVER, MAIN_EXECUTION}
    return renaming(first.name, near, candidates, [each.place for each in (first, *others)], known)


def _declare(scope: Scope, mention: Mention, section: str) -> str:
    """Return the way out where a name means none that is declared."""
    meant = _parameter_meant(scope, mention) or literal_compared(scope, mention)
    if meant is not None:
        return meant
    if mention.site is None and not is_identifier(mention.name):
        return _apart(scope, mention, section)
    if section == "agents":
        others = "'observer', 'main_execution'" if mention.path.startswith("context.") else "'main_execution'"
        return f"write {others}, or declare it under 'agents'"
    return f"declare '{mention.name}' under '{section}'"


def _apart(scope: Scope, mention: Mention, section: str) -> str:
    """Return the way out where what should be a name is none: several without ',', or one with more beside it."""
    words = _WORD.findall(mention.name)
    known = [word for word in words if word in scope.names(section) or word in _SOURCES.get(section, ())]
    if len(known) == len(words) > 1:
        return f"make each an item of a list: [{', '.join(known)}]"
    return f"write only '{known[0]}'" if len(known) == 1 else "write a name: letters A to Z, digits and '_'"


def _parameter_meant(scope: Scope, mention: Mention) -> str | None:
    """Return the parameter that is meant by a name in a template which is, or begins with, the name of one."""
    if mention.place.use is None:
        return None
    words = mention.name.split("_")
    begun = ("_".join(words[:count]) for count in range(len(words), 0, -1))
    meant = next((each for each in begun if each == INSTANCE or each in scope.parameters), "")
    return f"write {mention.name.replace(meant, f'$({meant})', 1)}" if meant else None


def _not_returned(scope: Scope, algorithm: str, first: Mention, others: list[Mention]) -> Diagnostic:
    assert first.site is not None
    key, returned = first.site.role, scope.returned_types[algorithm]
    if scope.declares("context", first.name):
        message = f"'{first.name}' in '{key}' of {first.user} is a context-variable, which is not seen there"
        moved = "ask for it in 'observable_when'"
        way_out = moved if key is Role.ACCEPT_WHEN else f"{moved}, or hand it to the algorithm with 'given'"
        return _told("name-out-of-sight", message, way_out, first, others)
    kind = scope.other_kind(first.name, "context")
    literal = literal_meant(scope, first.site, first.name)
    if kind is not None and literal is None:
        message = f"'{first.name}' in '{key}' of {first.user} is {kind}, not what the algorithm returns"
        return _told("wrong-kind-of-name", message, "name a returned value here", first, others)
    message = f"unknown returned value '{first.name}' in '{key}' of {first.user}"
    if literal is not None:
        fix = literal.fix((first, *others))
        return _told("unknown-returned-value", message, literal.help, first, others, fix=fix)
    near = scope.nearest(first.name, f"returned by {algorithm}", returned)
    if near is not None and is_slip(first.name, near):
        scope.meant_names.use((algorithm,), first.name, near)
    way_out = f"did you mean '{near}'?" if near else _declare(scope, first, "returns")
    fix = _renaming(scope, first, others, near, returned)
    return _told("unknown-returned-value", message, way_out, first, others, fix=fix)


def _told(
    rule: str, message: str, way_out: str, first: Mention, others: Iterable[Mention], *, fix: Fix | None = None
) -> Diagnostic:
    related = tuple(Related(f"also in {mention.user}", mention.place) for mention in others)
    return finding(rule, message, first.place, path=first.path, way_out=way_out, related=related, fix=fix)
