"""Read DSR's JSON, with messages that state the place of a mistake; write it byte for byte as RoboComp does.

A number that is not an integer loses the digits that a double cannot hold, as in RoboComp.
"""

from __future__ import annotations

import json
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import NoReturn, cast

from codra_dsl.regular_files import replace_file
from codra_dsl.runtime.knowledge.exchange.document import (
    MAX_NODE_NUMBER,
    DsrEdge,
    DsrGraph,
    DsrNode,
    DsrValue,
    ExchangeError,
    PlacedError,
    ValueCode,
    parse_value,
    to_json_value,
)

MAX_BYTES = 64 * 2**20
"""The maximum size of a file in bytes."""

MAX_DEPTH = 40
"""The maximum nesting depth of objects and lists."""

_MAX_DIGITS = 20
"""The maximum number of digits of the number of a node."""

MAX_ERRORS = 200
"""The maximum number of mistakes that are collected in one file."""

_JsonObject = Mapping[str, object]


class _ObjectWithDuplicateKey(dict[str, object]):
    """An object with a duplicate key.

    Attributes:
        key: the duplicate key.
    """

    key: str = ""


def read_dsr(path: Path | str, *, skip_missing_nodes: bool = False) -> DsrGraph:
    """Return the graph of a JSON file of RoboComp's DSR.

    Args:
        path: the file.
        skip_missing_nodes: whether to leave out edges whose origin or target does not exist, instead of refusing them.

    Raises:
        ExchangeError: if the file cannot be read, or is not a DSR file.
    """
    return parse_dsr(read_text(Path(path)), str(path), skip_missing_nodes=skip_missing_nodes)


def read_text(path: Path) -> str:
    """Return the text of a file.

    Raises:
        ExchangeError: if the file cannot be read, is too large, or is not UTF-8.
    """
    if path.exists() and not path.is_file():
        raise ExchangeError(f"{path}: this is not a file")
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        raise ExchangeError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    return decode_text(content, str(path))


def decode_text(content: bytes, source: str) -> str:
    """Return the bytes of a file as text.

    Raises:
        ExchangeError: if there are too many bytes, or they are not UTF-8.
    """
    if len(content) > MAX_BYTES:
        raise PlacedError(source, f"it has more than {MAX_BYTES} bytes: leave out images and point clouds")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        before = content[: error.start]
        position = before.count(b"\n") + 1, len(before.rpartition(b"\n")[2].decode()) + 1
        raise PlacedError(source, "a byte is not valid UTF-8: save the file as UTF-8", position=position) from None


def parse_dsr(text: str, source: str = "<text>", *, skip_missing_nodes: bool = False) -> DsrGraph:
    """Return the graph of a JSON text in the format of RoboComp's DSR.

    Args:
        text: the text of the file.
        source: the name of the file in messages.
        skip_missing_nodes: whether to leave out edges whose origin or target does not exist, instead of refusing them.

    Raises:
        ExchangeError: if the text is not a DSR file.
    """
    graph, errors = examine_dsr(text, source)
    for error in errors:
        if not (skip_missing_nodes and error.is_missing_node):
            raise error
    return graph


def examine_dsr(text: str, source: str) -> tuple[DsrGraph, tuple[PlacedError, ...]]:
    """Return the parts of a DSR file that can be read, and all mistakes in the other parts."""
    errors: list[PlacedError] = []
    top_object: _JsonObject = {}
    model: _JsonObject = {}
    nodes: list[DsrNode] = []
    edges_and_places: list[tuple[DsrEdge, _Place]] = []
    place = _Place(source).key("DSRModel")
    symbols_place = place.key("symbols")
    known_numbers: set[int] = set()
    with _collected(errors):
        top_object = _require_object(_parse_json(text, source), _Place(source))
        if "DSRModel" not in top_object:
            place.raise_error('the key is missing: a DSR file is {"DSRModel": {"symbols": {...}}}')
        model = _require_object(top_object["DSRModel"], place)
        for key, symbol in _require_object(model.get("symbols", {}), symbols_place).items():
            known_numbers |= {int(key)} if key.isdecimal() and len(key) <= _MAX_DIGITS else set()
            with _collected(errors):
                node, node_edges_and_places = _parse_node(key, symbol, symbols_place.key(key), errors)
                nodes.append(node)
                edges_and_places.extend(node_edges_and_places)
    _check_nodes(nodes, symbols_place, errors)
    graph = DsrGraph(
        nodes=tuple(nodes),
        edges=tuple(_checked_edges(edges_and_places, known_numbers, errors)),
        extra=_without_keys(top_object, "DSRModel"),
        model_extra=_without_keys(model, "symbols"),
    )
    return graph, tuple(errors)


