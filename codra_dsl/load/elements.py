"""Gathers the elements of a spec from its files and uses, each name once, and builds them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from codra_dsl.diagnostics import Related
from codra_dsl.expression.tokens import shown
from codra_dsl.load.build import (
    build_agent,
    build_algorithm,
    build_observer,
    build_resource,
    build_skill,
    build_variable,
)
from codra_dsl.load.document import SECTIONS
from codra_dsl.load.findings import Findings
from codra_dsl.load.names import check_name
from codra_dsl.load.nodes import MappingNode, YamlNode
from codra_dsl.load.origin import NOUNS, Origin, Subject
from codra_dsl.load.reader import Reader, Suspect
from codra_dsl.load.shape import explain, sound
from codra_dsl.load.templates import DEFINITIONS
from codra_dsl.model import Algorithm

_BUILDERS: Mapping[str, Callable[[Reader], Any]] = {
    "context": build_variable,
    "perception": build_algorithm,
    "skills": build_skill,
    "observers": build_observer,
    "resources": build_resource,
    "agents": build_agent,
}


class Elements:
    """The elements of one spec, as they are gathered.

    Attributes:
        built: by section and name, in the order of files and uses.
        damaged: names by section of elements that could not be read whole.
        partial: algorithms that could not be read whole, as far as they could.
        origins: the module of each element, by section and name.
    """

    def __init__(self, findings: Findings) -> None:
        self.built: dict[str, dict[str, Any]] = {section: {} for section in SECTIONS}
        self.damaged: dict[str, set[str]] = {section: set() for section in SECTIONS}
        self.partial: list[Algorithm] = []
        self.origins: dict[tuple[str, str], str] = {}
        self._findings = findings
        self._taken: dict[str, dict[str, Subject]] = {section: {} for section in SECTIONS}
        self._suspects: list[tuple[Suspect, frozenset[str]]] = []

    def add(self, section: str, elements: YamlNode | None, origin: Origin, wrong: frozenset[str] = frozenset()) -> None:
        """Add the elements of a section; `wrong` are those, as written, that a finding stands about already."""
        if not isinstance(elements, MappingNode):
            return
        all_sound = not wrong and sound(section, elements.data)
        for key, node in elements.entries.values():
            subject = Subject(section, key, origin)
            right = self._is_new(subject) and key.written not in wrong
            if not all_sound and key.written not in wrong:
                right = self._is_sound(subject, node) and right
            if isinstance(node, MappingNode):
                self._build(Reader(subject, node, self._findings), right=right)
            else:
                self.damaged[section].add(key.text)

    def _build(self, reader: Reader, *, right: bool) -> None:
        """Build an element; one that is not right is read only for what else is wrong with it."""
        section, name = reader.subject.section, reader.subject.name
        element = _BUILDERS[section](reader)
        if not right or element is None or reader.damaged:
            self.damaged[section].add(name)
            if isinstance(element, Algorithm):
                self.partial.append(element)
            return
        self.built[section][name] = element
        self.origins[section, name] = reader.origin.module
        if reader.suspects:
            self._suspect(reader, element)

    def report_comments(self) -> None:
        """Report comments after conditions that name what a condition there could see."""
        context = self.built["context"].keys()
        for suspect, returned in self._suspects:
            if all(name in context or name in returned for name in suspect.names):
                message = (
                    f"what follows the ' #' in {shown(suspect.written)} is a comment, though it reads like a condition"
                )
                way_out = "quote the whole if it belongs to the condition; else put the comment on a line of its own"
                self._findings.add("condition-in-comment", message, suspect.place, help=way_out, path=suspect.path)

    def _is_new(self, subject: Subject) -> bool:
        """Report a name that is no good or taken already."""
        if not check_name(subject.key, subject, subject, self._findings):
            return False
        first = self._taken[subject.section].setdefault(subject.name.casefold(), subject)
        if first is subject:
            return True
        report_taken(subject, first, self._findings)
        return False

    def _is_sound(self, subject: Subject, node: YamlNode) -> bool:
        definition = DEFINITIONS[subject.section]
        if sound(definition, node.data):
            return True
        explain(definition, node, subject, self._findings)
        return False

    def _suspect(self, reader: Reader, element: object) -> None:
        returned = element.returns if isinstance(element, Algorithm) else ()
        names = frozenset(value.name for value in returned)
        self._suspects.extend((suspect, names) for suspect in reader.suspects)


def report_taken(subject: Subject, first: Subject, findings: Findings) -> None:
    """Report a name that another element of its kind has already."""
    place, other = subject.origin.of(subject.key), first.origin.of(first.key)
    noun = NOUNS[subject.section]
    related = [Related("first declared here", other)]
    if place.span == other.span:
        message = f"two uses make the {noun} {shown(subject.name)}"
        way_out = "put $(instance) into its name, or declare it outside the template"
    elif subject.name == first.name:
        message, way_out = f"the {noun} {shown(subject.name)} is declared twice", "rename or remove one of them"
    else:
        message = f"the {noun}s {shown(first.name)} and {shown(subject.name)} differ only in case"
        way_out = "rename one of them"
    findings.add("duplicate-name", message, place, help=way_out, path=subject.path, related=related)
