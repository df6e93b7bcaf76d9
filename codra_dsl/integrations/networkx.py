"""DSR graphs as MultiDiGraph of networkx, and as GraphML for tools that draw and analyse graphs.

In networkx, a node is the name of a DSR node, and the key of an edge is the label of a DSR edge. Attributes have the
same names as in DSR, and plain Python values. The attribute `dsr` contains the rest: the numbers of nodes, the type
codes of values, and additional contents of files.
"""

from __future__ import annotations

import io
import json
import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from copy import deepcopy
from pathlib import Path
from typing import Any, NamedTuple, cast
from xml.etree import ElementTree
from xml.etree.ElementTree import ParseError

import networkx

from codra_dsl.regular_files import replace_file
from codra_dsl.runtime.knowledge.exchange import DsrEdge, DsrGraph, DsrNode, DsrValue, ExchangeError
from codra_dsl.runtime.knowledge.exchange.document import MAX_NODE_NUMBER, PlacedError, encode_value
from codra_dsl.runtime.knowledge.exchange.dsr_json import check_json, read_text

__all__ = ["from_networkx", "graphml_text", "parse_graphml", "read_graphml", "to_networkx", "write_graphml"]

TYPE_KEY = "type"
DSR_KEY = "dsr"
LABEL_KEY = "label"
_RESERVED_KEYS = (TYPE_KEY, DSR_KEY)
_DEFAULT_NODE_TYPE = "node"
_JSON_KINDS_KEY = "json"
"""The GraphML attribute that lists attributes written as JSON, because XML or networkx would lose their types."""

_XML_TEXT_PATTERN = re.compile(r"[\t\n\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]+")
"""The texts that XML can write and return unchanged."""

NEEDED_ATTRIBUTES: Mapping[str, tuple[str, ...]] = {"node": ("id",), "edge": ("source", "target")}
"""The attributes without which an element of GraphML names no node. networkx reads it all the same."""

SEVERAL_GRAPHS = "there are several graphs, of which only one can be read: put all nodes and edges into one 'graph'"

_READ_ERRORS = (
    *(ParseError, networkx.NetworkXError, LookupError, TypeError, ValueError, AttributeError, RecursionError, Warning),
)
"""The exceptions of networkx and of the JSON reader for files that are not GraphML."""


class _DsrData(NamedTuple):
    """The contents of the attribute `dsr`."""

    codes: Mapping[str, int]
    attribute_extras: Mapping[str, Mapping[str, object]]
    extra: Mapping[str, object]
    number: int | None = None


def to_networkx(graph: DsrGraph) -> networkx.MultiDiGraph[str]:
    """Return a graph as a graph of networkx. `from_networkx` converts it back without losses."""
    networkx_graph: networkx.MultiDiGraph[str] = networkx.MultiDiGraph()
    networkx_graph.graph[DSR_KEY] = {"extra": dict(graph.extra), "model_extra": dict(graph.model_extra)}
    names = {node.number: node.name for node in graph.nodes}
    for node in graph.nodes:
        dsr_attribute = {**_dsr_attribute(node.attributes, node.extra), "number": node.number}
        networkx_graph.add_node(
            node.name, **{TYPE_KEY: node.type, **_plain_values(node.attributes), DSR_KEY: dsr_attribute}
        )
    for edge in graph.edges:
        data = {**_plain_values(edge.attributes), DSR_KEY: _dsr_attribute(edge.attributes, edge.extra)}
        networkx_graph.add_edge(names[edge.origin], names[edge.target], key=edge.label)
        networkx_graph.edges[names[edge.origin], names[edge.target], edge.label].update(data)
    return networkx_graph


def from_networkx(graph: networkx.Graph[Any]) -> DsrGraph:
    """Return the DSR graph of any directed graph of networkx.

    Nodes without a number get one. Nodes without a type have the type `node`. The label of an edge is its key, or its
    attribute `label` in a graph without keys. Values keep their type code if they have one, and otherwise get one.

    Raises:
        ExchangeError: if the graph is not directed, or contains a value without a DSR type.
    """
    if not graph.is_directed():
        raise ExchangeError("the graph is not directed: convert it with to_directed(), or read it with both_ways=True")
    dsr_data_of_nodes = {name: _read_dsr_data(data, f"node {name!r}") for name, data in graph.nodes(data=True)}
    node_numbers = _node_numbers(dsr_data_of_nodes)
    nodes = [
        DsrNode(
            number=node_numbers[name],
            name=str(name),
            type=str(data.get(TYPE_KEY) or _DEFAULT_NODE_TYPE),
            attributes=dict(_dsr_attributes(data, dsr_data_of_nodes[name], f"node {name!r}")),
            extra=dsr_data_of_nodes[name].extra,
        )
        for name, data in graph.nodes(data=True)
    ]
    if len({node.name for node in nodes}) < len(nodes):
        raise ExchangeError(
            "two node names are equal when they are converted to text: node names must be unique as text"
        )
    if not all(node.name for node in nodes):
        raise ExchangeError("a node has no name: give it a non-empty text")
    graph_data = _require_mapping(graph.graph.get(DSR_KEY, {}), "the graph")
    return DsrGraph(
        nodes=tuple(nodes),
        edges=tuple(_dsr_edges(graph, node_numbers)),
        extra=_require_mapping(graph_data.get("extra", {}), "the graph"),
        model_extra=_require_mapping(graph_data.get("model_extra", {}), "the graph"),
    )


