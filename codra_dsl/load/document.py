"""One file as a document of this language: its head, and its sections as nodes."""

from __future__ import annotations

from dataclasses import dataclass

from codra_dsl.expression.tokens import shown
from codra_dsl.load.compose import compose
from codra_dsl.load.findings import Findings
from codra_dsl.load.names import check_name
from codra_dsl.load.nodes import MappingNode, ScalarNode, SequenceNode, YamlNode, scalars
from codra_dsl.load.origin import Origin, Subject
from codra_dsl.load.shape import WHOLE_FILE, explain_outline, schema
from codra_dsl.load.source import Source, file_place

VERSION = 1
SECTIONS = ("context", "resources", "agents", "perception", "skills", "observers")
"""The sections that hold elements; a template may have each of them."""


@dataclass(frozen=True, slots=True)
class Document:
    """A spec or a part.

    Attributes:
        lost: sections that could not be read, so that names may be missing.
    """

    origin: Origin
    root: MappingNode
    subject: Subject
    lost: frozenset[str]

    @property
    def name(self) -> ScalarNode | None:
        """The spec's name; None for a part."""
        node = self.root.value("name")
        return node if isinstance(node, ScalarNode) else None

    @property
    def includes(self) -> tuple[ScalarNode, ...]:
        """The paths of the parts."""
        node = self.root.value("include")
        items = node.items if isinstance(node, SequenceNode) else ()
        return tuple(item for item in items if isinstance(item, ScalarNode) and isinstance(item.data, str))

    def section(self, key: str) -> MappingNode | None:
        """Return a section, or None where it is absent or empty."""
        node = self.root.value(key)
        return node if isinstance(node, MappingNode) else None


def read_document(source: Source, findings: Findings) -> Document | None:
    """Return a file as a document, or None where nothing sensible could follow."""
    before = len(findings)
    root = compose(source, findings)
    if root is None and len(findings) > before:
        return None
    if not isinstance(root, MappingNode) or not root.entries:
        what = "the file is empty" if root is None else "the file holds no keys"
        findings.add("not-a-spec", what, file_place(source.file), help="begin it with 'codra: 1' and 'name: ...'")
        return None
    if not _check_version(root, source, findings):
        return None
    name = root.value("name")
    first = next(iter(root.entries.values()))[0]
    is_spec = isinstance(name, ScalarNode)
    subject = Subject("spec" if is_spec else "part", name if isinstance(name, ScalarNode) else first, Origin(source))
    _refuse_parameters(root, source, findings)
    explain_outline(WHOLE_FILE, root, subject, findings)
    document = Document(subject.origin, root, subject, _lost(root))
    if document.name is not None and isinstance(document.name.data, str):
        check_name(document.name, subject, subject, findings, "name")
    return document


def _check_version(root: MappingNode, source: Source, findings: Findings) -> bool:
    """Report a missing, late or unknown `codra: 1`; return whether the rest can be read."""
    entry = root.entries.get("codra")
    if entry is None:
        known = schema()["properties"]
        strange = [key for key in root.entries if key not in known]
        if findings.nearest("codra", strange) is None:
            message = "the file does not say 'codra: 1'"
            way_out = "write 'codra: 1' in its first line"
            findings.add("language-version", message, source.place(root.start, root.start), help=way_out)
        return any(key in SECTIONS or key in ("templates", "use") for key in root.entries)
    key, value = entry
    if value.data != VERSION or isinstance(value.data, bool):
        written = shown(value.text) if isinstance(value, ScalarNode) else "that"
        place = Origin(source).of_value(key, value)
        if not value.reported:
            findings.add("language-version", f"{written} is no version of the language", place, help="write 'codra: 1'")
        return False
    if next(iter(root.entries)) != "codra":
        place = source.place(key.start, key.end)
        findings.add("language-version", "'codra: 1' does not come first", place, help="move it to the first line")
    return True


def _lost(root: MappingNode) -> frozenset[str]:
    """Return the sections whose elements are unknown, since their keys or values are wrong."""
    known = schema()["properties"]
    lost: set[str] = set()
    for key, (_, value) in root.entries.items():
        readable = value.data is None or isinstance(value, SequenceNode if key == "include" else MappingNode)
        strange = key not in known and not isinstance(value, ScalarNode)
        if strange or (key in ("templates", "use", "include") and not readable):
            lost.update(SECTIONS)
        elif key in SECTIONS and not readable:
            lost.add(key)
    return frozenset(lost)


def _refuse_parameters(root: MappingNode, source: Source, findings: Findings) -> None:
    """Report parameters outside templates."""
    if "$(" not in source.text:
        return
    for key, (key_node, value) in root.entries.items():
        nodes: tuple[YamlNode, ...] = (key_node,) if key == "templates" else (key_node, value)
        for node in nodes:
            for scalar in scalars(node, lambda scalar: "$(" in scalar.text and not scalar.reported):
                scalar.reported = True
                message = f"{shown(scalar.text)} holds a parameter outside of a template"
                way_out = "parameters stand in templates; here, write what is meant"
                place = source.place(scalar.start, scalar.end)
                findings.add("parameter-outside-template", message, place, help=way_out, path=key)
