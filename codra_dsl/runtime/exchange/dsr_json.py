"""DSR's JSON: read with every mistake told by its place, and written byte for byte in the form that RoboComp gives it.

Numbers with more digits than a double has lose them, as in RoboComp, unless they are whole.
"""

from __future__ import annotations

import json
import os
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import NoReturn, cast

from codra_dsl.runtime.exchange.document import (
    MOST_NUMBER,
    DsrEdge,
    DsrGraph,
    DsrNode,
    DsrValue,
    ExchangeError,
    ValueCode,
    spelled,
    understood,
)

MOST_BYTES = 64 * 2**20
"""Bytes that a file may have."""

DEEPEST = 40
"""Objects and lists that may stand in each other."""

_Json = Mapping[str, object]


class _Twice(dict[str, object]):
    """An object in which a key stands twice.

    Attributes:
        key: the one.
    """

    key: str = ""


def read_dsr(path: Path | str) -> DsrGraph:
    """Return the graph of a JSON file of RoboComp's DSR.

    Raises:
        ExchangeError: if the file cannot be read, or is none.
    """
    return parse_dsr(read_text(Path(path)), str(path))


def read_text(path: Path) -> str:
    """Return the text of a file that is not too large.

    Raises:
        ExchangeError: if it cannot be read, is too large, or is no UTF-8.
    """
    if path.exists() and not path.is_file():
        raise ExchangeError(f"{path}: this is no file")
    try:
        with path.open("rb") as file:
            content = file.read(MOST_BYTES + 1)
    except (OSError, ValueError) as error:
        raise ExchangeError(f"{path}: cannot be read ({getattr(error, 'strerror', None) or error})") from None
    if len(content) > MOST_BYTES:
        raise ExchangeError(f"{path}: it has more than {MOST_BYTES} bytes: leave out images and point clouds")
    try:
        return content.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = content.count(b"\n", 0, error.start) + 1
        raise ExchangeError(f"{path}:{line}: a byte that is no UTF-8: save the file as UTF-8") from None


def parse_dsr(text: str, source: str = "<text>") -> DsrGraph:
    """Return the graph of the JSON text of RoboComp's DSR.

    Args:
        text: of the file.
        source: what messages call it.

    Raises:
        ExchangeError: if it is none.
    """
    top = _object(_decoded(text, source), _Place(source, "$"))
    place = _Place(source, "$").key("DSRModel")
    if "DSRModel" not in top:
        place.complain('there is none: a DSR file is {"DSRModel": {"symbols": {...}}}')
    model = _object(top["DSRModel"], place)
    symbols = place.key("symbols")
    nodes, links = [], []
    for key, symbol in _object(model.get("symbols", {}), symbols).items():
        node, more = _node(key, symbol, symbols.key(key))
        nodes.append(node)
        links.extend(more)
    _check_nodes(nodes, symbols)
    return DsrGraph(
        nodes=tuple(nodes),
        edges=tuple(_edges(links, {node.number for node in nodes})),
        extra=_without(top, "DSRModel"),
        model_extra=_without(model, "symbols"),
    )


def write_dsr(path: Path | str, graph: DsrGraph) -> None:
    """Write a graph to a JSON file for RoboComp's DSR, as a whole or not at all.

    Raises:
        ExchangeError: if the graph holds what JSON cannot write.
    """
    replace_file(Path(path), dsr_text(graph))


def replace_file(path: Path, text: str) -> None:
    """Write a file beside the one that is there, and then put it in its place."""
    beside = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        beside.write_text(text, encoding="utf-8")
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def dsr_text(graph: DsrGraph) -> str:
    """Return a graph as RoboComp's DSR writes it: keys in order, four spaces, empty lists over two lines.

    Raises:
        ExchangeError: if the graph holds what JSON cannot write.
    """
    links: dict[int, list[object]] = {node.number: [] for node in graph.nodes}
    for edge in graph.edges:
        if edge.origin not in links or edge.target not in links:
            raise ExchangeError(f"an edge {edge.label!r} goes from {edge.origin} to {edge.target}: one is no node")
        links[edge.origin].append(
            {
                **edge.extra,
                "src": str(edge.origin),
                "dst": str(edge.target),
                "label": edge.label,
                "linkAttribute": _spelled(edge.attributes),
            }
        )
    symbols = {
        str(node.number): {
            **node.extra,
            "id": str(node.number),
            "name": node.name,
            "type": node.type,
            "attribute": _spelled(node.attributes),
            "links": links[node.number],
        }
        for node in graph.nodes
    }
    tree: object = {**graph.extra, "DSRModel": {**graph.model_extra, "symbols": symbols}}
    check_json(tree, "<graph>")
    return "".join((*_pieces(tree, ""), "\n"))


