"""Read the needs of the decision before an action: names of variables, which must be known, and conditions."""

from __future__ import annotations

from typing import TypedDict

from codra_dsl.language.expression import WORDS, Name, names_in, parse_over_context
from codra_dsl.language.load.elements.conditions import read_condition, untorn_items
from codra_dsl.language.load.yaml.nodes import ScalarNode, YamlNode
from codra_dsl.language.load.yaml.reader import Reader
from codra_dsl.language.model import Condition, Reference

_NON_NAMES = frozenset({*WORDS, "is"})


class PreviewFields(TypedDict):
    """The fields of a skill that its preview fills."""

    preview: tuple[Reference, ...]
    preview_names: tuple[Reference, ...]
    preview_conditions: tuple[Condition, ...]


def read_preview(reader: Reader) -> PreviewFields:
    """Return the variables and conditions of a preview; a single entry without a list, which is an error, is read."""
    node = reader.node.value("preview")
    items = [(0, node)] if isinstance(node, ScalarNode) and node.text else untorn_items(reader, "preview")
    entries = [entry for index, item in items if (entry := _read_entry(reader, item, index)) is not None]
    return PreviewFields(
        preview=tuple(reference for entry in entries for reference in _references(entry)),
        preview_names=tuple(entry for entry in entries if isinstance(entry, Reference)),
        preview_conditions=tuple(entry for entry in entries if isinstance(entry, Condition)),
    )


def _read_entry(reader: Reader, item: YamlNode, index: int) -> Reference | Condition | None:
    """Return a name or a condition; None for an entry that is not a text, which is reported elsewhere.

    A single word is a name, even if no variable can have it: it is reported as an unknown variable, and so are several
    names without commas. Parentheses and blanks around a name change nothing.
    """
    if not isinstance(item, ScalarNode) or not isinstance(item.data, str) or item.reported:
        reader.damage("preview")
        return None
    if item.text.isidentifier() or _is_several_names(item.text):
        return reader.reference(item)
    condition = read_condition(reader, item, "preview", str(index), grammar=parse_over_context)
    tree = condition.tree
    if isinstance(tree, Name) and tree.pose_comparison is None:
        return Reference(name=tree.name, place=condition.place_of(tree))
    return condition


def _is_several_names(text: str) -> bool:
    """Return whether an entry consists of names that blanks or semicolons separate, because commas are missing."""
    words = text.replace(";", " ").split()
    return len(words) > 1 and all(word.isidentifier() and word.lower() not in _NON_NAMES for word in words)


def _references(entry: Reference | Condition) -> tuple[Reference, ...]:
    """Return the variables of an entry; a condition that reads a variable twice names it once."""
    if isinstance(entry, Reference):
        return (entry,)
    names = {} if entry.tree is None else {name.name: name for name in reversed(list(names_in(entry.tree)))}
    return tuple(Reference(name=name.name, place=entry.place_of(name)) for name in reversed(names.values()))
