"""Phase 1: every name that an element refers to is declared, is of the right kind, and can be seen from there."""

from __future__ import annotations

from collections.abc import Generator, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import chain

from codra_dsl.check.conditions import Role, Site
from codra_dsl.check.fixes import quoting, renaming, truth
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
from codra_dsl.check.scope import MAIN_EXECUTION, NOUNS, OBSERVER, Faults, Scope
from codra_dsl.diagnostics import Diagnostic, Fix, Place, Related
from codra_dsl.model import Access, Agent, Algorithm, Condition, Kind, Resource, Variable

_UNKNOWN = {
    "context": ("unknown-variable", "context-variable"),
    "resources": ("unknown-resource", "resource"),
    "agents": ("unknown-source", "source"),
}
_WORDS_FOR_TRUTH = {"yes": "true", "on": "true", "no": "false", "off": "false"}


def unknown_variables(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """Every context-variable that something refers to is declared: one finding per name, with all its mentions."""
    groups = list(unknown(scope, "context", chain(references(scope), mentions_in_preconditions(scope))))
    if not groups:
        return
    plain = [group for group in groups if not _is_returned(scope, group[0]) and _meant_literal(scope, group[0]) is None]
    left = yield from _misspelt(scope, "context", plain, _places(scope.variables), used_variables(scope))
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
    lonely = {name for name in unknown_names if not scope.nearest(name, section, candidates)}
    is_known = len(lonely) <= scope.nameless(section)
    return [group for group in left if not (is_known and group[0].name in lonely)]


def _places(declared: Mapping[str, Variable] | Mapping[str, Resource] | Mapping[str, Agent]) -> dict[str, Place]:
    return {name: element.place for name, element in declared.items()}


def _is_returned(scope: Scope, mention: Mention) -> bool:
    """Return whether a name in a precondition is what its algorithm returns."""
    return mention.site is not None and mention.name in scope.returned_types[mention.site.owner[1]]


def _meant_literal(scope: Scope, mention: Mention) -> _Literal | None:
    return None if mention.site is None else _literal(scope, mention.site, mention.name)


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
                    way_out = _literal(scope, site, mention.name) or _Literal("state a literal")
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
    literal: _Literal | None = None,
    known: frozenset[str] | None = None,
) -> Diagnostic:
    """Return the finding about a name that a section does not declare; `known` are the names that it might mean."""
    kind = scope.other_kind(first.name, section)
    if kind is not None:
        message = f"'{first.name}' in {first.user} is {kind}, not {NOUNS[section]}"
        return _told("wrong-kind-of-name", message, f"name {NOUNS[section]} here", first, others)
    rule, noun = _UNKNOWN[section]
    message = f"unknown {noun} '{first.name}' in {first.user}"
    if literal is not None:
        return _told(rule, message, literal.help, first, others, fix=literal.fix((first, *others)))
    candidates = scope.names(section) if known is None else known
    near = scope.nearest(first.name, section, candidates)
    if near is not None:
        scope.meant_names.use(section, first.name, near)
    fix = _renaming(scope, first, others, near, candidates)
    return _told(rule, message, f"did you mean '{near}'?" if near else _declare(first, section), first, others, fix=fix)


def _renaming(
    scope: Scope, first: Mention, others: Iterable[Mention], near: str | None, candidates: Iterable[str]
) -> Fix | None:
    if near is None:
        return None
    known = scope.mentioned | {OBSERVER, MAIN_EXECUTION}
    return renaming(first.name, near, candidates, [each.place for each in (first, *others)], known)


def _declare(mention: Mention, section: str) -> str:
    if section == "agents":
        return "write 'observer', 'main_execution', or declare it under 'agents'"
    return f"declare '{mention.name}' under '{section}'"


def _not_returned(scope: Scope, algorithm: str, first: Mention, others: list[Mention]) -> Diagnostic:
    assert first.site is not None
    key, returned = first.site.role, scope.returned_types[algorithm]
    if scope.declares("context", first.name):
        message = f"'{first.name}' in '{key}' of {first.user} is a context-variable, which is not seen there"
        moved = "ask for it in 'observable_when'"
        way_out = moved if key is Role.ACCEPT_WHEN else f"{moved}, or hand it to the algorithm with 'given'"
        return _told("name-out-of-sight", message, way_out, first, others)
    kind = scope.other_kind(first.name, "context")
    literal = _literal(scope, first.site, first.name)
    if kind is not None and literal is None:
        message = f"'{first.name}' in '{key}' of {first.user} is {kind}, not what the algorithm returns"
        return _told("wrong-kind-of-name", message, "name a returned value here", first, others)
    message = f"unknown returned value '{first.name}' in '{key}' of {first.user}"
    if literal is not None:
        fix = literal.fix((first, *others))
        return _told("unknown-returned-value", message, literal.help, first, others, fix=fix)
    near = scope.nearest(first.name, f"returned by {algorithm}", returned)
    if near is not None:
        scope.meant_names.use((algorithm,), first.name, near)
    listed = f"did you mean '{near}'?" if near else f"declare '{first.name}' under 'returns'"
    fix = _renaming(scope, first, others, near, returned)
    return _told("unknown-returned-value", message, listed, first, others, fix=fix)


@dataclass(frozen=True, slots=True)
class _Literal:
    """The way out where a name is meant as a literal. `truth` is what it means where that is true or false."""

    help: str
    truth: str = ""
    condition: Condition | None = None

    def fix(self, mentions: Sequence[Mention]) -> Fix | None:
        """Return the fix of all mentions of the name."""
        name = mentions[0].name
        if self.truth:
            return truth(name, self.truth, [mention.place for mention in mentions])
        alone = self.condition is not None and len(mentions) == 1
        return quoting(name, mentions[0].place, self.condition) if alone and self.condition else None


def _literal(scope: Scope, site: Site, name: str) -> _Literal | None:
    """Return the way out where a name is meant as a literal: a member without quotes, or `yes`."""
    if name.casefold() in _WORDS_FOR_TRUTH:
        meant = _WORDS_FOR_TRUTH[name.casefold()]
        return _Literal(f"write '{meant}'", meant)
    seen = scope.returned_types[site.owner[1]] if site.owner[0] == "perception" else {}
    types = [seen.get(each.name) or scope.context_types.get(each.name) for each in site.names]
    members = [each.values for each in (*types, scope.wanted(site)) if each is not None and each.kind is Kind.ENUM]
    is_member = any(name in each for each in members)
    return _Literal(f'members stand in quotes: "{name}"', condition=site.condition) if is_member else None


def _told(
    rule: str, message: str, way_out: str, first: Mention, others: Iterable[Mention], *, fix: Fix | None = None
) -> Diagnostic:
    related = tuple(Related(f"also in {mention.user}", mention.place) for mention in others)
    return finding(rule, message, first.place, path=first.path, way_out=way_out, related=related, fix=fix)