def check_json(tree: object, source: str) -> None:
    """Do nothing if something can be written as JSON and was read without loss.

    Raises:
        ExchangeError: if a key stands twice, a text has half a character, or things stand in each other too deep.
    """
    waiting: list[tuple[object, _Place, int]] = [(tree, _Place(source, "$"), 1)]
    while waiting:
        each, place, depth = waiting.pop()
        if isinstance(each, _Twice):
            place.key(each.key).complain("it stands twice in one object: of the two only one can count")
        if isinstance(each, str) and any("\ud800" <= character <= "\udfff" for character in each):
            place.complain("a text with half a character (a lone surrogate) cannot be written down")
        if depth > DEEPEST:
            place.complain(f"more than {DEEPEST} objects and lists stand in each other")
        if isinstance(each, dict):
            waiting += [(key, place, 0) for key in each]
            waiting += [(value, place.key(str(key)), depth + 1) for key, value in each.items()]
        elif isinstance(each, (list, tuple)):
            waiting += [(value, place.item(at), depth + 1) for at, value in enumerate(each)]
        elif not isinstance(each, (str, int, float, bool, type(None))):
            place.complain(f"JSON has no {type(each).__name__}")


# Reading


class _Place:
    """Where something stands in a file, as a JSON path that is put together when it is told."""

    __slots__ = ("_above", "_source", "_step")

    def __init__(self, source: str, step: str, above: _Place | None = None) -> None:
        self._source = source
        self._step = step
        self._above = above

    def key(self, key: str) -> _Place:
        """Return the place of what stands under a key."""
        return _Place(self._source, f".{key}" if key.isidentifier() else f"[{json.dumps(key)}]", self)

    def item(self, at: int) -> _Place:
        """Return the place of one of a list."""
        return _Place(self._source, f"[{at}]", self)

    def complain(self, why: str) -> NoReturn:
        """Raise what is wrong here."""
        steps: list[str] = []
        place: _Place | None = self
        while place is not None:
            steps.append(place._step)
            place = place._above
        raise ExchangeError(f"{self._source}: {''.join(reversed(steps))}: {why}")


def _decoded(text: str, source: str) -> object:
    try:
        tree: object = json.loads(text, object_pairs_hook=_pairs, parse_int=_int, parse_constant=_constant)
    except json.JSONDecodeError as error:
        raise ExchangeError(f"{source}:{error.lineno}:{error.colno}: this is no JSON: {error.msg}") from None
    except RecursionError:
        raise ExchangeError(f"{source}: more than {DEEPEST} objects and lists stand in each other") from None
    except ValueError as error:
        raise ExchangeError(f"{source}: this is no JSON: {error}") from None
    check_json(tree, source)
    return tree


def _pairs(pairs: list[tuple[str, object]]) -> dict[str, object]:
    found = dict(pairs)
    if len(found) == len(pairs):
        return found
    twice = _Twice(found)
    keys = [key for key, _ in pairs]
    twice.key = next(key for at, key in enumerate(keys) if key in keys[:at])
    return twice


def _int(digits: str) -> int | float:
    return -0.0 if digits == "-0" else int(digits)


def _constant(name: str) -> NoReturn:
    raise ValueError(f"{name} is none of its numbers: write null, or the text {name!r}")


def _object(given: object, place: _Place) -> _Json:
    if not isinstance(given, dict):
        place.complain("there must be an object: {...}")
    return cast("_Json", given)


def _node(key: str, given: object, place: _Place) -> tuple[DsrNode, list[tuple[DsrEdge, _Place]]]:
    symbol = _object(given, place)
    number = _number(symbol, "id", place)
    if key != str(number):
        place.complain(f"the symbol under this key has the id {number}: both must be the same")
    links = symbol.get("links", [])
    if not isinstance(links, list):
        place.key("links").complain("there must be a list: [...]")
    places = [place.key("links").item(at) for at in range(len(links))]
    edges = [(_edge(_object(link, at), at), at) for link, at in zip(links, places, strict=True)]
    node = DsrNode(
        number=number,
        name=_word(symbol, "name", place),
        type=_word(symbol, "type", place),
        attributes=_values(symbol, "attribute", place),
        extra=_without(symbol, "id", "name", "type", "attribute", "links"),
    )
    return node, edges


