"""What several holders declare is C_E(t) of the paper."""

from __future__ import annotations

from collections.abc import Iterator

from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.runtime.values.declarations import Declarations


def declarations() -> tuple[Declarations, list[str]]:
    told: list[str] = []
    made = Declarations(
        lambda name, holder: told.append(f"+{name} {holder}"), lambda name, holder: told.append(f"-{name} {holder}")
    )
    return made, told


def test_a_variable_leaves_when_its_last_holder_lets_go() -> None:
    made, told = declarations()
    made.hold("main", ["a", "b"])
    made.hold("skill", ["b"])
    made.hold("main", [])
    assert made.names() == {"b"}
    made.hold("skill", [])
    assert told == ["+a main", "+b main", "-a main", "-b skill"]
    assert "b" not in made
    assert made.holders() == ()


def test_what_a_holder_keeps_is_not_touched() -> None:
    made, told = declarations()
    made.hold("main", ["a", "b"])
    made.hold("main", (name for name in ("b", "c", "b")))
    assert told == ["+a main", "+b main", "+c main", "-a main"]
    assert made.of("main") == ("b", "c")


def letters() -> Iterator[st.SearchStrategy[list[str]]]:
    yield st.lists(st.sampled_from("abcd"), max_size=4)


@given(st.lists(st.tuples(st.sampled_from("xyz"), *letters()), max_size=20))
def test_what_is_declared_is_the_union_of_what_is_held(steps: list[tuple[str, list[str]]]) -> None:
    made, told = declarations()
    held: dict[str, set[str]] = {}
    for holder, names in steps:
        made.hold(holder, names)
        held[holder] = set(names)
        assert made.names() == set().union(*held.values())
        entered = {line.split()[0][1:] for line in told}
        assert all(
            sum(line[1] == name and (1 if line[0] == "+" else -1) for line in told) == (name in made)
            for name in entered
        )
