"""Replace the values of a spec's elements by those that a site states."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import replace

from codra_dsl.language.diagnostics import Place, Related, replacement_fix
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.schema.document import SECTIONS, section_of
from codra_dsl.language.load.schema.schema import keys_of
from codra_dsl.language.load.schema_file import schema
from codra_dsl.language.load.site.joined_source import JoinedSource, join, joined_origin, shifted
from codra_dsl.language.load.site.site_file import SiteFile
from codra_dsl.language.load.yaml.findings import Findings, list_names
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, YamlNode
from codra_dsl.language.load.yaml.origin import NOUNS, Subject
from codra_dsl.language.load.yaml.reader import KEYS_OF_MAPPINGS, entries
from codra_dsl.language.load.yaml.source import Source
from codra_dsl.language.model import Replacement

Entry = tuple[ScalarNode, YamlNode]
"""The name of an element or a key of an element, and its value."""

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
            self._applied[address] = self._overlaid(subject, node, entry)
        return self._applied[address]

    def _overlaid(self, subject: Subject, node: YamlNode, site_entry: Entry) -> Element:
        source = self._joined_source(subject.origin.source)
        joined_subject = replace(subject, origin=joined_origin(subject.origin, source))
        site_key, site_value = shifted(site_entry[0], source.site_start), shifted(site_entry[1], source.site_start)
        if subject.section == "use" and isinstance(site_value, MappingNode):
            self._refuse_template(joined_subject, site_value)
        return joined_subject, self._merged(joined_subject, (subject.key, node), (site_key, site_value), ())[1]

    def _joined_source(self, spec_source: Source) -> JoinedSource:
        if spec_source.file not in self._sources:
            self._sources[spec_source.file] = join(spec_source, self.site.source)
        return self._sources[spec_source.file]

    def _merged(self, subject: Subject, entry: Entry, site_entry: Entry, steps: tuple[str, ...]) -> Entry:
        """Return an entry of the spec with the values of the site; `steps` leads from the element to the entry."""
        (key, node), (_, value) = entry, site_entry
        if not (isinstance(node, MappingNode) and isinstance(value, MappingNode)):
            self._record(subject, site_entry, subject.origin.of_value(*entry) if steps else subject.place, steps)
            return site_entry
        merged = MappingNode(node.start, node.end, flow=node.flow)
        merged.reported, merged.unread = node.reported or value.reported, node.unread or value.unread
        for name, inner_entry in node.entries.items():
            site_inner_entry = value.entries.get(name)
            if site_inner_entry is None:
                merged.put(*inner_entry)
            else:
                merged.put(*self._merged(subject, inner_entry, site_inner_entry, (*steps, name)))
        for name, new_entry in value.entries.items():
            if name not in node.entries and self._may_add(subject, new_entry[0], node, steps):
                merged.put(*new_entry)
                self._record(subject, new_entry, None, (*steps, name))
        return key, merged

    def _may_add(self, subject: Subject, key: ScalarNode, node: MappingNode, steps: tuple[str, ...]) -> bool:
        """Return whether a site may state a value that the spec does not state; if not, report it.

        A key of the language has a default, which the site may replace. The entries of `with`, `returns` and the like
        have names of their own, which must exist. The names under `with` of a node are those of its type's attributes.
        """
        if subject.section == "use":
            return True
        element_text = f"{NOUNS[subject.section]} {shown(subject.name)}"  # a name in a template as a site writes it
        related = Related("declared here", subject.place)
        if subject.section != "nodes" and len(steps) <= 1 and (*steps, key.text)[0] in KEYS_OF_MAPPINGS:
            message = f"{element_text} has no {shown(key.text)}{f' under {shown(steps[0])}' if steps else ''}"
            self._refuse(message, subject, key, related, list(node.entries))
            return False
        definition = schema()["$defs"][subject.section]["additionalProperties"]["$ref"].rpartition("/")[2]
        known_keys = keys_of(definition)
        if steps or key.text in known_keys:
            return True
        message = f"unknown key {shown(key.written)} in {element_text}"
        help_text = f"allowed: {', '.join(sorted(known_keys))}"
        self._report("unknown-key", message, subject, key, related, help=help_text, names=known_keys, step=key.text)
        return False

    def _refuse_template(self, subject: Subject, arguments: MappingNode) -> None:
        """Report and remove the name of another template: it would remove and add elements."""
        entry = arguments.entries.get("template")
        if entry is not None:
            arguments.take("template")
            message = f"a site cannot choose the template of {subject}"
            related = Related("the template of the spec", subject.place)
            help_text = "remove 'template': a site changes only arguments"
            self._report("misplaced-key", message, subject, entry[0], related, help=help_text, step="template")

    def _record(self, subject: Subject, entry: Entry, replaced: Place | None, steps: tuple[str, ...]) -> None:
        key, value = entry
        replacement = Replacement(
            section=subject.section,
            name=subject.name,
            key=".".join(steps),
            place=subject.origin.of_value(key, value),
            extent=subject.origin.place(key.start, value.end),
            replaced=replaced,
            element=subject.place,
        )
        self.replacements.append(replacement)

    def _refuse(self, message: str, subject: Subject, key: ScalarNode, related: Related, names: list[str]) -> None:
        reason = f", which has {list_names(names)}" if names else ": declare it in the spec"
        help_text = f"a site adds nothing to the spec{reason}"
        self._report("not-in-spec", message, subject, key, related, help=help_text, names=names)

    def _report(
        self,
        rule: str,
        message: str,
        subject: Subject,
        key: ScalarNode,
        related: Related,
        *,
        help: str,
        names: Iterable[str] = (),
        step: str = "",
    ) -> None:
        """Report a key of the site. If one of the names is similar to the key, suggest it instead of `help`."""
        suggestion = self._findings.nearest(key.text, names)
        place, path = subject.origin.of(key), subject.part(*filter(None, [step]))
        fix = replacement_fix(place, key.written, suggestion, safe=False) if suggestion else None
        help_text = f"did you mean '{suggestion}'?" if suggestion else help
        self._findings.add(rule, message, place, help=help_text, path=path, related=[related], fix=fix)

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
                related = Related("the spec", spec.place)
                self._refuse(message, subject, key, related, list(names[section]))
