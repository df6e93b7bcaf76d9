"""Where names are used: every mention of a context-variable, a resource, a source or a returned value."""

from __future__ import annotations

from collections.abc import Iterable, Iterator
from dataclasses import dataclass

from codra_dsl.check.conditions import Role, Site
from codra_dsl.check.scope import MAIN_EXECUTION, OBSERVER, USERS, Scope
from codra_dsl.diagnostics import Place
from codra_dsl.expression import Name
from codra_dsl.model import Reference


@dataclass(frozen=True, slots=True)
class Mention:
    """A name where it is used; `user` says by whom, for people. `site` is the condition, if it stands in one."""

    name: str
    place: Place
    user: str
    path: str
    site: Site | None = None


def references(scope: Scope) -> Iterator[Mention]:
    """Yield every context-variable that is named outside conditions."""
    for algorithm in scope.spec.perception:
        for reference in algorithm.given:
            yield mention_of(reference, "perception", algorithm.name, "given")
        for entry in algorithm.identifies:
            yield mention_of(entry.variable, "perception", algorithm.name, "identifies")
    for skill in scope.spec.skills:
        watched = [expectation.variable for expectation in skill.monitor]
        for key, named in (("preview", skill.preview), ("monitor", watched), ("changes", skill.changes)):
            for reference in named:
                yield mention_of(reference, "skills", skill.name, key)
    for observer in scope.spec.observers:
        for reference in observer.identifies:
            yield mention_of(reference, "observers", observer.name, "identifies")


def resource_mentions(scope: Scope) -> Iterator[Mention]:
    """Yield every resource that an algorithm uses."""
    for algorithm in scope.spec.perception:
        for usage in algorithm.uses:
            yield mention_of(usage.resource, "perception", algorithm.name, "uses")


def source_mentions(scope: Scope) -> Iterator[Mention]:
    """Yield every source that is to be an agent."""
    for variable in scope.spec.context:
        for source in variable.sources:
            if source.name not in (OBSERVER, MAIN_EXECUTION):
                yield mention_of(source, "context", variable.name, "source")


def used_variables(scope: Scope) -> Iterator[str]:
    """Yield the names of all context-variables that something refers to, be they declared or not."""
    yield from (mention.name for mention in references(scope))
    for site in scope.sites:
        if site.role is Role.OBSERVABLE_WHEN:
            yield from (name.name for name in site.names)


def mentions_in_preconditions(scope: Scope) -> Iterator[Mention]:
    """Yield every name in a precondition that no context-variable has."""
    for site in scope.sites:
        if site.role is Role.OBSERVABLE_WHEN:
            yield from mentions_of(site, [name for name in site.names if not scope.declares("context", name.name)])


def mentions_of(site: Site, names: Iterable[Name]) -> Iterator[Mention]:
    """Yield names of a condition as mentions."""
    for name in names:
        yield Mention(name.name, site.condition.place_of(name), _user(*site.owner), site.path, site)


def mention_of(reference: Reference, section: str, element: str, key: str) -> Mention:
    """Return a name that an element has under a key as a mention."""
    return Mention(reference.name, reference.place, _user(section, element), f"{section}.{element}.{key}")


def _user(section: str, element: str) -> str:
    return f"{USERS[section]} '{element}'"


def unknown(scope: Scope, section: str, mentions: Iterable[Mention]) -> Iterator[list[Mention]]:
    """Yield the mentions of each name that a section does not declare, in the order of their places."""
    groups: dict[str, list[Mention]] = {}
    for mention in mentions:
        if not scope.declares(section, mention.name):
            groups.setdefault(mention.name, []).append(mention)
    for found in groups.values():
        yield sorted(found, key=lambda mention: mention.place.span)
