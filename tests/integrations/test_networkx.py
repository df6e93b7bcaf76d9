"""DSR graphs converted to networkx and GraphML, and graphs that users of networkx made."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import networkx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as some

from codra_dsl.integrations.networkx import (
    from_networkx,
    graphml_text,
    parse_graphml,
    read_graphml,
    to_networkx,
    write_graphml,
)
from codra_dsl.runtime.knowledge.exchange import (
    DsrEdge,
    DsrGraph,
    DsrNode,
    DsrValue,
    ExchangeError,
    dsr_text,
    parse_dsr,
    read_dsr,
)
from tests.runtime.knowledge.exchange.test_dsr_json import graphs, parts

EVERY_TYPE = Path(__file__).parents[1] / "data/dsr_every_type.json"


def test_the_file_with_every_type_is_converted_to_networkx_and_graphml_without_losses(tmp_path: Path) -> None:
    graph = read_dsr(EVERY_TYPE)
    assert from_networkx(to_networkx(graph)) == graph
    write_graphml(tmp_path / "shop.graphml", graph)
    assert dsr_text(read_graphml(tmp_path / "shop.graphml")) == dsr_text(graph)


def test_attributes_are_where_users_of_networkx_expect_them() -> None:
    made = to_networkx(read_dsr(EVERY_TYPE))
    assert isinstance(made, networkx.MultiDiGraph)
    assert made.nodes["every_type_ñ"]["type"] == "pallet_fork_probe"
    assert made.nodes["every_type_ñ"]["fork_stiction_index"] == 0.125
    assert networkx.get_node_attributes(made, "compressed_data") == {"every_type_ñ": b"\x00\x0a\x0d\x7f\x80\xff"}
    near = [(a, b) for a, b, label in made.edges(keys=True) if label == "close_to"]
    assert len(near) == 1
    assert made.edges[(*near[0], "close_to")]["distance_to_robot"] == 0.85


@settings(max_examples=40)
@given(graph=graphs())
def test_any_graph_is_converted_to_networkx_without_losses(graph: DsrGraph) -> None:
    assert parts(from_networkx(to_networkx(graph))) == parts(graph)


@settings(max_examples=40)
@given(graph=graphs())
def test_any_graph_is_converted_to_graphml_without_losses_or_its_names_are_refused(graph: DsrGraph) -> None:
    try:
        text = graphml_text(graph)
    except ExchangeError as error:
        message = str(error)
        assert "cannot be written in XML" in message or "this name is reserved" in message
    else:
        assert dsr_text(parse_graphml(text)) == dsr_text(graph)


def test_a_foreign_graph_gets_numbers_types_and_labels() -> None:
    given = networkx.MultiDiGraph()
    given.add_node("robot", type="robot", level=0.5, path=[1.0, 2.0], grid=np.array([1, 2]), count=np.int64(3))
    given.add_node(4)
    given.add_edge("robot", 4, key="near", label="kept")
    given.add_edge("robot", 4, label="sees", distance=2)
    given.add_edge(4, "robot")
    graph = from_networkx(given)
    robot, four = graph.nodes
    assert (robot.number, robot.type, four.number, four.name, four.type) == (1, "robot", 2, "4", "node")
    attributes = {name: (int(attribute.code), attribute.value) for name, attribute in robot.attributes.items()}
    assert attributes == {"level": (8, 0.5), "path": (3, (1.0, 2.0)), "grid": (9, (1, 2)), "count": (1, 3)}
    assert [edge.key for edge in graph.edges] == [(1, "near", 2), (1, "sees", 2), (2, "edge", 1)]
    assert graph.edges[0].attributes == {"label": DsrValue(code=0, value="kept")}
    assert parse_dsr(dsr_text(graph)) == graph
    assert [edge.label for edge in from_networkx(networkx.DiGraph([(1, 2)])).edges] == ["edge"]


def test_edges_in_graphml_have_unique_names_and_an_attribute_with_their_label() -> None:
    text = graphml_text(read_dsr(EVERY_TYPE))
    read = networkx.parse_graphml(text, force_multigraph=True)
    labels = sorted(label for _, _, label in read.edges(data="label"))
    assert labels == sorted(edge.label for edge in read_dsr(EVERY_TYPE).edges)
    assert len({key for _, _, key in read.edges(keys=True)}) == len(labels)
    named = {
        "label": DsrValue(code=0, value="a"),
        "label_": DsrValue(code=1, value=2),
        "json_": DsrValue(code=1, value=3),
    }
    graph = DsrGraph(
        nodes=(DsrNode(number=1, name="n", type="t"),),
        edges=(DsrEdge(origin=1, label="near", target=1, attributes=named),),
    )
    assert parse_graphml(graphml_text(graph)) == graph


def test_foreign_graphml_is_read_by_its_labels_or_else_its_identifiers() -> None:
    text = (
        '<graphml xmlns="http://graphml.graphdrawing.org/xmlns"><key id="d" for="edge" attr.name="label" '
        'attr.type="string"/><graph edgedefault="directed"><node id="a"/><node id="b"/>'
        '<edge id="7" source="a" target="b"><data key="d">near</data></edge><edge id="8" source="a" target="b"/>'
        "</graph></graphml>"
    )
    assert [edge.label for edge in parse_graphml(text).edges] == ["near", "8"]
    with pytest.raises(ExchangeError, match="f: edge a -near-> b: there are two such edges"):
        parse_graphml(text.replace('<edge id="8"', '<edge id="near"'), "f")


def test_a_value_that_was_changed_in_networkx_keeps_its_type_if_possible() -> None:
    values = {"a": DsrValue(code=2, value=1.5), "b": DsrValue(code=1, value=1), "c": DsrValue(code=7, value=1)}
    made = to_networkx(DsrGraph(nodes=(DsrNode(number=5, name="n", type="t", attributes=values),)))
    made.nodes["n"].update(a=2.5, b=2**40, c=-1)
    attributes = from_networkx(made).nodes[0].attributes
    assert {name: (int(attribute.code), attribute.value) for name, attribute in attributes.items()} == {
        "a": (2, 2.5),
        "b": (7, 2**40),
        "c": (1, -1),
    }


def digraph(*nodes: tuple[object, dict[str, Any]], edges: Any = ()) -> Any:
    graph: Any = networkx.MultiDiGraph()
    graph.add_nodes_from(nodes)
    graph.add_edges_from(edges)
    return graph


INVALID_GRAPHS = {
    "the graph is not directed: convert it": networkx.Graph([(1, 2)]),
    "node 'a'.pose: DSR has no type for object": digraph(("a", {"pose": object()})),
    "node 'a'.pose: DSR has no type for tuple": digraph(("a", {"pose": (1.0, "x")})),
    "two node names are equal when they are converted to text": digraph((1, {}), ("1", {})),
    "a node has no name": digraph(("a", {}), ("", {})),
    "two nodes have the same number": digraph(("a", {"dsr": {"number": 1}}), ("b", {"dsr": {"number": 1}})),
    "node 'a': 'dsr' does not hold a valid number and valid codes": digraph(("a", {"dsr": {"number": -1}})),
    "node 'a': 'dsr' holds unexpected contents": digraph(("a", {"dsr": 7})),
    "edge 1 -edge-> 2: there are two such edges: give them": digraph(edges=[(1, 2), (1, 2)]),
}


@pytest.mark.parametrize("message", INVALID_GRAPHS)
def test_a_graph_that_cannot_be_converted_is_refused_with_a_message(message: str) -> None:
    with pytest.raises(ExchangeError) as error_info:
        from_networkx(INVALID_GRAPHS[message])
    assert str(error_info.value).startswith(message)


BAD_XML = {
    "f:1:1: this is not XML: no element found": "",
    "f:2:3: this is not XML: mismatched tag": "<graphml>\n</x>",
    "f: the file declares a document type: remove": '<!DOCTYPE x [<!ENTITY a "b">]><graphml/>',
    "f: this is not GraphML": "<graphml/>",
    "f: the graph is not directed": '<graphml xmlns="http://graphml.graphdrawing.org/xmlns">'
    '<graph edgedefault="undirected"><node id="a"/></graph></graphml>',
    "f: this is not GraphML: could not convert": '<graphml xmlns="http://graphml.graphdrawing.org/xmlns">'
    '<key id="d" for="node" attr.name="x" attr.type="double"/>'
    '<graph edgedefault="directed"><node id="a"><data key="d">much</data></node></graph></graphml>',
    "f: this is not GraphML: unknown value 'foo'": '<graphml xmlns="http://graphml.graphdrawing.org/xmlns">'
    '<key id="d" for="node" attr.name="x" attr.type="foo"/><graph edgedefault="directed"/></graphml>',
    "f: there are several graphs": '<graphml xmlns="http://graphml.graphdrawing.org/xmlns">'
    '<graph edgedefault="directed"/><graph edgedefault="directed"><node id="a"/></graph></graphml>',
    "f: an element 'node' has no attribute 'id'": '<graphml xmlns="http://graphml.graphdrawing.org/xmlns">'
    '<graph edgedefault="directed"><node/></graph></graphml>',
    "f: this is not GraphML: maximum recursion depth": '<graphml xmlns="http://graphml.graphdrawing.org/xmlns">'
    '<key id="d" for="node" attr.name="json" attr.type="string"/>'
    f'<graph edgedefault="directed"><node id="a"><data key="d">{"[" * 100_000}</data></node></graph></graphml>',
}


@pytest.mark.parametrize("message", BAD_XML)
def test_text_that_is_not_graphml_is_refused_with_its_place(message: str) -> None:
    with pytest.raises(ExchangeError) as error_info:
        parse_graphml(BAD_XML[message], "f")
    assert str(error_info.value).startswith(message)


@settings(max_examples=40)
@given(data=some.data())
def test_damaged_graphml_is_read_or_refused_but_never_raises_another_exception(data: some.DataObject) -> None:
    values = {"x": DsrValue(code=3, value=(1.0, math.inf)), "y": DsrValue(code=0, value="")}
    nodes = tuple(DsrNode(number=index, name=f"n{index}", type="t", attributes=values) for index in range(2))
    text = graphml_text(DsrGraph(nodes=nodes, edges=(DsrEdge(origin=0, label="l", target=1, attributes=values),)))
    for _ in range(data.draw(some.integers(1, 3))):
        index = data.draw(some.integers(0, len(text) - 1))
        text = text[:index] + data.draw(some.text(max_size=3)) + text[index + data.draw(some.integers(0, 3)) :]
    try:
        parse_graphml(text, "f")
    except ExchangeError as error:
        message = str(error)
        assert message.startswith("f")


def test_a_node_with_an_empty_type_is_read_as_one_without_a_type_and_can_be_written() -> None:
    read = from_networkx(digraph(("a", {"type": ""})))
    assert [node.type for node in read.nodes] == ["node"]
    assert parse_graphml(graphml_text(read)) == read
