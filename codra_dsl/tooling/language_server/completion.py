"""Completion from the lines around the cursor, so that it also works while the text cannot be read."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping
from typing import Any, NamedTuple

from lsprotocol import types

from codra_dsl.language.check.index.spec_index import MAIN_EXECUTION, OBSERVER
from codra_dsl.language.check.symbols import RETURNS
from codra_dsl.language.expression import FUNCTIONS
from codra_dsl.language.expression.tokens import WORDS
from codra_dsl.language.load.schema.document import SECTIONS
from codra_dsl.language.load.schema_file import schema
from codra_dsl.language.load.site.site_file import SITE_KEY
from codra_dsl.language.load.templates.templates import INSTANCE
from codra_dsl.language.units import UNITS
from codra_dsl.tooling.language_server.documents import Document
from codra_dsl.tooling.language_server.index import Cursor, SpecNames
from codra_dsl.tooling.language_server.other_files import SECTIONS_BY_KEY, STATES_VALUES, TIMELINE_KEY, other_file

_BLOCK_ENTRY = re.compile(
    r"""(?P<indent> *)(?P<dashes>(?:- +)*)(?:(?P<key>"[^"]*"|'[^']*'|[^\s#:{}\[\],"'][^#]*?) *:(?:\s+|$))?"""
)
_FLOW_START = re.compile(r"\s*(?:- +)*[{\[]")
_FLOW_PART = re.compile(r"""(?P<text>"(?:[^"\\]|\\.)*"|'[^']*')|(?P<mark>[{}\[\],]|:(?=\s|$))""")
_WORD = re.compile(r"(?:\$(?:\(\w*\)?)?|\w)*$")
_REST_OF_KEY = re.compile(r"[\w$()]* *:")
_AFTER_NUMBER = re.compile(r"\d\s+[A-Za-z/*]*$|\d[A-Za-z/*]+$")
_BEFORE_MEMBER = re.compile(
    r"""(?P<name>(?:\$\(\w+\)|\w)+)\s*(?:==|!=|(?:not\s+)?in\s*\((?:[^)]*,)?|becomes|stays)\s*(?P<quote>["']?)\w*$"""
)

_SECTIONS_IN_SPECS: Mapping[str, tuple[str, ...]] = {
    **dict.fromkeys(("given", "changes", "identifies", "rate_of", "share_of", "held", "set"), ("context",)),
    **dict.fromkeys(("source", "by", "requesters", "agent"), ("agents",)),
    **dict.fromkeys(("choose", "then", "otherwise", "course"), ("actions",)),
    **dict.fromkeys(("in", "execute"), ("trees",)),
    **dict.fromkeys(("from", "to"), ("types", "nodes")),
    **dict.fromkeys(("owns", "reads"), ("context", "types", "edges", "tasks")),
    **dict.fromkeys((SITE_KEY, TIMELINE_KEY), ("spec",)),
    "uses": ("resources",),
    "template": ("templates",),
    "of": ("nodes",),
    "analyse": ("metrics",),
    "adapt": ("adaptation",),
}
"""The sections whose names can be written under a key of a spec."""

_CONTEXT = ("context", "metrics", "adaptation")
"""The sections that declare context-variables."""

