"""Completion from the lines around the cursor, so that it also works while the text cannot be read."""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

from lsprotocol import types

from codra_dsl.language.check.index.spec_index import MAIN_EXECUTION, OBSERVER
from codra_dsl.language.expression import FUNCTIONS
from codra_dsl.language.expression.tokens import WORDS
from codra_dsl.language.load.schema_file import schema
from codra_dsl.language.load.site.site_file import SITE_KEY
from codra_dsl.language.units import UNITS
from codra_dsl.tooling.language_server.documents import Document
from codra_dsl.tooling.language_server.index import Cursor, SpecNames
from codra_dsl.tooling.language_server.other_files import names_in

_BLOCK_ENTRY = re.compile(r"(?P<indent> *)(?P<dashes>(?:- +)*)(?:(?P<key>[^\s#:{}\[\],][^#:{}\[\],]*?) *:(?:\s+|$))?")
_FLOW_PART = re.compile(r"""(?P<text>"(?:[^"\\]|\\.)*"|'[^']*')|(?P<mark>[{}\[\],]|:(?=\s|$))""")
_WORD = re.compile(r"[\w$()]*$")
_REST_OF_KEY = re.compile(r"[\w$()]* *:")
_AFTER_NUMBER = re.compile(r"\d\s+[A-Za-z/*]*$|\d[A-Za-z/*]+$")
_BEFORE_MEMBER = re.compile(
    r"""(?P<name>[\w$()]+)\s*(?:==|!=|(?:not\s+)?in\s*\((?:[^)]*,)?|becomes|stays)\s*(?P<quote>["']?)\w*$"""
)

_SECTIONS_BY_KEY: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(
        ("given", "changes", "identifies", "rate_of", "share_of", "set", "declare", "withdraw"), ("context",)
    ),
    **dict.fromkeys(("believes", "decide", "decided", "overrides"), ("context",)),
    **dict.fromkeys(("source", "by", "requesters", "agent"), ("agents",)),
    **dict.fromkeys(("choose", "then", "otherwise", "course"), ("actions",)),
    **dict.fromkeys(("begin", "end", "act", "acted", "expect", "previews"), ("skills",)),
    **dict.fromkeys(("running", "stopped"), ("perception",)),
    **dict.fromkeys(("in", "execute"), ("trees",)),
    **dict.fromkeys(("from", "to"), ("types", "nodes")),
    **dict.fromkeys(("owns", "reads"), ("context", "types", "edges", "tasks")),
    "uses": ("resources",),
    "template": ("templates",),
    "of": ("nodes",),
    "analyse": ("metrics",),
    "adapt": ("adaptation",),
    "overlays": ("spec",),
    "timeline": ("spec",),
}
"""The sections whose names can be written under a key."""

_CONTEXT_CONDITIONS = frozenset(
    ("observable_when", "preview", "monitor", "derived", "wakes", "before", "during", "after", "if", "value", "rules")
)
_RESULT_CONDITIONS = frozenset(("accept_when", "identifies", "enter", "leave"))


class Slot(NamedTuple):
    """The place of the cursor.

    Attributes:
        path: the keys that lead to the place, from the outermost; the elements of lists have no key.
        is_key: whether a key is written here.
        is_item: whether an element of a list is written here; it can begin with a key.
        before: the text of the scalar before the cursor.
    """

    path: tuple[str, ...]
    is_key: bool
    is_item: bool
    before: str


def slot_at(document: Document, offset: int) -> Slot:
    """Return the place of an offset, from the indentation of lines and the brackets in the last of them."""
    number = document.position_at(offset).line
    line = document.text[document.line_starts[number] : offset].lstrip("\N{ZERO WIDTH NO-BREAK SPACE}")
    entry = _BLOCK_ENTRY.match(line)
    assert entry is not None  # the pattern matches any text
    parents = _parents(document, number, len(entry["indent"]), entry["dashes"])
    keys = [*parents, *([_unquoted(entry["key"])] if entry["key"] else [])]
    rest = line[entry.end() :]
    path, is_key, before = _in_flow(keys, rest)
    is_item = bool(entry["dashes"]) and not entry["key"]
    return Slot(path, is_key if rest[:1] in ("{", "[") else not entry["key"] and not is_item, is_item, before)


