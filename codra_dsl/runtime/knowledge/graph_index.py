"""Index of nodes by type, and of edges by their ends."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Iterable

from codra_dsl.runtime.knowledge.elements import Edge, EdgeKey, Node
from codra_dsl.runtime.values.persistent import PersistentMap

_MIN_ADDITIONS = 1_000
"""The minimum number of additions before the index is checked for deleted entries."""


class GraphIndex:
    """The names of all nodes and the keys of all edges of one state, and possibly names and keys of other states.

    States share one index. A reader skips the entries that its state does not contain: entries of later states, and of
    nodes and edges that were deleted or never committed. An insertion therefore adds an entry, and a deletion leaves
    the index unchanged. Once most entries are obsolete, the next state gets a new index. A thread may add entries only
    while it holds the graph's lock for writes; reading needs no lock.

    Attributes:
        addition_count: the number of added entries.
        compaction_threshold: the number of additions at which the index is next checked for obsolete entries.
    """

    __slots__ = ("_incoming_keys", "_names_by_type", "_outgoing_keys", "addition_count", "compaction_threshold")

    def __init__(self) -> None:
        """Create an empty index."""
        self._names_by_type: defaultdict[str, dict[str, None]] = defaultdict(dict)
        self._outgoing_keys: defaultdict[str, dict[EdgeKey, None]] = defaultdict(dict)
        self._incoming_keys: defaultdict[str, dict[EdgeKey, None]] = defaultdict(dict)
        self.addition_count = 0
        self.compaction_threshold = _MIN_ADDITIONS

    def add_node(self, name: str, type_name: str) -> None:
        """Add a node."""
        self._names_by_type[type_name][name] = None
        self.addition_count += 1

    def add_edge(self, key: EdgeKey) -> None:
        """Add an edge."""
        self._outgoing_keys[key[0]][key] = None
        self._incoming_keys[key[2]][key] = None
        self.addition_count += 1

    def names_of_type(self, type_name: str) -> Iterable[str]:
        """Return the names of the nodes of a type, and possibly names that the reader's state does not contain."""
        return tuple(self._names_by_type.get(type_name, ()))

    def outgoing_keys(self, name: str) -> Iterable[EdgeKey]:
        """Return the keys of the edges from a node, and possibly keys that the reader's state does not contain."""
        return tuple(self._outgoing_keys.get(name, ()))

    def incoming_keys(self, name: str) -> Iterable[EdgeKey]:
        """Return the keys of the edges to a node, and possibly keys that the reader's state does not contain."""
        return tuple(self._incoming_keys.get(name, ()))

    def compacted_index(self, nodes: PersistentMap[str, Node], edges: PersistentMap[EdgeKey, Edge]) -> GraphIndex:
        """Return an index for a state with these nodes and edges.

        If most entries of this index are obsolete, the result is a new index; otherwise it is this index.
        """
        if self.addition_count <= 2 * (len(nodes) + len(edges)):
            self.compaction_threshold = 2 * self.addition_count
            return self
        index = GraphIndex()
        for node in nodes.values():
            index.add_node(node.name, node.type)
        for edge in edges.values():
            index.add_edge(edge.key)
        index.compaction_threshold = 2 * index.addition_count + _MIN_ADDITIONS
        return index
