"""Version 1 of the manager's message interface: requests, answers and notices, all of plain data.

A message is a JSON object. A request names its operation in `ask`. A request may have an `id`, which the answer or
error to the request repeats:

    {"codra": 1, "id": 7, "ask": "get", "variable": "door_open"}
    {"codra": 1, "id": 7, "answer": {"reading": {"variable": "door_open", "known": true, "value": false, ...}}}

A notice is sent without a request: a new reading of a subscription, or the end of the lease.
"""

from __future__ import annotations

import math
import sys
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any

from codra_dsl.isolation.error_text import type_name
from codra_dsl.logic import Value
from codra_dsl.runtime.context.commands import NotDeclaredError
from codra_dsl.runtime.errors import AgentTakenError, NotASourceError, UnknownNameError, suggestion_text
from codra_dsl.runtime.geometry import FrameError
from codra_dsl.runtime.knowledge import AbsentError, ConflictError, OutrankedError, PresentError, RuleError
from codra_dsl.runtime.values.cell import Reading, Reason
from codra_dsl.runtime.values.model import NotOfTypeError, ValueType, unbox
from codra_dsl.runtime.values.previews import PreviewAnswer, UnknownVariable

VERSION = 1

PlainData = dict[str, Any]
"""A message, or a part of one: text, numbers, truth values, None, lists and mappings of these."""

MAX_NAMES = 10_000
"""The maximum number of names in one request."""

MAX_ID_CHARACTERS = 128
"""The maximum length of the `id` of a request."""

MAX_ID = 2**63 - 1
"""The largest `id` of a request that is a number."""

MAX_NAME_CHARACTERS = 1_000
"""The maximum length of a name in a request."""

MAX_ERROR_CHARACTERS = 2_000
"""The maximum length of the message of an error; the rest is cut off, because errors repeat parts of requests."""

MAX_LEASE_S = 3600.0
"""The longest lease that a session can request, so that a program that hangs does not keep its place for good."""

LARGEST_NUMBER = sys.float_info.max
"""The largest finite number; integers in JSON can be larger than this."""


class FieldType(StrEnum):
    """The type of a field of a request."""

    TEXT = f"a text of at most {MAX_NAME_CHARACTERS} characters"
    TEXTS = f"a list of at most {MAX_NAMES} texts"
    INTEGER = "an integer"
    NUMBER = "a number"
    DURATION = "a number that is not negative"
    LEASE = f"a number of seconds from 0 to {MAX_LEASE_S:g}"
    TRUTH = "true or false"
    VALUE = "a text, a number, or true or false"
    VALUES = f"a list of at most {MAX_NAMES} objects with `name` and `value`"
    INSTANTS = "a list of two numbers"
    ATTRIBUTES = f"a list of at most {MAX_NAMES} objects with `name` and, unless it is unknown, `value`"
    POSE = "a list of seven numbers"

    def holds(self, value: object) -> bool:
        """Return whether a value has this type."""
        is_number = _is_number(value)
        match self:
            case FieldType.TEXT:
                return _is_name(value)
            case FieldType.TEXTS:
                is_list = isinstance(value, (list, tuple)) and len(value) <= MAX_NAMES
                return is_list and all(map(_is_name, value))  # type: ignore[call-overload]
            case FieldType.INTEGER:
                return isinstance(value, int) and is_number
            case FieldType.NUMBER:
                return is_number
            case FieldType.DURATION:
                return is_number and value >= 0  # type: ignore[operator]
            case FieldType.LEASE:
                return is_number and 0 <= value <= MAX_LEASE_S  # type: ignore[operator]
            case FieldType.TRUTH:
                return isinstance(value, bool)
            case FieldType.VALUE:
                return is_number or isinstance(value, (bool, str))
            case FieldType.VALUES:
                return isinstance(value, list) and len(value) <= MAX_NAMES and all(map(_is_named_value, value))
            case FieldType.INSTANTS:
                return _is_numbers(value, 2)
            case FieldType.ATTRIBUTES:
                return isinstance(value, list) and len(value) <= MAX_NAMES and all(map(_is_attribute, value))
            case FieldType.POSE:
                return _is_numbers(value, 7)


def _is_number(value: object) -> bool:
    """Return whether a value is a number that a float can hold. A message states an infinite number by its sign."""
    if isinstance(value, float):
        return not math.isnan(value)
    return isinstance(value, int) and not isinstance(value, bool) and abs(value) <= LARGEST_NUMBER


def _is_numbers(value: object, count: int) -> bool:
    return isinstance(value, list) and len(value) == count and all(map(_is_number, value))


def _is_name(value: object) -> bool:
    return isinstance(value, str) and len(value) <= MAX_NAME_CHARACTERS


