"""C_E(t) of the paper is the union of the variables that several holders declare."""

from __future__ import annotations

from collections.abc import Iterator

from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.runtime.values.declarations import Declarations


def declarations() -> tuple[Declarations, list[str]]:
    log: list[str] = []
    declared_variables = Declarations(
        lambda name, holder: log.append(f"+{name} {holder}"), lambda name, holder: log.append(f"-{name} {holder}")
    )
    return declared_variables, log


def test_a_variable_leaves_when_its_last_holder_removes_it() -> None:
    declared_variables, log = declarations()
    declared_variables.hold("main", ["a", "b"])
    declared_variables.hold("skill", ["b"])
    declared_variables.hold("main", [])
    assert declared_variables.names() == {"b"}
    declared_variables.hold("skill", [])
    assert log == ["+a main", "+b main", "-a main", "-b skill"]
    assert "b" not in declared_variables
    assert declared_variables.holders() == ()


def test_a_variable_that_a_holder_keeps_does_not_leave_and_enter_again() -> None:
    declared_variables, log = declarations()
    declared_variables.hold("main", ["a", "b"])
    declared_variables.hold("main", (name for name in ("b", "c", "b")))
    assert log == ["+a main", "+b main", "+c main", "-a main"]
    assert declared_variables.of("main") == ("b", "c")


def variable_lists() -> Iterator[st.SearchStrategy[list[str]]]:
    yield st.lists(st.sampled_from("abcd"), max_size=4)


@given(st.lists(st.tuples(st.sampled_from("xyz"), *variable_lists()), max_size=20))
def test_the_declared_variables_are_the_union_over_all_holders(steps: list[tuple[str, list[str]]]) -> None:
    declared_variables, log = declarations()
    names_of_holders: dict[str, set[str]] = {}
    for holder, names in steps:
        declared_variables.hold(holder, names)
        names_of_holders[holder] = set(names)
        assert declared_variables.names() == set().union(*names_of_holders.values())
        entered_names = {line.split()[0][1:] for line in log}
        assert all(
            sum(line[1] == name and (1 if line[0] == "+" else -1) for line in log) == (name in declared_variables)
            for name in entered_names
        )
