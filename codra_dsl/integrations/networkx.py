"""DSR graphs as MultiDiGraph of networkx, and as GraphML for tools that draw and analyse graphs.

A node in networkx is the name of a DSR node, the key of an edge is its label, and attributes are plain Python values
under their own names. The attribute `dsr` holds the rest: numbers of nodes, codes of types, and additional contents
of files.
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
_RESERVED = (TYPE, DSR)
_DEFAULT_TYPE = "node"
_QUOTED = "json"
"""The GraphML attribute that lists attributes written as JSON, because XML or networkx would lose their types."""

_SAFE = re.compile(r"[\t\n\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]+")
"""The texts that XML can write and return unchanged."""

_BROKEN = (ParseError, networkx.NetworkXError, LookupError, TypeError, ValueError, AttributeError, Warning)
"""The exceptions of networkx for files that are not GraphML."""


class _Beside(NamedTuple):
    """The contents of the attribute `dsr`."""

    codes: Mapping[str, int]
    extras: Mapping[str, Mapping[str, object]]
    extra: Mapping[str, object]
    number: int | None = None


def to_networkx(graph: DsrGraph) -> networkx.MultiDiGraph[str]:
    """Return a graph as a graph of networkx. `from_networkx` converts it back without losses."""
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
    """Return the DSR graph of any directed graph of networkx.

    Nodes without a number get one. Nodes without a type have the type `node`. The label of an edge is its key, or its
    attribute `label` in a graph without keys. Values keep the code of their type if they have one, and get one if not.

    Raises:
        ExchangeError: if the graph is not directed, or contains a value without a DSR type.
    """
    if not given.is_directed():
        raise ExchangeError("the graph is not directed: convert it with to_directed()")
    besides = {name: _beside_of(data, f"node {name!r}") for name, data in given.nodes(data=True)}
    numbers = _numbers(besides)
    nodes = [
        DsrNode(
            number=numbers[name],
            name=str(name),
            type=str(data.get(TYPE) or _DEFAULT_TYPE),
            attributes=dict(_coded(data, besides[name], f"node {name!r}")),
            extra=besides[name].extra,
        )
        for name, data in given.nodes(data=True)
    ]
    if len({node.name for node in nodes}) < len(nodes):
        raise ExchangeError("two nodes have the same name as text: node names must be unique")
    if not all(node.name for node in nodes):
        raise ExchangeError("a node has no name: give it a non-empty text")
    extras = _mapping(given.graph.get(DSR, {}), "the graph")
    return DsrGraph(
        nodes=tuple(nodes),
        edges=tuple(_edges(given, numbers)),
        extra=_mapping(extras.get("extra", {}), "the graph"),
        model_extra=_mapping(extras.get("model_extra", {}), "the graph"),
    )


def write_graphml(path: Path | str, graph: DsrGraph) -> None:
    """Write a graph as a GraphML file, completely or not at all.

    Raises:
        ExchangeError: if it contains a name that XML cannot write.
    """
    replace_file(Path(path), graphml_text(graph))


def read_graphml(path: Path | str) -> DsrGraph:
    """Return the graph of any GraphML file.

    Raises:
        ExchangeError: if the file cannot be read, or is not GraphML.
    """
    return parse_graphml(read_text(Path(path)), str(path))


def graphml_text(graph: DsrGraph) -> str:
    """Return a graph as GraphML. Numbers, texts and booleans are plain; other values are written as JSON in a text.

    Raises:
        ExchangeError: if it contains a name that XML cannot write.
    """
    made, quoted = to_networkx(graph), cast("networkx.MultiDiGraph[str]", networkx.MultiDiGraph())
    quoted.graph.update(_xml_of(made.graph, "the graph"))
    for name, data in made.nodes(data=True):
        quoted.add_node(_word(name), **_xml_of(data, f"node {name!r}"))
    for at, (origin, target, label, data) in enumerate(made.edges(keys=True, data=True)):
        attributes = {_beside_label(key): value for key, value in data.items()}
        quoted.add_edge(origin, target, key=f"e{at}")  # identifiers are unique in a GraphML file
        quoted.edges[origin, target, f"e{at}"].update(_xml_of(attributes, f"edge {origin} -{label}-> {target}"))
        quoted.edges[origin, target, f"e{at}"][LABEL] = _word(label)
    written = io.BytesIO()
    networkx.write_graphml_xml(quoted, written, edge_id_from_attribute=None)
    return written.getvalue().decode("utf-8")


def parse_graphml(text: str, source: str = "<text>") -> DsrGraph:
    """Return the graph of GraphML.

    Args:
        text: the text of the file.
        source: the name of the file in messages.

    Raises:
        ExchangeError: if the text is not GraphML.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ExchangeError(f"{source}: it declares a document type: remove the declaration, it is not needed")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # networkx warns when it only guesses: then data would be lost
            read = networkx.read_graphml(io.BytesIO(text.encode("utf-8", "replace")), force_multigraph=True)
        for data in (
            read.graph,
            *(data for _, data in read.nodes(data=True)),
            *(edge[2] for edge in read.edges.data()),
        ):
            _unquote(data)
        return from_networkx(_labelled(read))
    except ParseError as error:
        line, column = error.position
        raise ExchangeError(f"{source}:{line}:{column + 1}: this is not XML: {error.msg.split(':')[0]}") from None
    except ExchangeError as error:
        raise ExchangeError(f"{source}: {error}") from None
    except _BROKEN as error:
        raise ExchangeError(f"{source}: this is not GraphML: {error}") from None


# networkx


