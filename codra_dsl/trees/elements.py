"""XML text -> elements with places. It stops at the first thing that is no XML, and never expands anything.

A document type, and with it every entity that a file could declare, is refused before it is read.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from xml.parsers import expat

from codra_dsl.diagnostics import Place
from codra_dsl.load.source import Source
from codra_dsl.trees.rules import Told
from codra_dsl.trees.values import Attribute

MAX_BYTES = 1024 * 1024
MAX_DEPTH = 50
"""Elements nested more deeply are refused."""

MAX_ELEMENTS = 10_000
MAX_ATTRIBUTES = 64
MAX_VALUE = 4000

WITH_TEXT = frozenset({"input_port", "output_port", "inout_port"})
"""Elements of which the text is kept: it describes a port."""

_ATTRIBUTE = re.compile(r"""\s([^\s=/>"']+)\s*=\s*(?:"([^"]*)"|'([^']*)')""")


@dataclass(slots=True, kw_only=True)
class Element:
    """An element as it stands in the text.

    Attributes:
        comments: those before it; `last_comments` those after its last child.
        text: what stands in it, where that means something (`WITH_TEXT`).
    """

    tag: str
    attributes: tuple[Attribute, ...]
    place: Place
    comments: tuple[str, ...] = ()
    children: list[Element] = field(default_factory=list)
    last_comments: tuple[str, ...] = ()
    text: str = ""

    def get(self, name: str) -> Attribute | None:
        """Return an attribute by its name."""
        return next((attribute for attribute in self.attributes if attribute.name == name), None)


class _RefusedError(Exception):
    """Ends the reading of a file; the finding has been made."""


def elements(source: Source, told: Told) -> Element | None:
    """Return the root of a text, or None if it is no XML that is accepted."""
    data = source.text.encode("utf-8")
    if len(data) > MAX_BYTES:
        told.add(
            "tree-file-too-large",
            f"'{source.file}' has more than {MAX_BYTES // 1024 // 1024} MiB",
            source.place(0, 0),
            help="split it, and include the parts",
        )
        return None
    reader = _Reader(source, data, told)
    try:
        reader.read()
    except _RefusedError:
        return None
    except expat.ExpatError as error:
        offset = source.line_starts[min(error.lineno, len(source.line_starts)) - 1] + error.offset
        reason = expat.ErrorString(error.code)
        told.add(
            "xml-syntax",
            f"this is no XML: {reason}",
            source.place(min(offset, len(source.text)), min(offset + 1, len(source.text))),
            help=_WAYS_OUT.get(error.code, "correct it; an editor for XML shows what belongs together"),
        )
        return None
    return reader.root


_WAYS_OUT = {
    expat.errors.codes[expat.errors.XML_ERROR_TAG_MISMATCH]: "close the element that was opened last",
    expat.errors.codes[expat.errors.XML_ERROR_NO_ELEMENTS]: 'begin with <root BTCPP_format="4">',
    expat.errors.codes[expat.errors.XML_ERROR_DUPLICATE_ATTRIBUTE]: "remove one of the two",
    expat.errors.codes[expat.errors.XML_ERROR_UNDEFINED_ENTITY]: "write &amp; for '&'; no entity can be declared",
    expat.errors.codes[expat.errors.XML_ERROR_INVALID_TOKEN]: "write &lt; for '<' and &amp; for '&' within values",
}


class _Reader:
    """Builds elements from what expat tells."""

    def __init__(self, source: Source, data: bytes, told: Told) -> None:
        self.root: Element | None = None
        self._source = source
        self._data = data
        self._told = told
        self._open: list[Element] = []
        self._comments: list[str] = []
        self._count = 0
        self._known = (0, 0)
        self._parser = expat.ParserCreate("utf-8")

    def read(self) -> None:
        """Read all of it."""
        parser = self._parser
        parser.ordered_attributes = True
        parser.buffer_text = True
        handlers: dict[str, Callable[..., object]] = {
            "StartElementHandler": self._start,
            "EndElementHandler": self._end,
            "CommentHandler": lambda text: self._comments.append(text.strip()),
            "CharacterDataHandler": self._text,
            "ProcessingInstructionHandler": self._instruction,
            "StartDoctypeDeclHandler": self._doctype,
            "XmlDeclHandler": self._declaration,
        }
        for name, handler in handlers.items():
            setattr(parser, name, handler)
        parser.Parse(self._data, True)
        if self.root is not None:
            self.root.last_comments += tuple(self._comments)

    def _offset(self) -> int:
        """Return where expat is, in code points; it only ever goes on."""
        byte, offset = self._known
        now = self._parser.CurrentByteIndex
        if now < byte:
            byte = offset = 0
        offset += len(self._data[byte:now].decode("utf-8", "replace"))
        self._known = now, offset
        return offset

    def _start(self, tag: str, pairs: list[str]) -> None:
        start = self._offset()
        self._count += 1
        place = self._source.place(start, start + 1 + len(tag))
        self._limit(len(self._open) < MAX_DEPTH, "tree-too-deep", f"more than {MAX_DEPTH} elements deep", place)
        self._limit(self._count <= MAX_ELEMENTS, "too-many-tree-nodes", f"more than {MAX_ELEMENTS:,} elements", place)
        self._limit(len(pairs) <= 2 * MAX_ATTRIBUTES, "too-many-tree-nodes", f"over {MAX_ATTRIBUTES} attributes", place)
        element = Element(tag=tag, attributes=self._attributes(start, tag, pairs), place=place)
        element.comments, self._comments = tuple(self._comments), []
        if self._open:
            self._open[-1].children.append(element)
        else:
            self.root = element
        self._open.append(element)

    def _attributes(self, start: int, tag: str, pairs: list[str]) -> tuple[Attribute, ...]:
        """Return attributes with their places: expat has found the tag to be right, so a pattern finds them."""
        found: list[Attribute] = []
        position = start + 1 + len(tag)
        for name, value in zip(pairs[::2], pairs[1::2], strict=True):
            match = _ATTRIBUTE.match(self._source.text, position) or _ATTRIBUTE.search(self._source.text, position)
            if match is None:
                raise AssertionError(f"expat read an attribute {name!r} that does not stand there")
            group = 2 if match[2] is not None else 3
            attribute = Attribute(
                name=name,
                value=value,
                place=self._source.place(match.start(1), match.end()),
                value_place=self._source.place(match.start(group), match.end(group)),
                is_literal=match[group] == value,
            )
            self._limit(
                len(value) <= MAX_VALUE,
                "tree-file-too-large",
                f"a value of over {MAX_VALUE:,} characters",
                attribute.place,
            )
            found.append(attribute)
            position = match.end()
        return tuple(found)

    def _limit(self, holds: bool, rule: str, what: str, place: Place) -> None:
        if not holds:
            self._told.add(rule, f"{what}: no tree needs that", place, help="split it into subtrees")
            raise _RefusedError

    def _end(self, _: str) -> None:
        element = self._open.pop()
        element.last_comments, self._comments = tuple(self._comments), []

    def _text(self, text: str) -> None:
        if self._open and self._open[-1].tag in WITH_TEXT:
            element = self._open[-1]
            element.text += text
            self._limit(
                len(element.text) <= MAX_VALUE,
                "tree-file-too-large",
                f"a text of over {MAX_VALUE:,} characters",
                element.place,
            )
        elif text.strip():
            start = self._offset()
            self._told.add(
                "xml-not-kept",
                f"the text {text.strip()[:40]!r} means nothing in a tree",
                self._source.place(start, start + 1),
                help="remove it, or make it a comment: <!-- ... -->",
            )

    def _instruction(self, target: str, _: str) -> None:
        start = self._offset()
        place = self._source.place(start, start + 2 + len(target))
        self._told.add("xml-not-kept", f"<?{target} ...?> means nothing in a tree", place, help="remove it")

    def _doctype(self, *_: object) -> None:
        start = self._offset()
        self._told.add(
            "xml-doctype",
            "a document type is not read: it could declare entities that grow without bound",
            self._source.place(start, start + len("<!DOCTYPE")),
            help="remove <!DOCTYPE ...>",
        )
        raise _RefusedError

    def _declaration(self, _: str, encoding: str | None, __: int) -> None:
        if encoding is not None and encoding.lower() not in ("utf-8", "utf8", "us-ascii"):
            self._told.add(
                "xml-encoding",
                f"the file says that it is {encoding}, and it is read as UTF-8",
                self._source.place(0, len("<?xml")),
                help='save it as UTF-8 and write encoding="UTF-8"',
            )
            raise _RefusedError
