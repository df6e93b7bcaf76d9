"""Fixes that follow from the text: the intended word or condition, and text to insert, remove or move."""

from __future__ import annotations

import re
from collections.abc import Sequence

from codra_dsl.language.diagnostics import Applicability, Edit, Fix, Place, surely_means
from codra_dsl.language.expression import Node, parse
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.load.yaml.nodes import MappingNode, SequenceNode
from codra_dsl.language.load.yaml.origin import Origin
from codra_dsl.language.load.yaml.source import Source
from codra_dsl.language.load.yaml.traps import Trap

_TYPE_NAME_SYNONYMS = {
    "boolean": "bool",
    "integer": "int",
    "number": "float",
    "double": "float",
    "real": "float",
    "string": "str",
    "text": "str",
    "enumeration": "enum",
}
_CERTAIN_SYNONYMS = frozenset({"boolean", "integer", "string", "enumeration"})
"""Type names of other languages that correspond to exactly one of ours."""

_TRUTH_VALUES = {"yes": "true", "on": "true", "no": "false", "off": "false"}
_ONLY_SEPARATORS = re.compile(r"[\s,]*")
_BULLET = re.compile(r"[ \t]*-[ \t]+")


def corrected_truth_value(text: str) -> str | None:
    """Return `true` or `false` for a word that was a truth value in YAML 1.1, or None for any other word."""
    return _TRUTH_VALUES.get(text.casefold())


def suggest_word(word: str, allowed: Sequence[str], findings: Findings) -> tuple[str | None, bool]:
    """Return the allowed word that another word probably means, or None, and whether the meaning is certain."""
    own_type_name = _TYPE_NAME_SYNONYMS.get(word.casefold())
    if own_type_name in allowed:
        return own_type_name, word.casefold() in _CERTAIN_SYNONYMS
    suggestion = findings.nearest(word, allowed)
    return suggestion, suggestion is not None and surely_means(word, suggestion, allowed)


def item_removal_fix(sequence: SequenceNode, index: int, origin: Origin) -> Fix | None:
    """Return the fix that removes one item of a list, but not its first item; None if a comment would be lost.

    The result is also None in the text of a template, because the item may differ in another use.
    """
    if origin.use is not None:
        return None
    source, item, previous_item = origin.source, sequence.items[index], sequence.items[index - 1]
    if sequence.flow:
        start, end = previous_item.end, item.end
        separator = _ONLY_SEPARATORS.fullmatch(source.text, start, item.start)
    else:
        first_line, last_line = source.span(item.start, item.end).line, source.span(item.start, item.end).end_line
        start = source.line_starts[first_line - 1]
        end = source.line_starts[last_line] if last_line < len(source.line_starts) else len(source.text)
        is_rest_blank = not source.text[item.end : end].strip()
        separator = _BULLET.fullmatch(source.text, start, item.start) if is_rest_blank else None
    if separator is None:
        return None
    edit = Edit(source.span(start, end), "")
    return Fix(message="Remove the duplicate", edits=(edit,), applicability=Applicability.SAFE)


def trap_fix(trap: Trap, place: Place) -> Fix | None:
    """Return the fix of a trap for conditions; None in a template, or if the new text would not be a condition."""
    span = place.span
    is_applicable = place.use is None and span.line == span.end_line and trap.replacement != ""
    if not is_applicable or not isinstance(parse(trap.condition), Node):
        return None
    return Fix(
        message=f"Write {trap.replacement}", edits=(Edit(span, trap.replacement),), applicability=Applicability.SAFE
    )


def version_fix(root: MappingNode, source: Source) -> Fix | None:
    """Return the fix that puts `codra: 1` before all other keys, or None if it would change more than its own line."""
    first = next(iter(root.entries.values()))[0]
    first_key_span = source.span(first.start, first.start)
    if root.flow or first_key_span.column != 1:
        return None
    insertion = Edit(first_key_span, "codra: 1\n")
    if "codra" not in root.entries:
        return Fix(message="Insert 'codra: 1'", edits=(insertion,), applicability=Applicability.SAFE)
    key = root.entries["codra"][0]
    line = source.span(key.start, key.start).line
    start, end = source.line_starts[line - 1], source.line_end(key.start)
    next_line_start = source.line_starts[line] if line < len(source.line_starts) else end
    if source.text[start:end].strip() != "codra: 1":
        return None
    removal = Edit(source.span(start, next_line_start), "")
    return Fix(message="Move 'codra: 1' to the top", edits=(insertion, removal), applicability=Applicability.SAFE)
