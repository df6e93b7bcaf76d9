"""The elements of a spec, except those of knowledge, as frozen values."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field, fields
from enum import StrEnum
from itertools import chain
from typing import Any

from codra_dsl.language.diagnostics import Place
from codra_dsl.language.expression import Node
from codra_dsl.language.fuzzy.model import Term

FOREVER_S = math.inf
DEFAULT_PERIOD_S = 1.0
"""The period of an observer without an entry in `observers` (P1, section 3.3: "a tick-rate of 1 s")."""

PlaceOf = Callable[[int, int], Place]
"""Returns the place of a range of one file's text, given in code points from its beginning."""


class Places(Mapping[str, Place]):
    """The places of an element's keys and values, by key, each created on access.

    The place of a key is its value if that is a scalar or a list on one line, else the key itself.
    """

    __slots__ = ("_keys", "_offsets", "_place_of")

    def __init__(self, place_of: PlaceOf, ranges: Mapping[str, tuple[int, int]]) -> None:
        """Store the ranges by key as two tuples, which save memory: a spec has many of these mappings."""
        self._place_of = place_of
        self._keys = tuple(ranges)
        self._offsets = tuple(chain.from_iterable(ranges.values()))

    def __getitem__(self, key: str) -> Place:
        """Return the place that belongs to a key."""
        if key not in self._keys:
            raise KeyError(key)
        index = 2 * self._keys.index(key)
        return self._place_of(self._offsets[index], self._offsets[index + 1])

    def __iter__(self) -> Iterator[str]:
        """Yield the keys in file order."""
        return iter(self._keys)

    def __len__(self) -> int:
        """Return how many keys are present."""
        return len(self._keys)

    def __repr__(self) -> str:
        """Return keys and ranges."""
        return f"Places({self._keys!r}, {self._offsets!r})"


@dataclass(frozen=True, slots=True)
class Letters:
    """The position of each letter of a text in its file.

    Attributes:
        runs: (first offset in the text, offset in the file, width in the file of each letter), in ascending order. If
            the width is 1, letters are consecutive; otherwise all of them have the same place (a parameter, an escape).
    """

    place_of: PlaceOf = field(repr=False)
    runs: tuple[tuple[int, int, int], ...]

    def place(self, start: int, end: int) -> Place | None:
        """Return the place of a range of the text, or None if none of its letters is in the file."""
        first, last = self._at(start), self._at(max(start, end - 1))
        return None if first is None or last is None else self.place_of(first[0], last[1])

    def _at(self, offset: int) -> tuple[int, int] | None:
        index = bisect_right(self.runs, (offset, math.inf)) - 1
        if index < 0:
            return None
        first, position, width = self.runs[index]
        begin = position + offset - first if width == 1 else position
        return begin, begin + width


class Kind(StrEnum):
    """The kinds of values."""

    BOOL = "bool"
    INT = "int"
    FLOAT = "float"
    STR = "str"
    ENUM = "enum"


class WhenUnobservable(StrEnum):
    """Whether a value is kept or forgotten when its precondition fails or a result is rejected."""

    KEEP = "keep"
    FORGET = "forget"


class Refresh(StrEnum):
    """When an observer perceives again."""

    PERIODIC = "periodic"
    ON_EVENT = "on_event"


class Access(StrEnum):
    """How an algorithm uses a resource. Observers are passive: `command` is parsed only to be refused."""

    READ = "read"
    SLOT = "slot"
    COMMAND = "command"


