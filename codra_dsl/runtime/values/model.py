"""The declarations of the modelled context C_M in generated code, as frozen values (P1, Equation 3)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal

from codra_dsl.isolation.error_text import type_name
from codra_dsl.logic import Term, Value

Kind = Literal["bool", "int", "float", "str", "enum"]
_CLASSES_OF_KINDS: Mapping[str, type[bool] | type[int] | type[str] | tuple[type[int], type[float]]] = {
    "bool": bool,
    "int": int,
    "float": (int, float),
    "str": str,
    "enum": str,
}
_MAX_SHOWN_CHARACTERS = 60

MAX_TEXT_CHARACTERS = 10_000
"""The length in characters of the longest text that context can hold: context is for decisions, not for payload."""

MAX_INTEGER = 2**63 - 1
"""The largest integer that context can hold and the journal can write."""


class NotOfTypeError(ValueError):
    """A value does not have its declared type or range."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueType:
    """The type of a context-variable or of a returned value.

    Attributes:
        unit: the unit of the values, for display only; numbers are not converted.
        range: the lowest and the highest value, both included.
        members: the members of an enum.
        optional: whether a result may leave out the value.
    """

    kind: Kind
    unit: str | None = None
    range: tuple[float, float] | None = None
    members: tuple[str, ...] = ()
    optional: bool = False

    def convert(self, raw_value: object) -> Value | None:
        """Return a value converted to this type, or None for NaN, which means that the value is unknown.

        Args:
            raw_value: a value from a program; a numpy scalar is converted to the number that it holds.

        Raises:
            NotOfTypeError: if the value has another type, lies outside the range, or is not a member.
        """
        if (raw_value is True or raw_value is False) and self.kind == "bool":
            return raw_value
        plain_value: Any = raw_value if type(raw_value) in _PLAIN_TYPES else _plain_number(unbox(raw_value))
        value_class = type(plain_value)  # an object can lie about its `__class__`
        if (value_class is bool) != (self.kind == "bool") or not issubclass(value_class, _CLASSES_OF_KINDS[self.kind]):
            raise NotOfTypeError(f"{_value_text(plain_value)} is not of type {self.kind}")
        converted_value = _checked_text(plain_value) if isinstance(plain_value, str) else self._to_number(plain_value)
        if converted_value is not None:
            self._check_bounds(converted_value)
        return converted_value

    def converter(self) -> Callable[[object], Value | None]:
        """Return a faster `convert` for very many values. It checks only the bounds if the class of a value fits."""
        convert, (low, high) = self.convert, self.range or (-math.inf, math.inf)
        member_set: frozenset[object] = frozenset(self.members)

        def to_integer(raw_value: object) -> Value | None:
            return (
                raw_value if type(raw_value) is int and min_integer <= raw_value <= max_integer else convert(raw_value)
            )

        def to_float(raw_value: object) -> Value | None:
            return raw_value if type(raw_value) is float and low <= raw_value <= high else convert(raw_value)

        def to_member(raw_value: object) -> Value | None:
            return raw_value if type(raw_value) is str and raw_value in member_set else convert(raw_value)

        min_integer, max_integer = max(low, -MAX_INTEGER), min(high, MAX_INTEGER)
        return {"int": to_integer, "float": to_float, "enum": to_member}.get(self.kind, convert)

    def _to_number(self, plain_value: bool | int | float) -> bool | int | float | None:
        if isinstance(plain_value, int) and abs(plain_value) > MAX_INTEGER:
            raise NotOfTypeError(f"{_value_text(plain_value)} is too large")
        if self.kind != "float":
            return plain_value if isinstance(plain_value, bool) else int(plain_value)
        return None if plain_value != plain_value else float(plain_value)

    def _check_bounds(self, plain_value: Value) -> None:
        if (
            self.range is not None
            and isinstance(plain_value, (int, float))
            and not self.range[0] <= plain_value <= self.range[1]
        ):
            raise NotOfTypeError(f"{plain_value!r} lies outside [{self.range[0]:g}, {self.range[1]:g}]")
        if self.members and plain_value not in self.members:
            raise NotOfTypeError(f"{_value_text(plain_value)} is not one of {', '.join(self.members)}")