def _is_named_value(value: object) -> bool:
    is_mapping = isinstance(value, Mapping) and set(value) == {"name", "value"}
    return is_mapping and _is_name(value["name"]) and FieldType.VALUE.holds(value["value"])  # type: ignore[index]


def _is_attribute(value: object) -> bool:
    is_unknown = isinstance(value, Mapping) and set(value) == {"name"} and _is_name(value["name"])
    return is_unknown or _is_named_value(value)


@dataclass(frozen=True, slots=True, kw_only=True)
class RequestShape:
    """The fields of one kind of request."""

    required: Mapping[str, FieldType] = field(default_factory=dict)
    optional: Mapping[str, FieldType] = field(default_factory=dict)


_DECISION_LIMITS = {
    "max_age_s": FieldType.DURATION,
    "since_s": FieldType.NUMBER,
    "wait_up_to_s": FieldType.DURATION,
}

_JOB = {"algorithm": FieldType.TEXT, "index": FieldType.INTEGER}
"""The fields that identify a job."""

_EDGE = {"origin": FieldType.TEXT, "type": FieldType.TEXT, "target": FieldType.TEXT}
_WRITE = {"value": FieldType.VALUE, "evidence_s": FieldType.NUMBER}
_VALUES = {"values": FieldType.ATTRIBUTES}
_REQUEST = {"task": FieldType.TEXT, "number": FieldType.INTEGER}
"""The fields that identify a request of a task."""


def _operation(required: Mapping[str, FieldType], optional: Mapping[str, FieldType] | None = None) -> RequestShape:
    return RequestShape(required=required, optional={**(optional or {}), "change": FieldType.INTEGER})


OPERATIONS: Mapping[str, RequestShape] = {
    "insert_node": _operation({"name": FieldType.TEXT, "type": FieldType.TEXT}, _VALUES),
    "delete_node": _operation({"name": FieldType.TEXT}),
    "set_attribute": _operation({"name": FieldType.TEXT, "attribute": FieldType.TEXT}, _WRITE),
    "insert_edge": _operation(_EDGE, _VALUES),
    "delete_edge": _operation(_EDGE),
    "set_edge_attribute": _operation({**_EDGE, "attribute": FieldType.TEXT}, _WRITE),
    "place": _operation({**_EDGE, "pose": FieldType.POSE}, {"stamp_s": FieldType.NUMBER}),
    "request_task": _operation({"task": FieldType.TEXT}, _VALUES),
    "acknowledge_task": _operation(_REQUEST),
    "finish_task": _operation({**_REQUEST, "result": FieldType.TEXT}),
    "abort_task": _operation(_REQUEST),
}
"""The requests by which an agent writes the knowledge graph: at once, or with `change` as a part of a transaction."""

AGENT_REQUESTS: Mapping[str, RequestShape] = {
    "graph": RequestShape(optional={"digest": FieldType.TEXT}),
    "enter": RequestShape(required={"agent": FieldType.TEXT}),
    "exit": RequestShape(),
    **OPERATIONS,
    "begin_change": RequestShape(optional={"rule": FieldType.TEXT}),
    "end_change": RequestShape(required={"change": FieldType.INTEGER}, optional={"discard": FieldType.TRUTH}),
    "check_rule": RequestShape(required={"rule": FieldType.TEXT}),
    "record_rule": RequestShape(
        required={"rule": FieldType.TEXT, "state": FieldType.TEXT}, optional={"message": FieldType.TEXT}
    ),
}
"""The requests of programs that share the knowledge graph; all but `graph` are those of agents."""