def write_graphml(path: Path | str, graph: DsrGraph) -> None:
    """Write a graph as a GraphML file, completely or not at all. A link is replaced, not followed.

    A replaced file keeps its permissions.

    Raises:
        ExchangeError: if the graph contains a name that XML cannot write.
        OSError: if the file cannot be written.
    """
    replace_file(Path(path), graphml_text(graph).encode())


def read_graphml(path: Path | str, *, both_ways: bool = False) -> DsrGraph:
    """Return the graph of any GraphML file.

    Args:
        path: the file.
        both_ways: whether an undirected edge is read as two edges, one in each direction, instead of refused.

    Raises:
        ExchangeError: if the file cannot be read, or is not GraphML.
    """
    return parse_graphml(read_text(Path(path)), str(path), both_ways=both_ways)


def graphml_text(graph: DsrGraph) -> str:
    """Return a graph as GraphML. Numbers, texts and booleans are plain; other values are written as JSON texts.

    Raises:
        ExchangeError: if the graph contains a name that XML cannot write.
    """
    networkx_graph, xml_graph = to_networkx(graph), cast("networkx.MultiDiGraph[str]", networkx.MultiDiGraph())
    xml_graph.graph.update(_xml_attributes(networkx_graph.graph, "the graph"))
    for name, data in networkx_graph.nodes(data=True):
        xml_graph.add_node(_xml_name(name), **_xml_attributes(data, f"node {name!r}"))
    for index, (origin, target, label, data) in enumerate(networkx_graph.edges(keys=True, data=True)):
        attributes = {_avoid_label_key(key): value for key, value in data.items()}
        xml_graph.add_edge(origin, target, key=f"e{index}")  # identifiers are unique in a GraphML file
        xml_graph.edges[origin, target, f"e{index}"].update(
            _xml_attributes(attributes, f"edge {origin} -{label}-> {target}")
        )
        xml_graph.edges[origin, target, f"e{index}"][LABEL_KEY] = _xml_name(label)
    buffer = io.BytesIO()
    networkx.write_graphml_xml(xml_graph, buffer, edge_id_from_attribute=None)
    return buffer.getvalue().decode("utf-8")


def parse_graphml(text: str, source: str = "<text>", *, both_ways: bool = False) -> DsrGraph:
    """Return the graph in a GraphML text.

    Args:
        text: the text of the file.
        source: the name of the file in messages.
        both_ways: whether an undirected edge is read as two edges, one in each direction, instead of refused.

    Raises:
        ExchangeError: if the text is not GraphML.
    """
    if "<!DOCTYPE" in text or "<!ENTITY" in text:
        raise ExchangeError(f"{source}: the file declares a document type: remove this declaration, it is not needed")
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")  # networkx warns when it only guesses; a guess could lose data
            warnings.filterwarnings("ignore", "No key type")  # the values of such keys are kept as texts
            _refuse_losses(ElementTree.fromstring(text))
            data = (_with_two_edges(text) if both_ways else text).encode("utf-8", "replace")
            parsed_graph = networkx.read_graphml(io.BytesIO(data), force_multigraph=True)
        for attributes in (
            parsed_graph.graph,
            *(attributes for _, attributes in parsed_graph.nodes(data=True)),
            *(edge[2] for edge in parsed_graph.edges.data()),
        ):
            _decode_json(attributes)
        return from_networkx(_with_label_keys(parsed_graph))
    except ParseError as error:
        line, column = error.position
        reason = f"this is not XML: {error.msg.split(':')[0]}"
        raise PlacedError(source, reason, position=(line, column + 1)) from None
    except ExchangeError as error:
        raise ExchangeError(f"{source}: {error}") from None
    except _READ_ERRORS as error:
        reason = f"unknown value {error}" if isinstance(error, KeyError) else str(error)
        raise ExchangeError(f"{source}: this is not GraphML: {reason}") from None


# networkx


def _plain_values(attributes: Mapping[str, DsrValue]) -> dict[str, object]:
    return {_unreserved_name(name): value.value for name, value in attributes.items()}