def _parents(document: Document, number: int, indent: int, dashes: str) -> list[str]:
    """Return the keys of the lines above that contain a line."""
    keys: list[str] = []
    limit = indent + 1 if dashes else indent  # an item may have the indentation of its key
    for line_number in range(number - 1, -1, -1):
        line = document.line(line_number)
        entry = _BLOCK_ENTRY.match(line)
        if entry is None or not line.strip() or line.lstrip().startswith("#"):
            continue
        key_indent = len(entry["indent"]) + len(entry["dashes"])
        if entry["key"] and key_indent < limit and (not dashes or not entry["dashes"] or key_indent < indent):
            keys.append(_unquoted(entry["key"]))
            limit, dashes = key_indent, ""
        if limit == 0:
            break
    return keys[::-1]


def _in_flow(keys: list[str], text: str) -> tuple[tuple[str, ...], bool, str]:
    """Return the path within brackets, whether the place is that of a key, and the text of the scalar."""
    stack: list[tuple[str, int]] = []
    path, start = list(keys), 0
    for part in _FLOW_PART.finditer(text):
        mark = part["mark"]
        if mark is None:
            continue
        if mark in "{[":
            stack.append((mark, len(path)))
        elif mark == ":" and stack and stack[-1][0] == "{" and len(path) == stack[-1][1]:
            path.append(_unquoted(text[start : part.start()].strip()))
        elif mark in "}]" and stack:
            del path[stack.pop()[1] :]
        elif mark == "," and stack:
            del path[stack[-1][1] :]
        else:
            continue
        start = part.end()
    is_key = bool(stack) and stack[-1][0] == "{" and len(path) == stack[-1][1]
    return tuple(path), is_key, text[start:].lstrip()


def _unquoted(key: str) -> str:
    return key.strip("\"'")


_Choice = tuple[str, types.CompletionItemKind, str]
"""A text to insert, its kind and its description."""


def completions(cursor: Cursor) -> list[types.CompletionItem]:
    """Return what can be written at a cursor."""
    document, offset = cursor.document, cursor.offset
    slot = slot_at(document, offset)
    word = _WORD.search(slot.before)
    replaced = document.range_between(offset - (len(word[0]) if word else 0), offset)
    key_ending = "" if _REST_OF_KEY.match(document.text, offset) else ": "
    keys = {text: (key_ending, kind, detail) for text, kind, detail in _keys(cursor, slot)}
    values = {} if slot.is_key else {text: ("", kind, detail) for text, kind, detail in _values(cursor, slot)}
    return [
        types.CompletionItem(
            text, kind=kind, documentation=detail, text_edit=types.TextEdit(replaced, f"{text}{ending}")
        )
        for text, (ending, kind, detail) in (keys | values).items()
    ]


def _keys(cursor: Cursor, slot: Slot) -> Iterator[_Choice]:
    """Yield the keys that can be written in a slot."""
    for definition in _definitions(slot.path) if slot.is_key or slot.is_item else ():
        for name, value in definition.get("properties", {}).items():
            yield name, types.CompletionItemKind.Property, value.get("description", "")
    if not slot.is_key:
        return
    yield from _names_under(cursor, slot.path)
    if slot.path[-2:-1] == ("identifies",):
        yield from _members(cursor, slot.path[-1], "")
    if slot.path[:-1] == ("use",):
        yield from _parameters(cursor, slot.path[1])


def _values(cursor: Cursor, slot: Slot) -> Iterator[_Choice]:
    """Yield the values that can be written in a slot."""
    key = slot.path[-1] if slot.path else ""
    if key == "unit":
        yield from _units()
    definitions = _definitions(slot.path)
    for definition in definitions:
        values = definition.get("enum", ())
        details = definition.get("markdownEnumDescriptions", [""] * len(values))
        yield from (
            (str(value), types.CompletionItemKind.EnumMember, detail)
            for value, detail in zip(values, details, strict=True)
        )
    reads_results = "perception" in slot.path and not _RESULT_CONDITIONS.isdisjoint(slot.path)
    if reads_results or key in _CONTEXT_CONDITIONS:
        yield from _in_condition(cursor, slot, reads_results=reads_results)
    elif not any(definition.get("type") == "object" for definition in definitions):
        yield from _names_under(cursor, slot.path)


def _names_under(cursor: Cursor, path: tuple[str, ...]) -> Iterator[_Choice]:
    """Yield the names that can be written under the last key of a path."""
    key = path[-1] if path else ""
    sections = _SECTIONS_BY_KEY.get(key, ())
    if key == "type" and "nodes" in path:
        sections = ("types",)
    if key == "monitor" and "loops" in path:
        sections = ("agents",)
    if key == "source":
        yield from ((name, types.CompletionItemKind.Keyword, "") for name in (OBSERVER, MAIN_EXECUTION))
    yield from _names(cursor, sections, in_template="templates" in path)


