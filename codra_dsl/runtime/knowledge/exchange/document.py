"""A graph in the model of RoboComp's DSR: numbered nodes, labelled edges, attributes with a type code.

A graph holds the complete content of a file, whether or not the spec declares it. Values are plain Python;
`to_json_value` returns them as in RoboComp's JSON: integers of 64 bits as text, since other JSON readers parse numbers
as doubles.
"""

from __future__ import annotations

import json
import math
import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from functools import partial

MAX_NODE_NUMBER = 2**64 - 2
"""The largest number of a node; the next number means "no node" to RoboComp."""

_INTEGER_PATTERN = re.compile(r"[+-]?[0-9]{1,20}")


class ExchangeError(ValueError):
    """The input is not a graph; the message states the place, the mistake and the correction."""


class PlacedError(ExchangeError):
    """A mistake in a file.

    Attributes:
        reason: the message without the file and the place.
        path: the keys and indices in JSON from the top of the file to the mistake.
        position: the line and the column, where the text is neither JSON nor XML.
        is_missing_node: whether the mistake is an edge whose origin or target does not exist.
    """

    def __init__(
        self,
        source: str,
        reason: str,
        path: tuple[str | int, ...] | None = None,
        *,
        position: tuple[int, int] | None = None,
        is_missing_node: bool = False,
    ) -> None:
        self.reason = reason
        self.path = path or ()
        self.position = position
        self.is_missing_node = is_missing_node
        line_and_column = "" if position is None else f":{position[0]}:{position[1]}"
        path_text = "" if path is None else f" {_path_text(path)}:"
        super().__init__(f"{source}{line_and_column}:{path_text} {reason}")


def _path_text(path: tuple[str | int, ...]) -> str:
    steps = (f".{step}" if str(step).isidentifier() else f"[{json.dumps(step)}]" for step in path)
    return f"${''.join(steps)}"


class ValueCode(IntEnum):
    """The types of DSR's values, by their numbers in files. Values of other types are kept as JSON."""

    TEXT = 0
    INT32 = 1
    FLOAT = 2
    FLOATS = 3
    BOOL = 4
    BYTES = 5
    UINT32 = 6
    UINT64 = 7
    DOUBLE = 8
    UINT64S = 9
    FLOATS_2 = 10
    FLOATS_3 = 11
    FLOATS_4 = 12
    FLOATS_6 = 13


@dataclass(frozen=True, slots=True, kw_only=True)
class DsrValue:
    """The value of an attribute.

    Attributes:
        code: the number of the type, a `ValueCode` or another number.
        value: str, int, float, bool, bytes, or a tuple of numbers. None means a number that JSON cannot represent.
        extra: the other keys of the attribute in the file.
    """

    code: int
    value: object
    extra: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class DsrNode:
    """A node with a unique number and name; `extra` holds the other keys of the node in the file."""

    number: int
    name: str
    type: str
    attributes: Mapping[str, DsrValue] = field(default_factory=dict)
    extra: Mapping[str, object] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class DsrEdge:
    """An edge; two nodes have at most one edge per label and direction. `extra` holds its other keys."""

    origin: int
    label: str
    target: int
    attributes: Mapping[str, DsrValue] = field(default_factory=dict)
    extra: Mapping[str, object] = field(default_factory=dict)

    @property
    def key(self) -> tuple[int, str, int]:
        """Return the key that identifies the edge."""
        return (self.origin, self.label, self.target)


