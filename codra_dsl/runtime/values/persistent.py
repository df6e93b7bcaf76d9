"""Persistent mappings. A change creates a new mapping; the old mapping stays as it is, and both share entries.

A reader that keeps a mapping sees the same state for as long as it likes, without a lock and without a copy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Generic, TypeVar, cast

KeyT = TypeVar("KeyT")
ValueT = TypeVar("ValueT")

_MAX_VERSION_STEPS = 32
"""If a reader of an old mapping has to search more than about this many versions, the mapping gets its own entries."""

_MAX_EXTRA_CHANGES = 1_000
"""A dictionary is copied when it has been changed more often than the number of its entries plus this number.

An old mapping that is still referenced keeps all later changes in memory, until this copy is made.
"""


class PersistentMap(Generic[KeyT, ValueT]):
    """A persistent mapping: each change returns another mapping. The order has no meaning, and no value is None.

    Only the newest version has a dictionary. An older version stores how it differs from the next version, and a
    reference to the next version. So the cost of a change does not depend on the number of entries, and the newest
    version is read directly.

    Threads may read all versions while one thread changes the newest version. A version is marked as old before its
    dictionary is changed; so after reading the dictionary, a reader checks that its version is still the newest. A
    change of an old version copies that version.
    """

    __slots__ = ("_change_count", "_entries", "_next_version", "_own_entries", "_replaced_values")

    _replaced_values: dict[KeyT, ValueT | None]
    """Only in an old version: the keys that the next version changed, with their values in this version."""

    _own_entries: dict[KeyT, ValueT] | None
    """Only in an old version: all entries of this version; None until a reader has needed them."""

    def __init__(self) -> None:
        """Create an empty mapping."""
        self._entries: dict[KeyT, ValueT] = {}
        self._next_version: PersistentMap[KeyT, ValueT] | None = None
        self._change_count = 0

    def get(self, key: KeyT) -> ValueT | None:
        """Return the value of a key, or None if the mapping lacks the key."""
        if self._next_version is None:
            value = self._entries.get(key)
            if self._next_version is None:
                return value
        return self._old_value(key)

    def __getitem__(self, key: KeyT) -> ValueT:
        value = self.get(key)
        if value is None:
            raise KeyError(key)
        return value

    def __contains__(self, key: object) -> bool:
        return self.get(cast("KeyT", key)) is not None

    def __len__(self) -> int:
        if self._next_version is None:
            entry_count = len(self._entries)
            if self._next_version is None:
                return entry_count
        return len(self._all_entries())

    def __iter__(self) -> Iterator[KeyT]:
        return iter(self._all_entries())

    def values(self) -> Iterator[ValueT]:
        """Yield all values."""
        return iter(self._all_entries().values())

    def with_entry(self, key: KeyT, value: ValueT) -> PersistentMap[KeyT, ValueT]:
        """Return the mapping with this value for a key. Only one thread at a time may call this."""
        return self.with_changes({key: value})

    def without_key(self, key: KeyT) -> PersistentMap[KeyT, ValueT]:
        """Return the mapping without a key; the same mapping if it does not have the key.

        Only one thread at a time may call this.
        """
        return self.with_changes({key: None}) if key in self else self

    def with_changes(self, changes: Mapping[KeyT, ValueT | None]) -> PersistentMap[KeyT, ValueT]:
        """Return the mapping with new values for some keys, and without the keys whose new value is None.

        Only one thread at a time may call this.
        """
        entries = self._entries
        new_map: PersistentMap[KeyT, ValueT] = _create_instance(PersistentMap)
        new_map._next_version = None
        if self._next_version is None and self._change_count <= len(entries) + _MAX_EXTRA_CHANGES:
            replaced_values: dict[KeyT, ValueT | None] = {}
            for key in changes:
                replaced_values[key] = entries.get(key)
            self._replaced_values, self._own_entries = replaced_values, None
            new_map._change_count = self._change_count + len(changes)
            new_map._entries = entries
            self._next_version = new_map  # from here on, readers of this version use `_replaced_values`
        else:
            new_map._entries = entries = dict(self._all_entries())
            new_map._change_count = 0
        for key, value in changes.items():  # the same as `_apply_changes`, without the cost of a call
            if value is not None:
                entries[key] = value
            else:
                entries.pop(key, None)
        return new_map

    def _old_value(self, key: KeyT) -> ValueT | None:
        """Return the value that a key had in this mapping when this mapping was the newest version."""
        version, step_count = self, 0
        while True:
            next_version = version._next_version
            if next_version is None:
                value = version._entries.get(key)
                if version._next_version is None:
                    return value
            elif version._own_entries is not None:
                return version._own_entries.get(key)
            elif key in version._replaced_values:
                return version._replaced_values[key]
            elif step_count > _MAX_VERSION_STEPS:
                return self._all_entries().get(key)
            else:
                version, step_count = next_version, step_count + 1

    def _all_entries(self) -> Mapping[KeyT, ValueT]:
        """Return all entries of this version; the caller must not change them."""
        version: PersistentMap[KeyT, ValueT] = self
        newer_versions: list[PersistentMap[KeyT, ValueT]] = []
        while True:
            next_version = version._next_version
            if next_version is None:
                entries = version._entries.copy()
                if version._next_version is None:
                    break
            elif version._own_entries is not None:
                if version is self:
                    return version._own_entries
                entries = version._own_entries.copy()
                break
            else:
                newer_versions.append(version)
                version = next_version
        for version in reversed(newer_versions):
            _apply_changes(entries, version._replaced_values)
        if newer_versions:
            self._own_entries = entries
        return entries


def _apply_changes(entries: dict[KeyT, ValueT], changes: Mapping[KeyT, ValueT | None]) -> None:
    for key, value in changes.items():
        if value is not None:
            entries[key] = value
        else:
            entries.pop(key, None)


_create_instance: Callable[[type[PersistentMap[Any, Any]]], PersistentMap[Any, Any]] = object.__new__
