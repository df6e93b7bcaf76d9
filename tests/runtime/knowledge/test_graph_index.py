"""The index of a graph, which is made anew when most of its entries are obsolete."""

from __future__ import annotations

from codra_dsl.runtime.knowledge.elements import Edge, EdgeKey, Node
from codra_dsl.runtime.knowledge.graph_index import GraphIndex
from codra_dsl.runtime.values.persistent import PersistentMap


def test_an_index_of_which_most_edges_were_deleted_is_made_anew() -> None:
    nodes, edges = PersistentMap[str, Node](), PersistentMap[EdgeKey, Edge]()
    index = GraphIndex()
    for number in range(3):
        index.add_edge((f"a{number}", "close_to", "robot"))
    compacted = index.compacted_index(nodes, edges)

    assert list(index.incoming_keys("robot")) == [(f"a{number}", "close_to", "robot") for number in range(3)]
    assert list(compacted.incoming_keys("robot")) == []
