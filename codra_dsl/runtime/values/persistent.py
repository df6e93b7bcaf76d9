"""Persistent mappings: a change creates a new mapping that shares entries with the old one, which stays unchanged.

A reader that keeps a mapping sees one state for as long as it likes, without a lock and without a copy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Generic, TypeVar, cast

KeyT = TypeVar("KeyT")
ValueT = TypeVar("ValueT")

_MOST_STEPS = 32
"""The number of versions that a reader of an old mapping passes before that mapping gets entries of its own."""

_MOST_CHANGES = 1_000
"""A dictionary is copied after as many changes as it has entries, and these more.

An old mapping that is still referenced keeps all later changes in memory, up to this copy.
"""


class PersistentMap(Generic[KeyT, ValueT]):
    """A persistent mapping: each change returns another mapping. It has no meaningful order, and no value is None.

    Only the newest version has a dictionary. An older version stores its differences from the next version, and a
    reference to it. So the cost of a change does not depend on the number of entries, and the newest version is read
    directly.

    Threads may read all versions while one thread changes the newest. After reading the dictionary, a reader checks
    that its version is still the newest: a version is marked as old before its dictionary is changed. Changing an old
    version copies it.
    """

    __slots__ = ("_before", "_changes", "_entries", "_later", "_own")

    _before: dict[KeyT, ValueT | None]
    """Of an old version: the keys that the next version changed, with their values in this version."""

    _own: dict[KeyT, ValueT] | None
    """Of an old version: all its entries, once a reader has needed all of them."""

    def __init__(self) -> None:
        """Create an empty mapping."""
        self._entries: dict[KeyT, ValueT] = {}
        self._later: PersistentMap[KeyT, ValueT] | None = None
        self._changes = 0

    def get(self, key: KeyT) -> ValueT | None:
        """Return the value of a key, or None."""
        if self._later is None:
            value = self._entries.get(key)
            if self._later is None:
                return value
        return self._as_it_was(key)

    def __getitem__(self, key: KeyT) -> ValueT:
        value = self.get(key)
        if value is None:
            raise KeyError(key)
        return value

    def __contains__(self, key: object) -> bool:
        return self.get(cast("KeyT", key)) is not None

    def __len__(self) -> int:
        if self._later is None:
            count = len(self._entries)
            if self._later is None:
                return count
        return len(self._all_entries())

    def __iter__(self) -> Iterator[KeyT]:
        return iter(self._all_entries())

    def values(self) -> Iterator[ValueT]:
        """Yield all values."""
        return iter(self._all_entries().values())

    def with_entry(self, key: KeyT, value: ValueT) -> PersistentMap[KeyT, ValueT]:
        """Return the mapping with this value for a key. Only one thread at a time may call this."""
        return self.with_changes({key: value})

    def without(self, key: KeyT) -> PersistentMap[KeyT, ValueT]:
        """Return the mapping without a key; the same mapping if it lacks the key. For one thread at a time."""
        return self.with_changes({key: None}) if key in self else self

    def with_changes(self, changes: Mapping[KeyT, ValueT | None]) -> PersistentMap[KeyT, ValueT]:
        """Return the mapping with new values for some keys, and without the keys whose new value is None.

        Only one thread at a time may call this.
        """
        entries = self._entries
        made: PersistentMap[KeyT, ValueT] = _new(PersistentMap)
        made._later = None
        if self._later is None and self._changes <= len(entries) + _MOST_CHANGES:
            before: dict[KeyT, ValueT | None] = {}
            for key in changes:
                before[key] = entries.get(key)
            self._before, self._own = before, None
            made._changes = self._changes + len(changes)
            made._entries = entries
            self._later = made  # from here on, readers of this version use `_before`
        else:
            made._entries = entries = dict(self._all_entries())
            made._changes = 0
        for key, value in changes.items():  # the same as `_change`, without the cost of a call
            if value is not None:
                entries[key] = value
            else:
                entries.pop(key, None)
        return made

    def _as_it_was(self, key: KeyT) -> ValueT | None:
        """Return the value of a key that this mapping had when it was the newest."""
        version, steps = self, 0
        while True:
            later = version._later
            if later is None:
                value = version._entries.get(key)
                if version._later is None:
                    return value
            elif version._own is not None:
                return version._own.get(key)
            elif key in version._before:
                return version._before[key]
            elif steps > _MOST_STEPS:
                return self._all_entries().get(key)
            else:
                version, steps = later, steps + 1

    def _all_entries(self) -> Mapping[KeyT, ValueT]:
        """Return all entries of this version; the caller must not change them."""
        version: PersistentMap[KeyT, ValueT] = self
        passed: list[PersistentMap[KeyT, ValueT]] = []
        while True:
            later = version._later
            if later is None:
                entries = version._entries.copy()
                if version._later is None:
                    break
            elif version._own is not None:
                if version is self:
                    return version._own
                entries = version._own.copy()
                break
            else:
                passed.append(version)
                version = later
        for version in reversed(passed):
            _change(entries, version._before)
        if passed:
            self._own = entries
        return entries


def _change(entries: dict[KeyT, ValueT], changes: Mapping[KeyT, ValueT | None]) -> None:
    for key, value in changes.items():
        if value is not None:
            entries[key] = value
        else:
            entries.pop(key, None)


_new: Callable[[type[PersistentMap[Any, Any]]], PersistentMap[Any, Any]] = object.__new__
