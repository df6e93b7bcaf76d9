"""Read XML: text -> elements with places.

Reading stops at the first XML error, except `&` and `<` in values, which are escaped. No entity of a file is ever
expanded: a document type, which could declare entities, is refused before it is read.
"""

from __future__ import annotations

import re
from collections.abc import Callable
from dataclasses import dataclass, field
from xml.parsers import expat

from codra_dsl.language.behavior_trees.rules import TreeFindings
from codra_dsl.language.behavior_trees.unescaped import EscapedText, escape_values
from codra_dsl.language.behavior_trees.values import Attribute
from codra_dsl.language.diagnostics import Place
from codra_dsl.language.load.yaml.source import Source

MAX_BYTES = 1024 * 1024
MAX_DEPTH = 50
"""The maximum nesting depth of elements."""

MAX_ELEMENTS = 10_000
MAX_ATTRIBUTES = 64
MAX_VALUE_LENGTH = 4000

TAGS_WITH_TEXT = frozenset({"input_port", "output_port", "inout_port", "bidirectional_port", "description"})
"""The tags of elements whose text is kept, since it describes a port or a node."""

_ATTRIBUTE = re.compile(r"""\s([^\s=/>"']+)\s*=\s*(?:"([^"]*)"|'([^']*)')""")


@dataclass(slots=True, kw_only=True)
class Element:
    """An element as written.

    Attributes:
        comments: the comments before the element.
        last_comments: the comments after its last child.
        text: the text of the element, if its tag is in `TAGS_WITH_TEXT`.
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
    """Stops the reading of a file; the reason has already been reported."""


def read_root(source: Source, findings: TreeFindings) -> Element | None:
    """Return the root element of a text, or None after a finding if its XML cannot be accepted."""
    if len(source.text.encode("utf-8")) > MAX_BYTES:
        findings.add(
            "tree-file-too-large",
            f"'{source.file}' has more than {MAX_BYTES // 1024 // 1024} MiB",
            source.place(0, 0),
            help="split the file, and include the parts",
        )
        return None
    try:
        root, element_findings = _read(source, EscapedText(source.text, (), (), ()))
    except expat.ExpatError as error:
        repaired = _read_escaped(source) if error.code == _INVALID_TOKEN else None
        if repaired is None:
            _report_syntax_error(error, source, findings)
            return None
        root, element_findings = repaired
    findings.extend(element_findings.all())
    return root


def _read(source: Source, escaped: EscapedText) -> tuple[Element | None, TreeFindings]:
    """Return the root element, or None if it was refused; and the findings.

    Raises:
        ExpatError: if the text is not well-formed.
    """
    findings = TreeFindings()
    reader = _Reader(source, escaped, findings)
    try:
        reader.read()
    except _RefusedError:
        return None, findings
    return reader.root, findings


def _read_escaped(source: Source) -> tuple[Element | None, TreeFindings] | None:
    """Read a text with `&` or `<` in values; return None if it is not well-formed either when they are escaped."""
    escaped = escape_values(source.text)
    if not escaped.offsets:
        return None
    try:
        root, findings = _read(source, escaped)
    except expat.ExpatError:
        return None
    first, count = escaped.offsets[0], len(escaped.offsets)
    findings.add(
        "xml-not-escaped",
        f"{source.text[first]!r} is not escaped in a value: BehaviorTree.CPP reads it, and most XML tools refuse it"
        + (f" ({count} places in this file)" if count > 1 else ""),
        source.place(first, first + 1),
        help="write &amp; for '&' and &lt; for '<'; codra trees convert does this in the whole file",
    )
    return root, findings


def _report_syntax_error(error: expat.ExpatError, source: Source, findings: TreeFindings) -> None:
    offset = source.line_starts[min(error.lineno, len(source.line_starts)) - 1] + error.offset
    findings.add(
        "xml-syntax",
        f"invalid XML: {expat.ErrorString(error.code)}",
        source.place(min(offset, len(source.text)), min(offset + 1, len(source.text))),
        help=_HELP_TEXTS.get(error.code, "correct it; an XML editor shows matching tags"),
    )


_INVALID_TOKEN = expat.errors.codes[expat.errors.XML_ERROR_INVALID_TOKEN]
_HELP_TEXTS = {
    expat.errors.codes[expat.errors.XML_ERROR_TAG_MISMATCH]: "close the element that was opened last",
    expat.errors.codes[expat.errors.XML_ERROR_NO_ELEMENTS]: 'begin with <root BTCPP_format="4">',
    expat.errors.codes[expat.errors.XML_ERROR_DUPLICATE_ATTRIBUTE]: "remove one of the two",
    expat.errors.codes[expat.errors.XML_ERROR_UNDEFINED_ENTITY]: "write &amp; for '&'; entities cannot be declared",
    _INVALID_TOKEN: "write &lt; for '<' and &amp; for '&' within values",
}


class _Reader:
    """Builds elements from the events of expat."""

    def __init__(self, source: Source, escaped: EscapedText, findings: TreeFindings) -> None:
        self.root: Element | None = None
        self._source = source
        self._escaped = escaped
        self._data = escaped.text.encode("utf-8")
        self._findings = findings
        self._open_elements: list[Element] = []
        self._comments: list[str] = []
        self._element_count = 0
        self._last_position = (0, 0)
        self._parser = expat.ParserCreate("utf-8")

    def read(self) -> None:
        """Read the complete text."""
        parser = self._parser
        parser.ordered_attributes = True
        parser.buffer_text = True
        handlers: dict[str, Callable[..., object]] = {
            "StartElementHandler": self._start_element,
            "EndElementHandler": self._end_element,
            "CommentHandler": lambda text: self._comments.append(text.strip()),
            "CharacterDataHandler": self._add_text,
            "ProcessingInstructionHandler": self._report_instruction,
            "StartDoctypeDeclHandler": self._refuse_doctype,
            "XmlDeclHandler": self._check_declaration,
        }
        for name, handler in handlers.items():
            setattr(parser, name, handler)
        parser.Parse(self._data, True)
        if self.root is not None:
            self.root.last_comments += tuple(self._comments)

    def _offset(self) -> int:
        """Return the position of expat in the original text, in code points.

        If the position has increased since the last call, only the bytes in between are decoded.
        """
        byte, offset = self._last_position
        current_byte = self._parser.CurrentByteIndex
        if current_byte < byte:
            byte = offset = 0
        offset += len(self._data[byte:current_byte].decode("utf-8", "replace"))
        self._last_position = current_byte, offset
        return self._escaped.original_offset(offset)

    def _start_element(self, tag: str, names_and_values: list[str]) -> None:
        start = self._offset()
        place = self._source.place(start, start + 1 + len(tag))
        self._count_element(place)
        self._limit(
            len(self._open_elements) < MAX_DEPTH, "tree-too-deep", f"more than {MAX_DEPTH} elements deep", place
        )
        self._limit(
            len(names_and_values) <= 2 * MAX_ATTRIBUTES,
            "too-many-tree-nodes",
            f"over {MAX_ATTRIBUTES} attributes",
            place,
        )
        element = Element(tag=tag, attributes=self._attributes(start, tag, names_and_values), place=place)
        element.comments, self._comments = tuple(self._comments), []
        if self._open_elements:
            self._open_elements[-1].children.append(element)
        else:
            self.root = element
        self._open_elements.append(element)

    def _count_element(self, place: Place) -> None:
        """Count an element. Instructions and texts count like elements, because each of them causes a finding."""
        self._element_count += 1
        self._limit(
            self._element_count <= MAX_ELEMENTS, "too-many-tree-nodes", f"more than {MAX_ELEMENTS:,} elements", place
        )

    def _attributes(self, start: int, tag: str, names_and_values: list[str]) -> tuple[Attribute, ...]:
        """Return attributes with their places.

        Expat has accepted the tag, so a pattern is enough to find each attribute.
        """
        attributes: list[Attribute] = []
        position = start + 1 + len(tag)
        for name, value in zip(names_and_values[::2], names_and_values[1::2], strict=True):
            match = _ATTRIBUTE.match(self._source.text, position) or _ATTRIBUTE.search(self._source.text, position)
            if match is None:
                raise AssertionError(f"expat read an attribute {name!r} that is not in the text")
            group = 2 if match[2] is not None else 3
            attribute = Attribute(
                name=name,
                value=value,
                place=self._source.place(match.start(1), match.end()),
                value_place=self._source.place(match.start(group), match.end(group)),
                is_literal=match[group] == value,
            )
            self._limit(
                len(value) <= MAX_VALUE_LENGTH,
                "tree-file-too-large",
                f"a value of over {MAX_VALUE_LENGTH:,} characters",
                attribute.place,
            )
            attributes.append(attribute)
            position = match.end()
        return tuple(attributes)

    def _limit(self, is_within_limit: bool, rule: str, excess: str, place: Place) -> None:
        if not is_within_limit:
            self._findings.add(rule, f"{excess}: too large for a tree", place, help="split it into subtrees")
            raise _RefusedError

    def _end_element(self, _: str) -> None:
        element = self._open_elements.pop()
        element.last_comments, self._comments = tuple(self._comments), []

    def _add_text(self, text: str) -> None:
        if self._open_elements and self._open_elements[-1].tag in TAGS_WITH_TEXT:
            element = self._open_elements[-1]
            element.text += text
            self._limit(
                len(element.text) <= MAX_VALUE_LENGTH,
                "tree-file-too-large",
                f"a text of over {MAX_VALUE_LENGTH:,} characters",
                element.place,
            )
        elif text.strip():
            start = self._offset()
            place = self._source.place(start, start + 1)
            self._count_element(place)
            self._findings.add(
                "xml-not-kept",
                f"the text {text.strip()[:40]!r} has no meaning in a tree",
                place,
                help="remove it, or make it a comment: <!-- ... -->",
            )

    def _report_instruction(self, target: str, _: str) -> None:
        start = self._offset()
        place = self._source.place(start, start + 2 + len(target))
        self._count_element(place)
        self._findings.add("xml-not-kept", f"<?{target} ...?> has no meaning in a tree", place, help="remove it")

    def _refuse_doctype(self, *_: object) -> None:
        start = self._offset()
        self._findings.add(
            "xml-doctype",
            "document types are refused: they could declare entities that grow without bound",
            self._source.place(start, start + len("<!DOCTYPE")),
            help="remove <!DOCTYPE ...>",
        )
        raise _RefusedError

    def _check_declaration(self, _: str, encoding: str | None, __: int) -> None:
        if encoding is not None and encoding.lower() not in ("utf-8", "utf8", "us-ascii"):
            self._findings.add(
                "xml-encoding",
                f"the file declares the encoding {encoding}, but it is read as UTF-8",
                self._source.place(0, len("<?xml")),
                help='save it as UTF-8 and write encoding="UTF-8"',
            )
            raise _RefusedError
