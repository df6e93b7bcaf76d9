"""Index of nodes by type, and of edges by their ends."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

from codra_dsl.runtime.knowledge.elements import Edge, EdgeKey, Node
from codra_dsl.runtime.values.persistent import PersistentMap

_MIN_ADDED = 1_000
"""The minimum number of additions before the index is checked for deleted entries."""


class GraphIndex:
    """Names and keys of all nodes and edges of a state, and possibly of others.

    States share one index. A reader skips the entries that its state does not contain: entries of later states, and of
    nodes and edges that were deleted or never committed. An insertion therefore adds an entry, and a deletion does
    nothing. Once most entries are obsolete, the next state gets an index of its own. Adding requires the turn of the
    graph; reading needs no lock.

    Attributes:
        added: the number of additions.
        compact_at: the number of additions at which the index is next checked for obsolete entries.
    """

    __slots__ = ("_into", "_of_type", "_out", "added", "compact_at")

    def __init__(self) -> None:
        """Create an empty index."""
        self._of_type: defaultdict[str, dict[str, None]] = defaultdict(dict)
        self._out: defaultdict[str, dict[EdgeKey, None]] = defaultdict(dict)
        self._into: defaultdict[str, dict[EdgeKey, None]] = defaultdict(dict)
        self.added = 0
        self.compact_at = _MIN_ADDED

    def add_node(self, name: str, type_name: str) -> None:
        """Add a node."""
        self._of_type[type_name][name] = None
        self.added += 1

    def add_edge(self, key: EdgeKey) -> None:
        """Add an edge."""
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

    def compacted(self, nodes: PersistentMap[str, Node], edges: PersistentMap[EdgeKey, Edge]) -> GraphIndex:
        """Return an index for a state of these nodes and edges: this one, unless most of its entries are obsolete."""
        if self.added <= 2 * (len(nodes) + len(edges)):
            self.compact_at = 2 * self.added
            return self
        index = GraphIndex()
        for node in nodes.values():
            index.add_node(node.name, node.type)
        for edge in edges.values():
            index.add_edge(edge.key)
        index.compact_at = 2 * index.added + _MIN_ADDED
        return index
