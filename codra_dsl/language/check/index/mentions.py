"""All uses of names: every mention of a context-variable, a resource, a source or a returned value."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator

from codra_dsl.language.check.conditions.conditions import CONTEXT_ROLES, Site
from codra_dsl.language.check.index.spec_index import KNOWLEDGE_SECTIONS, MAIN_EXECUTION, OBSERVER, SpecIndex
from codra_dsl.language.check.index.words import USERS
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.expression import Name, is_name
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import Parameter, Reference, Writer


@dataclass(frozen=True, slots=True)
class Mention:
    """A use of a name.

    Attributes:
        user: the element that uses the name, as messages show it.
        site: the condition that contains the name; None if the name is not in a condition.
    """

    name: str
    place: Place
    user: str
    path: str
    site: Site | None = None


def references(spec_index: SpecIndex) -> Iterator[Mention]:
    """Yield every mention of a context-variable outside conditions."""
    return (mention_of(*reference) for reference in variable_references(spec_index))


def undeclared_references(spec_index: SpecIndex) -> Iterator[Mention]:
    """Yield every mention of an undeclared context-variable outside conditions; almost all references are declared.

    An empty name is already reported.
    """
    for reference in variable_references(spec_index):
        if reference[0].name and not spec_index.declares("context", reference[0].name):
            yield mention_of(*reference)


def variable_references(spec_index: SpecIndex) -> Iterator[tuple[Reference, str, str, str]]:
    """Yield every reference to a context-variable outside conditions, with the arguments of `mention_of`."""
    for algorithm in spec_index.spec.perception:
        for reference in algorithm.given:
            yield reference, "perception", algorithm.name, "given"
        for entry in algorithm.identifies:
            yield entry.variable, "perception", algorithm.name, "identifies"
    for variable in spec_index.spec.context:
        if variable.rate is not None:
            yield variable.rate.of, "context", variable.name, variable.rate.kind.value
    for adaptation in spec_index.spec.adaptation:
        if isinstance(adaptation.does, Parameter):
            yield adaptation.does.variable, "adaptation", adaptation.name, "set"
    for skill in spec_index.spec.skills:
        monitored_variables = [expectation.variable for expectation in skill.monitor]
        for key, references_of_key in (
            ("preview", skill.preview_names),
            ("monitor", monitored_variables),
            ("changes", skill.changes),
        ):
            for reference in references_of_key:
                yield reference, "skills", skill.name, key
    for observer in spec_index.spec.observers:
        for reference in observer.identifies:
            yield reference, "observers", observer.name, "identifies"


def resource_mentions(spec_index: SpecIndex, *, declared: Collection[str] = ()) -> Iterator[Mention]:
    """Yield every mention of a resource in an algorithm, except mentions of the declared resources."""
    for algorithm in spec_index.spec.perception:
        for usage in algorithm.uses:
            if usage.resource.name not in declared:
                yield mention_of(usage.resource, "perception", algorithm.name, "uses")


def source_mentions(spec_index: SpecIndex) -> Iterator[Mention]:
    """Yield every mention of a source, executor or requester that must be an agent."""
    for variable in spec_index.spec.context:
        for source in variable.sources if not variable.is_computed else ():
            if source.name not in (OBSERVER, MAIN_EXECUTION):
                yield mention_of(source, "context", variable.name, "source")
    for writer, section, name in _writers(spec_index):
        if writer.name not in (OBSERVER, MAIN_EXECUTION):
            yield mention_of(writer, section, name, "source")
    for task in spec_index.spec.tasks:
        for key, references_of_key in (("by", (task.by,)), ("requesters", task.requesters)):
            for reference in references_of_key:
                if reference.name not in ("", MAIN_EXECUTION):
                    yield mention_of(reference, "tasks", task.name, key)


def _writers(spec_index: SpecIndex) -> Iterator[tuple[Writer, str, str]]:
    """Yield the writers under `source` of knowledge elements, each with the element's section and name."""
    elements = (("types", spec_index.spec.types), ("edges", spec_index.spec.edges))
    for section, element in ((section, element) for section, in_section in elements for element in in_section):
        yield from ((writer, section, element.name) for writer in element.sources)
        for attribute in element.attributes:
            yield from ((writer, section, element.name) for writer in attribute.sources)


def used_variables(spec_index: SpecIndex) -> Iterator[str]:
    """Yield the names of all context-variables that something refers to, including undeclared names."""
    yield from (mention.name for mention in references(spec_index))
    for site in spec_index.sites:
        if site.role in CONTEXT_ROLES:
            yield from (name.name for name in site.names if is_name(name.name))


def mentions_in_preconditions(spec_index: SpecIndex) -> Iterator[Mention]:
    """Yield every undeclared name in a condition over context, except names with several parts, such as `a.b`."""
    for site in spec_index.sites:
        if site.role in CONTEXT_ROLES:
            names = [
                name for name in site.names if not spec_index.declares("context", name.name) and is_name(name.name)
            ]
            if names:
                yield from mentions_of(site, names)


def mentions_of(site: Site, names: Iterable[Name]) -> Iterator[Mention]:
    """Yield a mention for each of these names in a condition."""
    for name in names:
        yield Mention(name.name, site.condition.place_of(name), user_of(*site.owner), site.path, site)


def mention_of(reference: Reference | Writer, section: str, element: str, key: str) -> Mention:
    """Return the mention of a name that is written under a key of an element."""
    group = "knowledge." if section in KNOWLEDGE_SECTIONS else ""
    return Mention(reference.name, reference.place, user_of(section, element), f"{group}{section}.{element}.{key}")


def user_of(section: str, element: str) -> str:
    """Return the name of an element in messages, e.g. `algorithm 'find_door'`."""
    return f"{USERS[section]} '{element}'"


def unknown_mentions(spec_index: SpecIndex, section: str, mentions: Iterable[Mention]) -> Iterator[list[Mention]]:
    """For each name that a section does not declare, yield the list of the name's mentions, in the order of places."""
    groups: dict[str, list[Mention]] = {}
    for mention in mentions:
        if not spec_index.declares(section, mention.name):
            groups.setdefault(mention.name, []).append(mention)
    for group in groups.values():
        yield sorted(group, key=lambda mention: mention.place.span)
