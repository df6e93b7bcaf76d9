"""Values that share what they have in common: changing one makes another, and both stay as they are.

A reader that holds one sees one state for as long as it likes, without a lock and without a copy.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, Generic, TypeVar

KeyT = TypeVar("KeyT")
ValueT = TypeVar("ValueT")
DefaultT = TypeVar("DefaultT")

_MOST_IN_BUCKET = 64
"""Entries in an average bucket; then there are four times as many buckets."""

_MOST_BUCKETS = 1024

_ABSENT: Any = object()


class PersistentMap(Generic[KeyT, ValueT]):
    """A mapping of which each change makes another mapping; it has no order that means anything.

    Entries stand in buckets by their hash. A change copies one bucket and the list of buckets, all else is shared: with
    ten thousand entries that is three hundred references, not ten thousand.
    """

    __slots__ = ("_buckets", "_count", "_mask")

    def __init__(self) -> None:
        """Make an empty mapping."""
        self._buckets: list[dict[KeyT, ValueT]] = [{}]
        self._mask = 0
        self._count = 0

    def __getitem__(self, key: KeyT) -> ValueT:
        return self._buckets[hash(key) & self._mask][key]

    def __contains__(self, key: object) -> bool:
        return key in self._buckets[hash(key) & self._mask]

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[KeyT]:
        for bucket in self._buckets:
            yield from bucket

    def get(self, key: KeyT, default: DefaultT = None) -> ValueT | DefaultT:  # type: ignore[assignment]
        """Return the value of a key, or the default."""
        return self._buckets[hash(key) & self._mask].get(key, default)

    def values(self) -> Iterator[ValueT]:
        """Yield all values."""
        for bucket in self._buckets:
            yield from bucket.values()

    def items(self) -> Iterator[tuple[KeyT, ValueT]]:
        """Yield all keys, each with its value."""
        for bucket in self._buckets:
            yield from bucket.items()

    def with_entry(self, key: KeyT, value: ValueT) -> PersistentMap[KeyT, ValueT]:
        """Return the mapping with a key that has this value."""
        place = hash(key) & self._mask
        bucket = self._buckets[place].copy()
        before = len(bucket)
        bucket[key] = value
        return self._with_bucket(place, bucket, len(bucket) - before)

    def without(self, key: KeyT) -> PersistentMap[KeyT, ValueT]:
        """Return the mapping without a key; the same if it has none."""
        place = hash(key) & self._mask
        bucket = self._buckets[place]
        if key not in bucket:
            return self
        bucket = bucket.copy()
        del bucket[key]
        return self._with_bucket(place, bucket, -1)

    def _with_bucket(self, place: int, bucket: dict[KeyT, ValueT], more: int) -> PersistentMap[KeyT, ValueT]:
        made: PersistentMap[KeyT, ValueT] = _new(PersistentMap)
        made._buckets = buckets = self._buckets.copy()
        buckets[place] = bucket
        made._mask = self._mask
        made._count = count = self._count + more
        if count > len(buckets) * _MOST_IN_BUCKET and len(buckets) < _MOST_BUCKETS:
            made._spread()
        return made

    def _spread(self) -> None:
        """Divide the entries among four times as many buckets; nobody else has seen this mapping yet."""
        wide: list[dict[KeyT, ValueT]] = [{} for _ in range(4 * len(self._buckets))]
        self._mask = mask = len(wide) - 1
        for key, value in self.items():
            wide[hash(key) & mask][key] = value
        self._buckets = wide


_new: Callable[[type[PersistentMap[Any, Any]]], PersistentMap[Any, Any]] = object.__new__
