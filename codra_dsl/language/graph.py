"""Dependency graphs over names: closure, strongly connected components, and shortest cycles as paths.

A graph is a mapping from each name to the names that it needs, in order. Every result depends only on the names and on
that order, never on hashes. The functions do not depend on the meaning of the names. They do not recurse, so that a
chain of names may be as long as memory allows.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import networkx as nx

Needs = Mapping[str, Sequence[str]]

MAX_VISITS = 200_000
"""The number of visited edges after which `shortest_cycle` returns the shortest cycle that it has found so far."""
SHORTEST_LENGTH = 2
"""The smallest possible length of a cycle of several names."""


def closure(needs: Needs, start: Iterable[str]) -> tuple[str, ...]:
    """Return the names in `start` and all names that they need, directly or indirectly.

    The names are listed depth first, in the order of `start` and `needs`.
    """
    reached_names: dict[str, None] = {}
    open_names = list(start)[::-1]
    while open_names:
        name = open_names.pop()
        if name not in reached_names:
            reached_names[name] = None
            open_names.extend(reversed(needs.get(name, ())))
    return tuple(reached_names)


def needs_first(needs: Needs, name: str) -> tuple[str, ...]:
    """Return a name and all names that it needs, each after the names that it needs, unless they need each other."""
    names: dict[str, None] = {}
    reached_names: set[str] = set()
    open_names = [name]
    while open_names:
        open_name = open_names[-1]
        if open_name in reached_names:
            names[open_names.pop()] = None
        else:
            reached_names.add(open_name)
            open_names.extend(need for need in needs.get(open_name, ()) if need not in reached_names)
    return tuple(names)


def strong_components(needs: Needs) -> tuple[tuple[str, ...], ...]:
    """Return the groups of names that need each other. Each group is sorted; groups are ordered by their first name.

    Names that are on no cycle are left out. A name that needs itself is a group even if it is alone.
    """
    if not needs:
        return ()
    import networkx as nx  # noqa: PLC0415  slow to import; a spec without feedback never needs it

    graph = _directed(needs)
    components = (sorted(names) for names in nx.strongly_connected_components(graph))
    return tuple(sorted(tuple(names) for names in components if len(names) > 1 or graph.has_edge(names[0], names[0])))


def shortest_cycle(needs: Needs) -> tuple[str, ...]:
    """Return a shortest cycle as a path, or () if there is no cycle. The last name of the path needs the first name.

    Among cycles of the same length, the function returns the cycle that is reached first from the least name. The path
    begins with its least name. On graphs with very many cycles, MAX_VISITS bounds the search.
    """
    self_needing_name = min((name for name, needed_names in needs.items() if name in needed_names), default=None)
    if self_needing_name is not None:
        return (self_needing_name,)
    graph = _directed(needs)
    budget = MAX_VISITS
    shortest: tuple[str, ...] = ()
    pending_parts = _cyclic_parts(graph)
    while pending_parts and budget > 0 and len(shortest) != SHORTEST_LENGTH:
        part = pending_parts.pop(0)
        start = min(part)
        path, visits = _cycle_through(start, part, shorter_than=len(shortest))
        shortest = path or shortest
        budget -= visits + part.number_of_edges()
        part.remove_node(start)  # no other cycle through `start` is shorter than `shortest`
        pending_parts.extend(_cyclic_parts(part))
    least_index = shortest.index(min(shortest)) if shortest else 0
    return shortest[least_index:] + shortest[:least_index]


def cycle_through(needs: Needs, name: str) -> tuple[str, ...]:
    """Return a shortest cycle through a name as a path that begins with this name, or () if the name is on no cycle."""
    if name not in closure(needs, needs.get(name, ())):
        return ()
    return _cycle_through(name, _directed(needs), shorter_than=0)[0]


def _directed(needs: Needs) -> nx.DiGraph[str]:
    """Return the graph with an edge from each name to each name that it needs."""
    import networkx as nx  # noqa: PLC0415

    graph: nx.DiGraph[str] = nx.DiGraph()
    graph.add_nodes_from(needs)
    graph.add_edges_from((name, need) for name, needed_names in needs.items() for need in needed_names)
    return graph


def _cyclic_parts(graph: nx.DiGraph[str]) -> list[nx.DiGraph[str]]:
    """Return copies of the parts of `graph` that contain a cycle of several names, ordered by least name."""
    import networkx as nx  # noqa: PLC0415

    name_groups = (names for names in nx.strongly_connected_components(graph) if len(names) > 1)
    return [graph.subgraph(names).copy() for names in sorted(name_groups, key=min)]


def _cycle_through(start: str, graph: nx.DiGraph[str], *, shorter_than: int) -> tuple[tuple[str, ...], int]:
    """Return a shortest cycle through `start`, and the number of visited edges.

    The cycle must be shorter than `shorter_than`; 0 means that any length is allowed. If there is no such cycle, return
    () as the cycle.
    """
    came_from: dict[str, str] = {}
    layer, length, visits = [start], 1, 0
    while layer and (shorter_than == 0 or length < shorter_than):
        next_layer: list[str] = []
        for name in layer:
            for need in sorted(graph.successors(name)):
                visits += 1
                if need == start:
                    return tuple(_path_back(name, start, came_from))[::-1], visits
                if need not in came_from:
                    came_from[need] = name
                    next_layer.append(need)
        layer, length = next_layer, length + 1
    return (), visits


def _path_back(name: str, start: str, came_from: Mapping[str, str]) -> Iterator[str]:
    """Yield the names from `name` back to `start`."""
    while name != start:
        yield name
        name = came_from[name]
    yield start
