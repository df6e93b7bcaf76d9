"""Values that share what they have in common: changing one makes another, and both stay as they are.

A reader that holds one sees one state for as long as it likes, without a lock and without a copy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from typing import Any, Generic, TypeVar, cast

KeyT = TypeVar("KeyT")
ValueT = TypeVar("ValueT")

_MOST_STEPS = 32
"""Changes through which a reader of an old mapping goes at most; then that mapping gets entries of its own."""

_MOST_CHANGES = 1_000
"""Changes of one dictionary, beyond as many as it has entries, until it is copied: an old mapping that somebody holds
keeps what was changed after it from being forgotten, up to there."""


class PersistentMap(Generic[KeyT, ValueT]):
    """A mapping of which each change makes another mapping; it has no order that means anything, and no value is None.

    Only the newest has a dictionary: each one before it knows what was different in it, and which came after. So a
    change costs the same however many entries there are, and what was written last is read at once.

    Threads may read all of them while one thread changes the newest. Who reads it makes sure afterwards that it still
    is: what makes it an old one comes before its dictionary is changed. Changing an old one copies it.
    """

    __slots__ = ("_before", "_changes", "_entries", "_later", "_own")

    _before: dict[KeyT, ValueT | None]
    """Of an old one: what the next has changed, as it is here."""

    _own: dict[KeyT, ValueT] | None
    """Of an old one: all its entries, once somebody has read much of it."""

    def __init__(self) -> None:
        """Make an empty mapping."""
        self._entries: dict[KeyT, ValueT] = {}
        self._later: PersistentMap[KeyT, ValueT] | None = None
        self._changes = 0

    def get(self, key: KeyT) -> ValueT | None:
        """Return the value of a key, or None."""
        if self._later is None:
            found = self._entries.get(key)
            if self._later is None:
                return found
        return self._as_it_was(key)

    def __getitem__(self, key: KeyT) -> ValueT:
        found = self.get(key)
        if found is None:
            raise KeyError(key)
        return found

    def __contains__(self, key: object) -> bool:
        return self.get(cast("KeyT", key)) is not None

    def __len__(self) -> int:
        if self._later is None:
            count = len(self._entries)
            if self._later is None:
                return count
        return len(self._whole())

    def __iter__(self) -> Iterator[KeyT]:
        return iter(self._whole())

    def values(self) -> Iterator[ValueT]:
        """Yield all values."""
        return iter(self._whole().values())

    def with_entry(self, key: KeyT, value: ValueT) -> PersistentMap[KeyT, ValueT]:
        """Return the mapping with a key that has this value; one thread at a time may do so."""
        return self.with_changes({key: value})

    def without(self, key: KeyT) -> PersistentMap[KeyT, ValueT]:
        """Return the mapping without a key; the same if it has none. One thread at a time may do so."""
        return self.with_changes({key: None}) if key in self else self

    def with_changes(self, changes: Mapping[KeyT, ValueT | None]) -> PersistentMap[KeyT, ValueT]:
        """Return the mapping with new values of some keys, and without those whose value is None.

        One thread at a time may do so.
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
            self._later = made  # from here on its readers look at what was before
        else:
            made._entries = entries = dict(self._whole())
            made._changes = 0
        for key, value in changes.items():  # as `_change`, which would cost a call
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
                found = version._entries.get(key)
                if version._later is None:
                    return found
            elif version._own is not None:
                return version._own.get(key)
            elif key in version._before:
                return version._before[key]
            elif steps > _MOST_STEPS:
                return self._whole().get(key)
            else:
                version, steps = later, steps + 1

    def _whole(self) -> Mapping[KeyT, ValueT]:
        """Return all entries, which do not change."""
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
