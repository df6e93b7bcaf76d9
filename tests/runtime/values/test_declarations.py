"""C_E(t) of the paper is the union of the variables that several holders declare."""

from __future__ import annotations

from collections.abc import Iterator

from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.runtime.values.declarations import Declarations


def create_declarations() -> tuple[Declarations, list[str]]:
    event_log: list[str] = []
    declarations = Declarations(
        lambda name, holder: event_log.append(f"+{name} {holder}"),
        lambda name, holder: event_log.append(f"-{name} {holder}"),
    )
    return declarations, event_log


def test_a_variable_leaves_when_its_last_holder_removes_it() -> None:
    declarations, event_log = create_declarations()
    declarations.declare_exactly("main", ["a", "b"])
    declarations.declare_exactly("skill", ["b"])
    declarations.declare_exactly("main", [])
    assert declarations.names() == {"b"}
    declarations.declare_exactly("skill", [])
    assert event_log == ["+a main", "+b main", "-a main", "-b skill"]
    assert "b" not in declarations
    assert declarations.holders() == ()


def test_a_variable_that_a_holder_keeps_does_not_leave_and_enter_again() -> None:
    declarations, event_log = create_declarations()
    declarations.declare_exactly("main", ["a", "b"])
    declarations.declare_exactly("main", (name for name in ("b", "c", "b")))
    assert event_log == ["+a main", "+b main", "+c main", "-a main"]
    assert declarations.names_of("main") == ("b", "c")


def variable_list_strategies() -> Iterator[st.SearchStrategy[list[str]]]:
    yield st.lists(st.sampled_from("abcd"), max_size=4)


@given(st.lists(st.tuples(st.sampled_from("xyz"), *variable_list_strategies()), max_size=20))
def test_the_declared_variables_are_the_union_over_all_holders(holds: list[tuple[str, list[str]]]) -> None:
    declarations, event_log = create_declarations()
    names_of_holders: dict[str, set[str]] = {}
    for holder, names in holds:
        declarations.declare_exactly(holder, names)
        names_of_holders[holder] = set(names)
        assert declarations.names() == set().union(*names_of_holders.values())
        entered_names = {event.split()[0][1:] for event in event_log}
        assert all(
            sum(event[1] == name and (1 if event[0] == "+" else -1) for event in event_log) == (name in declarations)
            for name in entered_names
        )