class Isolation(StrEnum):
    """Where a perception algorithm runs."""

    THREAD = "thread"
    PROCESS = "process"


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """A name that refers to a declaration elsewhere."""

    name: str
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueType:
    """A type as written.

    Attributes:
        unit: the unit's text, e.g. `m/s`, or None. Values are in this unit; only `with` literals are converted to SI.
        range: both ends inclusive, in `unit`.
        values: an enum's members, in order.
        places: by key, if the key is written (`type`, `unit`, `range`, `values`); `values.NAME` is that of a member.
    """

    kind: Kind
    unit: str | None = None
    range: tuple[float, float] | None = None
    values: tuple[str, ...] = ()
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """A condition as written, with parameters substituted.

    Attributes:
        text: on one line.
        tree: the parsed tree; None if `load` has already reported a syntax error.
        place: of the complete scalar.
        letters: the positions of the letters of `text` in the file, through quotes, folded lines and parameters; None
            if text and file cannot be matched (then `place` is used).
    """

    text: str
    tree: Node | None
    place: Place
    letters: Letters | None = field(default=None, compare=False)

    def place_of(self, node: Node) -> Place:
        """Return the place of a part of this condition, or of all of it if letters cannot be matched."""
        return self.place_between(node.start, node.end)

    def text_of(self, node: Node) -> str:
        """Return a part of this condition as written."""
        return self.text[node.start : node.end]

    def place_between(self, start: int, end: int) -> Place:
        """Return the place of a range of `text`, or of the complete condition if letters cannot be matched."""
        part = self.letters.place(start, end) if self.letters is not None else None
        return self.place if part is None else part


@dataclass(frozen=True, slots=True, kw_only=True)
class FuzzyTerm:
    """A linguistic term: a word for some of a variable's values.

    Attributes:
        term: its fuzzy set.
        text: as written.
        place: of the text.
    """

    term: Term
    text: str
    place: Place

    @property
    def name(self) -> str:
        """Return the word."""
        return self.term.name


