"""One text made of a spec's file and a site's file, because an element can have values in both files."""

from __future__ import annotations

from copy import copy
from typing import TypeVar

from codra_dsl.language.diagnostics import Place, Span, lazy_place
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.yaml.nodes import MappingNode, SequenceNode, YamlNode
from codra_dsl.language.load.yaml.origin import Origin
from codra_dsl.language.load.yaml.source import Source

NodeT = TypeVar("NodeT", bound=YamlNode)


@dataclass(frozen=True, slots=True)
class JoinedSource(Source):
    """The text of a file of the spec, then the text of the site. Offsets in the spec's file stay as they are.

    Attributes:
        file: the file of the spec.
    """

    spec: Source
    site: Source

    @property
    def site_start(self) -> int:
        """The offset at which the site's text begins."""
        return len(self.spec.text) + 1

    def span(self, start: int, end: int) -> Span:
        """Return the span of a range of the text, in the file that has the range."""
        site_start = self.site_start
        if start < site_start:
            return self.spec.span(start, end)
        return self.site.span(start - site_start, end - site_start)


@dataclass(frozen=True, slots=True)
class JoinedOrigin(Origin):
    """The origin of an element with values in two files. A use of a template concerns only the spec's file."""

    source: JoinedSource

    def place(self, start: int, end: int) -> Place:
        """Return the place of a range of the joined text."""
        return lazy_place(self.source, start, end, self.use if start < self.source.site_start else None)

    def of(self, node: YamlNode) -> Place:
        """Return the place of a node."""
        return self.place(node.start, node.end)


def join(spec: Source, site: Source) -> JoinedSource:
    """Return the text of a file of the spec, joined with the text of a site."""
    site_start = len(spec.text) + 1
    line_starts = (*spec.line_starts, *(site_start + line_start for line_start in site.line_starts))
    return JoinedSource(spec.file, f"{spec.text}\n{site.text}", line_starts, spec, site)


def joined_origin(origin: Origin, source: JoinedSource) -> JoinedOrigin:
    """Return the origin of an element of the spec, for values in both files."""
    return JoinedOrigin(source, origin.use, origin.template, origin.module)


def shifted(node: NodeT, offset: int) -> NodeT:
    """Return a copy of a node and of all nodes in it, with positions increased by an offset."""
    node = copy(node)
    node.start += offset
    node.end += offset
    if isinstance(node, SequenceNode):
        node.items = [shifted(item, offset) for item in node.items]
    elif isinstance(node, MappingNode):
        pairs = [(shifted(key, offset), shifted(value, offset)) for key, value in node.entries.values()]
        node.entries, node.data = {}, {}
        for key, value in pairs:
            node.put(key, value)
    return node
