"""Graphs of others as networkx's MultiDiGraph, and as GraphML for the tools that draw and measure graphs.

A node of networkx is the name of ours, an edge's key its label, and each attribute stands under its own name as plain
Python. What has no place there stands under `dsr`: numbers of nodes, codes of types, and what else a file said.
"""

from __future__ import annotations

import io
import json
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path
from typing import Any, NamedTuple, cast
from xml.etree.ElementTree import ParseError

import networkx

from codra_dsl.runtime.knowledge.exchange import DsrEdge, DsrGraph, DsrNode, DsrValue, ExchangeError
from codra_dsl.runtime.knowledge.exchange.document import MOST_NUMBER, encode_value
from codra_dsl.runtime.knowledge.exchange.dsr_json import check_json, read_text, replace_file

__all__ = ["from_networkx", "graphml_text", "parse_graphml", "read_graphml", "to_networkx", "write_graphml"]

TYPE = "type"
DSR = "dsr"
LABEL = "label"
_OURS = (TYPE, DSR)
_UNTYPED = "node"
_QUOTED = "json"
"""Where GraphML tells which attributes are written as JSON, since XML or networkx would lose what they are."""

_SAFE = re.compile(r"[\t\n\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]+")
"""What XML can write, and gives back as it was."""

_BROKEN = (ParseError, networkx.NetworkXError, LookupError, TypeError, ValueError, AttributeError, Warning)
"""What networkx raises for files that are none."""


class _Beside(NamedTuple):
    """What stands under `dsr`."""

    codes: Mapping[str, int]
    extras: Mapping[str, Mapping[str, object]]
    extra: Mapping[str, object]
    number: int | None = None


def to_networkx(graph: DsrGraph) -> networkx.MultiDiGraph[str]:
    """Return a graph as networkx has it. `from_networkx` gives back the same."""
    made: networkx.MultiDiGraph[str] = networkx.MultiDiGraph()
    made.graph[DSR] = {"extra": dict(graph.extra), "model_extra": dict(graph.model_extra)}
    names = {node.number: node.name for node in graph.nodes}
    for node in graph.nodes:
        beside = {**_beside(node.attributes, node.extra), "number": node.number}
        made.add_node(node.name, **{TYPE: node.type, **_flat(node.attributes), DSR: beside})
    for edge in graph.edges:
        data = {**_flat(edge.attributes), DSR: _beside(edge.attributes, edge.extra)}
        made.add_edge(names[edge.origin], names[edge.target], key=edge.label)
        made.edges[names[edge.origin], names[edge.target], edge.label].update(data)
    return made


def from_networkx(given: networkx.Graph[Any]) -> DsrGraph:
    """Return what a directed graph of networkx tells, ours or anyone's.

    Nodes without a number get one, those without a type are of type `node`, and an edge's label is its key, or in a
    graph without keys its attribute `label`. Values get the code of their type, or keep the one that they came with.

    Raises:
        ExchangeError: if it is not directed, or holds a value for which DSR has no type.
    """
    if not given.is_directed():
        raise ExchangeError("the graph has no directions: make it one with to_directed()")
    besides = {name: _beside_of(data, f"node {name!r}") for name, data in given.nodes(data=True)}
    numbers = _numbers(besides)
    nodes = [
        DsrNode(
            number=numbers[name],
            name=str(name),
            type=str(data.get(TYPE) or _UNTYPED),
            attributes=dict(_coded(data, besides[name], f"node {name!r}")),
            extra=besides[name].extra,
        )
        for name, data in given.nodes(data=True)
    ]
    if len({node.name for node in nodes}) < len(nodes):
        raise ExchangeError("two nodes have one name as text: names tell nodes apart")
    if not all(node.name for node in nodes):
        raise ExchangeError("a node has no name: give it a text that is not empty")
    extras = _mapping(given.graph.get(DSR, {}), "the graph")
    return DsrGraph(
        nodes=tuple(nodes),
        edges=tuple(_edges(given, numbers)),
        extra=_mapping(extras.get("extra", {}), "the graph"),
        model_extra=_mapping(extras.get("model_extra", {}), "the graph"),
    )


def write_graphml(path: Path | str, graph: DsrGraph) -> None:
    """Write a graph as a GraphML file, as a whole or not at all.

    Raises:
        ExchangeError: if it holds a name that XML cannot write.
    """
    replace_file(Path(path), graphml_text(graph))


def read_graphml(path: Path | str) -> DsrGraph:
    """Return the graph of a GraphML file, ours or anyone's.

    Raises:
        ExchangeError: if the file cannot be read, or is none.
    """
    return parse_graphml(read_text(Path(path)), str(path))


