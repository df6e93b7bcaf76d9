"""Read DSR's JSON, with messages that state the place of a mistake; write it byte for byte as RoboComp does.

A number that is not an integer loses the digits that a double cannot hold, as in RoboComp.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NoReturn, cast

from codra_dsl.runtime.knowledge.exchange.document import (
    MOST_NUMBER,
    DsrEdge,
    DsrGraph,
    DsrNode,
    DsrValue,
    ExchangeError,
    ValueCode,
    json_value,
    parse_value,
)

MAX_BYTES = 64 * 2**20
"""The maximum size of a file in bytes."""

MAX_DEPTH = 40
"""The maximum nesting depth of objects and lists."""

_Json = Mapping[str, object]


class _DuplicateKeys(dict[str, object]):
    """An object with a duplicate key.

    Attributes:
        key: the duplicate key.
    """

    key: str = ""


def read_dsr(path: Path | str) -> DsrGraph:
    """Return the graph of a JSON file of RoboComp's DSR.

    Raises:
        ExchangeError: if the file cannot be read, or is not a DSR file.
    """
    return parse_dsr(read_text(Path(path)), str(path))


def read_text(path: Path) -> str:
    """Return the text of a file.

    Raises:
        ExchangeError: if it cannot be read, is too large, or is not UTF-8.
    """
    if path.exists() and not path.is_file():
        raise ExchangeError(f"{path}: this is not a file")
    try:
        with path.open("rb") as file:
            content = file.read(MAX_BYTES + 1)
    except (OSError, ValueError) as error:
        raise ExchangeError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    if len(content) > MAX_BYTES:
        raise ExchangeError(f"{path}: it has more than {MAX_BYTES} bytes: leave out images and point clouds")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ExchangeError(f"{path}:{line}: a byte is not valid UTF-8: save the file as UTF-8") from None


def parse_dsr(text: str, source: str = "<text>") -> DsrGraph:
    """Return the graph of a JSON text in the format of RoboComp's DSR.

    Args:
        text: the text of the file.
        source: the name of the file in messages.

    Raises:
        ExchangeError: if the text is not a DSR file.
    """
    top = _object(_parse_json(text, source), _Place(source, "$"))
    place = _Place(source, "$").key("DSRModel")
    if "DSRModel" not in top:
        place.complain('the key is missing: a DSR file is {"DSRModel": {"symbols": {...}}}')
    model = _object(top["DSRModel"], place)
    symbols = place.key("symbols")
    nodes, links = [], []
    for key, symbol in _object(model.get("symbols", {}), symbols).items():
        node, node_links = _node(key, symbol, symbols.key(key))
        nodes.append(node)
        links.extend(node_links)
    _check_nodes(nodes, symbols)
    return DsrGraph(
        nodes=tuple(nodes),
        edges=tuple(_edges(links, {node.number for node in nodes})),
        extra=_without_keys(top, "DSRModel"),
        model_extra=_without_keys(model, "symbols"),
    )


def write_dsr(path: Path | str, graph: DsrGraph) -> None:
    """Write a graph to a JSON file for RoboComp's DSR, completely or not at all.

    Raises:
        ExchangeError: if the graph has a value that JSON cannot represent.
    """
    replace_file(Path(path), dsr_text(graph))


def replace_file(path: Path, text: str) -> None:
    """Replace a file atomically: write a temporary file in the same folder, then rename the temporary file."""
    temporary_path = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        temporary_path.write_text(text, encoding="utf-8")
        temporary_path.replace(path)
    finally:
        temporary_path.unlink(missing_ok=True)


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
    pending: list[tuple[object, _Place, int]] = [(tree, _Place(source, "$"), 1)]
    while pending:
        part, place, depth = pending.pop()
        if isinstance(part, _DuplicateKeys):
            place.key(part.key).complain("this key occurs twice in one object: remove one of the two entries")
        if isinstance(part, str) and any("\ud800" <= character <= "\udfff" for character in part):
            place.complain("a text with a lone surrogate (half a character) cannot be written: remove it")
        if depth > MAX_DEPTH:
            place.complain(f"objects and lists are nested more than {MAX_DEPTH} levels deep")
        if isinstance(part, dict):
            pending += [(key, place, 0) for key in part]
            pending += [(value, place.key(str(key)), depth + 1) for key, value in part.items()]
        elif isinstance(part, (list, tuple)):
            pending += [(value, place.item(index), depth + 1) for index, value in enumerate(part)]
        elif not isinstance(part, (str, int, float, bool, type(None))):
            place.complain(f"JSON has no {type(part).__name__}")


# Reading


class _Place:
    """A place in a file, as a JSON path. The text of the path is built only for a message."""

    __slots__ = ("_outer_place", "_source", "_step")

    def __init__(self, source: str, step: str, outer_place: _Place | None = None) -> None:
        self._source = source
        self._step = step
        self._outer_place = outer_place

    def key(self, key: str) -> _Place:
        """Return the place of the value of a key."""
        return _Place(self._source, f".{key}" if key.isidentifier() else f"[{json.dumps(key)}]", self)

    def item(self, index: int) -> _Place:
        """Return the place of an item of a list."""
        return _Place(self._source, f"[{index}]", self)

    def complain(self, message: str) -> NoReturn:
        """Raise an error about this place."""
        steps: list[str] = []
        place: _Place | None = self
        while place is not None:
            steps.append(place._step)
            place = place._outer_place
        raise ExchangeError(f"{self._source}: {''.join(reversed(steps))}: {message}")


def _parse_json(text: str, source: str) -> object:
    try:
        tree: object = json.loads(
            text,
            object_pairs_hook=_object_of_pairs,
            parse_int=lambda digits: -0.0 if digits == "-0" else int(digits),
            parse_constant=_refuse_constant,
        )
    except json.JSONDecodeError as error:
        raise ExchangeError(f"{source}:{error.lineno}:{error.colno}: this is not JSON: {error.msg}") from None
    except RecursionError:
        raise ExchangeError(f"{source}: objects and lists are nested more than {MAX_DEPTH} levels deep") from None
    except ValueError as error:
        raise ExchangeError(f"{source}: this is not JSON: {error}") from None
    check_json(tree, source)
    return tree


def _object_of_pairs(pairs: list[tuple[str, object]]) -> dict[str, object]:
    plain_object = dict(pairs)
    if len(plain_object) == len(pairs):
        return plain_object
    marked_object = _DuplicateKeys(plain_object)
    keys = [key for key, _ in pairs]
    marked_object.key = next(key for index, key in enumerate(keys) if key in keys[:index])
    return marked_object


def _refuse_constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is not a JSON number: write null, or the text {name!r}")


def _object(json_data: object, place: _Place) -> _Json:
    if not isinstance(json_data, dict):
        place.complain("there must be an object: {...}")
    return cast("_Json", json_data)


def _node(key: str, json_data: object, place: _Place) -> tuple[DsrNode, list[tuple[DsrEdge, _Place]]]:
    symbol = _object(json_data, place)
    number = _number(symbol, "id", place)
    if key != str(number):
        place.complain(f"the symbol under this key has the id {number}: the key and the id must be the same")
    links = symbol.get("links", [])
    if not isinstance(links, list):
        place.key("links").complain("there must be a list: [...]")
    places = [place.key("links").item(index) for index in range(len(links))]
    edges = [
        (_edge(_object(link, link_place), link_place), link_place)
        for link, link_place in zip(links, places, strict=True)
    ]
    node = DsrNode(
        number=number,
        name=_required_text(symbol, "name", place),
        type=_required_text(symbol, "type", place),
        attributes=_values(symbol, "attribute", place),
        extra=_without_keys(symbol, "id", "name", "type", "attribute", "links"),
    )
    return node, edges


def _edge(link: _Json, place: _Place) -> DsrEdge:
    return DsrEdge(
        origin=_number(link, "src", place),
        label=_required_text(link, "label", place),
        target=_number(link, "dst", place),
        attributes=_values(link, "linkAttribute", place),
        extra=_without_keys(link, "src", "dst", "label", "linkAttribute"),
    )


def _values(owner: _Json, key: str, place: _Place) -> dict[str, DsrValue]:
    values_place = place.key(key)
    return {
        name: _value(value, values_place.key(name)) for name, value in _object(owner.get(key, {}), values_place).items()
    }


def _value(json_data: object, place: _Place) -> DsrValue:
    attribute_object = _object(json_data, place)
    if "type" not in attribute_object or "value" not in attribute_object:
        place.complain('an attribute is {"type": NUMBER, "value": VALUE}')
    code = attribute_object["type"]
    if isinstance(code, bool) or not isinstance(code, int):
        place.key("type").complain("the type of a value is an integer, such as 0 for text or 2 for a float")
    try:
        value = parse_value(code, attribute_object["value"])
    except ValueError as error:
        name = ValueCode(code).name.lower()
        place.key("value").complain(f"{error}, but type {code} is {name}: change the value or the type")
    return DsrValue(code=code, value=value, extra=_without_keys(attribute_object, "type", "value"))


def _number(owner: _Json, key: str, place: _Place) -> int:
    try:
        number = cast("int", parse_value(ValueCode.UINT64, owner.get(key)))
    except ValueError:
        number = MOST_NUMBER + 1
    if number > MOST_NUMBER:
        place.key(key).complain(f"expected the number of a node, from 0 to {MOST_NUMBER}")
    return number


def _required_text(owner: _Json, key: str, place: _Place) -> str:
    text = owner.get(key)
    if not isinstance(text, str) or not text:
        place.key(key).complain("expected a text that is not empty")
    return text


def _without_keys(owner: _Json, *keys: str) -> dict[str, object]:
    return {key: value for key, value in owner.items() if key not in keys}


def _check_nodes(nodes: list[DsrNode], place: _Place) -> None:
    numbers: dict[str, int] = {}
    for node in nodes:
        if node.name in numbers:
            name_place = place.key(str(node.number)).key("name")
            name_place.complain(f"{node.name!r} is also the name of node {numbers[node.name]}: names must be unique")
        numbers[node.name] = node.number


def _edges(links: list[tuple[DsrEdge, _Place]], numbers: set[int]) -> Iterator[DsrEdge]:
    seen_keys: set[tuple[int, str, int]] = set()
    for edge, place in links:
        for key, number in (("src", edge.origin), ("dst", edge.target)):
            if number not in numbers:
                place.key(key).complain(f"there is no symbol {number}: add it, or remove the link")
        if edge.key in seen_keys:
            place.complain(f"there is already a link {edge.label!r} from {edge.origin} to {edge.target}")
        seen_keys.add(edge.key)
        yield edge


# Writing


def _json_attributes(attributes: Mapping[str, DsrValue]) -> dict[str, object]:
    return {
        name: {**value.extra, "type": int(value.code), "value": json_value(value)} for name, value in attributes.items()
    }


def _pieces(tree: object, indent: str) -> Iterator[str]:
    """Yield the parts of a JSON text with Qt's indentation."""
    inner_indent = f"{indent}    "
    if isinstance(tree, dict):
        sorted_items = sorted(tree.items(), key=lambda entry: str(entry[0]).encode("utf-16-be"))
        yield from _enclosed_pieces(
            "{}", [(f"{_scalar(key)}: ", value) for key, value in sorted_items], inner_indent, indent
        )
    elif isinstance(tree, (list, tuple)):
        yield from _enclosed_pieces("[]", [("", value) for value in tree], inner_indent, indent)
    else:
        yield _scalar(tree)


def _enclosed_pieces(brackets: str, items: list[tuple[str, object]], inner_indent: str, indent: str) -> Iterator[str]:
    yield f"{brackets[0]}\n"
    for index, (key, value) in enumerate(items, 1):
        yield f"{inner_indent}{key}"
        yield from _pieces(value, inner_indent)
        yield ",\n" if index < len(items) else "\n"
    yield f"{indent}{brackets[1]}"


def _scalar(content: object) -> str:
    if isinstance(content, float) and content.is_integer() and abs(content) < 2**53 and str(content) != "-0.0":
        content = int(content)
    try:
        return json.dumps(content, ensure_ascii=False, allow_nan=False)
    except ValueError:
        raise ExchangeError(f"JSON has no number {content!r}: make it a text") from None