_PLAIN_TYPES = frozenset((bool, int, float, str))
"""Classes whose values contain no other value, so `unbox` need not be called."""


def unbox(raw_value: object) -> object:
    """Return the number in a numpy scalar; return anything else unchanged."""
    try:
        item = getattr(raw_value, "item", None)
        return item() if callable(item) else raw_value
    except Exception:  # noqa: BLE001 - an array of several values, or a foreign object
        return raw_value


def _plain_number(value: object) -> object:
    """Return an object of a subclass of `int` or `float` as a plain number, and anything else unchanged.

    A subclass can override each method that checks a value or converts it. Therefore the base class reads the number.
    """
    if isinstance(value, bool):
        return value
    if issubclass(type(value), int):
        return int.__int__(value)  # type: ignore[arg-type]
    return float.__float__(value) if issubclass(type(value), float) else value  # type: ignore[arg-type]


def _checked_text(raw_text: str) -> str:
    plain_text = str.__str__(raw_text)  # a member of a StrEnum becomes plain text
    length = max(len(plain_text), len(raw_text))  # the beginning of a longer text has the length of the complete text
    if length > MAX_TEXT_CHARACTERS:
        raise NotOfTypeError(f"a text of {length} characters is too long: the limit is {MAX_TEXT_CHARACTERS}")
    if not plain_text.isascii() and any("\ud800" <= character <= "\udfff" for character in plain_text):
        raise NotOfTypeError("a text with half a character (a lone surrogate) cannot be written to a file")
    return plain_text


def _value_text(value: Any) -> str:
    """Return the text of a value for a message. The `repr` of an object of another class is not called."""
    value_class = type(value)
    if issubclass(value_class, str):
        plain_text = str.__str__(value)
        is_short = len(plain_text) <= _MAX_SHOWN_CHARACTERS
        return repr(plain_text if is_short else f"{plain_text[:_MAX_SHOWN_CHARACTERS]}...")
    if issubclass(value_class, int) and abs(value) > MAX_INTEGER:
        return f"a number of {value.bit_length()} bits"
    is_plain = value is None or issubclass(value_class, (int, float))
    return repr(value) if is_plain else f"a {type_name(value)}"


def boolean(*, optional: bool = False) -> ValueType:
    """Return the type of booleans."""
    return ValueType(kind="bool", optional=optional)


def integer(
    low: int | None = None, high: int | None = None, *, unit: str | None = None, optional: bool = False
) -> ValueType:
    """Return the type of integers, within a range if one is given."""
    return ValueType(kind="int", unit=unit, range=_make_range(low, high), optional=optional)


def real(
    low: float | None = None, high: float | None = None, *, unit: str | None = None, optional: bool = False
) -> ValueType:
    """Return the type of numbers, within a range if one is given."""
    return ValueType(kind="float", unit=unit, range=_make_range(low, high), optional=optional)


def text(*, optional: bool = False) -> ValueType:
    """Return the type of strings."""
    return ValueType(kind="str", optional=optional)


def member(*members: str, optional: bool = False) -> ValueType:
    """Return the type of an enum with these members."""
    return ValueType(kind="enum", members=members, optional=optional)


def _make_range(low: float | None, high: float | None) -> tuple[float, float] | None:
    if low is None and high is None:
        return None
    return (-math.inf if low is None else low, math.inf if high is None else high)


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicModel:
    """A field of the messages of a ROS 2 topic, from which a variable gets its values.

    Attributes:
        topic: the name of the topic.
        type: the type of the messages, `package/msg/Name`.
        field: the path of the field: names with dots, and indices in brackets.
        writer: `main_execution` or the agent as which the values are written.
        factor: the number by which the field is multiplied to get a value in the unit of the variable.
        qos: the quality of service of the subscription.
    """

    topic: str
    type: str
    field: str
    writer: str
    factor: float = 1.0
    qos: Literal["default", "sensor_data", "latched"] = "default"