REQUESTS: Mapping[str, RequestShape] = {
    "hello": RequestShape(optional={"lease_s": FieldType.LEASE, "token": FieldType.TEXT}),
    "keep": RequestShape(),
    "declare": RequestShape(required={"variable": FieldType.TEXT}, optional={"value": FieldType.VALUE}),
    "withdraw": RequestShape(required={"variable": FieldType.TEXT}),
    "expect": RequestShape(required={"skills": FieldType.TEXTS}),
    "begin": RequestShape(required={"skill": FieldType.TEXT}),
    "act": RequestShape(required={"number": FieldType.INTEGER}),
    "acted": RequestShape(required={"number": FieldType.INTEGER}),
    "finish": RequestShape(required={"number": FieldType.INTEGER}),
    "describe": RequestShape(required={"variable": FieldType.TEXT}),
    "get": RequestShape(required={"variable": FieldType.TEXT}),
    "why": RequestShape(required={"name": FieldType.TEXT}),
    "obstacle": RequestShape(required={"variable": FieldType.TEXT}),
    "set": RequestShape(
        required={"variable": FieldType.TEXT, "value": FieldType.VALUE},
        optional={"evidence_s": FieldType.NUMBER, "agent": FieldType.TEXT},
    ),
    "override": RequestShape(
        required={"variable": FieldType.TEXT, "for_s": FieldType.DURATION, "reason": FieldType.TEXT},
        optional={"value": FieldType.VALUE},
    ),
    "clear_override": RequestShape(required={"variable": FieldType.TEXT}),
    "decide": RequestShape(
        required={"variable": FieldType.TEXT}, optional={**_DECISION_LIMITS, "shadow": FieldType.TRUTH}
    ),
    "preview": RequestShape(
        required={"skill": FieldType.TEXT}, optional={**_DECISION_LIMITS, "looks": FieldType.TRUTH}
    ),
    "found": RequestShape(
        required={"decision": FieldType.INTEGER}, optional={"value": FieldType.VALUE, "raised": FieldType.TEXT}
    ),
    "subscribe": RequestShape(required={"variables": FieldType.TEXTS}),
    "unsubscribe": RequestShape(required={"subscription": FieldType.INTEGER}),
    "leave": RequestShape(),
    "attach": RequestShape(required={"host": FieldType.TEXT}, optional={"digest": FieldType.TEXT}),
    "evidence": RequestShape(
        required={
            **_JOB,
            "start_s": FieldType.NUMBER,
            "stamp_s": FieldType.NUMBER,
            "earliest_s": FieldType.NUMBER,
            "host_s": FieldType.INSTANTS,
        }
    ),
    "ended": RequestShape(required=_JOB, optional={"values": FieldType.VALUES, "message": FieldType.TEXT}),
    **AGENT_REQUESTS,
}
"""The kinds of requests; `attach`, `evidence` and `ended` are those of hosts."""


class MessageError(ValueError):
    """A message is not a request of this version."""


class LeaseError(RuntimeError):
    """A request came from a session that is over."""


class NotPermittedError(PermissionError):
    """The user of a session may not make a request."""


class TokenError(PermissionError):
    """A connection to a port does not begin with `hello` and the token of the manager."""


