"""Fixes that follow from what is written: what is meant by it, and what can be taken out of a file."""

from __future__ import annotations

import re
from collections.abc import Sequence

from codra_dsl.diagnostics import Applicability, Edit, Fix, Place, surely_means
from codra_dsl.expression import Node, parse
from codra_dsl.load.findings import Findings
from codra_dsl.load.nodes import MappingNode, SequenceNode
from codra_dsl.load.origin import Origin
from codra_dsl.load.source import Source
from codra_dsl.load.traps import Trap

_OTHER_NAMES = {
    "boolean": "bool",
    "integer": "int",
    "number": "float",
    "double": "float",
    "real": "float",
    "string": "str",
    "text": "str",
    "enumeration": "enum",
}
_SURE_NAMES = frozenset({"boolean", "integer", "string", "enumeration"})
"""Names of types in other languages that can mean only one of ours."""

_TRUTHS = {"yes": "true", "on": "true", "no": "false", "off": "false"}
_ONLY_SEPARATORS = re.compile(r"[\s,]*")
_BULLET = re.compile(r"[ \t]*-[ \t]+")


def truth_meant(text: str) -> str | None:
    """Return what a word means that was a truth value in YAML 1.1; None for any other."""
    return _TRUTHS.get(text.casefold())


def word_meant(word: str, allowed: Sequence[str], findings: Findings) -> tuple[str | None, bool]:
    """Return which of the allowed words is probably meant by another one, and whether it surely is."""
    other = _OTHER_NAMES.get(word.casefold())
    if other in allowed:
        return other, word.casefold() in _SURE_NAMES
    near = findings.nearest(word, allowed)
    return near, near is not None and surely_means(word, near, allowed)


def without_item(several: SequenceNode, index: int, origin: Origin) -> Fix | None:
    """Return how to take an item that is not the first out of a list; None where a comment would go with it.

    There is none for one use of a template either: in another, the item may be another one.
    """
    if origin.use is not None:
        return None
    source, item, before = origin.source, several.items[index], several.items[index - 1]
    if several.flow:
        start, end = before.end, item.end
        alone = _ONLY_SEPARATORS.fullmatch(source.text, start, item.start)
    else:
        first, last = source.span(item.start, item.end).line, source.span(item.start, item.end).end_line
        start = source.line_starts[first - 1]
        end = source.line_starts[last] if last < len(source.line_starts) else len(source.text)
        is_whole_line = not source.text[item.end : end].strip()
        alone = _BULLET.fullmatch(source.text, start, item.start) if is_whole_line else None
    if alone is None:
        return None
    edit = Edit(source.span(start, end), "")
    return Fix(message="Remove what stands twice", edits=(edit,), applicability=Applicability.SAFE)


def trap_fix(trap: Trap, place: Place) -> Fix | None:
    """Return the cure of a trap for conditions; None where it does not make a condition of what is written."""
    span = place.span
    fits = place.use is None and span.line == span.end_line and trap.cure != ""
    if not fits or not isinstance(parse(trap.condition), Node):
        return None
    return Fix(message=f"Write {trap.cure}", edits=(Edit(span, trap.cure),), applicability=Applicability.SAFE)


def version_fix(root: MappingNode, source: Source) -> Fix | None:
    """Return how `codra: 1` comes to stand before all other keys; None where that takes more than its line."""
    first = next(iter(root.entries.values()))[0]
    top = source.span(first.start, first.start)
    if root.flow or top.column != 1:
        return None
    insertion = Edit(top, "codra: 1\n")
    if "codra" not in root.entries:
        return Fix(message="Insert 'codra: 1'", edits=(insertion,), applicability=Applicability.SAFE)
    key = root.entries["codra"][0]
    line = source.span(key.start, key.start).line
    start, end = source.line_starts[line - 1], source.line_end(key.start)
    after = source.line_starts[line] if line < len(source.line_starts) else end
    if source.text[start:end].strip() != "codra: 1":
        return None
    removal = Edit(source.span(start, after), "")
    return Fix(message="Move 'codra: 1' to the top", edits=(insertion, removal), applicability=Applicability.SAFE)
