"""Encode events as the JSON of a journal's messages, and decode them without loss.

Details that are None are left out. Infinity becomes `1e999`, which is valid JSON and is parsed as infinity again.
"""

from __future__ import annotations

import json
import math
from collections.abc import Mapping
from typing import Any

from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.journal.schemas import TOPICS, Kind

_encode_json = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode

_KINDS_ON_SHARED_TOPICS = frozenset(kind for kind, topic in TOPICS.items() if topic.is_shared)
"""Kinds whose events share one topic."""

_SCALAR_TYPES = frozenset({bool, int, float, str})


def message_of(event: Event) -> bytes:
    """Return the JSON text of an event. It does not contain the kind of the event, which follows from the topic."""
    fields: dict[str, Any] = {"instant_s": event.instant_s, "name": event.name, "what": event.what}
    for key, detail in event.details.items():
        if type(detail) in _SCALAR_TYPES:
            fields[key] = detail
        elif isinstance(detail, Mapping):
            fields[key] = {name: inner_detail for name, inner_detail in detail.items() if inner_detail is not None}
        elif detail is not None:
            fields[key] = detail
    if event.kind in _KINDS_ON_SHARED_TOPICS:
        _make_uniform(event.kind, fields)
    return bytes_of(json_text(fields))


def _make_uniform(kind: Kind, fields: dict[str, Any]) -> None:
    """Change the fields of an event on a shared topic, so that a field has the same type in all events of the topic."""
    if "value" in fields:
        fields["value"] = json_text(fields["value"])
    if kind is Kind.INPUT and isinstance(fields.get("evidence_s"), float):
        fields["evidence_s"] = [fields["evidence_s"]]


def event_of(kind: Kind, data: bytes) -> Event:
    """Return the event that a message encodes.

    Raises:
        ValueError, KeyError, TypeError: if the message does not encode an event.
    """
    fields = json.loads(data)
    instant_s, name, what = fields.pop("instant_s"), fields.pop("name"), fields.pop("what")
    if kind in _KINDS_ON_SHARED_TOPICS and "value" in fields:
        fields["value"] = json.loads(fields["value"])
    return Event(float(instant_s), kind, str(name), str(what), fields)


def bytes_of(text: str) -> bytes:
    """Return JSON text in UTF-8. Lone surrogates, which UTF-8 cannot encode, are written as JSON escapes."""
    return text.encode("utf-8", "backslashreplace")


def json_text(value: Any) -> str:
    """Return plain data as JSON."""
    try:
        return _encode_json(value)
    except ValueError:  # a number that is not finite
        return _encode_nonfinite(value)


def _encode_nonfinite(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ",".join(f"{json.dumps(key)}:{_encode_nonfinite(element)}" for key, element in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ",".join(map(_encode_nonfinite, value)) + "]"
    if isinstance(value, float) and not math.isfinite(value):
        return "null" if value != value else "1e999" if value > 0 else "-1e999"
    return json.dumps(value, ensure_ascii=False)
