"""Phase 1: every name that an element refers to is declared, is of the right kind, and can be seen from there."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain

from codra_dsl.check.conditions import Role, Site
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import MAIN_EXECUTION, NOUNS, OBSERVER, USERS, Faults, Scope
from codra_dsl.diagnostics import Diagnostic, Place, Related
from codra_dsl.expression import Name
from codra_dsl.model import Access, Algorithm, Kind, Reference

_UNKNOWN = {
    "context": ("unknown-variable", "context-variable"),
    "resources": ("unknown-resource", "resource"),
    "agents": ("unknown-source", "source"),
}
_WORDS_FOR_TRUTH = {"yes": "true", "on": "true", "no": "false", "off": "false"}


@dataclass(frozen=True, slots=True)
class Mention:
    """A name where it is used; `user` says by whom, for people. `site` is the condition, if it stands in one."""

    name: str
    place: Place
    user: str
    path: str
    site: Site | None = None


def unknown_variables(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """Every context-variable that something refers to is declared: one finding per name, with all its mentions."""
    mentions = chain(_references(scope), _mentions_in_preconditions(scope))
    for first, *others in _unknown(scope, "context", mentions):
        site = first.site
        if site is not None and first.name in scope.returned_types[site.owner[1]]:
            message = f"'{first.name}' in 'observable_when' of {first.user} is what the algorithm returns"
            way_out = "move the condition to 'accept_when'"
            yield _told("name-out-of-sight", message, way_out, first, others)
        else:
            literal = None if site is None else _literal_help(scope, site, first.name)
            yield _not_declared(scope, "context", first, others, way_out=literal)


def unknown_resources(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """Every resource that an algorithm uses is declared."""
    mentions = (
        _mention(usage.resource, "perception", algorithm.name, "uses")
        for algorithm in scope.spec.perception
        for usage in algorithm.uses
    )
    for first, *others in _unknown(scope, "resources", mentions):
        yield _not_declared(scope, "resources", first, others)


def unknown_sources(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """A source is `observer`, `main_execution` or an agent."""
    mentions = (
        _mention(source, "context", variable.name, "source")
        for variable in scope.spec.context
        for source in variable.sources
        if source.name not in (OBSERVER, MAIN_EXECUTION)
    )
    sources = {OBSERVER, MAIN_EXECUTION} | scope.names("agents")
    for first, *others in _unknown(scope, "agents", mentions):
        near = scope.nearest(first.name, "source", sources)
        listed = "write 'observer', 'main_execution', or declare it under 'agents'"
        way_out = f"did you mean '{near}'?" if near else listed
        yield _not_declared(scope, "agents", first, others, way_out=way_out)


def unknown_names_in_results(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """`accept_when` and `identifies` see what the algorithm returns, and nothing else."""
    unknown: dict[tuple[str, str], list[Mention]] = {}
    for site in scope.sites:
        if site.role in (Role.ACCEPT_WHEN, Role.IDENTIFIES) and scope.readable(*site.owner, "returns"):
            algorithm = site.owner[1]
            returned = scope.returned_types[algorithm]
            for mention in _mentions(site, [name for name in site.values if name.name not in returned]):
                unknown.setdefault((algorithm, mention.name), []).append(mention)
    for (algorithm, _name), (first, *others) in unknown.items():
        yield _not_returned(scope, algorithm, first, others)


def names_in_expectations(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """What a skill expects of a variable is stated with literals."""
    for site in scope.sites:
        if site.role is Role.MONITOR:
            for mention in _mentions(site, site.values):
                if mention.name != site.variable:
                    message = f"'{mention.name}' is no value that {mention.user} can expect of '{site.variable}'"
                    way_out = _literal_help(scope, site, mention.name) or "state a literal"
                    yield _told("name-out-of-sight", message, way_out, mention, ())


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


def _references(scope: Scope) -> Iterator[Mention]:
    """Yield every context-variable that is named outside conditions."""
    for algorithm in scope.spec.perception:
        for reference in algorithm.given:
            yield _mention(reference, "perception", algorithm.name, "given")
        for entry in algorithm.identifies:
            yield _mention(entry.variable, "perception", algorithm.name, "identifies")
    for skill in scope.spec.skills:
        watched = [expectation.variable for expectation in skill.monitor]
        for key, references in (("preview", skill.preview), ("monitor", watched), ("changes", skill.changes)):
            for reference in references:
                yield _mention(reference, "skills", skill.name, key)
    for observer in scope.spec.observers:
        for reference in observer.identifies:
            yield _mention(reference, "observers", observer.name, "identifies")


def _mentions_in_preconditions(scope: Scope) -> Iterator[Mention]:
    for site in scope.sites:
        if site.role is Role.OBSERVABLE_WHEN:
            yield from _mentions(site, [name for name in site.names if not scope.declares("context", name.name)])


def _mentions(site: Site, names: Iterable[Name]) -> Iterator[Mention]:
    for name in names:
        yield Mention(name.name, site.condition.place_of(name), _user(*site.owner), site.path, site)


def _mention(reference: Reference, section: str, element: str, key: str) -> Mention:
    return Mention(reference.name, reference.place, _user(section, element), f"{section}.{element}.{key}")


def _user(section: str, element: str) -> str:
    return f"{USERS[section]} '{element}'"


def _unknown(scope: Scope, section: str, mentions: Iterable[Mention]) -> Iterator[list[Mention]]:
    """Yield the mentions of each name that a section does not declare, in the order of their places."""
    unknown: dict[str, list[Mention]] = {}
    for mention in mentions:
        if not scope.declares(section, mention.name):
            unknown.setdefault(mention.name, []).append(mention)
    for found in unknown.values():
        yield sorted(found, key=lambda mention: mention.place.span)


def _not_declared(
    scope: Scope, section: str, first: Mention, others: list[Mention], *, way_out: str | None = None
) -> Diagnostic:
    """Return the finding about a name that a section does not declare."""
    kind = scope.other_kind(first.name, section)
    if kind is not None:
        message = f"'{first.name}' in {first.user} is {kind}, not {NOUNS[section]}"
        return _told("wrong-kind-of-name", message, f"name {NOUNS[section]} here", first, others)
    near = None if way_out else scope.nearest(first.name, section, scope.names(section))
    known_way = f"did you mean '{near}'?" if near else f"declare '{first.name}' under '{section}'"
    rule, noun = _UNKNOWN[section]
    return _told(rule, f"unknown {noun} '{first.name}' in {first.user}", way_out or known_way, first, others)


def _not_returned(scope: Scope, algorithm: str, first: Mention, others: list[Mention]) -> Diagnostic:
    assert first.site is not None
    key, returned = first.site.role, scope.returned_types[algorithm]
    if scope.declares("context", first.name):
        message = f"'{first.name}' in '{key}' of {first.user} is a context-variable, which is not seen there"
        moved = "ask for it in 'observable_when'"
        way_out = moved if key is Role.ACCEPT_WHEN else f"{moved}, or hand it to the algorithm with 'given'"
        return _told("name-out-of-sight", message, way_out, first, others)
    kind = scope.other_kind(first.name, "context")
    literal = _literal_help(scope, first.site, first.name)
    if kind is not None and literal is None:
        message = f"'{first.name}' in '{key}' of {first.user} is {kind}, not what the algorithm returns"
        return _told("wrong-kind-of-name", message, "name a returned value here", first, others)
    near = scope.nearest(first.name, f"returned by {algorithm}", returned)
    listed = f"did you mean '{near}'?" if near else f"declare '{first.name}' under 'returns'"
    message = f"unknown returned value '{first.name}' in '{key}' of {first.user}"
    return _told("unknown-returned-value", message, literal or listed, first, others)


def _literal_help(scope: Scope, site: Site, name: str) -> str | None:
    """Return the way out where a name is meant as a literal: a member without quotes, or `yes`."""
    if name.casefold() in _WORDS_FOR_TRUTH:
        return f"write '{_WORDS_FOR_TRUTH[name.casefold()]}'"
    seen = scope.returned_types[site.owner[1]] if site.owner[0] == "perception" else {}
    types = [seen.get(each.name) or scope.context_types.get(each.name) for each in site.names]
    members = [each.values for each in (*types, scope.wanted(site)) if each is not None and each.kind is Kind.ENUM]
    return f'members stand in quotes: "{name}"' if any(name in each for each in members) else None


def _told(rule: str, message: str, way_out: str, first: Mention, others: Iterable[Mention]) -> Diagnostic:
    related = tuple(Related(f"also in {mention.user}", mention.place) for mention in others)
    return finding(rule, message, first.place, path=first.path, way_out=way_out, related=related)
