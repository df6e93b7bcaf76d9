"""Build nodes with positions from the events of a YAML parser; tagged objects are never constructed.

This module refuses the YAML features that are not part of this language (tags, anchors, merge keys, directives, further
documents), and enforces the limits on time and memory before anything is built.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Iterator
from itertools import islice
from typing import Any

import yaml

from codra_dsl.language.diagnostics import Related
from codra_dsl.language.expression import And, Arithmetic, Node, Not, Or, parse, parts
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.fixes import trap_fix
from codra_dsl.language.load.yaml.nodes import MappingNode, ScalarNode, SequenceNode, Style, YamlNode
from codra_dsl.language.load.yaml.parser_error import Parser, Problem
from codra_dsl.language.load.yaml.repair import (
    NO_KEY,
    colon_before_bracket,
    colon_between,
    colon_without_blank,
    missing_blank,
    missing_colon,
)
from codra_dsl.language.load.yaml.repaired_text import RepairedText
from codra_dsl.language.load.yaml.scalars import SPECIAL_FIRST, resolve
from codra_dsl.language.load.yaml.source import Source
from codra_dsl.language.load.yaml.syntax import explain
from codra_dsl.language.load.yaml.traps import Openings, read_as_block_trap, read_as_tag_trap

MAX_DEPTH = 64
MAX_NODES = 1_500_000
MAX_TEXT = 64 * 1024
"""The maximum length of a scalar, in code points."""

MAX_REPAIRS = 50
_MAX_REPARSED = 8_000_000

_MAX_PIECES = 50
"""The maximum number of entries of a mapping that may be pieces of one condition."""

CONDITION_KEYS = frozenset(
    {
        *("observable_when", "accept_when", "identifies", "preview", "monitor", "wakes", "before", "during", "after"),
        "derived",
    }
)

_STYLES = {"": Style.PLAIN, None: Style.PLAIN} | {style.value: style for style in Style}


_DROPPED_KEY = ScalarNode("", None, 0, 0, Style.PLAIN)
"""Placeholder for a key whose value is read and then dropped."""

_CONTROL_CHARACTER = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f]")
_FOLDED_ITEM = re.compile(r"\n[ \t]*(?P<item>-)[ \t]")
_PROPERTIES = re.compile(r"(?:[!&]\S*(?:\s+|$))*")


class _StopError(Exception):
    """Stops the reading of a file that cannot be read any further."""


class _PunctuationError(Exception):
    """Stops the reading of a text that is valid YAML but does not have the intended shape."""

    def __init__(self, problem: Problem) -> None:
        super().__init__(problem.message)
        self.problem = problem


def compose(source: Source, findings: Findings) -> YamlNode | None:
    """Return a file's document as nodes, or None if it is not YAML, exceeds a limit, or is empty.

    If a trap for conditions makes the file unreadable, the affected text is masked and the rest is read. If a letter
    is missing, the rest is read as if the letter were there.
    """
    repaired_text = RepairedText(source)
    for _ in range(max(1, min(MAX_REPAIRS, _MAX_REPARSED // max(1, len(source.text))))):
        round_findings = Findings()
        try:
            root = _Composer(repaired_text, round_findings).document()
        except _StopError:
            findings.extend(round_findings)
            return None
        except (yaml.YAMLError, _PunctuationError) as error:
            problem = error.problem if isinstance(error, _PunctuationError) else explain(repaired_text.text, error)
            if repaired_text.has_caused(problem):
                return None
            findings.add(
                problem.rule,
                problem.message,
                repaired_text.place(problem.start, problem.end),
                help=problem.help,
                fix=repaired_text.fix(problem),
            )
            if not repaired_text.repair(problem):
                return None
        else:
            findings.extend(round_findings)
            repaired_text.restore_offsets(root)
            return root
    return None


class _Composer:
    """Builds nodes from the events of one text.

    Events have the type `Any`, because the type stubs allow None for their marks, but a parser always sets the marks.

    Attributes:
        _current: the collection that is being read.
        _key: the key of `_current` that waits for its value.
        _parents: the enclosing collections, each with the key that waits for its value when the inner collection is
            closed.
        _continued_section: the section that a duplicate key continues.
        _duplicate_keys: for each open mapping, by its id, the duplicate keys as (second key, first key).
    """

    def __init__(self, repaired_text: RepairedText, findings: Findings) -> None:
        self._source = repaired_text
        self._text = repaired_text.text
        self._findings = findings
        self._reported_offsets = repaired_text.reported_offsets
        self._root: YamlNode | None = None
        self._parents: list[tuple[MappingNode | SequenceNode | None, ScalarNode | None]] = []
        self._current: MappingNode | SequenceNode | None = None
        self._key: ScalarNode | None = None
        self._continued_section: MappingNode | None = None
        self._duplicate_keys: dict[int, list[tuple[ScalarNode, ScalarNode]]] = {}
        self._values_left = MAX_NODES
        self._last_end = 0
        self._documents = 0
        self._anchors: set[str] = set()

    def document(self) -> YamlNode | None:
        """Return the root of the first document."""
        handlers: dict[type, Callable[[Any], None]] = {
            yaml.MappingStartEvent: self._open_mapping,
            yaml.SequenceStartEvent: self._open_sequence,
            yaml.MappingEndEvent: self._close,
            yaml.SequenceEndEvent: self._close,
            yaml.AliasEvent: self._alias,
            yaml.DocumentStartEvent: self._begin_document,
        }
        parser = Parser(self._text)
        scalar_event, handle_scalar = yaml.ScalarEvent, self._scalar
        try:
            for event in iter(parser.get_event, None):
                if type(event) is scalar_event:
                    handle_scalar(event)
                elif (handler := handlers.get(type(event))) is not None:
                    handler(event)
                    if self._documents == 2:
                        break
        finally:
            parser.dispose()
        return self._root

    def _begin_document(self, event: Any) -> None:
        self._documents += 1
        start, end = event.start_mark.index, event.end_mark.index
        if self._documents == 2:
            help_text = "put each document into its own file; share parts with the key 'include'"
            self._report("second-document", "a second document begins here", start, end, help_text)
        elif event.version or event.tags:
            line = self._source.line_end(start)
            self._report("directive", "directives are not part of this language", start, line, "remove this line")

    def _scalar(self, event: Any) -> None:
        """Handle a scalar. This event is the most frequent one, so rare cases are left to `_look_closely`."""
        text, style = event.value, event.style
        node = ScalarNode(text, text, event.start_mark.index, event.end_mark.index, _STYLES[style])
        if style or text[:1] in SPECIAL_FIRST or len(text) > MAX_TEXT or self._reported_offsets:
            self._look_closely(event, node)
        elif event.tag is not None or event.anchor is not None:
            self._refuse_properties(event, node)
        self._last_end = node.end
        mapping = self._current
        if self._key is not None or type(mapping) is not MappingNode:
            self._attach(node)
        elif text in mapping.entries or text == "<<":
            self._refuse_key(node, mapping)
        elif " " in text or node.reported:
            self._suspect_key(node, mapping)
        else:
            self._key = node

    def _look_closely(self, event: Any, node: ScalarNode) -> None:
        """Check a scalar that is not just a plain text."""
        if event.tag is not None or event.anchor is not None:
            self._refuse_properties(event, node)
        if node.style is Style.PLAIN:
            if not node.text:
                self._suspect_value(node)
            if node.text[:1] in SPECIAL_FIRST:
                self._resolve(node)
        elif node.style is not Style.SINGLE_QUOTED:
            self._examine(node)
        if len(node.text) > MAX_TEXT:
            self._report_too_long(node)
        if node.start in self._reported_offsets:
            node.reported = True

    def _suspect_key(self, node: ScalarNode, mapping: MappingNode) -> None:
        """Handle the text of a key that may also contain a value, or may replace a missing key."""
        self._key = node
        if node.reported and node.text == NO_KEY:
            self._key = _DROPPED_KEY
            mapping.unread = True
        elif node.style is Style.PLAIN and (at := colon_before_bracket(node.text)) is not None:
            raise _PunctuationError(missing_colon(self._text, node.start, node.start + at))

    def _suspect_value(self, node: ScalarNode) -> None:
        """Handle a missing value: the text of the key may contain the value."""
        key, mapping = self._key, self._current
        is_plain = key is not None and key.style is Style.PLAIN and not key.reported
        if key is None or not is_plain or type(mapping) is not MappingNode or node.end > node.start:
            return
        colon_offset = colon_without_blank(key.text) if mapping.flow and ":" in key.text else None
        if colon_offset is not None:
            raise _PunctuationError(missing_blank(self._text, key.start, key.start + colon_offset, key.end))
        if " " not in key.text:
            return
        at = colon_between(key.text)
        if at is None or "\n" in self._text[key.start : key.end]:
            return
        recent_entries = islice(reversed(mapping.entries.values()), _MAX_PIECES)
        if not any(type(value) is ScalarNode and Openings(value.text).is_any_open for _, value in recent_entries):
            raise _PunctuationError(missing_colon(self._text, key.start, key.start + at))

    def _report_too_long(self, node: ScalarNode) -> None:
        node.reported = True
        message = f"a text of {len(node.text)} characters is too long"
        self._report("text-too-long", message, node.start, node.start + 1, f"at most {MAX_TEXT} are allowed")

    def _refuse_key(self, node: ScalarNode, mapping: MappingNode) -> None:
        """Report a duplicate key, or YAML's merge key."""
        self._key = node
        if node.text in mapping.entries:
            self._key = _DROPPED_KEY
            first, value = mapping.entries[node.text]
            self._continued_section = value if len(self._parents) == 1 and type(value) is MappingNode else None
            self._duplicate_keys.setdefault(id(mapping), []).append((node, first))
            for container in (mapping, value) if len(self._parents) > 1 else ():
                if type(container) is MappingNode:
                    container.unread = True
        elif node.text == "<<" and node.style is Style.PLAIN:
            self._key = _DROPPED_KEY
            mapping.reported = True
            help_text = "write the keys out, or use a template"
            self._report("merge-key", "the merge key '<<' is not part of this language", *_range(node), help_text)

    def _report_duplicate_keys(self, duplicate_keys: list[tuple[ScalarNode, ScalarNode]]) -> None:
        """Report a mapping's duplicate keys. If there are several, a line above an element is probably missing."""
        (key, first), *others = duplicate_keys
        related = [Related("first one here", self._source.place(*_range(first)))]
        related += [
            Related(f"{shown(other.text)} is repeated as well", self._source.place(*_range(other)))
            for other, _ in others
        ]
        help_text = (
            "a line that begins another element is missing above" if others else "remove one of them or merge them"
        )
        self._report("duplicate-key", f"the key {shown(key.text)} occurs twice", *_range(key), help_text, *related)

    def _report_folded(self, items: Iterable[YamlNode]) -> None:
        """Report items of a list that YAML joins with the item above, because they are indented deeper."""
        for item in items:
            if type(item) is not ScalarNode or item.style is not Style.PLAIN or " - " not in item.text:
                continue
            folded_match = _FOLDED_ITEM.search(self._text, item.start, item.end)
            if folded_match is not None and _is_not_condition(item.text):
                item.reported = True
                message, help_text = (
                    "this item is indented deeper than the one above",
                    "put every '- ' in the same column",
                )
                self._report("yaml-syntax", message, *folded_match.span("item"), help_text)

    def _attach(self, node: YamlNode) -> None:
        self._values_left -= 1
        if self._values_left < 0:
            help_text = "split the file into parts, or use templates"
            message = f"the file holds more than {MAX_NODES} values"
            self._report("too-many-values", message, node.start, node.start + 1, help_text)
            raise _StopError
        container, key = self._current, self._key
        self._continued_section = None
        if type(container) is MappingNode:
            self._key = None
            if key is not _DROPPED_KEY and key is not None:
                container.entries[key.text] = (key, node)
                container.data[key.text] = node.data
        elif type(container) is SequenceNode:
            container.items.append(node)
            container.data.append(node.data)
        elif self._root is None:
            self._root = node

    def _open_mapping(self, event: Any) -> None:
        self._open(event, MappingNode(event.start_mark.index, event.end_mark.index, flow=event.flow_style))

    def _open_sequence(self, event: Any) -> None:
        self._open(event, SequenceNode(event.start_mark.index, event.end_mark.index, flow=event.flow_style))

    def _open(self, event: Any, node: MappingNode | SequenceNode) -> None:
        if event.tag is not None or event.anchor is not None:
            self._refuse_properties(event, node)
        if len(self._parents) == MAX_DEPTH:
            message = f"values are nested more than {MAX_DEPTH} deep"
            self._report(
                "nested-too-deeply",
                message,
                node.start,
                node.start + 1,
                "reduce the nesting; no part of a spec needs more levels",
            )
            raise _StopError
        parent_key = None
        if self._key is None and type(self._current) is MappingNode:
            if all(around is not _DROPPED_KEY for _, around in self._parents):
                help_text = "write a plain text before the ':'"
                self._report("key-not-text", "a key must be a text", node.start, node.start + 1, help_text)
                self._current.unread = True
            parent_key = _DROPPED_KEY
        continued_section = self._continued_section if type(node) is MappingNode else None
        if parent_key is None:
            self._attach(node)
        self._parents.append((self._current, parent_key))
        self._current, self._key = continued_section or node, None

    def _close(self, event: Any) -> None:
        collection = self._current
        assert collection is not None
        is_bracketed = collection.flow and self._text.startswith(("[", "{"), collection.start)
        collection.end = event.end_mark.index if is_bracketed else max(collection.start, self._last_end)
        self._last_end = collection.end
        if type(collection) is SequenceNode and not collection.flow:
            self._report_folded(collection.items)
        if self._duplicate_keys and id(collection) in self._duplicate_keys:
            self._report_duplicate_keys(self._duplicate_keys.pop(id(collection)))
        self._current, self._key = self._parents.pop()

    def _alias(self, event: Any) -> None:
        node = ScalarNode("", None, event.start_mark.index, event.end_mark.index, Style.PLAIN)
        node.reported = True
        self._last_end = node.end
        if event.anchor not in self._anchors:
            self._refuse_anchor(f"the alias '*{event.anchor}'", event.anchor, *_range(node))
        if self._key is None and type(self._current) is MappingNode:
            self._key = _DROPPED_KEY
        else:
            self._attach(node)

    def _refuse_properties(self, event: Any, node: YamlNode) -> None:
        """Refuse a node's tag and anchor, and move its beginning after them."""
        start = node.start
        properties = _PROPERTIES.match(self._text, start)
        node.start = min(node.end, properties.end()) if properties else start
        for word in re.finditer(r"\S+", self._text[start : node.start]):
            first, last = start + word.start(), start + word.end()
            if word[0].startswith("&"):
                self._refuse_anchor(f"the anchor '{word[0]}'", event.anchor or "", first, last)
            else:
                node.reported = True
                self._refuse_tag(word[0], first, last, node)

    def _refuse_anchor(self, description: str, name: str, start: int, end: int) -> None:
        self._anchors.add(name)
        help_text = "to repeat something, write a template and use it twice"
        self._report("anchor", f"{description} is not part of this language", start, end, help_text)

    def _refuse_tag(self, tag: str, start: int, end: int, node: YamlNode) -> None:
        if not tag.startswith("!!") and self._in_condition():
            rest = f" {node.text}" if isinstance(node, ScalarNode) and node.text else ""
            trap = read_as_tag_trap(tag, rest)
            place = self._source.place(start, end)
            self._findings.add(trap.rule, trap.message, place, help=trap.help, fix=trap_fix(trap, place))
            return
        help_text = "list the part under 'include'" if tag == "!include" else "remove it; quote the value if it is text"
        self._report("tag", f"the tag {shown(tag)} is not part of this language", start, end, help_text)

    def _resolve(self, node: ScalarNode) -> None:
        try:
            node.data = resolve(node.text)
        except OverflowError:
            node.reported = True
            is_nan = node.text.lower() == ".nan"
            message = f"{shown(node.text)} is not a number" if is_nan else f"the number {shown(node.text)} is too large"
            help_text = "write a finite number of at most 1e100; quote the value if it is text"
            self._report("number-out-of-range", message, *_range(node), help_text)

    def _examine(self, node: ScalarNode) -> None:
        """Check a scalar in double quotes for control characters, or a scalar in block form for a trap."""
        if node.style is not Style.DOUBLE_QUOTED:
            while node.end > node.start and self._text[node.end - 1] in " \t\r\n":
                node.end -= 1
            head = self._text[node.start : node.start + 2]
            if head[1:].isdigit() and self._in_condition():
                node.reported = True
                trap = read_as_block_trap(head)
                self._report(trap.rule, trap.message, node.start, node.start + len(head), trap.help)
        elif control_match := _CONTROL_CHARACTER.search(node.text):
            node.reported = True
            message = f"the text holds the control character U+{ord(control_match[0]):04X}"
            self._report("control-character", message, *_range(node), "remove the escape of this character")

    def _in_condition(self) -> bool:
        return any(key in CONDITION_KEYS for key in self._keys_around())

    def _keys_around(self) -> Iterator[str]:
        if self._key is not None:
            yield self._key.text
        for collection, _ in self._parents:
            if type(collection) is MappingNode and collection.entries:
                yield next(reversed(collection.entries))

    def _report(self, rule: str, message: str, start: int, end: int, help_text: str, *related: Related) -> None:
        self._findings.add(rule, message, self._source.place(start, end), help=help_text, related=related)


def _is_not_condition(text: str) -> bool:
    """Return whether a text is not a condition, or has a number where a truth value is required."""
    tree = parse(text)
    return not isinstance(tree, Node) or any(isinstance(part, Arithmetic) for part in _truth_valued_nodes(tree))


def _truth_valued_nodes(tree: Node) -> Iterator[Node]:
    """Yield the parts of a condition that must be true or false."""
    yield tree
    for part in parts(tree) if isinstance(tree, (And, Or, Not)) else ():
        yield from _truth_valued_nodes(part)


def _range(node: YamlNode) -> tuple[int, int]:
    return node.start, node.end