@dataclass(frozen=True, slots=True, kw_only=True)
class Rate:
    """The declaration that a variable is the rate of change of another variable.

    Attributes:
        of: the other variable.
        over_s: the time over which the rate is computed.
        is_falling: whether a decreasing value has a positive rate.
    """

    of: Reference
    over_s: float
    is_falling: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseCondition:
    """A comparison with poses, such as `distance(a, b) < 0.9 m`.

    Attributes:
        tree: the comparison; each function of two nodes is one name in it.
        condition: the condition that contains it; the first one if there are several.
        owner: the section and the name of the element with that condition, and the condition's key.
    """

    tree: Node
    condition: Condition
    owner: tuple[str, str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """A context-variable c = (name, value) of C_M (P1, Equations 1 to 3).

    Attributes:
        sources: who may write: `observer`, `main_execution`, or agents' names; empty if the spec has no `source`.
        valid_for_s: how long evidence is valid; FOREVER_S for `forever` or if the spec has no `valid_for`.
        states_validity: whether the spec has `valid_for`.
        history: the number of readings that are kept.
        node: the node of the knowledge graph of which it is an attribute (`of`).
        terms: words for its values, for fuzzy rules.
        rate: set if it is the rate of change of another variable.
        is_derived: whether another element implies it: it holds a metric, a weight, a course or a result over poses.
        pose_condition: the comparison with poses whose result it holds, if any.
        places: by key (`valid_for`, `source`, ...); also `name`.
    """

    name: str
    type: ValueType
    place: Place
    label: str
    description: str = ""
    sources: tuple[Reference, ...]
    valid_for_s: float = FOREVER_S
    states_validity: bool = False
    when_unobservable: WhenUnobservable = WhenUnobservable.KEEP
    refresh: Refresh = Refresh.PERIODIC
    history: int = 100
    node: str = "context"
    terms: tuple[FuzzyTerm, ...] = ()
    rate: Rate | None = None
    is_derived: bool = False
    pose_condition: PoseCondition | None = None
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Hysteresis:
    """`{enter, leave, confirm: k of n}`: between enter and leave the value does not change."""

    enter: Condition
    leave: Condition | None
    confirm: tuple[int, int] | None
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class Members:
    """A mapping from an enum's members to conditions; the first condition that holds determines the value."""

    cases: tuple[tuple[Reference, Condition], ...]
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class Identification:
    """How the value of a context-variable follows from an algorithm's result (P1, Equation 6)."""

    variable: Reference
    by: Condition | Members | Hysteresis


def needed_of(entry: Identification) -> int:
    """Return the number of results that must agree before an identification sets its variable."""
    confirm = entry.by.confirm if isinstance(entry.by, Hysteresis) else None
    return 1 if confirm is None else confirm[0]


@dataclass(frozen=True, slots=True, kw_only=True)
class Usage:
    """A resource and how it is used."""

    resource: Reference
    access: Access
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class Returned:
    """One value of an algorithm's result."""

    name: str
    type: ValueType
    optional: bool
    place: Place


Literal = bool | int | float | str


@dataclass(frozen=True, slots=True)
class Setting:
    """A scalar key of an element that generated code hands to the runtime unchanged.

    Loading, generation and `codra diff` handle all settings alike, by the type of the default: a float is a duration in
    seconds, an int is a whole number, and a `StrEnum` is a choice of words.

    Attributes:
        field_name: the name of the field, here and in `codra_dsl.runtime.values.model`.
        key: the key in a spec.
        may_be_zero: whether a duration of 0 s is allowed.
    """

    field_name: str
    key: str
    default: Any
    may_be_zero: bool


def _settings_of(element_type: type[Any]) -> tuple[Setting, ...]:
    """Return the settings of a type of elements: those of its fields whose metadata has a key."""
    return tuple(
        Setting(entry.name, entry.metadata["key"], entry.default, entry.metadata.get("may_be_zero", False))
        for entry in fields(element_type)
        if "key" in entry.metadata
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Algorithm:
    """A perception algorithm pi: how a value is perceived and when it can be trusted (P1, section 3.1).

    Attributes:
        call: `package.module:function`.
        parameters: literals in file order, with quantities as SI floats; `places` has a key `with.NAME` for each.
        given: variables whose values it gets as arguments; it needs all of them to be known.
        places: by key; also `name`.
    """

    name: str
    place: Place
    call: str
    parameters: tuple[tuple[str, Literal], ...] = ()
    uses: tuple[Usage, ...] = ()
    given: tuple[Reference, ...] = ()
    returns: tuple[Returned, ...] = ()
    observable_when: tuple[Condition, ...] = ()
    accept_when: tuple[Condition, ...] = ()
    identifies: tuple[Identification, ...] = ()
    timeout_s: float = field(default=5.0, metadata={"key": "timeout"})
    min_interval_s: float = field(default=0.0, metadata={"key": "min_interval", "may_be_zero": True})
    isolate: Isolation = field(default=Isolation.THREAD, metadata={"key": "isolate"})
    rank: int = 1
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


ALGORITHM_SETTINGS = _settings_of(Algorithm)
"""The settings of a perception algorithm, in the order of its fields."""


class Expected(StrEnum):
    """The expected behaviour of a monitored variable."""

    WATCHED = "watched"
    BECOMES = "becomes"
    STAYS = "stays"


@dataclass(frozen=True, slots=True, kw_only=True)
class Expectation:
    """An entry of `monitor`: a name alone, `NAME becomes VALUE within D`, or `NAME stays VALUE`.

    Attributes:
        condition: over the variable, e.g. `x == true` for `x becomes true`; None for a name alone.
    """

    variable: Reference
    expected: Expected
    condition: Condition | None = None
    within_s: float | None = None
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class Skill:
    """A unit of main execution: the context that it decides on, watches and changes (P1, Figure 1)."""

    name: str
    place: Place
    preview: tuple[Reference, ...] = ()
    monitor: tuple[Expectation, ...] = ()
    changes: tuple[Reference, ...] = ()
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverSetting:
    """An entry of `observers`: the name, period and priority of a tree that Algorithm 2 creates in any case."""

    name: str
    place: Place
    identifies: tuple[Reference, ...]
    period_s: float = DEFAULT_PERIOD_S
    priority: int = 0
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Resource:
    """A resource that algorithms share; with `slots` it limits the number of simultaneous jobs and has no handle."""

    name: str
    place: Place
    slots: int | None = None