def _unreserved_name(name: str) -> str:
    """Return a name that is not reserved: `type` becomes `type_`, and `type_` becomes `type__`."""
    return f"{name}_" if name.rstrip("_") in _RESERVED_KEYS else name


def _dsr_attribute(attributes: Mapping[str, DsrValue], extra: Mapping[str, object]) -> dict[str, object]:
    codes = {name: int(value.code) for name, value in attributes.items()}
    attribute_extras = {name: dict(value.extra) for name, value in attributes.items() if value.extra}
    return {"codes": codes, "extras": attribute_extras, "extra": dict(extra)}


def _read_dsr_data(data: Mapping[str, object], subject: str) -> _DsrData:
    content = _require_mapping(data.get(DSR_KEY, {}), subject)
    codes, attribute_extras, extra = (
        _require_mapping(content.get(key, {}), subject) for key in ("codes", "extras", "extra")
    )
    number = content.get("number")
    is_valid_number = isinstance(number, int) and not isinstance(number, bool) and 0 <= number <= MAX_NODE_NUMBER
    if not (number is None or is_valid_number) or not all(type(code) is int for code in codes.values()):
        raise ExchangeError(f"{subject}: {DSR_KEY!r} does not hold a valid number and valid codes: remove {DSR_KEY!r}")
    for name, value_extra in attribute_extras.items():
        _require_mapping(value_extra, f"{subject}.{name}")
    return _DsrData(
        cast("Mapping[str, int]", codes),
        cast("Mapping[str, Mapping[str, object]]", attribute_extras),
        extra,
        cast("int | None", number),
    )


def _node_numbers(dsr_data_of_nodes: Mapping[Any, _DsrData]) -> dict[Any, int]:
    given_numbers = [dsr_data.number for dsr_data in dsr_data_of_nodes.values() if dsr_data.number is not None]
    if len(set(given_numbers)) < len(given_numbers):
        raise ExchangeError("two nodes have the same number: remove one of the two numbers under 'dsr'")
    used_numbers = set(given_numbers)
    free_numbers = (number for number in range(1, MAX_NODE_NUMBER) if number not in used_numbers)
    return {
        name: next(free_numbers) if dsr_data.number is None else dsr_data.number
        for name, dsr_data in dsr_data_of_nodes.items()
    }


def _dsr_attributes(
    data: Mapping[str, object], dsr_data: _DsrData, subject: str, *ignored_keys: str
) -> Iterator[tuple[str, DsrValue]]:
    for key, value in data.items():
        if key in _RESERVED_KEYS or key in ignored_keys:
            continue
        name = key[:-1] if isinstance(key, str) and key.rstrip("_") in _RESERVED_KEYS else str(key)
        try:
            yield name, encode_value(value, dsr_data.codes.get(name), dsr_data.attribute_extras.get(name))
        except (ValueError, OverflowError) as error:
            raise ExchangeError(f"{subject}.{name}: {error}") from None


def _dsr_edges(graph: networkx.Graph[Any], node_numbers: Mapping[Any, int]) -> Iterator[DsrEdge]:
    edge_keys: set[tuple[int, str, int]] = set()
    for origin, target, key, data in _edges_with_keys(graph):
        label = key if isinstance(key, str) and key else str(data.get(LABEL_KEY) or "edge")
        subject = f"edge {origin} -{label}-> {target}"
        dsr_data = _read_dsr_data(data, subject)
        ignored_keys = () if label == key else (LABEL_KEY,)
        edge = DsrEdge(
            origin=node_numbers[origin],
            label=label,
            target=node_numbers[target],
            attributes=dict(_dsr_attributes(data, dsr_data, subject, *ignored_keys)),
            extra=dsr_data.extra,
        )
        if edge.key in edge_keys:
            raise ExchangeError(f"{subject}: there are two such edges: give them different labels as keys")
        edge_keys.add(edge.key)
        yield edge


def _edges_with_keys(graph: networkx.Graph[Any]) -> Iterator[tuple[Any, Any, object, dict[str, object]]]:
    if isinstance(graph, networkx.MultiDiGraph):
        yield from graph.edges(keys=True, data=True)
    else:
        for origin, target, data in graph.edges(data=True):
            yield origin, target, None, data


def _require_mapping(content: object, subject: str) -> Mapping[str, object]:
    if isinstance(content, dict) and all(isinstance(key, str) for key in content):
        return content
    raise ExchangeError(f"{subject}: {DSR_KEY!r} holds unexpected contents: remove {DSR_KEY!r}")


# GraphML


def _avoid_label_key(name: str) -> str:
    return f"{name}_" if name.rstrip("_") == LABEL_KEY else name


