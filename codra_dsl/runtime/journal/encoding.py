"""Encode events as the JSON of a journal's messages, and decode them without loss.

Details that are None are left out. An infinite number becomes `1e999`, which is valid JSON and is parsed as infinity.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.journal.schemas import TOPICS, Kind

_encoded = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode

_SHARED = frozenset(kind for kind, topic in TOPICS.items() if topic.is_shared)
"""Kinds whose events share one topic."""

_SCALARS = frozenset({bool, int, float, str})


def message_of(event: Event) -> bytes:
    """Return the JSON text of an event, without its kind, which the topic determines."""
    plain: dict[str, Any] = {"instant_s": event.instant_s, "name": event.name, "what": event.what}
    for key, detail in event.details.items():
        if type(detail) in _SCALARS:
            plain[key] = detail
        elif isinstance(detail, Mapping):
            plain[key] = {name: part for name, part in detail.items() if part is not None}
        elif detail is not None:
            plain[key] = detail
    if event.kind in _SHARED:
        _make_uniform(event.kind, plain)
    return bytes_of(json_text(plain))


def _make_uniform(kind: Kind, plain: dict[str, Any]) -> None:
    """Give each field that events on a shared topic have in common a single type."""
    if "value" in plain:
        plain["value"] = json_text(plain["value"])
    if kind is Kind.INPUT and isinstance(plain.get("evidence_s"), float):
        plain["evidence_s"] = [plain["evidence_s"]]


def event_of(kind: Kind, data: bytes) -> Event:
    """Return the event that a message encodes.

    Raises:
        ValueError, KeyError, TypeError: if the message does not encode an event.
    """
    plain = json.loads(data)
    instant_s, name, what = plain.pop("instant_s"), plain.pop("name"), plain.pop("what")
    if kind in _SHARED and "value" in plain:
        plain["value"] = json.loads(plain["value"])
    return Event(float(instant_s), kind, str(name), str(what), plain)


def bytes_of(text: str) -> bytes:
    """Return JSON text in UTF-8; lone surrogates, which UTF-8 cannot encode, are written as JSON escapes."""
    return text.encode("utf-8", "backslashreplace")


def json_text(value: Any) -> str:
    """Return plain data as JSON."""
    try:
        return _encoded(value)
    except ValueError:  # a number that is not finite
        return _encode_nonfinite(value)


def _encode_nonfinite(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{json.dumps(key)}:{_encode_nonfinite(part)}" for key, part in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ",".join(map(_encode_nonfinite, value)) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return "null" if value != value else "1e999" if value > 0 else "-1e999"
    return json.dumps(value, ensure_ascii=False)
