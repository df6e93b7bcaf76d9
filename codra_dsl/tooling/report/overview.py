"""A condensed form of graphs that are too large for a picture: one box for each use of a template and for each file."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable, Mapping

from codra_dsl.language.frozen import dataclass
from codra_dsl.tooling.report.graphs import Element, Graph


@dataclass(frozen=True, slots=True, kw_only=True)
class Box:
    """Elements that are drawn as one box.

    Attributes:
        spec: the spec of the elements.
        element_count: the number of elements.
    """

    spec: str
    label: str
    element_count: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Overview:
    """A graph of boxes.

    Attributes:
        link_counts: a mapping from two boxes to the number of links between them. A key has the number of the needed
            box, then the number of the box that needs it.
    """

    specs: tuple[str, ...]
    boxes: tuple[Box, ...]
    link_counts: Mapping[tuple[int, int], int]


def overview(graph: Graph) -> Overview:
    """Return a graph condensed to a box for each use of a template and for each file.

    If this gives only one box, each observer has a box instead, and so has each element without an observer.
    """
    if len({_module_key(element) for element in graph.elements}) > 1:
        return _condense(graph, _module_key)
    return _condense(graph, _observer_key)


_Key = tuple[str, str]


def _module_key(element: Element) -> _Key:
    return element.spec, element.group


def _observer_key(element: Element) -> _Key:
    return element.spec, (element.observer or element.id).rpartition("/")[2]


def _condense(graph: Graph, key_of: Callable[[Element], _Key]) -> Overview:
    element_counts = Counter(map(key_of, graph.elements))
    number_by_key = {key: number for number, key in enumerate(element_counts)}
    box_by_element = {element.id: number_by_key[key_of(element)] for element in graph.elements}
    link_counts = Counter(
        (box_by_element[need], box_by_element[user]) for need, user in (link.flow for link in graph.links)
    )
    return Overview(
        specs=graph.specs,
        boxes=tuple(
            Box(spec=spec, label=label, element_count=count) for (spec, label), count in element_counts.items()
        ),
        link_counts={ends: count for ends, count in link_counts.items() if ends[0] != ends[1]},
    )