def _flat(attributes: Mapping[str, DsrValue]) -> dict[str, object]:
    return {_renamed(name): value.value for name, value in attributes.items()}


def _renamed(name: str) -> str:
    """Return a name that is not reserved: `type` becomes `type_`, and `type_` becomes `type__`."""
    return f"{name}_" if name.rstrip("_") in _RESERVED else name


def _beside(attributes: Mapping[str, DsrValue], extra: Mapping[str, object]) -> dict[str, object]:
    codes = {name: int(value.code) for name, value in attributes.items()}
    extras = {name: dict(value.extra) for name, value in attributes.items() if value.extra}
    return {"codes": codes, "extras": extras, "extra": dict(extra)}


def _beside_of(data: Mapping[str, object], subject: str) -> _Beside:
    dsr_data = _mapping(data.get(DSR, {}), subject)
    codes, extras, extra = (_mapping(dsr_data.get(key, {}), subject) for key in ("codes", "extras", "extra"))
    number = dsr_data.get("number")
    is_number = isinstance(number, int) and not isinstance(number, bool) and 0 <= number <= MOST_NUMBER
    if not (number is None or is_number) or not all(type(code) is int for code in codes.values()):
        raise ExchangeError(f"{subject}: {DSR!r} holds no valid number and codes: remove it")
    for name, value_extra in extras.items():
        _mapping(value_extra, f"{subject}.{name}")
    return _Beside(
        cast("Mapping[str, int]", codes),
        cast("Mapping[str, Mapping[str, object]]", extras),
        extra,
        cast("int | None", number),
    )


def _numbers(besides: Mapping[Any, _Beside]) -> dict[Any, int]:
    given = [beside.number for beside in besides.values() if beside.number is not None]
    if len(set(given)) < len(given):
        raise ExchangeError("two nodes have the same number: remove one of them under 'dsr'")
    taken = set(given)
    free = (number for number in range(1, MOST_NUMBER) if number not in taken)
    return {name: next(free) if beside.number is None else beside.number for name, beside in besides.items()}


def _coded(data: Mapping[str, object], beside: _Beside, subject: str, *ours: str) -> Iterator[tuple[str, DsrValue]]:
    for key, value in data.items():
        if key in _RESERVED or key in ours:
            continue
        name = key[:-1] if isinstance(key, str) and key.rstrip("_") in _RESERVED else str(key)
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
            raise ExchangeError(f"{subject}: there are two: give them their labels as keys")
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
    raise ExchangeError(f"{subject}: {DSR!r} holds unexpected contents: remove it")


# GraphML


def _beside_label(name: str) -> str:
    return f"{name}_" if name.rstrip("_") == LABEL else name


def _labelled(read: networkx.Graph[Any]) -> networkx.Graph[Any]:
    """Return a graph that was read from GraphML, with the labels of those edges that have one as keys."""
    if not read.is_directed():
        return read
    made: networkx.MultiDiGraph[Any] = networkx.MultiDiGraph()
    made.graph.update(read.graph)
    made.add_nodes_from(read.nodes(data=True))
    for origin, target, key, data in _keyed(read):
        label = str(data.pop(LABEL, None) or key)
        if made.has_edge(origin, target, label):
            raise ExchangeError(f"edge {origin} -{label}-> {target}: there are two: labels must differ")
        is_ours = DSR in data
        made.add_edge(origin, target, key=label)
        made.edges[origin, target, label].update(
            {(key[:-1] if is_ours and key.rstrip("_") == LABEL else key): value for key, value in data.items()}
        )
    return made


def _xml_of(data: Mapping[str, object], subject: str) -> dict[str, object]:
    """Return attributes for XML: plain values unchanged, other values as JSON, and the list of the latter."""
    written: dict[str, object] = {}
    quoted: dict[str, str] = {}
    for key, value in data.items():
        if _is_plain(value):
            written[_word(key)] = value
        else:
            kind, json_form = _json_form(value)
            check_json(json_form, subject)
            written[_word(key)], quoted[key] = json.dumps(json_form), kind
    if _QUOTED in data:
        raise ExchangeError(f"{subject}.{_QUOTED}: this name is reserved in GraphML: write DSR's JSON instead")
    return {**written, _QUOTED: json.dumps(quoted)} if quoted else written


def _json_form(value: object) -> tuple[str, object]:
    kinds: Mapping[type, str] = {bytes: "bytes", tuple: "tuple", float: "float"}
    kind = kinds.get(type(value), "")
    if kind == "tuple":
        return kind, [
            repr(number) if isinstance(number, float) else number for number in cast("tuple[object, ...]", value)
        ]
    return kind, list(value) if isinstance(value, bytes) else repr(value) if kind == "float" else value


_FROM_JSON_FORM: Mapping[str, Callable[[Any], object]] = {
    "": lambda value: value,
    "bytes": bytes,
    "float": float,
    "tuple": lambda value: tuple(float(number) if isinstance(number, str) else number for number in value),
}


def _is_plain(value: object) -> bool:
    if isinstance(value, str):
        return _SAFE.fullmatch(value) is not None
    return isinstance(value, (bool, int)) or (isinstance(value, float) and value == value)


def _word(name: str) -> str:
    if _SAFE.fullmatch(name) is None:
        raise ExchangeError(f"the name {name!r:.60} cannot be written in XML: write DSR's JSON instead")
    return name


def _unquote(data: dict[str, Any]) -> None:
    quoted = data.pop(_QUOTED, None)
    kinds = json.loads(quoted) if isinstance(quoted, str) else {}
    for key, kind in kinds.items():
        data[key] = _FROM_JSON_FORM[kind](json.loads(data[key]))
