"""Replace the values of a spec's elements by those that a site states."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from codra_dsl.language.diagnostics import Place, Related, replacement_fix
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.schema.document import SECTIONS, section_of
from codra_dsl.language.load.schema.schema import keys_of
from codra_dsl.language.load.schema_file import schema
from codra_dsl.language.load.site.joined_source import JoinedSource, join, joined_origin, shifted, shifted_scalar
from codra_dsl.language.load.site.site_file import SiteFile
from codra_dsl.language.load.yaml.findings import Findings, list_names
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, YamlNode
from codra_dsl.language.load.yaml.origin import NOUNS, Subject
from codra_dsl.language.load.yaml.reader import KEYS_OF_MAPPINGS, entries
from codra_dsl.language.load.yaml.source import Source
from codra_dsl.language.model import Replacement

Element = tuple[Subject, YamlNode]
"""The name of an element or a use with its origin, and the value of this name."""


class Overlay:
    """The values of one site.

    Values replace those of elements after templates are expanded, and arguments of uses before. A mapping replaces only
    the entries that it names; a scalar or a list replaces the complete value.

    Attributes:
        replacements: the values that have been replaced so far.
    """

    def __init__(self, site: SiteFile, findings: Findings) -> None:
        self.site = site
        self.replacements: list[Replacement] = []
        self._findings = findings
        self._entries = {
            (section, key.text): (key, value)
            for section in (*SECTIONS, "use")
            for key, value in entries(section_of(site.root, section))
        }
        self._sources: dict[str, JoinedSource] = {}
        self._applied: dict[tuple[str, str], Element] = {}

    def apply(self, subject: Subject, node: YamlNode) -> Element:
        """Return an element or a use with the values of the site; an element that the site does not name as it is.

        The values are replaced once: later calls with the same name return the first result.
        """
        address = (subject.section, subject.name)
        entry = self._entries.get(address)
        if entry is None:
            return subject, node
        if address not in self._applied:
            self._applied[address] = self._overlaid(subject, node, *entry)
        return self._applied[address]

    def _overlaid(self, subject: Subject, node: YamlNode, key: ScalarNode, value: YamlNode) -> Element:
        source = self._joined_source(subject.origin.source)
        joined_subject = replace(subject, origin=joined_origin(subject.origin, source))
        site_key, site_value = shifted_scalar(key, source.site_start), shifted(value, source.site_start)
        if subject.section == "use" and isinstance(site_value, MappingNode):
            self._refuse_template(joined_subject, site_value)
        merged = self._merged(joined_subject, node, site_value, ())
        if merged is site_value:
            self._record(joined_subject, (site_key, site_value), subject.origin.of(subject.key), ())
        return joined_subject, merged

    def _joined_source(self, spec_source: Source) -> JoinedSource:
        if spec_source.file not in self._sources:
            self._sources[spec_source.file] = join(spec_source, self.site.source)
        return self._sources[spec_source.file]

    def _merged(self, subject: Subject, node: YamlNode, value: YamlNode, steps: tuple[str, ...]) -> YamlNode:
        """Return a value of the spec with the values of the site; `steps` leads from the element to the value."""
        if not (isinstance(node, MappingNode) and isinstance(value, MappingNode)):
            return value
        merged = MappingNode(node.start, node.end, flow=node.flow)
        merged.reported, merged.unread = node.reported or value.reported, node.unread or value.unread
        for name, (key, inner) in node.entries.items():
            site_entry = value.entries.get(name)
            if site_entry is None:
                merged.put(key, inner)
            elif isinstance(inner, MappingNode) and isinstance(site_entry[1], MappingNode):
                merged.put(key, self._merged(subject, inner, site_entry[1], (*steps, name)))
            else:
                merged.put(*site_entry)
                self._record(subject, site_entry, subject.origin.of_value(key, inner), (*steps, name))
        for name, (key, inner) in value.entries.items():
            if name not in node.entries and self._may_add(subject, key, node, steps):
                merged.put(key, inner)
                self._record(subject, (key, inner), None, (*steps, name))
        return merged

    def _may_add(self, subject: Subject, key: ScalarNode, node: MappingNode, steps: tuple[str, ...]) -> bool:
        """Return whether a site may state a value that the spec does not state; if not, report it.

        A key of the language has a default, which the site may replace. The entries of `with`, `returns` and the like
        have names of their own, which must exist. The names under `with` of a node are those of its type's attributes.
        """
        if subject.section == "use":
            return True
        key_of_element = (*steps, key.text)[0]
        if subject.section == "nodes" or len(steps) > 1 or key_of_element not in KEYS_OF_MAPPINGS:
            return bool(steps) or self._is_known_key(subject, key)
        message = f"{_expanded_text(subject)} has no {shown(key.text)}{f' under {shown(steps[0])}' if steps else ''}"
        related = Related("declared here", subject.origin.of(subject.key))
        self._refuse(message, key, subject, node.entries, related)
        return False

    def _is_known_key(self, subject: Subject, key: ScalarNode) -> bool:
        """Return whether elements of a section can have a key; if not, report it."""
        definition = schema()["$defs"][subject.section]["additionalProperties"]["$ref"].rpartition("/")[2]
        known_keys = keys_of(definition)
        if key.text in known_keys:
            return True
        suggestion = self._findings.nearest(key.text, known_keys)
        help_text = f"did you mean '{suggestion}'?" if suggestion else f"allowed: {', '.join(sorted(known_keys))}"
        message, place = f"unknown key {shown(key.written)} in {_expanded_text(subject)}", subject.origin.of(key)
        related = Related("declared here", subject.origin.of(subject.key))
        fix = replacement_fix(place, key.written, suggestion, safe=False) if suggestion else None
        path = subject.part(key.text)
        self._findings.add("unknown-key", message, place, help=help_text, path=path, related=[related], fix=fix)
        return False

    def _refuse_template(self, subject: Subject, arguments: MappingNode) -> None:
        """Report and remove the name of another template: it would remove and add elements."""
        entry = arguments.entries.get("template")
        if entry is not None:
            arguments.take("template")
            related = Related("the template of the spec", subject.origin.of(subject.key))
            message, place = f"a site cannot choose the template of {subject}", subject.origin.of(entry[0])
            help_text, path = "remove 'template': a site changes only arguments", subject.part("template")
            self._findings.add("misplaced-key", message, place, help=help_text, path=path, related=[related])

    def _record(
        self, subject: Subject, entry: tuple[ScalarNode, YamlNode], replaced: Place | None, steps: tuple[str, ...]
    ) -> None:
        key, value = entry
        origin = subject.origin
        replacement = Replacement(
            section=subject.section,
            name=subject.name,
            key=".".join(steps),
            place=origin.of_value(key, value),
            extent=origin.place(key.start, value.end),
            replaced=replaced,
            element=origin.of(subject.key),
        )
        self.replacements.append(replacement)

    def _refuse(self, message: str, key: ScalarNode, subject: Subject, names: Iterable[str], related: Related) -> None:
        candidates = list(names)
        suggestion = self._findings.nearest(key.text, candidates)
        place = subject.origin.of(key)
        fix = replacement_fix(place, key.written, suggestion, safe=False) if suggestion else None
        if suggestion:
            help_text = f"did you mean '{suggestion}'?"
        elif candidates:
            help_text = f"a site adds nothing to the spec, which has {list_names(candidates)}"
        else:
            help_text = "a site adds nothing to the spec: declare it in the spec"
        self._findings.add("not-in-spec", message, place, help=help_text, path=subject.path, related=[related], fix=fix)

    def report_unknown_names(
        self, spec: Subject, names: Mapping[str, Iterable[str]], damaged_names: Mapping[str, frozenset[str]]
    ) -> None:
        """Report elements and uses that the spec does not have.

        Args:
            spec: the name of the spec.
            names: for each section, the names of the elements or uses of the spec.
            damaged_names: for each section, the names that could not be read completely, as in `Spec.damaged`.
        """
        for (section, name), (key, _) in self._entries.items():
            is_known = (section, name) in self._applied or name in damaged_names.get(section, frozenset())
            if not is_known and not key.reported:
                subject = Subject(section, key, self.site.origin)
                message = f"{spec} has no {NOUNS[section]} {shown(name)}"
                related = Related("the spec", spec.origin.of(spec.key))
                self._refuse(message, key, subject, names[section], related)


def _expanded_text(subject: Subject) -> str:
    """Return noun and name of an element as a site names it, with the parameters of its template substituted."""
    return f"{NOUNS[subject.section]} {shown(subject.name)}"
