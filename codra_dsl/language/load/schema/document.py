"""A file as a document of this language: its head, and its sections as nodes."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.diagnostics import replacement_fix
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.schema.keys_and_values import explain_outline
from codra_dsl.language.load.schema.schema import FILE_DEFINITION
from codra_dsl.language.load.schema_file import schema
from codra_dsl.language.load.yaml.compose import compose
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.fixes import version_fix
from codra_dsl.language.load.yaml.names import check_name
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, SequenceNode, YamlNode, scalars
from codra_dsl.language.load.yaml.origin import Origin, Subject
from codra_dsl.language.load.yaml.reader import is_unread
from codra_dsl.language.load.yaml.source import Source, file_place

VERSION = 1
KNOWLEDGE = ("types", "nodes", "edges", "tasks")
"""The sections under `knowledge`."""

MAPE = ("metrics", "actions", "adaptation", "trees", "loops")
"""The sections of MAPE-K loops."""

KEYS = ("context", "resources", "knowledge", "agents", "perception", "skills", "observers", *MAPE)
"""The keys of a file that contain elements; templates may have them as well."""

SECTIONS = ("context", "resources", *KNOWLEDGE, "agents", "perception", "skills", "observers", *MAPE)
"""The sections that contain elements."""


@dataclass(frozen=True, slots=True)
class Document:
    """A spec or a part.

    Attributes:
        lost_sections: the sections that could not be read completely, so that names in them may be missing.
    """

    origin: Origin
    root: MappingNode
    subject: Subject
    lost_sections: frozenset[str]

    @property
    def name(self) -> ScalarNode | None:
        """The spec's name; None for a part."""
        node = self.root.value("name")
        return node if isinstance(node, ScalarNode) else None

    @property
    def may_be_named(self) -> bool:
        """Whether the document may be a spec whose name is under an unknown key or in an unreadable form."""
        has_unknown_keys = any(key not in schema()["properties"] for key in self.root.entries)
        return self.root.unread or has_unknown_keys or "name" in self.root.entries

    @property
    def includes(self) -> tuple[ScalarNode, ...]:
        """The paths of the parts that the document includes."""
        node = self.root.value("include")
        items = node.items if isinstance(node, SequenceNode) else ()
        return tuple(item for item in items if isinstance(item, ScalarNode) and isinstance(item.data, str))

    def section(self, key: str) -> MappingNode | None:
        """Return a section, or None if it is absent or empty."""
        node = self.root.value(key)
        return node if isinstance(node, MappingNode) else None


def section_of(root: MappingNode, section: str) -> MappingNode | None:
    """Return a section of a file or a template, or None if it is absent or empty."""
    holder = root.value("knowledge") if section in KNOWLEDGE else root
    node = holder.value(section) if isinstance(holder, MappingNode) else None
    return node if isinstance(node, MappingNode) else None


def take_section(root: MappingNode, section: str) -> MappingNode | None:
    """Remove and return a section of a file, so that its nodes can be freed; None if it is absent or empty."""
    node = section_of(root, section)
    holder = root.value("knowledge") if section in KNOWLEDGE else root
    if node is not None and isinstance(holder, MappingNode):
        holder.take(section)
    return node


def read_root(source: Source, findings: Findings, second_key: str = "name") -> MappingNode | None:
    """Return the keys of a file, or None if it has none or is not of this version of the language.

    `second_key` is the key after `codra`, for the help about an empty file.
    """
    before = len(findings)
    root = compose(source, findings)
    if root is None and len(findings) > before:
        return None
    if not isinstance(root, MappingNode) or not root.entries:
        message = "the file is empty" if root is None else "the file has no keys"
        help_text = f"begin it with 'codra: 1' and '{second_key}: ...'"
        findings.add("not-a-spec", message, file_place(source.file), help=help_text)
        return None
    if not _check_version(root, source, findings):
        return None
    _refuse_parameters(root, source, findings)
    return root


def read_document(source: Source, findings: Findings) -> Document | None:
    """Return a file as a document, or None if it cannot be read as a spec or a part."""
    root = read_root(source, findings)
    if root is None:
        return None
    name = root.value("name")
    first = next(iter(root.entries.values()))[0]
    is_spec = isinstance(name, ScalarNode)
    subject = Subject("spec" if is_spec else "part", name if isinstance(name, ScalarNode) else first, Origin(source))
    explain_outline(FILE_DEFINITION, root, subject, findings)
    document = Document(subject.origin, root, subject, _lost_sections(root))
    if document.name is not None and isinstance(document.name.data, str):
        check_name(document.name, subject, subject, findings, "name")
    return document


