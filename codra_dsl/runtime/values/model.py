"""What generated code declares of the modelled context C_M, as frozen values (P1, Equation 3)."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Literal

from codra_dsl.logic import Term, Value

Kind = Literal["bool", "int", "float", "str", "enum"]
_CLASSES: Mapping[str, type[bool] | type[int] | type[str] | tuple[type[int], type[float]]] = {
    "bool": bool,
    "int": int,
    "float": (int, float),
    "str": str,
    "enum": str,
}
_MAX_SHOWN = 60

MAX_TEXT = 10_000
"""Characters of the longest text that context can hold: it is for decisions, not for payload."""

MAX_WHOLE = 2**63 - 1
"""The largest whole number that context can hold, and the journal can write."""


class NotOfTypeError(ValueError):
    """A value is not what its declaration says."""


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueType:
    """The type of a context-variable or of a returned value.

    Attributes:
        unit: the unit that values are in, for people; numbers are taken as they are.
        range: both ends inclusive.
        members: of an enum.
        optional: whether a result may leave the value out.
    """

    kind: Kind
    unit: str | None = None
    range: tuple[float, float] | None = None
    members: tuple[str, ...] = ()
    optional: bool = False

    def convert(self, given: object) -> Value | None:
        """Return a value of this type, or None for NaN, which is unknown.

        Args:
            given: a value as a program hands it over; numpy's scalars are taken for the numbers that they are.

        Raises:
            NotOfTypeError: if it has another type, lies outside the range, or is no member.
        """
        if (given is True or given is False) and self.kind == "bool":
            return given
        plain = given if given.__class__ in _PLAIN else unboxed(given)
        if isinstance(plain, bool) != (self.kind == "bool") or not isinstance(plain, _CLASSES[self.kind]):
            raise NotOfTypeError(f"{_shown(plain)} is no {self.kind}")
        converted = _text(plain) if isinstance(plain, str) else self._number(plain)
        if converted is not None:
            self._check_bounds(converted)
        return converted

    def converter(self) -> Callable[[object], Value | None]:
        """Return `convert`, ready for very many values: one that is plainly of this type is only held to its bounds."""
        convert, (low, high) = self.convert, self.range or (-math.inf, math.inf)
        plain: frozenset[object] = frozenset(self.members)

        def whole(given: object) -> Value | None:
            return given if given.__class__ is int and least <= given <= most else convert(given)

        def real(given: object) -> Value | None:
            return given if given.__class__ is float and low <= given <= high else convert(given)

        def member(given: object) -> Value | None:
            return given if given.__class__ is str and given in plain else convert(given)

        least, most = max(low, -MAX_WHOLE), min(high, MAX_WHOLE)
        return {"int": whole, "float": real, "enum": member}.get(self.kind, convert)

    def _number(self, plain: bool | int | float) -> bool | int | float | None:
        if isinstance(plain, int) and abs(plain) > MAX_WHOLE:
            raise NotOfTypeError(f"{_shown(plain)} is too large")
        if self.kind != "float":
            return plain if isinstance(plain, bool) else int(plain)
        return None if plain != plain else float(plain)

    def _check_bounds(self, plain: Value) -> None:
        if self.range is not None and isinstance(plain, (int, float)) and not self.range[0] <= plain <= self.range[1]:
            raise NotOfTypeError(f"{plain!r} lies outside [{self.range[0]:g}, {self.range[1]:g}]")
        if self.members and plain not in self.members:
            raise NotOfTypeError(f"{_shown(plain)} is none of {', '.join(self.members)}")


_PLAIN = frozenset((bool, int, float, str))
"""Nothing is in a box of these."""


def unboxed(given: object) -> object:
    """Return the number that one of numpy's scalars stands for, and anything else as it is."""
    try:
        item = getattr(given, "item", None)
        return item() if callable(item) else given
    except Exception:  # noqa: BLE001 - an array of several values, or a foreign object
        return given


def _text(plain: str) -> str:
    if len(plain) > MAX_TEXT:
        raise NotOfTypeError(f"a text of {len(plain)} characters is too long: {MAX_TEXT} are enough for a decision")
    if not plain.isascii() and any("\ud800" <= character <= "\udfff" for character in plain):
        raise NotOfTypeError("a text with half a character (a lone surrogate) is no str that can be written down")
    return str.__str__(plain)  # a member of a StrEnum becomes the text that it is


