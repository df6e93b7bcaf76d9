"""The comparison of two values of the model, field by field.

Every field is compared. A table gives comparers for the fields whose changes have a category or wording of their own.
A field that is not in the table is compared by default: nested values field by field, entries by name, and everything
else for equality. Therefore changes of a new field of the model are reported without an edit of this module.
"""

from __future__ import annotations

from collections import ChainMap
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import fields, is_dataclass, replace
from typing import Any

from codra_dsl.language.diagnostics import Place, suggest
from codra_dsl.language.expression import Node
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.model import Condition, FuzzyTerm, Phrase, Reference, Spec, ValueType
from codra_dsl.tooling.diff.changes import Category, Change
from codra_dsl.tooling.diff.guards import normal_text
from codra_dsl.tooling.diff.version import Pair, duration_text

_LEAF_CLASSES = (Reference, Condition, Place, Node)
"""Dataclasses that are compared as one value."""

_KEY_OF_FIELD = {
    "method": "inference",
    "node": "of",
    "origin": "from",
    "origins": "from",
    "parameters": "with",
    "rate": "rate_of",
    "resolution_m": "resolution",
    "sources": "source",
    "targets": "to",
    "values": "with",
    "variable": "set",
    "within": "in",
}
"""The keys of those fields that have another name than their key in specs. Messages and places use these keys."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Scope:
    """Two values of one class, from the versions A and B of a spec, and the element that contains the values.

    Attributes:
        comparer_table: the comparers by class and field.
        id: the identifier of the element in a `Change`, e.g. `lab/context/centrifuge_open`. The identifier of the spec
            itself is its name.
        elements: the element in A and in B, which give the places of keys; None for a version without this element.
        values: the elements themselves, or values inside the elements.
        path: the key of the values within the element; empty for the element itself.
    """

    pair: Pair
    comparer_table: ComparerTable
    id: str
    elements: tuple[Any, Any]
    values: tuple[Any, Any]
    path: str = ""

    def changes(self, skipped_fields: frozenset[str] = frozenset()) -> Iterator[Change]:
        """Yield the changes of all fields except those in `skipped_fields`."""
        new = self.values[1]
        classes = (cls for cls in reversed(type(new).__mro__) if cls in self.comparer_table)
        comparers = {name: compare for cls in classes for name, compare in self.comparer_table[cls].items()}
        for field in fields(new):
            if field.compare and field.name not in skipped_fields:
                before, after = (getattr(value, field.name) for value in self.values)
                is_duration = field.name.endswith("_s") and float in {type(before), type(after)}
                compare = comparers.get(
                    field.name, equality_comparer(show=duration_text) if is_duration else compare_by_default
                )
                yield from compare(self, _key_of_field(field.name), before, after)

    def element_scope(self, kind: str, name: str, old: Any, new: Any) -> Scope:
        """Return the scope of an element of the spec."""
        return replace(self, id=self.pair.element_id(kind, name), elements=(old, new), values=(old, new))

    def inner_scope(self, key: str, old: Any, new: Any) -> Scope:
        """Return the scope of two values that are inside the values of this scope."""
        return replace(self, values=(old, new), path=self.path_of(key))

    def path_of(self, key: str) -> str:
        """Return the path from the element to a key of the values, with dots."""
        return ".".join(filter(None, (self.path, key)))

    def make_change(
        self,
        category: Category,
        key: str,
        message: str,
        old_text: str | None = None,
        new_text: str | None = None,
        *,
        changed_parts: tuple[Any, Any] = (None, None),
    ) -> Change:
        """Return a change of a key.

        Args:
            category: the category of the change.
            key: the key within the values of this scope.
            message: the effect of the change.
            old_text: the text or value in A.
            new_text: the text or value in B.
            changed_parts: the changed part in A and in B, which gives the place; for None, the key gives the place.
        """
        key = self.path_of(key)
        old_place, new_place = (
            self._place(index, key) if part is None else part.place for index, part in enumerate(changed_parts)
        )
        return Change(
            category=category,
            element=self.id,
            key=key,
            message=f"{self.path}: {message}" if self.path else message,
            old_text=old_text or None,
            new_text=new_text or None,
            old_place=old_place,
            new_place=new_place,
        )

    def _place(self, index: int, key: str) -> Place | None:
        """Return the place of a key in one version, or else the nearest known place around the key."""
        element, value = self.elements[index], self.values[index]
        if element is None:
            return None
        candidates = (element, *(getattr(element, field.name) for field in fields(element)))
        places = ChainMap(*(candidate.places for candidate in candidates if hasattr(candidate, "places")))
        value_place = getattr(value, "place", None) if self.path else None
        place: Place = places.get(key) or value_place or places.get(key.partition(".")[0]) or element.place
        return place


Comparer = Callable[[Scope, str, Any, Any], Iterator[Change]]
"""Yields the changes of a field. The arguments are the scope, the key of the field, and its values in A and in B."""

ComparerTable = Mapping[type, Mapping[str, Comparer]]
Wording = tuple[Category, str]
"""The category and the message of a change."""


def equality_comparer(
    category: Category | Callable[[Scope], Category] = Category.REDEFINED,
    message: str = "'{}' has changed",
    show: Callable[[Any], str] | None = None,
    select_part: Callable[[Any], object] | None = None,
) -> Comparer:
    """Return the comparer of values that are only compared for equality.

    Args:
        category: the category of the change, or a function that gives it.
        message: the message of the change; `{}` is replaced by the key.
        show: returns the text of a value; if it is given, both values are shown completely. Otherwise, only the entries
            of lists that differ are shown, or all entries if only their order differs.
        select_part: returns the part of a value that is compared.
    """

    def compare(scope: Scope, key: str, old: Any, new: Any) -> Iterator[Change]:
        before, after = map(select_part or plain_value, (old, new))
        if before != after:
            change_category = category if isinstance(category, Category) else category(scope)
            shown_values = (old, new) if show else (_entries_not_in(new, old), _entries_not_in(old, new))
            yield scope.make_change(change_category, key, message.format(key), *map(show or text_of, shown_values))

    return compare


def set_comparer(message: str) -> Comparer:
    """Return the comparer of lists without an order. All entries of a list are compared together."""
    return equality_comparer(message=message, select_part=lambda entries: frozenset(map(plain_value, entries)))


def _entries_not_in(base_value: Any, value: Any) -> Any:
    """Return the entries of `value` that `base_value` does not have, or all entries if only the order differs.

    A value that is not a list is returned whole.
    """
    if not isinstance(base_value, tuple) or not isinstance(value, tuple):
        return value
    known_entries = {*map(plain_value, base_value)}
    return tuple(entry for entry in value if plain_value(entry) not in known_entries) or (
        value if len(base_value) == len(value) else ()
    )


def compare_by_default(scope: Scope, key: str, old: Any, new: Any) -> Iterator[Change]:
    """Yield the changes of a field that is not in the table."""
    if is_nested(old, new):
        yield from scope.inner_scope(key, old, new).changes()
    elif _has_names(old) and _has_names(new):
        yield from (element_comparer(key) if isinstance(scope.values[1], Spec) else entry_comparer("entry"))(
            scope, key, old, new
        )
    else:
        yield from equality_comparer()(scope, key, old, new)


def element_comparer(
    kind: str, noun: str | None = None, find_successor: Callable[[Pair, Any], str | None] | None = None
) -> Comparer:
    """Return the comparer of the elements in a section of the spec, which are paired by name.

    Args:
        kind: the kind in the identifiers of the elements.
        noun: the word for an element in messages, by default the kind; if it is empty, removed and added elements are
            not reported.
        find_successor: returns the name of the new element that is probably a removed element under a new name. By
            default, this is the name of a new element with a similar name.
    """
    noun = kind if noun is None else noun

    def compare(scope: Scope, _: str, old: Any, new: Any) -> Iterator[Change]:
        for name, before, after in pair_by_name(old, new):
            inner_scope = scope.element_scope(kind, name, before, after)
            if before and after:
                yield from inner_scope.changes()
            elif not noun or getattr(before or after, "is_derived", False):
                continue
            elif after:
                yield inner_scope.make_change(Category.ADDED, "", f"new {noun}")
            else:
                added_names = sorted({element.name for element in new} - {element.name for element in old})
                similar_name = find_successor(scope.pair, before) if find_successor else suggest(name, added_names)
                yield inner_scope.make_change(Category.REMOVED, "", removal_message(noun, similar_name))

    return compare


def removal_message(noun: str, similar_name: str | None) -> str:
    """Return the message for a removed element.

    `similar_name` is the name of the new element that is probably the same element.
    """
    return f"the {noun} is gone" + ("" if similar_name is None else f"; '{similar_name}' looks like its new name")


def entry_comparer(noun: str, make_wording: Callable[[Any], Wording] | None = None) -> Comparer:
    """Return the comparer of entries of an element, which are paired by name.

    Args:
        noun: the word for an entry in messages; if it is empty, removed and added entries are not reported.
        make_wording: returns the category and the message for an entry that only one version has. Its argument is the
            entry in B, or None if only A has the entry. `{}` in the message is replaced by the name of the entry.
    """

    def compare(scope: Scope, key: str, old: Any, new: Any) -> Iterator[Change]:
        for name, before, after in pair_by_name(old, new):
            default_wording = (
                (Category.ADDED, f"new {noun} '{{}}'") if after else (Category.REMOVED, f"{noun} '{{}}' is gone")
            )
            if before and after:
                yield from scope.inner_scope(f"{key}.{name}", before, after).changes()
            elif noun:
                category, message = make_wording(after) if make_wording else default_wording
                type_texts = (text_of(getattr(entry, "type", None)) for entry in (before, after))
                yield scope.make_change(category, f"{key}.{name}", message.format(name), *type_texts)

    return compare


def pair_by_name(old: Iterable[Any], new: Iterable[Any]) -> Iterator[tuple[str, Any, Any]]:
    """Yield each name, with the entries of this name in A and in B; None for a version without such an entry."""
    before, after = ({_name_of(entry): entry for entry in entries} for entries in (old, new))
    for name in dict.fromkeys((*before, *after)):
        yield name, before.get(name), after.get(name)


def is_nested(old: Any, new: Any) -> bool:
    """Return whether two values have the same class and are compared field by field."""
    return type(old) is type(new) and is_dataclass(new) and not isinstance(new, _LEAF_CLASSES)


def plain_value(value: Any) -> Any:
    """Return a hashable form of a value. Places, and differences in the spelling of conditions, are left out."""
    match value:
        case Place():
            return None
        case Condition():
            return value.text if value.tree is None else normal_text(value.tree)
        case Node():
            return normal_text(value)
        case Mapping():
            return frozenset((name, plain_value(entry)) for name, entry in value.items())
        case tuple():
            return tuple(map(plain_value, value))
        case _ if is_dataclass(value):
            return tuple(plain_value(getattr(value, field.name)) for field in fields(value) if field.compare)
    return value


def text_of(value: Any) -> str:
    """Return a value as messages show it."""
    match value:
        case Reference():
            return value.name
        case FuzzyTerm():
            return f"{value.name}: {value.text}"
        case Condition() | Phrase():
            return value.text
        case ValueType():
            unit_text = "" if value.unit is None else f" in {value.unit}"
            range_text = "" if value.range is None else f" from {value.range[0]:g} to {value.range[1]:g}"
            return f"{value.kind}{unit_text}{range_text}{f' of {text_of(value.values)}' if value.values else ''}"
        case None | Place() | Mapping():
            return ""
        case tuple():
            return ", ".join(
                ": ".join(map(text_of, entry)) if isinstance(entry, tuple) else text_of(entry) for entry in value
            )
        case _ if is_dataclass(value):
            names_and_parts = ((field.name, getattr(value, field.name)) for field in fields(value))
            keys_and_texts = (
                (
                    _key_of_field(name),
                    duration_text(part) if name.endswith("_s") and isinstance(part, float) else text_of(part),
                )
                for name, part in names_and_parts
            )
            return f"({', '.join(f'{key}: {text}' for key, text in keys_and_texts if text)})"
        case bool():
            return str(value).lower()
        case float():
            return f"{value:.10g}"
    return str(value)


def _key_of_field(name: str) -> str:
    """Return the key of a field."""
    return _KEY_OF_FIELD.get(name) or name.removeprefix("is_").removesuffix("_s")


def _name_of(entry: Any) -> str:
    """Return the name of an entry, or else the name of its first field value that has a name; empty without a name."""
    values = (entry, *(getattr(entry, field.name) for field in fields(entry)))
    names = (value.name for value in values if isinstance(getattr(value, "name", None), str))
    return next(names, "")


def _has_names(value: Any) -> bool:
    return isinstance(value, tuple) and all(
        is_dataclass(entry) and not isinstance(entry, _LEAF_CLASSES) and hasattr(entry, "name") for entry in value
    )
