"""Where nodes and edges are found: by the type of a node, and by the ends of an edge."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

from codra_dsl.runtime.knowledge.elements import Edge, EdgeKey, Node
from codra_dsl.runtime.values.persistent import PersistentMap

_LEAST = 1_000
"""What is added at least until it is looked whether much of it is gone."""


class GraphIndex:
    """Names and keys of all that may be in a state. What is in the state is in here; not all that is here is there.

    States share one: what a later one has is passed over by whoever looks for an earlier one's, and so is what was
    deleted or never came to be. So to insert is to add here, and to delete is nothing. Once most of it is gone the next
    state has a directory of its own. Whoever adds holds the turn of the graph; looking needs no lock.

    Attributes:
        added: how often something was added.
        most: how often that may be until it is time to look what is gone.
    """

    __slots__ = ("_into", "_of_type", "_out", "added", "most")

    def __init__(self) -> None:
        """Know of nothing."""
        self._of_type: defaultdict[str, dict[str, None]] = defaultdict(dict)
        self._out: defaultdict[str, dict[EdgeKey, None]] = defaultdict(dict)
        self._into: defaultdict[str, dict[EdgeKey, None]] = defaultdict(dict)
        self.added = 0
        self.most = _LEAST

    def add_node(self, name: str, type_name: str) -> None:
        """Let a node be found."""
        self._of_type[type_name][name] = None
        self.added += 1

    def add_edge(self, key: EdgeKey) -> None:
        """Let an edge be found."""
        self._out[key[0]][key] = None
        self._into[key[2]][key] = None
        self.added += 1

    def of_type(self, type_name: str) -> Iterable[str]:
        """Return the names of nodes that may have a type."""
        return tuple(self._of_type.get(type_name, ()))

    def out(self, name: str) -> Iterable[EdgeKey]:
        """Return the keys of edges that may go out from a node."""
        return tuple(self._out.get(name, ()))

    def into(self, name: str) -> Iterable[EdgeKey]:
        """Return the keys of edges that may go to a node."""
        return tuple(self._into.get(name, ()))

    def renewed(self, nodes: PersistentMap[str, Node], edges: PersistentMap[EdgeKey, Edge]) -> GraphIndex:
        """Return a directory for a state of these: the same, unless most of it is gone."""
        if self.added <= 2 * (len(nodes) + len(edges)):
            self.most = 2 * self.added
            return self
        made = GraphIndex()
        for node in nodes.values():
            made.add_node(node.name, node.type)
        for edge in edges.values():
            made.add_edge(edge.key)
        made.most = 2 * made.added + _LEAST
        return made