@dataclass(frozen=True, slots=True, kw_only=True)
class DsrGraph:
    """A graph.

    `extra` holds the further keys at the top level of the file, `model_extra` the further keys next to `symbols`. Nodes
    and edges keep their order in the file, but this order has no meaning: graphs that differ only in the order are
    equal.
    """

    nodes: tuple[DsrNode, ...] = ()
    edges: tuple[DsrEdge, ...] = ()
    extra: Mapping[str, object] = field(default_factory=dict)
    model_extra: Mapping[str, object] = field(default_factory=dict)

    def __eq__(self, other: object) -> bool:
        if not isinstance(other, DsrGraph):
            return NotImplemented
        has_equal_extras = (self.extra, self.model_extra) == (other.extra, other.model_extra)
        return has_equal_extras and self._sorted_content() == other._sorted_content()

    __hash__ = None  # type: ignore[assignment]  # its content is not hashable

    def _sorted_content(self) -> tuple[list[DsrNode], list[DsrEdge]]:
        edges = sorted(self.edges, key=lambda edge: (edge.origin, edge.target, edge.label))
        return sorted(self.nodes, key=lambda node: node.number), edges

    def node(self, name: str) -> DsrNode:
        """Return a node by its name.

        Raises:
            KeyError: if the name is unknown.
        """
        node = next((node for node in self.nodes if node.name == name), None)
        if node is None:
            raise KeyError(f"the node {name!r} does not exist")
        return node


def parse_value(code: int, json_data: object) -> object:
    """Return a value of a file as plain Python.

    As in RoboComp, integers and floats may be written as text, floats also with a decimal comma.

    Raises:
        ValueError: if the value does not have the type of the code.
    """
    reader = _READERS.get(code)
    return json_data if reader is None else reader(json_data)


def to_json_value(value: DsrValue) -> object:
    """Return a value as in RoboComp's JSON."""
    content = value.value
    match value.code:
        case ValueCode.UINT32 if isinstance(content, int):
            return content - 2**32 if content >= 2**31 else content  # RoboComp writes and reads it as a signed number
        case ValueCode.UINT64:
            return str(content)
        case ValueCode.UINT64S if isinstance(content, tuple):
            return [str(number) for number in content]
        case _ if isinstance(content, (tuple, bytes)):
            return [_finite_or_text(number) for number in content]
        case _:
            return _finite_or_text(content)


def encode_value(content: object, code: int | None = None, extra: Mapping[str, object] | None = None) -> DsrValue:
    """Return a plain value with the code of its type.

    Args:
        content: a value for `DsrValue.value`; lists and numpy arrays become tuples.
        code: the preferred code. If it is None, or cannot represent the value exactly, another code is chosen.
        extra: other keys of the value.

    Raises:
        ValueError: if no type can represent the value.
    """
    if code is not None and code not in _READERS:
        return DsrValue(code=code, value=content, extra=dict(extra or {}))
    plain_value = _plain_value(content)
    for candidate_code in (*(() if code is None else (code,)), *_preferred_codes(plain_value)):
        if _represents_exactly(plain_value, candidate_code):
            return DsrValue(code=candidate_code, value=plain_value, extra=dict(extra or {}))
    raise ValueError(f"DSR has no type for {type(content).__name__} {content!r:.60}")


def _represents_exactly(plain_value: object, code: int) -> bool:
    """Return whether a code represents a value without changing it."""
    try:
        decoded_value = parse_value(code, list(plain_value) if isinstance(plain_value, (tuple, bytes)) else plain_value)
    except ValueError:
        return False
    return type(decoded_value) is type(plain_value) and decoded_value == plain_value


def _plain_value(content: object) -> object:
    to_list = getattr(content, "tolist", None)
    content = to_list() if callable(to_list) else content
    return tuple(content) if isinstance(content, list) else content


def _preferred_codes(plain_value: object) -> Sequence[int]:
    """Return the codes that may represent a value, in order of preference."""
    if isinstance(plain_value, bool):
        return (ValueCode.BOOL,)
    if isinstance(plain_value, int):
        return (ValueCode.INT32, ValueCode.UINT64, ValueCode.DOUBLE)
    if isinstance(plain_value, tuple):
        is_integral = bool(plain_value) and all(type(number) is int for number in plain_value)
        return (ValueCode.UINT64S, ValueCode.FLOATS) if is_integral else (ValueCode.FLOATS,)
    return {str: (ValueCode.TEXT,), bytes: (ValueCode.BYTES,), float: (ValueCode.DOUBLE,)}.get(type(plain_value), ())