def _edge(link: _Json, place: _Place) -> DsrEdge:
    return DsrEdge(
        origin=_number(link, "src", place),
        label=_word(link, "label", place),
        target=_number(link, "dst", place),
        attributes=_values(link, "linkAttribute", place),
        extra=_without(link, "src", "dst", "label", "linkAttribute"),
    )


def _values(owner: _Json, key: str, place: _Place) -> dict[str, DsrValue]:
    within = place.key(key)
    return {name: _value(each, within.key(name)) for name, each in _object(owner.get(key, {}), within).items()}


def _value(given: object, place: _Place) -> DsrValue:
    described = _object(given, place)
    if "type" not in described or "value" not in described:
        place.complain('an attribute is {"type": NUMBER, "value": VALUE}')
    code = described["type"]
    if isinstance(code, bool) or not isinstance(code, int):
        place.key("type").complain("the type of a value is a whole number, such as 0 for text or 2 for a float")
    try:
        value = understood(code, described["value"])
    except ValueError as error:
        name = ValueCode(code).name.lower()
        place.key("value").complain(f"{error}, and type {code} is {name}: change one of the two")
    return DsrValue(code=code, value=value, extra=_without(described, "type", "value"))


def _number(owner: _Json, key: str, place: _Place) -> int:
    try:
        number = cast("int", understood(ValueCode.UINT64, owner.get(key)))
    except ValueError:
        number = MOST_NUMBER + 1
    if number > MOST_NUMBER:
        place.key(key).complain(f"the number of a node belongs here, from 0 to {MOST_NUMBER}")
    return number


def _word(owner: _Json, key: str, place: _Place) -> str:
    found = owner.get(key)
    if not isinstance(found, str) or not found:
        place.key(key).complain("a text that is not empty belongs here")
    return found


def _without(owner: _Json, *keys: str) -> dict[str, object]:
    return {key: value for key, value in owner.items() if key not in keys}


def _check_nodes(nodes: list[DsrNode], place: _Place) -> None:
    numbers: dict[str, int] = {}
    for node in nodes:
        if node.name in numbers:
            also = place.key(str(node.number)).key("name")
            also.complain(f"{node.name!r} is the name of {numbers[node.name]} as well: names tell nodes apart")
        numbers[node.name] = node.number


def _edges(links: list[tuple[DsrEdge, _Place]], numbers: set[int]) -> Iterator[DsrEdge]:
    seen: set[tuple[int, str, int]] = set()
    for edge, place in links:
        for key, number in (("src", edge.origin), ("dst", edge.target)):
            if number not in numbers:
                place.key(key).complain(f"there is no symbol {number}: add it, or take the link away")
        if edge.key in seen:
            place.complain(f"there is a link {edge.label!r} from {edge.origin} to {edge.target} already")
        seen.add(edge.key)
        yield edge


# Writing


def _spelled(attributes: Mapping[str, DsrValue]) -> dict[str, object]:
    return {
        name: {**value.extra, "type": int(value.code), "value": spelled(value)} for name, value in attributes.items()
    }


def _pieces(tree: object, indent: str) -> Iterator[str]:
    """Yield the text of some JSON, as Qt indents it."""
    within = f"{indent}    "
    if isinstance(tree, dict):
        ordered = sorted(tree.items(), key=lambda each: str(each[0]).encode("utf-16-be"))
        yield from _enclosed("{}", [(f"{_scalar(key)}: ", value) for key, value in ordered], within, indent)
    elif isinstance(tree, (list, tuple)):
        yield from _enclosed("[]", [("", value) for value in tree], within, indent)
    else:
        yield _scalar(tree)


def _enclosed(brackets: str, items: list[tuple[str, object]], within: str, indent: str) -> Iterator[str]:
    yield f"{brackets[0]}\n"
    for at, (key, value) in enumerate(items, 1):
        yield f"{within}{key}"
        yield from _pieces(value, within)
        yield ",\n" if at < len(items) else "\n"
    yield f"{indent}{brackets[1]}"


def _scalar(content: object) -> str:
    if isinstance(content, float) and content.is_integer() and abs(content) < 2**53 and str(content) != "-0.0":
        content = int(content)
    try:
        return json.dumps(content, ensure_ascii=False, allow_nan=False)
    except ValueError:
        raise ExchangeError(f"JSON has no number {content!r}: make it a text") from None