ERRORS: Mapping[str, type[Exception]] = {
    "malformed": MessageError,
    "lease_over": LeaseError,
    "wrong_token": TokenError,
    "not_permitted": NotPermittedError,
    "unknown_name": UnknownNameError,
    "not_declared": NotDeclaredError,
    "not_a_source": NotASourceError,
    "agent_taken": AgentTakenError,
    "outranked": OutrankedError,
    "rule": RuleError,
    "conflict": ConflictError,
    "absent": AbsentError,
    "present": PresentError,
    "frame": FrameError,
    "not_of_type": NotOfTypeError,
    "not_allowed": ValueError,
    "closed": RuntimeError,
}
"""The kinds of errors, ordered from special to general."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """A request with valid fields.

    Attributes:
        id: the ID that the answer repeats; None if the request has no ID.
        ask: the operation, a key of `REQUESTS`.
        fields: the other fields.
    """

    id: int | str | None
    ask: str
    fields: PlainData


def request_of(message: object) -> Request:
    """Return the request of a message.

    Raises:
        MessageError: if the message is not a request of this version.
    """
    if not isinstance(message, Mapping):
        raise MessageError("a message must be a mapping")
    if message.get("id") is not None and id_of(message) is None:
        raise MessageError(f"`id` must be a text of at most {MAX_ID_CHARACTERS} characters or an integer of 64 bits")
    if message.get("codra") != VERSION or isinstance(message["codra"], bool):
        raise MessageError(f"this interface has version {VERSION}: set `codra: {VERSION}`")
    ask = message.get("ask")
    if not isinstance(ask, str) or ask not in REQUESTS:
        name = ask if isinstance(ask, str) and len(ask) <= MAX_NAME_CHARACTERS else ""
        raise MessageError(f"`ask` must be one of {', '.join(REQUESTS)}{suggestion_text(name, REQUESTS)}")
    fields = {key: content for key, content in message.items() if key not in ("codra", "id", "ask")}
    _check_fields(ask, fields)
    return Request(id=id_of(message), ask=ask, fields=fields)


def id_of(message: object) -> int | str | None:
    """Return the `id` of a message; None if it is missing, too long, or neither an integer nor a text."""
    message_id = message.get("id") if isinstance(message, Mapping) else None
    if isinstance(message_id, str):
        return message_id if len(message_id) <= MAX_ID_CHARACTERS else None
    if isinstance(message_id, int) and not isinstance(message_id, bool):
        return message_id if abs(message_id) <= MAX_ID else None
    return None


def answer_to(request_id: int | str | None, answer: PlainData) -> PlainData:
    """Return the message that answers a request."""
    return {"codra": VERSION, "id": request_id, "answer": answer}


def error_to(request_id: int | str | None, error: Exception) -> PlainData:
    """Return the message that reports the error of a request."""
    kind = next(kind for kind, error_type in ERRORS.items() if isinstance(error, error_type))
    return {"codra": VERSION, "id": request_id, "error": {"kind": kind, "message": str(error)[:MAX_ERROR_CHARACTERS]}}


def notice(notice_kind: str, **fields: object) -> PlainData:
    """Return a message that is sent without a request."""
    return {"codra": VERSION, "notice": notice_kind, **fields}


def error_of(plain: Mapping[str, Any]) -> Exception:
    """Return the exception that an `error` describes."""
    return ERRORS.get(str(plain.get("kind")), RuntimeError)(str(plain.get("message", "")))


REPORTED_ERRORS = tuple(ERRORS.values())
"""The errors that are caused by the sender of a request."""


def plain_value(value: object) -> Value | None:
    """Return a value of a program as a message carries it: the number in a numpy scalar; None for None and NaN.

    Raises:
        NotOfTypeError: if no message can carry the value.
    """
    plain: Any = unbox(value)
    if plain is None or (isinstance(plain, float) and math.isnan(plain)):
        return None
    if not FieldType.VALUE.holds(plain):
        raise NotOfTypeError(f"a value is {FieldType.VALUE}, not this {type_name(plain)}")
    return plain  # type: ignore[no-any-return]


def plain_type(value_type: ValueType) -> PlainData:
    """Return the type of a variable as plain data."""
    value_range = None if value_type.range is None else list(value_type.range)
    return {
        "kind": value_type.kind,
        "unit": value_type.unit,
        "range": value_range,
        "members": list(value_type.members),
    }


def type_of(plain: Mapping[str, Any]) -> ValueType:
    """Return the type of a variable that plain data describes."""
    low_and_high = plain["range"]
    value_range = None if low_and_high is None else (float(low_and_high[0]), float(low_and_high[1]))
    return ValueType(kind=plain["kind"], unit=plain["unit"], range=value_range, members=tuple(plain["members"]))


def plain_reading(reading: Reading[Any]) -> PlainData:
    """Return a reading as plain data; infinite instants and an unknown value are None."""
    return {
        "variable": reading.name,
        "known": reading.known,
        "value": reading.content,
        "reason": None if reading.reason is None else reading.reason.value,
        "detail": reading.detail,
        "source": reading.source,
        **{name: _finite_or_none(getattr(reading, name)) for name in _INSTANTS},
    }


def plain_preview(answer: PreviewAnswer) -> PlainData:
    """Return the answer to a preview as plain data; `outcome` is holds, violated or unknown."""
    return {
        "skill": answer.skill,
        "outcome": str(answer.outcome),
        "violated": list(answer.violated),
        "undecided": list(answer.undecided),
        "unknown": [
            {"variable": variable.name, "reason": variable.reason, "detail": variable.detail}
            for variable in answer.unknown
        ],
    }


def preview_of(plain: Mapping[str, Any]) -> PreviewAnswer:
    """Return the answer to a preview that plain data describes."""
    return PreviewAnswer(
        skill=plain["skill"],
        violated=tuple(plain["violated"]),
        undecided=tuple(plain["undecided"]),
        unknown=tuple(
            UnknownVariable(name=entry["variable"], reason=entry["reason"], detail=entry["detail"])
            for entry in plain["unknown"]
        ),
    )


def reading_of(plain: Mapping[str, Any]) -> Reading[Any]:
    """Return the reading that plain data describes."""
    instants = {name: plain[name] for name in _INSTANTS if plain[name] is not None}
    return Reading(
        name=plain["variable"],
        content=plain["value"],
        reason=None if plain["reason"] is None else Reason(plain["reason"]),
        detail=plain["detail"],
        source=plain["source"],
        **instants,
    )


_INSTANTS = ("evidence_s", "start_s", "identified_s", "expires_s")


def _finite_or_none(number: float) -> float | None:
    return number if math.isfinite(number) else None


def _check_fields(ask: str, fields: PlainData) -> None:
    shape = REQUESTS[ask]
    field_types = {**shape.required, **shape.optional}
    for name in shape.required:
        if name not in fields:
            raise MessageError(f"`{ask}` needs `{name}`: {shape.required[name]}")
    for name, value in fields.items():
        if name not in field_types:
            shown_name = str(name)[:MAX_NAME_CHARACTERS]
            raise MessageError(f"`{ask}` has no field {shown_name!r}{suggestion_text(shown_name, field_types)}")
        if not field_types[name].holds(value):
            raise MessageError(f"`{name}` of `{ask}` must be {field_types[name]}")
