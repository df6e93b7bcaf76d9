"""The union of what several holders declare is C_E(t) of the paper."""

from __future__ import annotations

from collections.abc import Iterator

from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.runtime.values.declarations import Declarations


def declarations() -> tuple[Declarations, list[str]]:
    log: list[str] = []
    made = Declarations(
        lambda name, holder: log.append(f"+{name} {holder}"), lambda name, holder: log.append(f"-{name} {holder}")
    )
    return made, log


def test_a_variable_leaves_when_its_last_holder_removes_it() -> None:
    made, log = declarations()
    made.hold("main", ["a", "b"])
    made.hold("skill", ["b"])
    made.hold("main", [])
    assert made.names() == {"b"}
    made.hold("skill", [])
    assert log == ["+a main", "+b main", "-a main", "-b skill"]
    assert "b" not in made
    assert made.holders() == ()


def test_a_variable_that_a_holder_keeps_does_not_leave_and_enter_again() -> None:
    made, log = declarations()
    made.hold("main", ["a", "b"])
    made.hold("main", (name for name in ("b", "c", "b")))
    assert log == ["+a main", "+b main", "+c main", "-a main"]
    assert made.of("main") == ("b", "c")


def variable_lists() -> Iterator[st.SearchStrategy[list[str]]]:
    yield st.lists(st.sampled_from("abcd"), max_size=4)


@given(st.lists(st.tuples(st.sampled_from("xyz"), *variable_lists()), max_size=20))
def test_the_declared_variables_are_the_union_over_all_holders(steps: list[tuple[str, list[str]]]) -> None:
    made, log = declarations()
    held: dict[str, set[str]] = {}
    for holder, names in steps:
        made.hold(holder, names)
        held[holder] = set(names)
        assert made.names() == set().union(*held.values())
        entered = {line.split()[0][1:] for line in log}
        assert all(
            sum(line[1] == name and (1 if line[0] == "+" else -1) for line in log) == (name in made) for name in entered
        )