@dataclass(frozen=True, slots=True, kw_only=True)
class VariableModel:
    """A context-variable of C_M (P1, Equations 1 to 3).

    Attributes:
        sources: the permitted writers: `observer`, `main_execution`, agents.
        valid_for_s: how long evidence is valid.
        when_unobservable: whether the last value is kept when a precondition fails or a result is rejected.
        refresh: whether the variable is observed periodically, or after events.
        history: the largest number of readings that `ContextManager.history` returns.
        pose_condition: if the variable follows from the knowledge graph, its condition over `distance` and `in_view`,
            its distance, or the number of matches of a path; otherwise None.
        resolution_m: the step to which a distance is rounded.
        derived: if the variable is derived, the expression over its inputs; otherwise None.
        ros: the topic of ROS 2 from which the values come; None without a topic.
    """

    name: str
    type: ValueType
    label: str = ""
    sources: tuple[str, ...] = ("observer",)
    valid_for_s: float = math.inf
    when_unobservable: Literal["keep", "forget"] = "keep"
    refresh: Literal["periodic", "on_event"] = "periodic"
    history: int = 100
    pose_condition: Term | None = field(default=None, compare=False)
    resolution_m: float | None = None
    derived: Term | None = field(default=None, compare=False)
    ros: TopicModel | None = None

    @property
    def is_computed(self) -> bool:
        """Return whether the value follows from the graph or from other variables, so that it has no writer."""
        return self.pose_condition is not None or self.derived is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class Algorithm:
    """A perception algorithm pi: a passive callable and its needs (P1, section 3.2).

    Attributes:
        call: `package.module:function`, or a class with `perceive`; imported when the forest is built.
        parameters: constant arguments.
        handles: names of the resources whose handles the function receives.
        slots: resources of which each job uses a slot; at any time, one job can run in a slot.
        given: context-variables whose values the function receives; all of them must be known.
        returns: the type of each value of a result.
        timeout_s: a job that runs longer than this times out.
        min_interval_s: the minimum time between the starts of two jobs.
        isolate: whether the function runs in a thread of the program, or in a separate process.
        host: the program that runs the function, on this machine or another one; empty for the program of the context
            manager.
    """

    name: str
    call: str
    parameters: Mapping[str, Value] = field(default_factory=dict)
    handles: tuple[str, ...] = ()
    slots: tuple[str, ...] = ()
    given: tuple[str, ...] = ()
    returns: Mapping[str, ValueType] = field(default_factory=dict)
    timeout_s: float = 5.0
    min_interval_s: float = 0.0
    isolate: Literal["thread", "process"] = "thread"
    host: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectationModel:
    """A condition on a variable that a skill expects to become true, or to stay true, from the start of acting.

    Attributes:
        text: the expectation as written in the spec.
        condition: the condition over one variable that is to become true, or to stay true.
        within_s: how long it may take until the condition is true; infinite if the condition is to stay true while the
            skill acts.
    """

    text: str
    condition: Term
    within_s: float = math.inf

    @property
    def variable(self) -> str:
        """Return the variable of the condition."""
        (name,) = self.condition.variables()
        return name

    @property
    def is_to_become(self) -> bool:
        """Return whether the condition is to become true, rather than to stay true."""
        return self.within_s < math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class PreviewCondition:
    """A condition that must hold before a skill acts.

    Attributes:
        text: the condition as written in the spec.
    """

    text: str
    condition: Term


@dataclass(frozen=True, slots=True, kw_only=True)
class SkillModel:
    """A unit of main execution: the variables that it previews, monitors and changes (P1, Figure 1).

    Attributes:
        preview: the variables that the decision before acting needs. A variable that no condition reads must be known.
        preview_conditions: the conditions that must hold before the skill acts.
        expects: the conditions on monitored variables that are to become or to stay true.
    """

    name: str
    preview: tuple[str, ...] = ()
    preview_conditions: tuple[PreviewCondition, ...] = ()
    monitor: tuple[str, ...] = ()
    changes: tuple[str, ...] = ()
    expects: tuple[ExpectationModel, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class HandleModel:
    """How a site makes the handle of a resource.

    Attributes:
        call: `module:name` of a class or function.
        parameters: its arguments, with quantities in SI units.
    """

    call: str
    parameters: Mapping[str, Value] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class ResourceModel:
    """A resource that algorithms share: a handle or, if `slots` is given, slots for this number of jobs at a time.

    Attributes:
        handle: how the site makes the handle; None if the program must pass it to `start`.
    """

    name: str
    slots: int | None = None
    handle: HandleModel | None = None