def _shown(given: object) -> str:
    """Return a value as a message shows it, without asking a foreign object for its `repr`."""
    if isinstance(given, str):
        return repr(given if len(given) <= _MAX_SHOWN else f"{given[:_MAX_SHOWN]}...")
    if isinstance(given, int) and abs(given) > MAX_WHOLE:
        return f"a number of {given.bit_length()} bits"
    return repr(given) if given is None or isinstance(given, (bool, int, float)) else f"a {type(given).__name__}"


def boolean(*, optional: bool = False) -> ValueType:
    """Return the type of true and false."""
    return ValueType(kind="bool", optional=optional)


def integer(
    low: int | None = None, high: int | None = None, *, unit: str | None = None, optional: bool = False
) -> ValueType:
    """Return the type of whole numbers, within a range if one is given."""
    return ValueType(kind="int", unit=unit, range=_range(low, high), optional=optional)


def real(
    low: float | None = None, high: float | None = None, *, unit: str | None = None, optional: bool = False
) -> ValueType:
    """Return the type of numbers, within a range if one is given."""
    return ValueType(kind="float", unit=unit, range=_range(low, high), optional=optional)


def text(*, optional: bool = False) -> ValueType:
    """Return the type of strings."""
    return ValueType(kind="str", optional=optional)


def member(*members: str, optional: bool = False) -> ValueType:
    """Return the type of one of some names."""
    return ValueType(kind="enum", members=members, optional=optional)


def _range(low: float | None, high: float | None) -> tuple[float, float] | None:
    if low is None and high is None:
        return None
    return (-math.inf if low is None else low, math.inf if high is None else high)


@dataclass(frozen=True, slots=True, kw_only=True)
class VariableModel:
    """A context-variable of C_M (P1, Equations 1 to 3).

    Attributes:
        sources: who may write: `observer`, `main_execution`, agents.
        valid_for_s: how long evidence stands.
        when_unobservable: what becomes of the last value when a precondition fails or a result is rejected.
        refresh: whether it is looked at again and again, or when something has happened.
        history: how many readings `ContextManager.history` tells at most.
        posed: what it asks of poses, over `distance` and `in_view`; None for all that do not follow from poses.
    """

    name: str
    type: ValueType
    label: str = ""
    sources: tuple[str, ...] = ("observer",)
    valid_for_s: float = math.inf
    when_unobservable: Literal["keep", "forget"] = "keep"
    refresh: Literal["periodic", "on_event"] = "periodic"
    history: int = 100
    posed: Term | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Algorithm:
    """A perception algorithm pi: a passive callable and what it needs (P1, section 3.2).

    Attributes:
        call: `package.module:function`, or a class with `perceive`; imported when the forest is built.
        parameters: literals that it always gets.
        handles: resources whose handle it gets, by name.
        slots: resources of which one job at a time and slot can run.
        given: context-variables whose values it gets, each of which must be known.
        returns: the type of each value of its result.
        timeout_s: when its job has run longer than this, it counts as timed out.
        min_interval_s: the least time between the starts of two jobs.
        isolate: whether it runs in a thread of the program, or in a process of its own.
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


@dataclass(frozen=True, slots=True, kw_only=True)
class ExpectationModel:
    """What a skill expects of a variable, counted from acting.

    Attributes:
        text: as the spec says it.
        condition: over the one variable: it becomes true, or stays so.
        within_s: how long it may take to become true; infinite if it is to stay true while the skill acts.
    """

    text: str
    condition: Term
    within_s: float = math.inf

    @property
    def variable(self) -> str:
        """Return the variable of which something is expected."""
        (name,) = self.condition.variables()
        return name

    @property
    def is_to_become(self) -> bool:
        """Return whether the condition is to become true, rather than to stay so."""
        return self.within_s < math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class SkillModel:
    """A unit of main execution: what it decides on, watches and changes (P1, Figure 1).

    Attributes:
        expects: what monitored variables are to become, or to stay.
    """

    name: str
    preview: tuple[str, ...] = ()
    monitor: tuple[str, ...] = ()
    changes: tuple[str, ...] = ()
    expects: tuple[ExpectationModel, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True)
class ResourceModel:
    """Something that algorithms share: a handle, or with `slots` a number of jobs at a time."""

    name: str
    slots: int | None = None