def _check_version(root: MappingNode, source: Source, findings: Findings) -> bool:
    """Report a missing or misplaced `codra: 1`, or another version; return whether the rest can be read."""
    entry = root.entries.get("codra")
    if entry is None:
        known_keys = schema()["properties"]
        unknown_keys = [key for key in root.entries if key not in known_keys]
        suggestion = findings.nearest("codra", unknown_keys)
        misspelt_key = suggestion or next((key for key in unknown_keys if _is_version(root.entries[key][1])), None)
        if misspelt_key is not None:
            return suggestion is not None or _rename_to_codra(root, misspelt_key, source, findings)
        if not root.unread:
            message = "the file does not begin with 'codra: 1'"
            help_text = "write 'codra: 1' in its first line"
            place = source.place(root.start, root.start)
            findings.add("language-version", message, place, help=help_text, fix=version_fix(root, source))
        return root.unread or any(key in KEYS or key in ("templates", "use") for key in root.entries)
    key, value = entry
    if not _is_version(value):
        written_version = shown(value.text) if isinstance(value, ScalarNode) else "this"
        place = Origin(source).of_value(key, value)
        if not value.reported:
            findings.add(
                "language-version",
                f"{written_version} is not a version of the language",
                place,
                help="write 'codra: 1'",
            )
        return False
    if next(iter(root.entries)) != "codra":
        place = source.place(key.start, key.end)
        message, help_text = "'codra: 1' is not the first key", "move it to the first line"
        findings.add("language-version", message, place, help=help_text, fix=version_fix(root, source))
    return True


def _is_version(value: YamlNode) -> bool:
    return value.data == VERSION and not isinstance(value.data, bool)


def _rename_to_codra(root: MappingNode, misspelt_key: str, source: Source, findings: Findings) -> bool:
    """Report a key that is written instead of `codra`, and rename it to `codra`."""
    key = root.entries[misspelt_key][0]
    message, place = f"unknown key {shown(misspelt_key)} in this file", source.place(key.start, key.end)
    findings.add(
        "unknown-key",
        message,
        place,
        help="did you mean 'codra'?",
        fix=replacement_fix(place, misspelt_key, "codra", safe=False),
    )
    entries = list(root.entries.items())
    root.entries.clear()
    for name, (node, value) in entries:
        root.entries["codra" if name == misspelt_key else name] = (node, value)
    root.data["codra"] = root.data.pop(misspelt_key)
    return True


def _lost_sections(root: MappingNode) -> frozenset[str]:
    """Return the sections whose elements are unknown because keys or values are wrong."""
    known_keys = schema()["properties"]
    lost_sections: set[str] = set(SECTIONS) if root.unread else set()
    for key, (_, value) in root.entries.items():
        is_readable = value.data is None or isinstance(value, SequenceNode if key == "include" else MappingNode)
        is_unknown = key not in known_keys and not isinstance(value, ScalarNode)
        if is_unknown or (key in ("templates", "use", "include") and (not is_readable or is_unread(value))):
            lost_sections.update(SECTIONS)
        elif key == "knowledge":
            lost_sections.update(_lost_sections_of_knowledge(value))
        elif key in SECTIONS and (not is_readable or is_unread(value)):
            lost_sections.add(key)
    return frozenset(lost_sections)


def _lost_sections_of_knowledge(knowledge: YamlNode) -> Iterator[str]:
    """Yield the sections under `knowledge` that could not be read."""
    has_known_keys = (
        isinstance(knowledge, MappingNode) and not knowledge.unread and knowledge.entries.keys() <= {*KNOWLEDGE}
    )
    if knowledge.data is not None and not has_known_keys:
        yield from KNOWLEDGE
    for key, (_, value) in knowledge.entries.items() if isinstance(knowledge, MappingNode) else ():
        is_readable = value.data is None or isinstance(value, MappingNode)
        if key in KNOWLEDGE and (not is_readable or is_unread(value)):
            yield key


def _refuse_parameters(root: MappingNode, source: Source, findings: Findings) -> None:
    """Report parameters outside templates; unknown sections are skipped, since they may contain templates."""
    if "$(" not in source.text or root.unread:
        return
    for key, (key_node, value) in root.entries.items():
        if key not in schema()["properties"] and isinstance(value, MappingNode):
            continue
        nodes: tuple[YamlNode, ...] = (key_node,) if key == "templates" else (key_node, value)
        for node in nodes:
            for scalar in scalars(node, lambda scalar: "$(" in scalar.text and not scalar.reported):
                scalar.reported = True
                message = f"{shown(scalar.text)} contains a parameter outside of a template"
                help_text = "parameters are allowed only in templates; write the value here"
                place = source.place(scalar.start, scalar.end)
                findings.add("parameter-outside-template", message, place, help=help_text, path=key)