def _read_text(json_data: object) -> object:
    if isinstance(json_data, str):
        return json_data
    raise ValueError(f"{_value_text(json_data)} is not a text")


def _read_bool(json_data: object) -> object:
    if isinstance(json_data, bool):
        return json_data
    raise ValueError(f"{_value_text(json_data)} is neither true nor false")


def _read_integer(json_data: object, low: int, high: int) -> int:
    if (isinstance(json_data, str) and _INTEGER_PATTERN.fullmatch(json_data)) or (
        isinstance(json_data, float) and json_data.is_integer()
    ):
        json_data = int(json_data)
    if isinstance(json_data, bool) or not isinstance(json_data, int):
        raise ValueError(f"{_value_text(json_data)} is not an integer")
    if not low <= json_data <= high:
        raise ValueError(f"{_value_text(json_data)} lies outside [{low}, {high}]")
    return json_data


def _read_uint32(json_data: object) -> object:
    """Return an unsigned number; RoboComp writes a large one as the negative number with the same bits."""
    return _read_integer(json_data, -(2**31), 2**32 - 1) % 2**32


def _read_real(json_data: object) -> object:
    if json_data is None:
        return None
    if isinstance(json_data, str):
        try:
            return float(json_data.replace(",", "."))
        except ValueError:
            raise ValueError(f"{_value_text(json_data)} is not a number") from None
    if isinstance(json_data, bool) or not isinstance(json_data, (int, float)):
        raise ValueError(f"{_value_text(json_data)} is not a number")
    try:
        return float(json_data) if float(json_data) == json_data or json_data != json_data else json_data
    except OverflowError:
        raise ValueError(f"{_value_text(json_data)} is too large") from None


def _read_list(
    json_data: object, read: Callable[[object], object], required_length: int | None = None
) -> tuple[object, ...]:
    if not isinstance(json_data, list):
        raise ValueError(f"{_value_text(json_data)} is not a list")
    if required_length is not None and len(json_data) != required_length:
        raise ValueError(f"there are {len(json_data)} numbers instead of {required_length}")
    return tuple(read(number) for number in json_data)


def _read_bytes(json_data: object) -> object:
    return bytes(_read_integer(byte, 0, 255) for byte in _read_list(json_data, lambda number: number))


def _finite_or_text(content: object) -> object:
    """Return a value for JSON; a number that is not finite becomes a text, which RoboComp parses as this number."""
    return repr(content) if isinstance(content, float) and not math.isfinite(content) else content


_read_uint64 = partial(_read_integer, low=0, high=2**64 - 1)

_READERS: Mapping[int, Callable[[object], object]] = {
    ValueCode.TEXT: _read_text,
    ValueCode.INT32: partial(_read_integer, low=-(2**31), high=2**31 - 1),
    ValueCode.FLOAT: _read_real,
    ValueCode.FLOATS: partial(_read_list, read=_read_real),
    ValueCode.BOOL: _read_bool,
    ValueCode.BYTES: _read_bytes,
    ValueCode.UINT32: _read_uint32,
    ValueCode.UINT64: _read_uint64,
    ValueCode.DOUBLE: _read_real,
    ValueCode.UINT64S: partial(_read_list, read=_read_uint64),
    ValueCode.FLOATS_2: partial(_read_list, read=_read_real, required_length=2),
    ValueCode.FLOATS_3: partial(_read_list, read=_read_real, required_length=3),
    ValueCode.FLOATS_4: partial(_read_list, read=_read_real, required_length=4),
    ValueCode.FLOATS_6: partial(_read_list, read=_read_real, required_length=6),
}


def _value_text(json_data: object) -> str:
    if isinstance(json_data, (list, tuple)):
        return "a list"
    if json_data is None or isinstance(json_data, bool):
        return {None: "null", True: "true", False: "false"}[json_data]
    return "an object" if isinstance(json_data, dict) else f"{json_data!r:.60}"
