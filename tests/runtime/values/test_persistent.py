"""Persistent mappings: a version stays as it was, whatever is changed later, in whichever thread."""

from __future__ import annotations

from collections.abc import Callable

from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.runtime.values.persistent import PersistentMap

CHANGES = st.dictionaries(st.integers(0, 12), st.one_of(st.none(), st.integers(1, 9)), max_size=4)


def entries(mapping: PersistentMap[int, int]) -> dict[int, int]:
    return {key: mapping[key] for key in mapping}


@given(st.lists(st.tuples(st.integers(0, 10**6), CHANGES), max_size=60), st.integers(0, 10**6))
def test_every_version_stays_as_it_was_when_any_of_them_is_changed(
    changes: list[tuple[int, dict[int, int | None]]], first_asked: int
) -> None:
    versions: list[tuple[PersistentMap[int, int], dict[int, int]]] = [(PersistentMap(), {})]
    for version_choice, change in changes:
        before, expected_entries = versions[-1 if version_choice % 3 else version_choice % len(versions)]
        after = {key: value for key, value in {**expected_entries, **change}.items() if value is not None}
        versions.append((before.with_changes(change), after))
    first = first_asked % len(versions)
    for mapping, expected_entries in versions[first:] + versions[:first]:
        assert {key: mapping.get(key) for key in range(13) if key in mapping} == expected_entries
        assert (len(mapping), entries(mapping), sorted(mapping.values())) == (
            len(expected_entries),
            expected_entries,
            sorted(expected_entries.values()),
        )


@given(st.integers(1, 3000), st.data())
def test_an_old_version_is_read_after_thousands_of_changes(count: int, data: st.DataObject) -> None:
    versions = [PersistentMap[int, int]()]
    for number in range(1, count + 1):
        versions.append(versions[-1].with_entry(number % 7, number))
    version_index = data.draw(st.integers(0, count))
    expected_entries = {number % 7: number for number in range(1, version_index + 1)}
    assert [versions[version_index].get(key) for key in range(7)] == [expected_entries.get(key) for key in range(7)]
    assert entries(versions[version_index]) == expected_entries


def test_removing_a_missing_key_returns_the_same_mapping() -> None:
    mapping = PersistentMap[str, int]().with_entry("a", 1)
    assert mapping.without_key("b") is mapping
    assert "a" not in mapping.without_key("a")
    assert "a" in mapping


class Key:
    """A key that lets another thread run when a dictionary computes its hash."""

    def __init__(self, name: str) -> None:
        self.name = name
        self.turn: Callable[[], object] | None = None

    def __hash__(self) -> int:
        turn, self.turn = self.turn, None
        if turn is not None:
            turn()
            self.turn = turn
        return hash(self.name)

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Key) and self.name == other.name


def test_a_reader_of_a_mapping_during_its_change_gets_the_old_entries() -> None:
    keys = [Key(name) for name in "abc"]
    before = PersistentMap[Key, int]().with_changes({Key(name): 1 for name in "abc"})
    read_values: list[list[int | None]] = []
    for key in keys:
        key.turn = lambda: read_values.append([before.get(Key(name)) for name in "abc"])
    after = before.with_changes(dict.fromkeys(keys, 2))
    assert len(read_values) > len(keys)
    assert all(values == [1, 1, 1] for values in read_values)
    assert [after.get(Key(name)) for name in "abc"] == [2, 2, 2]


def test_a_mapping_that_is_changed_during_a_read_returns_its_old_values() -> None:
    old_mapping = PersistentMap[Key, int]().with_entry(Key("a"), 1)
    newest = [old_mapping]
    asked = Key("a")
    asked.turn = lambda: newest.append(newest[-1].with_entry(Key("a"), len(newest) + 1))
    assert [old_mapping.get(asked) for _ in range(5)] == [1, 1, 1, 1, 1]
    assert newest[-1][Key("a")] == len(newest) > 5