def _refuse_losses(root: ElementTree.Element) -> None:
    """Refuse what networkx reads without an error, but not as it is meant.

    Raises:
        ExchangeError: if there are several graphs, or an element does not name its nodes.
    """
    if len(root.findall(".//{*}graph")) > 1:
        raise ExchangeError(SEVERAL_GRAPHS)
    for tag, names in NEEDED_ATTRIBUTES.items():
        for element in root.findall(f".//{{*}}{tag}"):
            for name in names:
                if name not in element.attrib:
                    raise ExchangeError(f"an element '{tag}' has no attribute '{name}'")


def _with_two_edges(text: str) -> str:
    """Return GraphML in which each undirected edge is replaced by two edges, one in each direction."""
    root = ElementTree.fromstring(text)
    for graph in root.findall(".//{*}graph"):
        default = graph.get("edgedefault") == "directed"
        graph.set("edgedefault", "directed")
        for edge in graph.findall("{*}edge"):
            if edge.get("directed") != "true" and not (default and edge.get("directed") is None):
                edge.set("directed", "true")
                origin, target = edge.get("source", ""), edge.get("target", "")
                if origin != target:
                    opposite_edge = deepcopy(edge)
                    opposite_edge.attrib.update(source=target, target=origin)
                    graph.append(opposite_edge)
    return ElementTree.tostring(root, "unicode")


def _with_label_keys(parsed_graph: networkx.Graph[Any]) -> networkx.Graph[Any]:
    """Return a graph that was read from GraphML; if an edge has a label, the label becomes the key of the edge."""
    if not parsed_graph.is_directed():
        return parsed_graph
    labelled_graph: networkx.MultiDiGraph[Any] = networkx.MultiDiGraph()
    labelled_graph.graph.update(parsed_graph.graph)
    labelled_graph.add_nodes_from(parsed_graph.nodes(data=True))
    for origin, target, key, data in _edges_with_keys(parsed_graph):
        label = str(data.pop(LABEL_KEY, None) or key)
        if labelled_graph.has_edge(origin, target, label):
            raise ExchangeError(f"edge {origin} -{label}-> {target}: there are two such edges: labels must differ")
        has_dsr_data = DSR_KEY in data
        labelled_graph.add_edge(origin, target, key=label)
        labelled_graph.edges[origin, target, label].update(
            {(key[:-1] if has_dsr_data and key.rstrip("_") == LABEL_KEY else key): value for key, value in data.items()}
        )
    return labelled_graph


def _xml_attributes(data: Mapping[str, object], subject: str) -> dict[str, object]:
    """Return attributes for XML: plain values unchanged, and other values as JSON.

    If there are JSON values, an additional attribute `json` lists the attributes with JSON values.
    """
    xml_attributes: dict[str, object] = {}
    json_kinds: dict[str, str] = {}
    for key, value in data.items():
        if _is_plain_value(value):
            xml_attributes[_xml_name(key)] = value
        else:
            kind, json_form = _kind_and_json_form(value)
            check_json(json_form, subject)
            xml_attributes[_xml_name(key)], json_kinds[key] = json.dumps(json_form), kind
    if _JSON_KINDS_KEY in data:
        raise ExchangeError(f"{subject}.{_JSON_KINDS_KEY}: this name is reserved in GraphML: write DSR's JSON instead")
    return {**xml_attributes, _JSON_KINDS_KEY: json.dumps(json_kinds)} if json_kinds else xml_attributes


def _kind_and_json_form(value: object) -> tuple[str, object]:
    kind_by_type: Mapping[type, str] = {bytes: "bytes", tuple: "tuple", float: "float"}
    kind = kind_by_type.get(type(value), "")
    if kind == "tuple":
        return kind, [repr(item) if isinstance(item, float) else item for item in cast("tuple[object, ...]", value)]
    return kind, list(value) if isinstance(value, bytes) else repr(value) if kind == "float" else value


_JSON_FORM_DECODERS: Mapping[str, Callable[[Any], object]] = {
    "": lambda value: value,
    "bytes": bytes,
    "float": float,
    "tuple": lambda value: tuple(float(number) if isinstance(number, str) else number for number in value),
}


def _is_plain_value(value: object) -> bool:
    if isinstance(value, str):
        return _XML_TEXT_PATTERN.fullmatch(value) is not None
    return isinstance(value, (bool, int)) or (isinstance(value, float) and value == value)


def _xml_name(name: str) -> str:
    if _XML_TEXT_PATTERN.fullmatch(name) is None:
        raise ExchangeError(f"the name {name!r:.60} cannot be written in XML: write DSR's JSON instead")
    return name


def _decode_json(data: dict[str, Any]) -> None:
    for key in [key for key, value in data.items() if value is None]:  # an empty label of yEd
        del data[key]
    kinds_text = data.pop(_JSON_KINDS_KEY, None)
    json_kinds = json.loads(kinds_text) if isinstance(kinds_text, str) else {}
    for key, kind in json_kinds.items():
        data[key] = _JSON_FORM_DECODERS[kind](json.loads(data[key]))