def write_dsr(path: Path | str, graph: DsrGraph) -> None:
    """Write a graph to a JSON file for RoboComp's DSR, completely or not at all. A link is replaced, not followed.

    A replaced file keeps its permissions.

    Raises:
        ExchangeError: if the graph has a value that JSON cannot represent.
        OSError: if the file cannot be written.
    """
    replace_file(Path(path), dsr_text(graph).encode())


def dsr_text(graph: DsrGraph) -> str:
    """Return a graph as RoboComp's DSR writes it: sorted keys, indents of four spaces, empty lists on two lines.

    Raises:
        ExchangeError: if the graph has a value that JSON cannot represent.
    """
    links: dict[int, list[object]] = {node.number: [] for node in graph.nodes}
    for edge in graph.edges:
        if edge.origin not in links or edge.target not in links:
            raise ExchangeError(
                f"an edge {edge.label!r} goes from {edge.origin} to {edge.target}: one of the two is not a node"
            )
        links[edge.origin].append(
            {
                **edge.extra,
                "src": str(edge.origin),
                "dst": str(edge.target),
                "label": edge.label,
                "linkAttribute": _json_attributes(edge.attributes),
            }
        )
    symbols = {
        str(node.number): {
            **node.extra,
            "id": str(node.number),
            "name": node.name,
            "type": node.type,
            "attribute": _json_attributes(node.attributes),
            "links": links[node.number],
        }
        for node in graph.nodes
    }
    tree: object = {**graph.extra, "DSRModel": {**graph.model_extra, "symbols": symbols}}
    check_json(tree, "<graph>")
    return "".join((*_pieces(tree, ""), "\n"))


def check_json(tree: object, source: str) -> None:
    """Check that a value can be written as JSON, and was read without loss.

    Raises:
        ExchangeError: if an object has a duplicate key, a text has a lone surrogate, or the nesting is too deep.
    """
    pending_values: list[tuple[object, _Place, int]] = [(tree, _Place(source), 1)]
    while pending_values:
        json_data, place, depth = pending_values.pop()
        if isinstance(json_data, _ObjectWithDuplicateKey):
            place.key(json_data.key).raise_error("this key occurs twice in one object: remove one of the two entries")
        if isinstance(json_data, str) and any("\ud800" <= character <= "\udfff" for character in json_data):
            place.raise_error("a text with a lone surrogate (half a character) cannot be written: remove it")
        if depth > MAX_DEPTH:
            place.raise_error(f"objects and lists are nested more than {MAX_DEPTH} levels deep")
        if isinstance(json_data, dict):
            pending_values += [(key, place, 0) for key in json_data]
            pending_values += [(value, place.key(str(key)), depth + 1) for key, value in json_data.items()]
        elif isinstance(json_data, (list, tuple)):
            pending_values += [(value, place.item(index), depth + 1) for index, value in enumerate(json_data)]
        elif not isinstance(json_data, (str, int, float, bool, type(None))):
            place.raise_error(f"JSON has no {type(json_data).__name__}")


# Reading


class _Place:
    """A place in a file. Its path is built only for a message."""

    __slots__ = ("_outer_place", "_source", "_step")

    def __init__(self, source: str, step: str | int = "", outer_place: _Place | None = None) -> None:
        self._source = source
        self._step = step
        self._outer_place = outer_place

    def key(self, key: str) -> _Place:
        """Return the place of the value of a key."""
        return _Place(self._source, key, self)

    def item(self, index: int) -> _Place:
        """Return the place of an item of a list."""
        return _Place(self._source, index, self)

    def raise_error(self, message: str, *, is_missing_node: bool = False) -> NoReturn:
        """Raise an error about this place."""
        steps: list[str | int] = []
        place = self
        while place._outer_place is not None:
            steps.append(place._step)
            place = place._outer_place
        raise PlacedError(self._source, message, tuple(reversed(steps)), is_missing_node=is_missing_node)


