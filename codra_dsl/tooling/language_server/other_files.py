"""The names in sites and timelines. These files are not parts of a spec, but they name its elements."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from functools import lru_cache
from typing import NamedTuple

from codra_dsl.language.load.schema.document import SECTIONS, section_of
from codra_dsl.language.load.site.site_file import SITE_KEY
from codra_dsl.language.load.yaml.compose import compose
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, SequenceNode, YamlNode
from codra_dsl.language.load.yaml.reader import entries
from codra_dsl.language.load.yaml.source import accept
from codra_dsl.tooling.language_server.documents import Document

_TIMELINE_KEY = "timeline"
_FIRST_KEYS = re.compile(rf"^({SITE_KEY}|{_TIMELINE_KEY})\b", re.MULTILINE)

_SECTIONS_BY_KEY: Mapping[str, str] = {
    **dict.fromkeys(("agents", "perception", "resources", "loops"), ""),
    **dict.fromkeys(("believes", "decide", "decided", "overrides", "set", "declare", "withdraw"), "context"),
    **dict.fromkeys(("expect", "begin", "act", "acted", "end", "preview", "previews", "expects"), "skills"),
    **dict.fromkeys(("running", "stopped"), "perception"),
    "poses": "edges",
}
"""For each key of a moment or of the main execution, the section of the names below it; empty if it is the key."""

_CONTEXT_BELOW = ("agents", "expects")
"""The keys below whose names are names of context-variables."""


class NameInFile(NamedTuple):
    """A name in a site or a timeline, as a range of the file's text."""

    section: str
    name: str
    start: int
    end: int


@lru_cache(maxsize=32)
def names_in(document: Document, file: str) -> tuple[str, tuple[NameInFile, ...]]:
    """Return the spec that a site or a timeline names, and its other names; ("", ()) for any other file."""
    if not _FIRST_KEYS.search(document.text):
        return "", ()
    findings = Findings()
    source = accept(document.text, file, findings)
    root = None if source is None else compose(source, findings)
    if not isinstance(root, MappingNode):
        return "", ()
    key = SITE_KEY if SITE_KEY in root.entries else _TIMELINE_KEY
    spec = root.value(key)
    if not isinstance(spec, ScalarNode):
        return "", ()
    names_in_nodes = _names_in_site if key == SITE_KEY else _names_in_timeline
    mark = document.offset_of(1, 1)  # the nodes do not count a byte order mark
    found = (("spec", spec), *names_in_nodes(root))
    return spec.text, tuple(
        NameInFile(section, node.text, node.start + mark, node.end + mark) for section, node in found
    )


def _names_in_site(root: MappingNode) -> Iterator[tuple[str, ScalarNode]]:
    for section in (*SECTIONS, "use"):
        yield from ((section, key) for key, _ in entries(section_of(root, section)))


def _names_in_timeline(node: YamlNode | None) -> Iterator[tuple[str, ScalarNode]]:
    """Yield the names below the keys of a timeline, of its moments, and of the main execution."""
    for key, value in entries(node):
        if key.text in _SECTIONS_BY_KEY:
            yield from _names_below(key.text, value)
        else:
            yield from _names_in_timeline(value)


def _names_below(key: str, value: YamlNode | None) -> Iterator[tuple[str, ScalarNode]]:
    section = _SECTIONS_BY_KEY[key] or key
    if isinstance(value, SequenceNode):
        yield from ((section, item) for item in value.items if isinstance(item, ScalarNode))
    for name, inner in entries(value):
        yield section, name
        if key in _CONTEXT_BELOW:
            yield from (("context", inner_name) for inner_name, _ in entries(inner))
        source = inner.value("source") if isinstance(inner, MappingNode) else None
        if isinstance(source, ScalarNode):
            yield from (("perception", source), ("agents", source))
