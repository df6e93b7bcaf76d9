"""What a browser may ask for, read from untrusted bytes."""

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
"""A request is not longer."""


class BadRequestError(ValueError):
    """A request says nothing that the page understands; the message says what it would."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Order:
    """A container is to be brought from one area to another."""

    kind: OrderKind
    area: str
    to: str


def read_order(body: bytes) -> Order:
    """Return the order that a body says.

    Raises:
        BadRequestError: if it says none.
    """
    said = _mapping(body, {"kind", "area", "to"})
    kind = _one_of("kind", said, [*OrderKind])
    area = _one_of("area", said, [*PICKING_AREAS])
    if kind is OrderKind.PROVIDE:
        return Order(kind=kind, area=SUPPLY.name, to=area)
    if kind is OrderKind.COLLECT:
        return Order(kind=kind, area=area, to=DELIVERY.name)
    to = _one_of("to", said, [name for name in PICKING_AREAS if name != area])
    return Order(kind=kind, area=area, to=to)


def read_name(body: bytes) -> str:
    """Return the name of the order that a body says.

    Raises:
        BadRequestError: if it says none.
    """
    said = _mapping(body, {"order"}).get("order")
    if not isinstance(said, str):
        raise BadRequestError("'order' is the name of an order")
    return said


def read_load(body: bytes) -> Load:
    """Return the load of the container that a body says.

    Raises:
        BadRequestError: if it says none.
    """
    return _one_of("load", _mapping(body, {"load"}), list(Load))


def _mapping(body: bytes, keys: set[str]) -> Mapping[str, Any]:
    try:
        said = json.loads(body.decode("utf-8"))
    except (ValueError, RecursionError):
        raise BadRequestError("the body is no JSON") from None
    if not isinstance(said, dict) or not said.keys() <= keys:
        raise BadRequestError(f"the body is no object with {' and '.join(sorted(keys))} alone")
    return said


def _one_of(key: str, said: Mapping[str, Any], allowed: Sequence[TextT]) -> TextT:
    found = next((each for each in allowed if said.get(key) == each), None)
    if found is None:
        raise BadRequestError(f"{key!r} is one of {', '.join(allowed)}")
    return found
