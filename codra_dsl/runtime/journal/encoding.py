"""Encode events as the JSON of a journal's messages, and decode them without loss.

Details that are None are left out. JSON has no infinite numbers, and many readers refuse numbers such as `1e999`, which
earlier versions wrote. Therefore an infinite number is written as the sign of infinity, 1 or -1, under another key:
instead of `value` under `infinite`, and instead of any other `key` under `infinite_key`. In a list, and as a text of
its own, it becomes `{"infinite": 1}` or `{"infinite": -1}`. NaN becomes null.
"""

from __future__ import annotations

import json
import math
from _json import encode_basestring, make_encoder
from collections.abc import Mapping
from typing import Any

from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.journal.schemas import TOPICS, Kind

_encoder = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":"))
# `JSONEncoder.encode` makes an encoder in C for each text, which takes longer than to encode an event
_encode_parts = make_encoder(None, _encoder.default, encode_basestring, None, ":", ",", False, False, False)

_KINDS_ON_SHARED_TOPICS = frozenset(kind for kind, topic in TOPICS.items() if topic.is_shared)
"""Kinds whose events share one topic."""

_SCALAR_TYPES = frozenset({bool, int, float, str})

_INFINITE = "infinite"
_SIGNS = (1, -1)


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
    try:
        return bytes_of(_encode_json(fields))
    except ValueError:  # a number that is not finite
        return bytes_of(_encode_nonfinite(_with_infinite_results(fields)))


def _encode_json(value: Any) -> str:
    return "".join(_encode_parts(value, 0))


def _make_uniform(kind: Kind, fields: dict[str, Any]) -> None:
    """Change the fields of an event on a shared topic, so that a field has the same type in all events of the topic."""
    if "value" in fields and not _is_infinite(fields["value"]):
        fields["value"] = json_text(fields["value"])
    if kind is Kind.INPUT and isinstance(fields.get("evidence_s"), float):
        fields["evidence_s"] = [fields["evidence_s"]]


def _with_infinite_results(fields: dict[str, Any]) -> dict[str, Any]:
    """Move the infinite results of a job to a field of their own; users have chosen the names of results."""
    results = fields.get("values")
    if not isinstance(results, Mapping):
        return fields
    signs = {name: _sign(result) for name, result in results.items() if _is_infinite(result)}
    finite_results = {name: result for name, result in results.items() if name not in signs}
    return {**fields, "values": finite_results, **({_INFINITE: signs} if signs else {})}


def event_of(kind: Kind, data: bytes) -> Event:
    """Return the event that a message encodes.

    Raises:
        ValueError, KeyError, TypeError: if the message does not encode an event.
    """
    fields = json.loads(data)
    if b'"infinite' in data:
        fields = _restore_event_fields(fields)
    instant_s, name, what = fields.pop("instant_s"), fields.pop("name"), fields.pop("what")
    if kind in _KINDS_ON_SHARED_TOPICS and isinstance(fields.get("value"), str):
        fields["value"] = parse_json(fields["value"])
    return Event(float(instant_s), kind, str(name), str(what), fields)


def _restore_event_fields(fields: dict[str, Any]) -> dict[str, Any]:
    restored: dict[str, Any] = restore_infinite({key: _restore_elements(field) for key, field in fields.items()})
    if "values" in restored:
        signs = restored.pop(_INFINITE, {})
        restored["values"] = {**restored["values"], **{name: sign * math.inf for name, sign in signs.items()}}
    return restored


def _restore_elements(field: Any) -> Any:
    return list(map(_restore_element, field)) if isinstance(field, list) else field


def _restore_element(element: Any) -> Any:
    return restore_infinite(element) if isinstance(element, dict) else element


def restore_infinite(entries: dict[str, Any]) -> Any:
    """Return an object of JSON with its infinite numbers; pass it to `json.loads` as `object_hook`."""
    keys = [key for key in entries if key.startswith(_INFINITE)]
    if not keys:
        return entries
    if keys == [_INFINITE] == list(entries) and entries[_INFINITE] in _SIGNS:
        return entries[_INFINITE] * math.inf
    restored = {}
    for key, entry in entries.items():
        original_key = _original_key(key)
        is_sign = original_key not in (key, *entries) and type(entry) is int and entry in _SIGNS
        restored[original_key if is_sign else key] = entry * math.inf if is_sign else entry
    return restored


def _original_key(key: str) -> str:
    return "value" if key == _INFINITE else key.removeprefix(f"{_INFINITE}_")


def parse_json(text: str) -> Any:
    """Return the plain data of a text that `json_text` has written."""
    return json.loads(text, object_hook=restore_infinite)


def bytes_of(text: str) -> bytes:
    """Return JSON text in UTF-8. Lone surrogates, which UTF-8 cannot encode, are written as JSON escapes."""
    return text.encode("utf-8", "backslashreplace")


def json_text(value: Any) -> str:
    """Return plain data as JSON. No two keys of an object may differ only by the prefix `infinite_`."""
    try:
        return _encode_json(value)
    except ValueError:  # a number that is not finite
        return _encode_nonfinite(value)


def _encode_nonfinite(value: Any) -> str:
    if isinstance(value, Mapping):
        return "{" + ",".join(_encode_entry(key, element) for key, element in value.items()) + "}"
    if isinstance(value, (list, tuple)):
        return "[" + ",".join(map(_encode_nonfinite, value)) + "]"
    if _is_infinite(value):
        return f'{{"{_INFINITE}":{_sign(value)}}}'
    return "null" if value != value else json.dumps(value, ensure_ascii=False)


def _encode_entry(key: str, element: Any) -> str:
    if _is_infinite(element):
        key, element = _INFINITE if key == "value" else f"{_INFINITE}_{key}", _sign(element)
    return f"{json.dumps(key, ensure_ascii=False)}:{_encode_nonfinite(element)}"


def _is_infinite(value: Any) -> bool:
    return isinstance(value, float) and math.isinf(value)


def _sign(number: float) -> int:
    return 1 if number > 0 else -1
