"""Dependency graphs over names, compared with networkx's own enumeration on small graphs."""

from __future__ import annotations

import networkx as nx
from hypothesis import given
from hypothesis import strategies as st

from codra_dsl.language.graph import closure, needs_first, shortest_cycle, strong_components

NAMES = "abcdefg"
GRAPHS = st.dictionaries(st.sampled_from(NAMES), st.lists(st.sampled_from(NAMES), unique=True, max_size=4))


def directed(needs: dict[str, list[str]]) -> nx.DiGraph[str]:
    return nx.DiGraph([(name, need) for name, wanted in needs.items() for need in wanted])


@given(GRAPHS)
def test_the_shortest_cycle_is_a_cycle_and_no_other_is_shorter(needs: dict[str, list[str]]) -> None:
    cycles = [len(cycle) for cycle in nx.simple_cycles(directed(needs))]

    path = shortest_cycle(needs)

    assert len(path) == min(cycles, default=0)
    assert all(need in needs[name] for name, need in zip(path, path[1:] + path[:1], strict=True))
    assert path == () or path[0] == min(path)


@given(GRAPHS, st.lists(st.sampled_from(NAMES), max_size=2))
def test_a_closure_contains_the_reachable_names(needs: dict[str, list[str]], start: list[str]) -> None:
    graph = directed(needs)
    graph.add_nodes_from(start)
    expected = set(start).union(*(nx.descendants(graph, name) for name in start))

    reached = closure(needs, start)

    assert set(reached) == expected
    assert len(reached) == len(expected)


@given(GRAPHS, st.sampled_from(NAMES))
def test_needed_names_come_first_unless_they_need_each_other(needs: dict[str, list[str]], start: str) -> None:
    graph = directed(needs)
    graph.add_node(start)

    ordered = needs_first(needs, start)

    assert sorted(ordered) == sorted(closure(needs, [start]))
    for position, name in enumerate(ordered):
        later = set(ordered[position + 1 :]) & set(needs.get(name, ()))
        assert all(name in nx.descendants(graph, need) for need in later)


@given(GRAPHS)
def test_mutually_dependent_names_form_a_component(needs: dict[str, list[str]]) -> None:
    graph = directed(needs)
    cyclic = {name for cycle in nx.simple_cycles(graph) for name in cycle}

    components = strong_components(needs)

    assert {name for component in components for name in component} == cyclic
    for component in components:
        for name in component:
            assert set(component) - {name} <= nx.descendants(graph, name)


def test_a_closure_follows_the_order_in_which_names_are_needed() -> None:
    assert closure({"a": ["c", "b"], "c": ["d"]}, ["a"]) == ("a", "c", "d", "b")


def test_a_cycle_begins_with_its_least_name() -> None:
    assert shortest_cycle({"b": ["c"], "c": ["a"], "a": ["b"]}) == ("a", "b", "c")


def test_a_name_that_needs_itself_is_the_shortest_cycle() -> None:
    assert shortest_cycle({"a": ["b"], "b": ["a"], "z": ["z"]}) == ("z",)


def test_a_ring_of_ten_thousand_names_is_one_cycle() -> None:
    ring = {f"v{number}": [f"v{(number + 1) % 10_000}"] for number in range(10_000)}

    assert len(shortest_cycle(ring)) == 10_000
    assert len(closure(ring, ["v0"])) == 10_000
    assert len(strong_components(ring)) == 1


def test_answers_do_not_depend_on_the_order_of_the_mapping() -> None:
    needs = {"a": ["b", "c"], "b": ["a"], "c": ["a"]}

    assert shortest_cycle(dict(reversed(needs.items()))) == shortest_cycle(needs) == ("a", "b")
