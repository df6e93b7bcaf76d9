"""The names in sites and timelines. These files are not parts of a spec, but they name its elements."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple

from codra_dsl.language.check.symbols import VALUES
from codra_dsl.language.load.schema.document import SECTIONS, section_of
from codra_dsl.language.load.site.site_file import SITE_KEY
from codra_dsl.language.load.yaml.compose import compose
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, SequenceNode, YamlNode
from codra_dsl.language.load.yaml.reader import entries
from codra_dsl.language.load.yaml.source import accept
from codra_dsl.tooling.language_server.documents import Document

TIMELINE_KEY = "timeline"
_KIND = re.compile(rf"^({SITE_KEY}|{TIMELINE_KEY})\b(?:[ \t]*:[ \t]*(\w+))?", re.MULTILINE)

SECTIONS_BY_KEY: Mapping[str, str] = {
    **dict.fromkeys(("believes", "decide", "decided", "overrides", "set", "declare", "withdraw"), "context"),
    **dict.fromkeys(("expect", "begin", "act", "acted", "end", "preview", "previews", "expects"), "skills"),
    **dict.fromkeys(("running", "stopped"), "perception"),
    **{section: section for section in ("agents", "perception", "resources", "loops")},
    "poses": "edges",
}
"""For each key of a moment or of the main execution of a timeline, the section of the names below it."""

_VARIABLES_BELOW = ("agents", "expects")
"""The keys below whose names are names of context-variables."""

STATES_VALUES = ("agents", "believes", "decide", "overrides", "set")
"""The keys that state values of context-variables, alone or under one of the next keys."""

VALUE_KEYS = ("is", "otherwise")


class NameInFile(NamedTuple):
    """A name in a site or a timeline, as a range of the file's text; the owner of a member is a variable."""

    section: str
    name: str
    owner: str
    start: int
    end: int


@dataclass(frozen=True, slots=True)
class OtherFile:
    """A file of this language. Its `kind` is the key of sites or that of timelines; it is empty for any other file.

    Attributes:
        spec: the name of the spec that a site or a timeline names.
        is_readable: whether its names could be read.
    """

    kind: str = ""
    spec: str = ""
    names: tuple[NameInFile, ...] = ()
    is_readable: bool = True


@lru_cache(maxsize=32)
def other_file(document: Document, file: str) -> OtherFile:
    """Return the names in a site or a timeline."""
    kind = _KIND.search(document.text)
    if kind is None:
        return OtherFile()
    findings = Findings()
    source = accept(document.text, file, findings)
    root = None if source is None else compose(source, findings)
    spec = root.value(kind[1]) if isinstance(root, MappingNode) else None
    if not isinstance(root, MappingNode) or not isinstance(spec, ScalarNode):
        return OtherFile(kind[1], kind[2] or "", is_readable=False)
    names = _names_in_site(root) if kind[1] == SITE_KEY else _names_in_timeline(root)
    mark = document.mark_length  # the nodes do not count it
    ranges = (
        NameInFile(section, node.text, owner, node.start + mark, node.end + mark)
        for section, node, owner in (("spec", spec, ""), *names)
    )
    return OtherFile(kind[1], spec.text, tuple(ranges), is_readable=not findings.all())


_Name = tuple[str, ScalarNode, str]


def _names_in_site(root: MappingNode) -> Iterator[_Name]:
    for section in (*SECTIONS, "use"):
        yield from ((section, key, "") for key, _ in entries(section_of(root, section)))


def _names_in_timeline(node: YamlNode | None) -> Iterator[_Name]:
    """Yield the names below the keys of a timeline, of its moments, and of the main execution."""
    for key, value in entries(node):
        if key.text in SECTIONS_BY_KEY:
            yield from _names_below(key.text, value)
        else:
            yield from _names_in_timeline(value)


def _names_below(key: str, value: YamlNode | None) -> Iterator[_Name]:
    section = SECTIONS_BY_KEY[key]
    if isinstance(value, SequenceNode):
        yield from ((section, item, "") for item in value.items if isinstance(item, ScalarNode))
    for name, inner in entries(value):
        yield section, name, ""
        stated = entries(inner) if key in _VARIABLES_BELOW else ((name, inner),)
        if key in _VARIABLES_BELOW:
            yield from (("context", variable, "") for variable, _ in stated)
        if key in STATES_VALUES:
            yield from (member for variable, node in stated for member in _members(variable.text, node))
        source = inner.value("source") if isinstance(inner, MappingNode) else None
        if isinstance(source, ScalarNode):
            yield from (("perception", source, ""), ("agents", source, ""))


def _members(variable: str, node: YamlNode) -> Iterator[_Name]:
    """Yield the values that a node states for a variable, as far as they can be members of an enum."""
    inner = (node.value(key) for key in VALUE_KEYS) if isinstance(node, MappingNode) else ()
    for value in (node, *inner):
        if isinstance(value, ScalarNode) and isinstance(value.data, str):
            yield VALUES, value, variable
