"""The functions of a graph's page, run by a JavaScript engine without a document."""

from __future__ import annotations

from itertools import combinations, pairwise
from pathlib import Path
from typing import Any

import dukpy
import pytest
from hypothesis import given
from hypothesis import strategies as st

import codra_dsl.tooling.report

SCRIPT = Path(codra_dsl.tooling.report.__file__).parent / "viewer/graph.js"
ENDLESS = 99_999
Edge = tuple[int, int, str]


class Viewer:
    """The functions of the page's script."""

    def __init__(self) -> None:
        self._engine = dukpy.JSInterpreter()
        self._engine.evaljs(SCRIPT.read_text("utf-8") + "\n0")

    def value(self, expression: str, **names: object) -> Any:
        """Return the value of an expression in which names refer to values."""
        bound = "".join(f"const {name} = dukpy['{name}'];" for name in names)
        return self._engine.evaljs(f"(() => {{ {bound} return {expression}; }})()", **names)


@pytest.fixture(scope="module")
def viewer() -> Viewer:
    return Viewer()


def edges_of(count: int, *, acyclic: bool = False) -> st.SearchStrategy[list[Edge]]:
    numbers = st.integers(0, count - 1)
    ends = st.tuples(numbers, numbers).filter(lambda both: both[0] < both[1] if acyclic else True)
    return st.lists(ends.map(lambda both: (*both, "requires")), max_size=2 * count, unique=True)


SIZES = st.lists(st.tuples(st.integers(40, 200), st.integers(27, 42)), min_size=2, max_size=24)


# The needs and dependents of a node


@given(edges=edges_of(12), start=st.integers(0, 11), steps=st.sampled_from([0, 1, 2, 3, ENDLESS]))
def test_the_needs_of_a_node_are_those_within_a_number_of_edges(
    viewer: Viewer, edges: list[Edge], start: int, steps: int
) -> None:
    expected, edge = {start}, {start}
    for _ in range(min(steps, 12)):
        edge = {need for need, user, _ in edges if user in edge} - expected
        expected |= edge

    reached = viewer.value(
        "[...reach([start], neighboursOf(12, edges).needs, steps)]", edges=edges, start=start, steps=steps
    )

    assert set(reached) == expected
    assert len(reached) == len(expected)


@given(edges=edges_of(12))
def test_dependents_are_the_inverse_of_needs(viewer: Viewer, edges: list[Edge]) -> None:
    both = viewer.value("neighboursOf(12, edges)", edges=edges)

    assert sorted(
        (need, user, number) for user, links in enumerate(both["needs"]) for need, _, number in links
    ) == sorted((need, user, number) for need, links in enumerate(both["neededBy"]) for user, _, number in links)


# Layout


def laid_out(viewer: Viewer, sizes: list[tuple[int, int]], edges: list[Edge]) -> Any:
    items = [{"width": width, "height": height} for width, height in sizes]
    return viewer.value("layOut(items, edges)", items=items, edges=edges)


def overlapping(sizes: list[tuple[int, int]], at: list[dict[str, float]]) -> list[tuple[int, int]]:
    return [
        (one, other)
        for one, other in combinations(range(len(sizes)), 2)
        if abs(at[one]["x"] - at[other]["x"]) < (sizes[one][0] + sizes[other][0]) / 2 - 1e-6
        and abs(at[one]["y"] - at[other]["y"]) < (sizes[one][1] + sizes[other][1]) / 2 - 1e-6
    ]


@given(sizes=SIZES, data=st.data())
def test_nodes_do_not_overlap(viewer: Viewer, sizes: list[tuple[int, int]], data: st.DataObject) -> None:
    edges = data.draw(edges_of(len(sizes)))

    assert overlapping(sizes, laid_out(viewer, sizes, edges)["at"]) == []


@given(sizes=SIZES, data=st.data())
def test_a_needed_node_is_left_of_those_that_need_it(
    viewer: Viewer, sizes: list[tuple[int, int]], data: st.DataObject
) -> None:
    edges = data.draw(edges_of(len(sizes), acyclic=True))

    made = laid_out(viewer, sizes, edges)

    for (need, user, _), way in zip(edges, made["ways"], strict=True):
        stops = [made["at"][need]["x"] + sizes[need][0] / 2, *(bend["x"] for bend in way)]
        stops.append(made["at"][user]["x"] - sizes[user][0] / 2)
        assert all(before < after for before, after in pairwise(stops))


@pytest.mark.parametrize("count", [1, 20, 21, 300])
def test_a_long_column_is_split_into_several_that_do_not_overlap(viewer: Viewer, count: int) -> None:
    sizes = [(100, 42 if number % 2 else 27) for number in range(count + 1)]

    at = laid_out(viewer, sizes, [(number, count, "requires") for number in range(count)])["at"]

    assert overlapping(sizes, at) == []
    assert max(position["y"] for position in at) - min(position["y"] for position in at) <= 20 * (42 + 14)


def test_an_empty_graph_has_a_layout(viewer: Viewer) -> None:
    assert laid_out(viewer, [], []) == {"at": [], "ways": []}


# The overview


@given(edges=edges_of(12), groups=st.lists(st.sampled_from("abc"), min_size=12, max_size=12))
def test_two_boxes_with_edges_in_both_directions_have_one_link_with_two_heads(
    viewer: Viewer, edges: list[Edge], groups: list[str]
) -> None:
    groups[0], groups[1] = "a", "b"
    boxes = [
        {"label": label, "members": [number for number, group in enumerate(groups) if group == label]}
        for label in sorted(set(groups))
    ]
    ways = {(groups[need], groups[user]) for need, user, _ in edges if groups[need] != groups[user]}

    links = viewer.value("linksBetween(boxes, edges)", boxes=boxes, edges=edges)

    named = {(boxes[one]["label"], boxes[other]["label"]): kind for one, other, kind in links}
    assert len(named) == len(links)
    assert {frozenset(ends) for ends in named} == {frozenset(ends) for ends in ways}
    assert {frozenset(ends) for ends, kind in named.items() if kind == "several both"} == {
        frozenset(ends) for ends in ways if ends[::-1] in ways
    }


# Search


def node(label: str, **properties: object) -> dict[str, object]:
    defaults: dict[str, object] = {"name": label, "id": f"lab/context/{label}", "place": "specs/lab.yaml:4"}
    return {"label": label, "description": "", "facts": {}, **defaults, **properties}


NODES = [
    node("lid_open", description="of the Centrifuge"),
    node("open_door"),
    node("door_open"),
    node("look", facts={"Calls": "robot.doors:look"}),
]


@pytest.mark.parametrize(
    ("asked", "expected"),
    [
        ("open", [1, 0, 2]),
        ("OPEN door", [1, 2]),
        ("centrifuge", [0]),
        ("robot.doors", [3]),
        ("lab.yaml:4", [0, 1, 2, 3]),
        ("door  window", []),
        ("", []),
        ("  ", []),
    ],
)
def test_a_search_finds_nodes_with_all_words_and_lists_labels_first(
    viewer: Viewer, asked: str, expected: list[int]
) -> None:
    assert viewer.value("matchingNodes(nodes, query)", nodes=NODES, query=asked) == expected
