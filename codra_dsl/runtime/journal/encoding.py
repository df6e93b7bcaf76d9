"""Encode events as the JSON of a journal's messages, and decode them without loss.

Details that are None are left out. JSON has no infinite numbers, and many readers refuse numbers such as `1e999`, which
earlier versions wrote. Therefore an infinite number is written as the sign of infinity, 1 or -1, under another key:
instead of `value` under `infinite`, and instead of any other `key` under `infinite_key`. In a list, and as a text of
its own, it becomes `{"infinite": 1}` or `{"infinite": -1}`. NaN becomes null.
"""

from __future__ import annotations

import json
import math
import sys
from collections.abc import Callable, Mapping, Sequence
from functools import lru_cache
from json.encoder import encode_basestring
from typing import Any

from codra_dsl.runtime.journal.events import Event
from codra_dsl.runtime.journal.schemas import TOPICS, Kind
from codra_dsl.runtime.values.cell import Reason

_encode_json = json.JSONEncoder(ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode
_decode_json = json.JSONDecoder().decode

_KINDS_ON_SHARED_TOPICS = frozenset(kind for kind, topic in TOPICS.items() if topic.is_shared)
"""Kinds whose events share one topic."""

_INFINITE = "infinite"
_SIGNS = (1, -1)

_MAX_NUMBER = sys.float_info.max

_FIELDS_OF_OVERRIDES: Mapping[tuple[Kind, str], Mapping[str, str]] = {
    (Kind.INPUT, "override"): {"variable": "a text", "for_s": "a number", "detail": "a text", "step": "an integer"},
    (Kind.INPUT, "clear"): {"variable": "a text", "step": "an integer"},
    (Kind.OVERRIDE, "begun"): {"until_s": "a number", "detail": "a text"},
    (Kind.OVERRIDE, "expired"): {"source": "a text"},
    (Kind.OVERRIDE, "cleared"): {"source": "a text"},
}
"""The fields that the events of overrides always have, and their descriptions."""

_OPTIONAL_FIELDS_OF_OVERRIDES = {"value": "a value", "reason": "a reason", "work": "the number of a job"}

_FIELD_CHECKS: Mapping[str, Callable[[Any], bool]] = {
    "a text": lambda field: isinstance(field, str),
    "a number": lambda field: type(field) in (int, float) and abs(field) <= _MAX_NUMBER,
    "an integer": lambda field: type(field) is int,
    "a value": lambda field: field is None or isinstance(field, (bool, int, float, str)),
    "a reason": lambda field: field is None or field in tuple(Reason),
    "the number of a job": lambda field: field is None or type(field) is int,
}


class MalformedEventError(ValueError):
    """A message of a journal encodes an event that no run has written."""


def message_of(event: Event) -> bytes:
    """Return the JSON text of an event. It does not contain the kind of the event, which follows from the topic."""
    details = _uniform_details(event) if event.kind in _KINDS_ON_SHARED_TOPICS else event.details
    try:
        return bytes_of(_event_text(event, details))
    except (ValueError, TypeError):  # a number that is not finite, or a key that is not a text
        return _uncommon_message(event, details)


def _event_text(event: Event, details: Mapping[str, Any]) -> str:
    """Return the JSON text of an event. For objects as small as most events, this is faster than an encoder."""
    parts = [f'{{"instant_s":{_text(event.instant_s)},"name":{_text(event.name)},"what":{_key_text(event.what)}']
    for key, detail in details.items():
        if detail is not None:
            encode = _DETAIL_ENCODERS.get(type(detail), _uncommon_text)
            parts.append(f",{_key_text(key)}:{encode(detail)}")
    parts.append("}")
    return "".join(parts)


def _object_text(entries: Mapping[str, Any]) -> str:
    texts = [f"{_key_text(name)}:{_text(entry)}" for name, entry in entries.items() if entry is not None]
    return f"{{{','.join(texts)}}}"


def _array_text(elements: Sequence[Any]) -> str:
    return f"[{','.join(map(_text, elements))}]"


def _uncommon_text(detail: Any) -> str:
    if isinstance(detail, Mapping):
        return _object_text(detail)
    return _array_text(detail) if isinstance(detail, (list, tuple)) else _encode_json(detail)


def _text(value: Any) -> str:
    encode = _SCALAR_ENCODERS.get(type(value))
    return _encode_json(value) if encode is None else encode(value)


def _number_text(number: float) -> str:
    """Return the JSON text of a number. Many numbers are repeated, because all events of a step have one instant."""
    return _nonzero_text(number) if number else repr(number)  # 0.0 and -0.0 are equal


@lru_cache(maxsize=64)
def _nonzero_text(number: float) -> str:
    if not math.isfinite(number):
        raise ValueError(f"JSON has no number {number}")
    return repr(number)


@lru_cache(maxsize=1024)
def _key_text(key: str) -> str:
    return encode_basestring(key)


_SCALAR_ENCODERS: Mapping[type, Callable[[Any], str]] = {
    bool: lambda value: "true" if value else "false",
    int: int.__repr__,
    float: _number_text,
    str: encode_basestring,
    Reason: encode_basestring,
}

_DETAIL_ENCODERS: Mapping[type, Callable[[Any], str]] = {
    **_SCALAR_ENCODERS,
    dict: _object_text,
    list: _array_text,
    tuple: _array_text,
}


def _uncommon_message(event: Event, details: Mapping[str, Any]) -> bytes:
    fields: dict[str, Any] = {"instant_s": event.instant_s, "name": event.name, "what": event.what}
    fields |= {key: _without_none(detail) for key, detail in details.items() if detail is not None}
    try:
        return bytes_of(_encode_json(fields))
    except ValueError:  # a number that is not finite
        return bytes_of(_encode_nonfinite(_with_infinite_results(fields)))


def _without_none(detail: Any) -> Any:
    if not isinstance(detail, Mapping):
        return detail
    return {name: entry for name, entry in detail.items() if entry is not None}


def _uniform_details(event: Event) -> Mapping[str, Any]:
    """Return the details of an event on a shared topic, whose fields have the same type in all events."""
    details = event.details
    if details.get("value") is not None and not _is_infinite(details["value"]):
        details = {**details, "value": json_text(_without_none(details["value"]))}
    if event.kind is Kind.INPUT and isinstance(details.get("evidence_s"), float):
        details = {**details, "evidence_s": [details["evidence_s"]]}
    return details


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
        MalformedEventError: if the message encodes an event of an override that no run has written.
        ValueError, KeyError, TypeError: if the message does not encode an event.
    """
    fields = _decode_json(data.decode("utf-8", "surrogatepass"))
    if b'"infinite' in data:
        fields = _restore_event_fields(fields)
    instant_s, name, what = fields.pop("instant_s"), fields.pop("name"), fields.pop("what")
    if kind in _KINDS_ON_SHARED_TOPICS and isinstance(fields.get("value"), str):
        fields["value"] = parse_json(fields["value"])
    event = Event(float(instant_s), kind, str(name), str(what), fields)
    if kind is Kind.OVERRIDE or (kind is Kind.INPUT and (kind, event.what) in _FIELDS_OF_OVERRIDES):
        _check_override(event)
    return event


def _check_override(event: Event) -> None:
    """Refuse an event of an override that no run has written, because `why` and replay rely on its fields."""
    required_fields, fields = _FIELDS_OF_OVERRIDES.get((event.kind, event.what)), event.details
    if required_fields is None:
        raise MalformedEventError(f"{event.what!r:.60} is no event of an override")
    for key, expected in {**required_fields, **_OPTIONAL_FIELDS_OF_OVERRIDES}.items():
        if not _FIELD_CHECKS[expected](fields.get(key)):
            field_text = f"not {fields[key]!r:.60}" if key in fields else "but it is missing"
            raise MalformedEventError(f"'{key}' of an override is {expected}, {field_text}")


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
    if key == _INFINITE:
        return "value"
    original_key = key.removeprefix(f"{_INFINITE}_")
    return key if original_key == "value" else original_key  # `value` has one key for its sign, not two


def parse_json(text: str) -> Any:
    """Return the plain data of a text that `json_text` has written."""
    return _decode_plain_json(text)


_decode_plain_json = json.JSONDecoder(object_hook=restore_infinite).decode


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