_PATTERNS = frozenset(("wakes", "before", "during", "after"))
_CONTEXT_CONDITIONS = frozenset(
    ("observable_when", "preview", "monitor", "derived", *_PATTERNS, "if", "value", "rules")
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

    @property
    def key(self) -> str:
        """The innermost key; empty at the top."""
        return self.path[-1] if self.path else ""


def slot_at(document: Document, offset: int) -> Slot:
    """Return the place of an offset, from the indentation of lines, and the brackets after the last key above it."""
    number = document.position_at(offset).line
    line = document.text[document.line_starts[number] : offset]
    if number == 0:
        line = line[document.mark_length :]
    entry = _BLOCK_ENTRY.match(line)
    assert entry is not None  # the pattern matches any text
    parents = _parents(document, number, entry)
    keys = [key for key, _ in parents]
    around = document.text[parents[-1][1] : offset] if parents else ""
    if _FLOW_START.match(around):
        path, is_key, before, is_closed = _in_flow(keys, around)
        if not is_closed:
            return Slot(path, is_key, is_item=False, before=before)
    rest = line[entry.end() :]
    path, is_key, before, _ = _in_flow([*keys, *([_unquoted(entry["key"])] if entry["key"] else [])], rest)
    is_item = bool(entry["dashes"]) and not entry["key"]
    return Slot(path, is_key if rest[:1] in ("{", "[") else not entry["key"] and not is_item, is_item, before)


def _parents(document: Document, number: int, entry: re.Match[str]) -> list[tuple[str, int]]:
    """Return the keys of the lines above that contain a line, each with the offset after it."""
    keys: list[tuple[str, int]] = []
    indent, dashes = len(entry["indent"]), entry["dashes"]
    limit = indent + 1 if dashes else indent  # an item may have the indentation of its key
    for line_number in range(number - 1, -1, -1):
        line = document.line(line_number)
        above = _BLOCK_ENTRY.match(line)
        if limit == 0 or above is None or not above["key"] or line.lstrip().startswith("#"):
            continue
        key_indent = len(above["indent"]) + len(above["dashes"])
        if key_indent < limit and (not dashes or not above["dashes"] or key_indent < indent):
            keys.append((_unquoted(above["key"]), document.line_starts[line_number] + above.end()))
            limit, dashes = key_indent, ""
    return keys[::-1]


def _in_flow(keys: Iterable[str], text: str) -> tuple[tuple[str, ...], bool, str, bool]:
    """Return the path within brackets, whether a key is written, the text of the scalar, and whether all are closed."""
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
    return tuple(path), is_key, text[start:].lstrip(), not stack


def _unquoted(key: str) -> str:
    return key.strip("\"'")


def completions(cursor: Cursor) -> list[types.CompletionItem]:
    """Return what can be written at a cursor."""
    document, offset = cursor.document, cursor.offset
    completion = _Completion(cursor, slot_at(document, offset))
    word = _WORD.search(document.text, document.line_starts[document.position_at(offset).line], offset)
    replaced = document.range_between(offset if word is None else word.start(), offset)
    key_ending = "" if _REST_OF_KEY.match(document.text, offset) else ": "
    choices = {choice.text: (choice, key_ending) for choice in completion.new_keys()}
    choices |= {choice.text: (choice, "") for choice in completion.new_values()}
    return [
        types.CompletionItem(
            text, kind=choice.kind, documentation=choice.detail, text_edit=types.TextEdit(replaced, f"{text}{ending}")
        )
        for text, (choice, ending) in choices.items()
    ]


class _Choice(NamedTuple):
    """A text to insert, its kind and its description."""

    text: str
    kind: types.CompletionItemKind
    detail: str = ""


class _Completion:
    """What can be written in a slot."""

    def __init__(self, cursor: Cursor, slot: Slot) -> None:
        self._cursor, self._slot, self._path = cursor, slot, slot.path
        other = other_file(cursor.document, cursor.file)
        self._kind = other.kind
        self._template = slot.path[1] if slot.path[:1] == ("templates",) and len(slot.path) > 2 else ""
        self._specs: list[SpecNames] = [
            names
            for names in cursor.index.specs
            if cursor.file in names.spec.files or (other.kind and names.spec.name == other.spec)
        ]

    def new_keys(self) -> Iterator[_Choice]:
        """Yield the keys that can be written."""
        slot, path = self._slot, self._path
        for definition in _definitions(path, self._kind) if slot.is_key or slot.is_item else ():
            for name, value in definition.get("properties", {}).items():
                if (name, path[:1], self._kind) != ("template", ("use",), SITE_KEY):
                    yield _Choice(name, types.CompletionItemKind.Property, value.get("description", ""))
        if not slot.is_key:
            return
        yield from self._names_under_key()
        if path[-2:-1] == ("identifies",):
            yield from self._members(slot.key, "")
        if path[:-1] == ("use",):
            yield from self._arguments(slot.key)
        if slot.key == RETURNS and self._kind:
            yield from self._returned_values()

    def new_values(self) -> Iterator[_Choice]:
        """Yield the values that can be written."""
        slot, path = self._slot, self._path
        if slot.is_key:
            return
        if slot.key == "unit":
            yield from _units()
        definitions = _definitions(path, self._kind)
        for definition in definitions:
            values = definition.get("enum", ())
            details = definition.get("markdownEnumDescriptions", [""] * len(values))
            for value, detail in zip(values, details, strict=True):
                yield _Choice(str(value), types.CompletionItemKind.EnumMember, detail)
        if self._kind == TIMELINE_KEY:
            for name in path[-2:] if not set(path).isdisjoint(STATES_VALUES) else ():
                yield from self._members(name, "")
        elif self._reads_results or (slot.key in _CONTEXT_CONDITIONS and path[:1] != ("loops",)):
            yield from self._in_condition()
            return
        if not any(definition.get("type") == "object" for definition in definitions):
            yield from self._names_under_key()

    @property
    def _reads_results(self) -> bool:
        return "perception" in self._path and not _RESULT_CONDITIONS.isdisjoint(self._path)

    def _names_under_key(self) -> Iterator[_Choice]:
        """Yield the names that can be written under the innermost key."""
        key = self._slot.key
        if key == "source":
            yield from (_Choice(name, types.CompletionItemKind.Keyword) for name in (OBSERVER, MAIN_EXECUTION))
        yield from self._names(self._sections())

    def _sections(self) -> tuple[str, ...]:
        """Return the sections whose names can be written under the innermost key."""
        path, key = self._path, self._slot.key
        if self._kind == TIMELINE_KEY and path[-2:-1] in (("agents",), ("expects",)):
            return _CONTEXT
        if self._kind == TIMELINE_KEY and key == "source":
            return ("perception", "agents")
        if self._kind == TIMELINE_KEY and key in SECTIONS_BY_KEY:
            return _CONTEXT if SECTIONS_BY_KEY[key] == "context" else (SECTIONS_BY_KEY[key],)
        if self._kind == SITE_KEY and key in (*SECTIONS, "use"):
            return (key,)
        if (key == "type" and "nodes" in path) or path[-2:-1] == ("nodes",):
            return ("types",)
        if key == "monitor" and path[:1] == ("loops",):
            return ("agents",)
        return _SECTIONS_IN_SPECS.get(key, ())

    def _names(self, sections: tuple[str, ...]) -> Iterator[_Choice]:
        """Yield the names of sections; in a template, also those that it makes, and its parameters."""
        for names in self._cursor.index.specs if sections == ("spec",) else self._specs:
            for symbol in names.declarations:
                if symbol.section in sections:
                    yield _Choice(symbol.name, types.CompletionItemKind.Variable)
        if not self._template:
            return
        for symbol, _, start, end, is_declaration, is_written in self._cursor.index.in_file(self._cursor.file):
            if is_declaration and not is_written and symbol.section in sections:
                text = self._cursor.document.text[start:end]
                yield _Choice(text, types.CompletionItemKind.Variable, "made by this template")
        yield from self._parameters()

    def _parameters(self) -> Iterator[_Choice]:
        """Yield the parameters of the template around the cursor."""
        if self._template and self._path[2] != "parameters":
            yield _Choice(f"$({INSTANCE})", types.CompletionItemKind.TypeParameter, "the name of the use")
            for template in (template for names in self._specs for template in names.spec.templates):
                for parameter in template.parameters if template.name == self._template else ():
                    yield _Choice(f"$({parameter.name})", types.CompletionItemKind.TypeParameter, parameter.type)

    def _arguments(self, instance: str) -> Iterator[_Choice]:
        """Yield the parameters that a use can give: those of its template, or of all templates if it names none."""
        for names in self._specs:
            used = [use.template for use in names.spec.uses if use.instance == instance]
            for template in names.spec.templates:
                for parameter in template.parameters if not used or template.name in used else ():
                    detail = f"parameter of {template.name}: {parameter.summary}"
                    yield _Choice(parameter.name, types.CompletionItemKind.Property, detail)

    def _in_condition(self) -> Iterator[_Choice]:
        member = _BEFORE_MEMBER.search(self._slot.before)
        if member is not None:
            yield from self._members(member["name"], "" if member["quote"] else '"')
            if member["quote"]:
                return
        if _AFTER_NUMBER.search(self._slot.before):
            yield from _units()
        elif self._reads_results:
            yield from self._returned_values()
            yield from self._parameters()
        else:
            in_pattern = ("nodes", "types", "edges", "tasks") if self._slot.key in _PATTERNS else ()
            yield from self._names((*_CONTEXT, *in_pattern))
        yield from (_Choice(word, types.CompletionItemKind.Keyword) for word in (*WORDS, *FUNCTIONS))

    def _returned_values(self) -> Iterator[_Choice]:
        """Yield the values that the algorithm around the cursor returns."""
        algorithms = self._intended_names("perception", self._algorithm)
        for symbol in (symbol for names in self._specs for symbol in names.declarations):
            if symbol.section == RETURNS and symbol.owner in algorithms:
                yield _Choice(symbol.name, types.CompletionItemKind.Field)

    @property
    def _algorithm(self) -> str:
        """The algorithm around the cursor as it is written; empty outside of algorithms."""
        return next(iter(self._path[self._path.index("perception") + 1 :]), "") if "perception" in self._path else ""

    def _members(self, written: str, quote: str) -> Iterator[_Choice]:
        """Yield the members of the variables or of the returned values around the cursor that a text can mean."""
        owners = self._intended_names("context", written)
        owners |= {f"{algorithm}.{written}" for algorithm in self._intended_names("perception", self._algorithm)}
        for member in (member for names in self._specs for owner in sorted(owners) for member in names.members(owner)):
            yield _Choice(f"{quote}{member}{quote}", types.CompletionItemKind.EnumMember)

    def _intended_names(self, section: str, written: str) -> set[str]:
        """Return the names that a text means: itself or, in a template, the names that it makes."""
        if "$(" not in written:
            return {written}
        text = self._cursor.document.text
        ranges = self._cursor.index.in_file(self._cursor.file)
        return {
            one.symbol.name for one in ranges if one.symbol.section == section and text[one.start : one.end] == written
        }


def _units() -> Iterator[_Choice]:
    return (_Choice(unit, types.CompletionItemKind.Unit) for unit in UNITS)


def _definitions(path: tuple[str, ...], kind: str) -> list[dict[str, Any]]:
    """Return the definitions of the schema for a path in a spec or, with the key of their kind, in a site or timeline.

    A site has the keys of the spec, except those of resources and uses.
    """
    roots = {SITE_KEY: schema()["$defs"]["site"], TIMELINE_KEY: schema()["$defs"]["timeline"]}
    is_like_spec = kind == SITE_KEY and len(path) > 1 and path[0] not in ("resources", "use")
    definitions = _forms(schema() if is_like_spec else roots.get(kind, schema()))
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