def _names(cursor: Cursor, sections: tuple[str, ...], *, in_template: bool) -> Iterator[_Choice]:
    """Yield the names of sections; in a template, also those that it makes, as it writes them."""
    for names in cursor.index.specs if sections == ("spec",) else _specs(cursor):
        for symbol in names.declarations:
            if symbol.section in sections:
                yield symbol.name, types.CompletionItemKind.Variable, ""
    for _, _, start, end, is_declaration, is_written in cursor.index.in_file(cursor.file) if in_template else ():
        if is_declaration and not is_written:
            yield cursor.document.text[start:end], types.CompletionItemKind.Variable, "made by this template"


def _specs(cursor: Cursor) -> Iterator[SpecNames]:
    """Yield the specs to which the file of a cursor belongs, or which it names."""
    named_spec, _ = names_in(cursor.document, cursor.file)
    for names in cursor.index.specs:
        if cursor.file in names.spec.files or names.spec.name == named_spec:
            yield names


def _in_condition(cursor: Cursor, slot: Slot, *, reads_results: bool) -> Iterator[_Choice]:
    member = _BEFORE_MEMBER.search(slot.before)
    if member is not None:
        yield from _members(cursor, member["name"], "" if member["quote"] else '"')
        if member["quote"]:
            return
    if _AFTER_NUMBER.search(slot.before):
        yield from _units()
    elif reads_results:
        yield from _returned_values(cursor)
    else:
        yield from _names(cursor, ("context", "metrics", "adaptation"), in_template="templates" in slot.path)
    yield from ((word, types.CompletionItemKind.Keyword, "") for word in (*WORDS, *FUNCTIONS))


def _returned_values(cursor: Cursor) -> Iterator[_Choice]:
    """Yield the values that the algorithm around a cursor returns."""
    document, ranges = cursor.document, cursor.index.in_file(cursor.file)
    algorithms = {
        name_range.symbol.name
        for name_range in ranges
        if name_range.symbol.section == "perception" and name_range.is_declaration
        if name_range.start <= cursor.offset <= document.end_of_entry(name_range.start)
    }
    values = (name_range.symbol for name_range in ranges if name_range.symbol.owner in algorithms)
    return ((value.name, types.CompletionItemKind.Field, "") for value in values)


def _members(cursor: Cursor, name: str, quote: str) -> Iterator[_Choice]:
    """Yield the members of the enums with a name: variables and returned values."""
    for names in _specs(cursor):
        types_by_name = [(variable.name, variable.type) for variable in names.spec.context]
        for algorithm in names.spec.perception:
            types_by_name += [(value.name, value.type) for value in algorithm.returns]
        for member in (member for other, value_type in types_by_name if other == name for member in value_type.values):
            yield f"{quote}{member}{quote}", types.CompletionItemKind.EnumMember, ""


def _parameters(cursor: Cursor, instance: str) -> Iterator[_Choice]:
    """Yield the parameters that a use can give: those of its template, or of all templates if it names none."""
    for names in _specs(cursor):
        used = [use.template for use in names.spec.uses if use.instance == instance]
        for template in names.spec.templates:
            for parameter in template.parameters if not used or template.name in used else ():
                yield parameter.name, types.CompletionItemKind.Property, f"parameter of {template.name}"


def _units() -> Iterator[_Choice]:
    return ((unit, types.CompletionItemKind.Unit, "") for unit in UNITS)


def _definitions(path: tuple[str, ...]) -> list[dict[str, Any]]:
    """Return the definitions of the schema for a path."""
    root = schema()
    if path[:1] in ((SITE_KEY,), ("timeline",), ("stories",), ("start",)):
        root = root["$defs"]["site" if path[0] == SITE_KEY else "timeline"]
    definitions = _forms(root)
    for key in path:
        definitions = [form for definition in definitions for form in _below(definition, key)]
    return definitions


def _below(definition: dict[str, Any], key: str) -> list[dict[str, Any]]:
    if "items" in definition:  # elements of lists have no key of their own
        return [form for item in _forms(definition["items"]) for form in _below(item, key)]
    below = definition.get("properties", {}).get(key, definition.get("additionalProperties"))
    return _forms(below) if isinstance(below, dict) else []


def _forms(definition: dict[str, Any]) -> list[dict[str, Any]]:
    """Return a definition with its references followed, as the list of its alternatives."""
    if "$ref" in definition:
        return _forms(schema()["$defs"][definition["$ref"].rpartition("/")[2]])
    if "anyOf" in definition:
        return [form for alternative in definition["anyOf"] for form in _forms(alternative)]
    if "items" in definition:
        return [definition, *_forms(definition["items"])]
    return [definition]