@contextmanager
def _collected(errors: list[PlacedError]) -> Iterator[None]:
    """Add an error to the list instead of raising it. A full list gets only the first one that is no missing node."""
    try:
        yield
    except PlacedError as error:
        has_other_error = error.is_missing_node or any(not other.is_missing_node for other in errors)
        if len(errors) < MAX_ERRORS or not has_other_error:
            errors.append(error)


def _parse_json(text: str, source: str) -> object:
    try:
        tree: object = json.loads(
            text,
            object_pairs_hook=_object_of_pairs,
            parse_int=lambda digits: -0.0 if digits == "-0" else int(digits),
            parse_constant=_refuse_constant,
        )
    except json.JSONDecodeError as error:
        position = error.lineno, error.colno
        raise PlacedError(source, f"this is not JSON: {error.msg}", position=position) from None
    except RecursionError:
        raise PlacedError(source, f"objects and lists are nested more than {MAX_DEPTH} levels deep") from None
    except ValueError as error:
        raise PlacedError(source, f"this is not JSON: {error}") from None
    check_json(tree, source)
    return tree


def _object_of_pairs(pairs: list[tuple[str, object]]) -> dict[str, object]:
    plain_object = dict(pairs)
    if len(plain_object) == len(pairs):
        return plain_object
    object_with_duplicate = _ObjectWithDuplicateKey(plain_object)
    keys = [key for key, _ in pairs]
    object_with_duplicate.key = next(key for index, key in enumerate(keys) if key in keys[:index])
    return object_with_duplicate


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a JSON number: write null, or the text {name!r}")


def _require_object(json_data: object, place: _Place) -> _JsonObject:
    if not isinstance(json_data, dict):
        place.raise_error("there must be an object: {...}")
    return cast("_JsonObject", json_data)


def _parse_node(
    key: str, json_data: object, place: _Place, errors: list[PlacedError]
) -> tuple[DsrNode, list[tuple[DsrEdge, _Place]]]:
    symbol = _require_object(json_data, place)
    number = _parse_node_number(symbol, "id", place)
    if key != str(number):
        place.raise_error(f"the symbol under this key has the id {number}: the key and the id must be the same")
    links = symbol.get("links", [])
    if not isinstance(links, list):
        place.key("links").raise_error("there must be a list: [...]")
    edges_and_places = []
    for index, link in enumerate(links):
        link_place = place.key("links").item(index)
        with _collected(errors):
            edges_and_places.append((_parse_edge(_require_object(link, link_place), link_place, errors), link_place))
    node = DsrNode(
        number=number,
        name=_require_text(symbol, "name", place),
        type=_require_text(symbol, "type", place),
        attributes=_parse_attributes(symbol, "attribute", place, errors),
        extra=_without_keys(symbol, "id", "name", "type", "attribute", "links"),
    )
    return node, edges_and_places


def _parse_edge(link: _JsonObject, place: _Place, errors: list[PlacedError]) -> DsrEdge:
    return DsrEdge(
        origin=_parse_node_number(link, "src", place),
        label=_require_text(link, "label", place),
        target=_parse_node_number(link, "dst", place),
        attributes=_parse_attributes(link, "linkAttribute", place, errors),
        extra=_without_keys(link, "src", "dst", "label", "linkAttribute"),
    )


def _parse_attributes(owner: _JsonObject, key: str, place: _Place, errors: list[PlacedError]) -> dict[str, DsrValue]:
    values_place = place.key(key)
    attributes = {}
    for name, value in _require_object(owner.get(key, {}), values_place).items():
        with _collected(errors):
            attributes[name] = _parse_attribute(value, values_place.key(name))
    return attributes


