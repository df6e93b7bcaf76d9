"""Collect and build the elements of a spec from its files and uses. A second element with the same name is reported."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Any

from codra_dsl.language.diagnostics import Related
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.elements.build import (
    build_algorithm,
    build_observer,
    build_resource,
    build_skill,
    build_variable,
)
from codra_dsl.language.load.elements.knowledge import (
    as_mapping,
    build_agent,
    build_edge,
    build_node,
    build_node_type,
    build_task,
)
from codra_dsl.language.load.elements.loops import build_action, build_adaptation, build_loop, build_metric, build_tree
from codra_dsl.language.load.schema.document import SECTIONS
from codra_dsl.language.load.schema.keys_and_values import explain
from codra_dsl.language.load.schema.schema import has_shape, keys_of
from codra_dsl.language.load.site.overlay import Overlay
from codra_dsl.language.load.templates.templates import DEFINITIONS
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.names import check_name
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, YamlNode
from codra_dsl.language.load.yaml.origin import NOUNS, Origin, Subject
from codra_dsl.language.load.yaml.reader import Reader, Suspect
from codra_dsl.language.model import Algorithm

_BUILDERS: Mapping[str, Callable[[Reader], Any]] = {
    "context": build_variable,
    "perception": build_algorithm,
    "skills": build_skill,
    "observers": build_observer,
    "resources": build_resource,
    "agents": build_agent,
    "types": build_node_type,
    "nodes": build_node,
    "edges": build_edge,
    "tasks": build_task,
    "metrics": build_metric,
    "actions": build_action,
    "adaptation": build_adaptation,
    "trees": build_tree,
    "loops": build_loop,
}

_NO_WRONG_KEYS: Mapping[str, frozenset[str]] = {}


class Elements:
    """The elements of one spec.

    Attributes:
        elements_by_section: the elements that could be read, by section and name, in the order of files and uses.
        damaged: for each section, the names of elements that could not be read completely, whether built or not.
        damaged_keys: for each built element (section, name) that is damaged, the keys that could not be read.
        origins: the name of the generated module of each element (section, name).
    """

    def __init__(self, findings: Findings, overlay: Overlay | None = None) -> None:
        """Initialize; `overlay` has the values that a site replaces."""
        self.elements_by_section: dict[str, dict[str, Any]] = {section: {} for section in SECTIONS}
        self.damaged: dict[str, set[str]] = {section: set() for section in SECTIONS}
        self.damaged_keys: dict[tuple[str, str], frozenset[str]] = {}
        self.origins: dict[tuple[str, str], str] = {}
        self._findings = findings
        self._overlay = overlay
        self._first_subjects: dict[str, dict[str, Subject]] = {section: {} for section in SECTIONS}
        self._suspects: list[tuple[Suspect, frozenset[str]]] = []

    def add(
        self,
        section: str,
        elements: YamlNode | None,
        origin: Origin,
        wrong_keys: Mapping[str, frozenset[str]] = _NO_WRONG_KEYS,
    ) -> None:
        """Add the elements of a section.

        `wrong_keys` maps the names of elements, as written, to their wrong keys; these have already been reported.
        """
        if not isinstance(elements, MappingNode):
            return
        all_have_shape = not wrong_keys and has_shape(section, elements.data)
        for key, node in elements.entries.values():
            subject = Subject(section, key, origin)
            is_new = self._is_new(subject)
            damaged = wrong_keys.get(key.written, frozenset())
            element_node = node
            if self._overlay is not None and is_new and key.written not in wrong_keys:
                subject, node = self._overlay.apply(subject, _as_element(section, key, node))  # noqa: PLW2901
            if node is not element_node or not (all_have_shape or key.written in wrong_keys):
                damaged = self._report_shape_mistakes(subject, node)
            if isinstance(node, MappingNode) and node.unread:
                damaged |= keys_of(DEFINITIONS[section]) - node.entries.keys()
            element = None
            node = _as_element(section, key, node)  # noqa: PLW2901
            if isinstance(node, MappingNode):  # duplicates are read to find their other mistakes
                reader = Reader(subject, node, self._findings, damaged)
                element = _BUILDERS[section](reader)
            if element is None or not is_new:
                self.record_lost(section, key.text)
            else:
                self._keep(reader, element)

    def record_lost(self, section: str, name: str) -> None:
        """Record an element that is not built.

        If an element with the same name has been built, all keys of the built element count as unreadable.
        """
        self.damaged[section].add(name)
        if name in self.elements_by_section[section]:
            self.damaged_keys[section, name] = keys_of(DEFINITIONS[section])

    def _keep(self, reader: Reader, element: object) -> None:
        section, name = reader.subject.section, reader.subject.name
        self.elements_by_section[section][name] = element
        self.origins[section, name] = reader.origin.module
        if reader.damaged:
            self.damaged[section].add(name)
            self.damaged_keys[section, name] = frozenset(reader.damaged)
        if reader.suspects:
            returned = element.returns if isinstance(element, Algorithm) else ()
            names = frozenset(value.name for value in returned)
            self._suspects.extend((suspect, names) for suspect in reader.suspects)

    def report_comments(self) -> None:
        """Report each comment that may be part of the condition before it, since all names in the comment are known."""
        context = self.elements_by_section["context"].keys()
        for suspect, returned in self._suspects:
            if all(name in context or name in returned for name in suspect.names):
                message = f"the text after ' #' in {shown(suspect.written)} is a comment, but it reads like a condition"
                help_text = (
                    "if the comment belongs to the condition, quote the complete text;"
                    " otherwise put the comment on a line of its own"
                )
                self._findings.add("condition-in-comment", message, suspect.place, help=help_text, path=suspect.path)

    def _is_new(self, subject: Subject) -> bool:
        """Report an invalid or duplicate name; return whether the name is new."""
        if not check_name(subject.key, subject, subject, self._findings):
            return False
        first = self._first_subjects[subject.section].setdefault(subject.name.casefold(), subject)
        if first is subject:
            return True
        report_duplicate_name(subject, first, self._findings)
        return False

    def _report_shape_mistakes(self, subject: Subject, node: YamlNode) -> frozenset[str]:
        """Report mistakes in the shape of an element; return the keys that cannot be read because of them."""
        definition = DEFINITIONS[subject.section]
        return frozenset() if has_shape(definition, node.data) else explain(definition, node, subject, self._findings)


def _as_element(section: str, key: ScalarNode, node: YamlNode) -> YamlNode:
    """Return the value of an element's name as the element. For a node, a text alone is its type."""
    return as_mapping(key, node) if section == "nodes" else node


def report_duplicate_name(subject: Subject, first: Subject, findings: Findings) -> None:
    """Report a name that another element of the same kind already has."""
    place, first_place = subject.origin.of(subject.key), first.origin.of(first.key)
    noun = NOUNS[subject.section]
    related = [Related("first declared here", first_place)]
    if place.span == first_place.span:
        message = f"two uses create the {noun} {shown(subject.name)}"
        help_text = "put $(instance) into its name, or declare it outside the template"
    elif subject.name == first.name:
        message, help_text = f"the {noun} {shown(subject.name)} is declared twice", "rename or remove one of them"
    else:
        message = f"the {noun}s {shown(first.name)} and {shown(subject.name)} differ only in case"
        help_text = "rename one of them"
    findings.add("duplicate-name", message, place, help=help_text, path=subject.path, related=related)