def graphml_text(graph: DsrGraph) -> str:
    """Return a graph as GraphML. Numbers, texts and truth values are plain, all else is written as JSON in a text.

    Raises:
        ExchangeError: if it holds a name that XML cannot write.
    """
    made, quoted = to_networkx(graph), cast("networkx.MultiDiGraph[str]", networkx.MultiDiGraph())
    quoted.graph.update(_xml_of(made.graph, "the graph"))
    for name, data in made.nodes(data=True):
        quoted.add_node(_word(name), **_xml_of(data, f"node {name!r}"))
    for at, (origin, target, label, data) in enumerate(made.edges(keys=True, data=True)):
        found = {_beside_label(key): value for key, value in data.items()}
        quoted.add_edge(origin, target, key=f"e{at}")  # GraphML wants each identifier once in a file
        quoted.edges[origin, target, f"e{at}"].update(_xml_of(found, f"edge {origin} -{label}-> {target}"))
        quoted.edges[origin, target, f"e{at}"][LABEL] = _word(label)
    written = io.BytesIO()
    networkx.write_graphml_xml(quoted, written, edge_id_from_attribute=None)
    return written.getvalue().decode("utf-8")


def parse_graphml(text: str, source: str = "<text>") -> DsrGraph:
    """Return the graph of GraphML.

    Args:
        text: of the file.
        source: what messages call it.

    Raises:
        ExchangeError: if it is none.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ExchangeError(
            f"{source}: it declares a document type: take the declaration away, nothing in it is needed"
        )
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # what networkx only guesses at would be lost
            read = networkx.read_graphml(io.BytesIO(text.encode("utf-8", "replace")), force_multigraph=True)
        for data in (
            read.graph,
            *(data for _, data in read.nodes(data=True)),
            *(each[2] for each in read.edges.data()),
        ):
            _unquote(data)
        return from_networkx(_labelled(read))
    except ParseError as error:
        line, column = error.position
        raise ExchangeError(f"{source}:{line}:{column + 1}: this is no XML: {error.msg.split(':')[0]}") from None
    except ExchangeError as error:
        raise ExchangeError(f"{source}: {error}") from None
    except _BROKEN as error:
        raise ExchangeError(f"{source}: this is no GraphML: {error}") from None


# networkx


def _flat(attributes: Mapping[str, DsrValue]) -> dict[str, object]:
    return {_renamed(name): value.value for name, value in attributes.items()}


def _renamed(name: str) -> str:
    """Return a name that is none of ours: `type` becomes `type_`, and `type_` becomes `type__`."""
    return f"{name}_" if name.rstrip("_") in _OURS else name


def _beside(attributes: Mapping[str, DsrValue], extra: Mapping[str, object]) -> dict[str, object]:
    codes = {name: int(value.code) for name, value in attributes.items()}
    extras = {name: dict(value.extra) for name, value in attributes.items() if value.extra}
    return {"codes": codes, "extras": extras, "extra": dict(extra)}


def _beside_of(data: Mapping[str, object], subject: str) -> _Beside:
    told = _mapping(data.get(DSR, {}), subject)
    codes, extras, extra = (_mapping(told.get(key, {}), subject) for key in ("codes", "extras", "extra"))
    number = told.get("number")
    is_number = isinstance(number, int) and not isinstance(number, bool) and 0 <= number <= MOST_NUMBER
    if not (number is None or is_number) or not all(type(code) is int for code in codes.values()):
        raise ExchangeError(f"{subject}: {DSR!r} holds no number and codes of ours: take it away")
    for name, each in extras.items():
        _mapping(each, f"{subject}.{name}")
    return _Beside(
        cast("Mapping[str, int]", codes),
        cast("Mapping[str, Mapping[str, object]]", extras),
        extra,
        cast("int | None", number),
    )


def _numbers(besides: Mapping[Any, _Beside]) -> dict[Any, int]:
    given = [each.number for each in besides.values() if each.number is not None]
    if len(set(given)) < len(given):
        raise ExchangeError("two nodes have one number: take it away from one, under 'dsr'")
    taken = set(given)
    free = (number for number in range(1, MOST_NUMBER) if number not in taken)
    return {name: next(free) if each.number is None else each.number for name, each in besides.items()}


def _coded(data: Mapping[str, object], beside: _Beside, subject: str, *ours: str) -> Iterator[tuple[str, DsrValue]]:
    for key, value in data.items():
        if key in _OURS or key in ours:
            continue
        name = key[:-1] if isinstance(key, str) and key.rstrip("_") in _OURS else str(key)
        try:
            yield name, _value(value, beside.codes.get(name), beside.extras.get(name))
        except (ValueError, OverflowError) as error:
            raise ExchangeError(f"{subject}.{name}: {error}") from None


def _value(value: object, code: int | None, extra: Mapping[str, object] | None) -> DsrValue:
    return encode_value(value, code, extra)


def _edges(given: networkx.Graph[Any], numbers: Mapping[Any, int]) -> Iterator[DsrEdge]:
    seen: set[tuple[int, str, int]] = set()
    for origin, target, key, data in _keyed(given):
        label = key if isinstance(key, str) and key else str(data.get(LABEL) or "edge")
        subject = f"edge {origin} -{label}-> {target}"
        beside = _beside_of(data, subject)
        own = () if label == key else (LABEL,)
        edge = DsrEdge(
            origin=numbers[origin],
            label=label,
            target=numbers[target],
            attributes=dict(_coded(data, beside, subject, *own)),
            extra=beside.extra,
        )
        if edge.key in seen:
            raise ExchangeError(f"{subject}: there are two: give them keys that are their labels")
        seen.add(edge.key)
        yield edge


def _keyed(given: networkx.Graph[Any]) -> Iterator[tuple[Any, Any, object, dict[str, object]]]:
    if isinstance(given, networkx.MultiDiGraph):
        yield from given.edges(keys=True, data=True)
    else:
        for origin, target, data in given.edges(data=True):
            yield origin, target, None, data


def _mapping(given: object, subject: str) -> Mapping[str, object]:
    if isinstance(given, dict) and all(isinstance(key, str) for key in given):
        return given
    raise ExchangeError(f"{subject}: {DSR!r} holds what is none of ours: take it away")


# GraphML


def _beside_label(name: str) -> str:
    return f"{name}_" if name.rstrip("_") == LABEL else name


def _labelled(read: networkx.Graph[Any]) -> networkx.Graph[Any]:
    """Return a graph that was read from GraphML with its labels as keys, where edges have one."""
    if not read.is_directed():
        return read
    made: networkx.MultiDiGraph[Any] = networkx.MultiDiGraph()
    made.graph.update(read.graph)
    made.add_nodes_from(read.nodes(data=True))
    for origin, target, key, data in _keyed(read):
        label = str(data.pop(LABEL, None) or key)
        if made.has_edge(origin, target, label):
            raise ExchangeError(f"edge {origin} -{label}-> {target}: there are two: between two nodes labels differ")
        is_ours = DSR in data
        made.add_edge(origin, target, key=label)
        made.edges[origin, target, label].update(
            {(key[:-1] if is_ours and key.rstrip("_") == LABEL else key): value for key, value in data.items()}
        )
    return made


def _xml_of(data: Mapping[str, object], subject: str) -> dict[str, object]:
    """Return what XML can hold: plain values as they are, and others as JSON, with the names of those."""
    found: dict[str, object] = {}
    quoted: dict[str, str] = {}
    for key, value in data.items():
        if _is_plain(value):
            found[_word(key)] = value
        else:
            kind, spelt = _spelt(value)
            check_json(spelt, subject)
            found[_word(key)], quoted[key] = json.dumps(spelt), kind
    if _QUOTED in data:
        raise ExchangeError(f"{subject}.{_QUOTED}: GraphML needs this name for itself: DSR's JSON can hold it")
    return {**found, _QUOTED: json.dumps(quoted)} if quoted else found


def _spelt(value: object) -> tuple[str, object]:
    kinds: Mapping[type, str] = {bytes: "bytes", tuple: "tuple", float: "float"}
    kind = kinds.get(type(value), "")
    if kind == "tuple":
        return kind, [repr(each) if isinstance(each, float) else each for each in cast("tuple[object, ...]", value)]
    return kind, list(value) if isinstance(value, bytes) else repr(value) if kind == "float" else value


_UNSPELT: Mapping[str, Callable[[Any], object]] = {
    "": lambda value: value,
    "bytes": bytes,
    "float": float,
    "tuple": lambda value: tuple(float(each) if isinstance(each, str) else each for each in value),
}


def _is_plain(value: object) -> bool:
    if isinstance(value, str):
        return _SAFE.fullmatch(value) is not None
    return isinstance(value, (bool, int)) or (isinstance(value, float) and value == value)


def _word(name: str) -> str:
    if _SAFE.fullmatch(name) is None:
        raise ExchangeError(f"the name {name!r:.60} cannot be written in XML: DSR's JSON can hold it")
    return name


def _unquote(data: dict[str, Any]) -> None:
    quoted = data.pop(_QUOTED, None)
    kinds = json.loads(quoted) if isinstance(quoted, str) else {}
    for key, kind in kinds.items():
        data[key] = _UNSPELT[kind](json.loads(data[key]))