def _parse_attribute(json_data: object, place: _Place) -> DsrValue:
    attribute_object = _require_object(json_data, place)
    if "type" not in attribute_object or "value" not in attribute_object:
        place.raise_error('an attribute is {"type": NUMBER, "value": VALUE}')
    code = attribute_object["type"]
    if isinstance(code, bool) or not isinstance(code, int):
        place.key("type").raise_error("the type of a value is an integer, such as 0 for text or 2 for a float")
    try:
        value = parse_value(code, attribute_object["value"])
    except ValueError as error:
        name = ValueCode(code).name.lower()
        place.key("value").raise_error(f"{error}, but type {code} is {name}: change the value or the type")
    return DsrValue(code=code, value=value, extra=_without_keys(attribute_object, "type", "value"))


def _parse_node_number(owner: _JsonObject, key: str, place: _Place) -> int:
    try:
        number = cast("int", parse_value(ValueCode.UINT64, owner.get(key)))
    except ValueError:
        number = MAX_NODE_NUMBER + 1
    if number > MAX_NODE_NUMBER:
        place.key(key).raise_error(f"expected the number of a node, from 0 to {MAX_NODE_NUMBER}")
    return number


def _require_text(owner: _JsonObject, key: str, place: _Place) -> str:
    text = owner.get(key)
    if not isinstance(text, str) or not text:
        place.key(key).raise_error("expected a text that is not empty")
    return text


def _without_keys(owner: _JsonObject, *keys: str) -> dict[str, object]:
    return {key: value for key, value in owner.items() if key not in keys}


def _check_nodes(nodes: list[DsrNode], place: _Place, errors: list[PlacedError]) -> None:
    numbers_by_name: dict[str, int] = {}
    for node in nodes:
        with _collected(errors):
            if node.name in numbers_by_name:
                name_place = place.key(str(node.number)).key("name")
                name_place.raise_error(
                    f"{node.name!r} is also the name of node {numbers_by_name[node.name]}: names must be unique"
                )
            numbers_by_name[node.name] = node.number


def _checked_edges(
    edges_and_places: list[tuple[DsrEdge, _Place]], node_numbers: set[int], errors: list[PlacedError]
) -> Iterator[DsrEdge]:
    seen_keys: set[tuple[int, str, int]] = set()
    for edge, place in edges_and_places:
        with _collected(errors):
            for key, number in (("src", edge.origin), ("dst", edge.target)):
                if number not in node_numbers:
                    message = f"there is no symbol {number}: add it, or remove the link"
                    place.key(key).raise_error(message, is_missing_node=True)
            if edge.key in seen_keys:
                place.raise_error(f"there is already a link {edge.label!r} from {edge.origin} to {edge.target}")
            seen_keys.add(edge.key)
            yield edge


# Writing


def _json_attributes(attributes: Mapping[str, DsrValue]) -> dict[str, object]:
    return {
        name: {**value.extra, "type": int(value.code), "value": to_json_value(value)}
        for name, value in attributes.items()
    }


def _pieces(tree: object, indent: str) -> Iterator[str]:
    """Yield the parts of a JSON text with Qt's indentation."""
    inner_indent = f"{indent}    "
    if isinstance(tree, dict):
        sorted_items = sorted(tree.items(), key=lambda entry: str(entry[0]).encode("utf-16-be"))
        yield from _enclosed_pieces(
            "{}", [(f"{_scalar_text(key)}: ", value) for key, value in sorted_items], inner_indent, indent
        )
    elif isinstance(tree, (list, tuple)):
        yield from _enclosed_pieces("[]", [("", value) for value in tree], inner_indent, indent)
    else:
        yield _scalar_text(tree)


def _enclosed_pieces(brackets: str, items: list[tuple[str, object]], inner_indent: str, indent: str) -> Iterator[str]:
    yield f"{brackets[0]}\n"
    for index, (key, value) in enumerate(items, 1):
        yield f"{inner_indent}{key}"
        yield from _pieces(value, inner_indent)
        yield ",\n" if index < len(items) else "\n"
    yield f"{indent}{brackets[1]}"


def _scalar_text(content: object) -> str:
    if isinstance(content, float) and content.is_integer() and abs(content) < 2**53 and str(content) != "-0.0":
        content = int(content)
    try:
        return json.dumps(content, ensure_ascii=False, allow_nan=False)
    except ValueError:
        raise ExchangeError(f"JSON has no number {content!r}: write the number as a text") from None
