"""Fold a large graph: elements that belong together become one element, so that people can read the picture."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

from codra_dsl.generation.build_plan import NodeKind
from codra_dsl.tooling.report.findings import visible_text
from codra_dsl.tooling.report.graphs import Element, Graph, Link
from codra_dsl.tooling.report.looks import label_of, latency_text

MAX_SHOWN = 24
"""The largest number of elements that a picture shows without folding."""

_MAX_LINES = 8
"""The largest number of names in a folded element."""

_KIND_WORDS: Mapping[str, str] = {
    NodeKind.CONTEXT: "variable",
    NodeKind.PERCEPTION: "algorithm",
    NodeKind.TYPE: "type of nodes",
    NodeKind.EDGE: "type of edges",
}


class _Key(NamedTuple):
    """What elements have in common that are folded into one. Empty texts are of no account."""

    spec: str
    owner: str
    kind: str
    template: str = ""


_Pattern = Callable[[Element, str], str]
"""Returns a name with `*` for the parts in which repeated elements differ."""

_PATTERNS: tuple[_Pattern, ...] = (
    lambda _, name: name,
    lambda element, name: f"_{name}_".replace(f"_{element.use}_", "_*_")[1:-1] if element.use else name,
    lambda element, name: re.sub("[0-9]+", "*", _PATTERNS[1](element, name), count=1),
    lambda element, name: re.sub("[0-9]+", "*", _PATTERNS[1](element, name)),
)


def fold(graph: Graph, unfolded_ids: Collection[str] = ()) -> Graph:
    """Return the graph in its finest form with at most `MAX_SHOWN` elements.

    An observer takes in its algorithms and variables. Other elements become one element for each kind and owner: the
    node of variables, the phase of agents, or else the use of a template or the file. In a larger graph, repetitions
    become one element: first the uses of a template, then names that differ only in numbers. If this does not suffice,
    each use and each file becomes one element, or each kind, or each spec.

    Args:
        graph: the complete graph, or the selected part of it.
        unfolded_ids: elements to be shown one by one, together with the elements that would be folded with them.
    """
    if len(graph.elements) <= MAX_SHOWN:
        return graph
    fitting = (division for division in _divisions(graph.elements) if len(set(division[0].values())) <= MAX_SHOWN)
    coarsest = {element.id: _Key(element.spec, element.spec, "") for element in graph.elements}, _PATTERNS[0]
    keys, pattern = next(fitting, coarsest)
    unfolded_keys = {keys[element_id] for element_id in unfolded_ids}
    members_by_key: dict[_Key | str, list[Element]] = {}
    for element in graph.elements:
        key = keys[element.id]
        members_by_key.setdefault(element.id if key in unfolded_keys else key, []).append(element)
    boxes = {
        key: members[0] if isinstance(key, str) or len(members) == 1 else _box(key, tuple(members), pattern)
        for key, members in members_by_key.items()
    }
    box_ids = {member.id: boxes[key].id for key, members in members_by_key.items() for member in members}
    links = (Link(box_ids[link.source], box_ids[link.target], link.kind) for link in graph.links)
    links_between = dict.fromkeys(link for link in links if link.source != link.target)
    return replace(graph, elements=tuple(boxes.values()), links=tuple(links_between))


def _divisions(elements: Sequence[Element]) -> Iterator[tuple[Mapping[str, _Key], _Pattern]]:
    """Yield ways to divide elements, from fine to coarse, as a mapping from ids to keys."""
    observers = {element.id: element for element in elements if element.kind is NodeKind.OBSERVER}
    for pattern in _PATTERNS:
        yield (
            {element.id: _owner_key(element, observers.get(element.observer), pattern) for element in elements},
            pattern,
        )
    by_file = {element.id: _Key(element.spec, element.use or element.group, "") for element in elements}
    if len(set(by_file.values())) > len({element.spec for element in elements}):
        yield by_file, _PATTERNS[0]
    yield {element.id: _Key(element.spec, "", element.kind) for element in elements}, _PATTERNS[0]


def _owner_key(element: Element, observer: Element | None, pattern: _Pattern) -> _Key:
    if observer is not None:
        return _Key(element.spec, pattern(observer, observer.name), NodeKind.OBSERVER, observer.template)
    file = element.group if element.group != element.spec else ""
    owner = element.owner or (element.use if pattern is _PATTERNS[0] else element.template) or file
    return _Key(element.spec, pattern(element, owner), element.kind, element.template)


def _box(key: _Key, members: tuple[Element, ...], pattern: _Pattern) -> Element:
    """Return the element that represents several."""
    counts = Counter(member.kind for member in members)
    observer_count = counts[NodeKind.OBSERVER]
    if key.kind == NodeKind.OBSERVER and key.owner:
        label = f"{observer_count} \N{MULTIPLICATION SIGN} {key.owner}" if observer_count > 1 else key.owner
        lines = _names([member for member in members if member.kind is NodeKind.CONTEXT], pattern)
    elif key.kind:
        label = ": ".join(filter(None, (key.owner, _count_text(members[0].kind, len(members)))))
        lines = _names(members, pattern)
    else:
        label, lines = key.owner, [_count_text(kind, count) for kind, count in counts.items()]
    box_id = "/".join((key.spec, "folded", key.owner, key.kind, key.template))
    observer = box_id if any(member.observer for member in members) else ""
    return replace(
        members[0],
        id=box_id,
        name=label,
        label=label,
        observer=observer,
        description="",
        worst_case_s=None,
        members=members,
        lines=tuple(lines),
    )


def _names(elements: Sequence[Element], pattern: _Pattern) -> list[str]:
    """Return the names of elements, each once, with the longest of their worst cases; of many names only the first."""
    latencies: dict[str, Element] = {}
    for element in elements:
        name = label_of(element) if pattern is _PATTERNS[0] else visible_text(pattern(element, element.name))
        latencies[name] = max(latencies.get(name, element), element, key=lambda other: other.worst_case_s or 0)
    lines = [
        "\N{NO-BREAK SPACE}".join(filter(None, (name, latency_text(element)))) for name, element in latencies.items()
    ]
    if len(lines) > _MAX_LINES:
        lines = [*lines[: _MAX_LINES - 1], f"and {len(lines) - _MAX_LINES + 1} more"]
    return lines


def _count_text(kind: NodeKind, count: int) -> str:
    words = _KIND_WORDS.get(kind, kind.value)
    return f"{count} {words if count == 1 else re.sub('^[a-z]+', lambda noun: noun[0] + 's', words)}"
