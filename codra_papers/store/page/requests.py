"""Parsing of requests from browsers. The bytes are untrusted."""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, TypeVar

from codra_papers.store.layout import DELIVERY, PICKING_AREAS, SUPPLY
from codra_papers.store.simulator.situations import OrderKind
from codra_papers.store.simulator.state import Load

TextT = TypeVar("TextT", bound=str)

MOST_BYTES = 1_024
"""The largest length of a request's body."""


class BadRequestError(ValueError):
    """A request is invalid. The message describes a valid request."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """An order to bring a container from one area to another."""

    kind: OrderKind
    area: str
    to: str


def read_order(body: bytes) -> Order:
    """Return the order in a body.

    Raises:
        BadRequestError: the body contains no valid order.
    """
    fields = _fields(body, {"kind", "area", "to"})
    kind = _choice("kind", fields, [*OrderKind])
    area = _choice("area", fields, [*PICKING_AREAS])
    if kind is OrderKind.PROVIDE:
        return Order(kind=kind, area=SUPPLY.name, to=area)
    if kind is OrderKind.COLLECT:
        return Order(kind=kind, area=area, to=DELIVERY.name)
    to = _choice("to", fields, [name for name in PICKING_AREAS if name != area])
    return Order(kind=kind, area=area, to=to)


def read_name(body: bytes) -> str:
    """Return the name of an order in a body.

    Raises:
        BadRequestError: the body contains no name of an order.
    """
    name = _fields(body, {"order"}).get("order")
    if not isinstance(name, str):
        raise BadRequestError("'order' must be the name of an order")
    return name


def read_load(body: bytes) -> Load:
    """Return the load of a container in a body.

    Raises:
        BadRequestError: the body contains no valid load.
    """
    return _choice("load", _fields(body, {"load"}), list(Load))


def _fields(body: bytes, keys: set[str]) -> Mapping[str, Any]:
    try:
        fields = json.loads(body.decode("utf-8"))
    except (ValueError, RecursionError):
        raise BadRequestError("the body is not JSON; send a JSON object") from None
    if not isinstance(fields, dict) or not fields.keys() <= keys:
        raise BadRequestError(f"the body must be an object with only the keys {' and '.join(sorted(keys))}")
    return fields


def _choice(key: str, fields: Mapping[str, Any], allowed_texts: Sequence[TextT]) -> TextT:
    match = next((text for text in allowed_texts if fields.get(key) == text), None)
    if match is None:
        raise BadRequestError(f"{key!r} must be one of {', '.join(allowed_texts)}")
    return match
