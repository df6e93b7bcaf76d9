"""The elements of a spec, except those of knowledge, as frozen values."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping
from dataclasses import field, fields
from enum import StrEnum
from itertools import chain
from typing import Any

from codra_dsl.language.diagnostics import Place
from codra_dsl.language.expression import Node
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.fuzzy.model import Term
from codra_dsl.language.model.topic import Topic

FOREVER_S = math.inf
DEFAULT_PERIOD_S = 1.0
"""The period of an observer without an entry in `observers` (P1, section 3.3: "a tick-rate of 1 s")."""

PlaceOf = Callable[[int, int], Place]
"""Returns the place of a range of a file's text. The range is given in code points from the beginning of the file."""


class Places(Mapping[str, Place]):
    """The places of an element's entries, by key. Each place is created on access.

    The place of an entry is that of its value if the value is a scalar or in brackets; otherwise it is that of the key.
    """

    __slots__ = ("_keys", "_offsets", "_place_of")

    def __init__(self, place_of: PlaceOf, ranges: Mapping[str, tuple[int, int]]) -> None:
        """Store the ranges as two tuples. This saves memory, because a spec has many of these mappings."""
        self._place_of = place_of
        self._keys = tuple(ranges)
        self._offsets = tuple(chain.from_iterable(ranges.values()))

    def __getitem__(self, key: str) -> Place:
        """Return the place of the entry with a key."""
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
        runs: runs of letters, in ascending order. Each run is (offset of its first letter in the text, offset of this
            letter in the file, width of each letter in the file). If the width is 1, the letters of the run are
            consecutive in the file; otherwise all of them have the same place (a parameter, an escape).
    """

    place_of: PlaceOf = field(repr=False)
    runs: tuple[tuple[int, int, int], ...]

    def place(self, start: int, end: int) -> Place | None:
        """Return the place of a range of the text, or None if none of its letters is in the file."""
        first, last = self._range_at(start), self._range_at(max(start, end - 1))
        return None if first is None or last is None else self.place_of(first[0], last[1])

    def _range_at(self, offset: int) -> tuple[int, int] | None:
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
    """Whether a value is kept or forgotten when a precondition fails or a result is rejected."""

    KEEP = "keep"
    FORGET = "forget"


class Refresh(StrEnum):
    """When an observer perceives again."""

    PERIODIC = "periodic"
    ON_EVENT = "on_event"


class Access(StrEnum):
    """How an algorithm uses a resource. `command` is parsed only to be refused, because observers are passive."""

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
        range: the least and the greatest value, in `unit`.
        values: an enum's members, in order.
        places: the places of the keys that are written (`type`, `unit`, `range`, `values`), by key. The place of a
            member has the key `values.NAME`.
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
        text: the condition on one line.
        tree: the parsed tree; None if `load` has already reported a syntax error.
        place: the place of the complete scalar.
        letters: the positions of the letters of `text` in the file, even if quotes, folded lines or parameters change
            the text; None if text and file cannot be matched (then `place` is used).
    """

    text: str
    tree: Node | None
    place: Place
    letters: Letters | None = field(default=None, compare=False)

    def place_of(self, node: Node) -> Place:
        """Return the place of a part of this condition, or of the complete condition if letters cannot be matched."""
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
        term: the fuzzy set.
        text: the fuzzy set as written.
        place: the place of the text.
    """

    term: Term
    text: str
    place: Place

    @property
    def name(self) -> str:
        """Return the word."""
        return self.term.name


class RateKind(StrEnum):
    """What loops compute from the history of a variable: the key of a spec that names this variable."""

    RATE = "rate_of"
    """The rate of change of a number."""

    SHARE = "share_of"
    """The share of time at which a bool is true."""

    HELD = "held"
    """Whether a bool has been true for some time, without interruption."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Rate:
    """The declaration that loops compute a variable from the history of another variable.

    Attributes:
        of: the other variable.
        over_s: the time over which the rate or the share is computed, or for which the bool must have been true.
        is_falling: whether a decreasing value has a positive rate.
        kind: the kind of the computed value.
    """

    of: Reference
    over_s: float
    is_falling: bool = False
    kind: RateKind = RateKind.RATE

    @property
    def duration_key(self) -> str:
        """Return the key of a spec that states the time."""
        return "for" if self.kind is RateKind.HELD else "over"


@dataclass(frozen=True, slots=True, kw_only=True)
class PoseCondition:
    """A comparison with poses, such as `distance(a, b) < 0.9 m`; in derived variables also a distance or a count.

    Attributes:
        tree: the syntax tree of the comparison, in which each function of two nodes is one name.
        condition: the condition that contains the comparison; the first one if there are several.
        owner: the section and the name of the element that has this condition, and the key of the condition.
        resolution_m: the step to which a distance is rounded; None for other values.
    """

    tree: Node
    condition: Condition
    owner: tuple[str, str, str]
    resolution_m: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """A context-variable c = (name, value) of C_M (P1, Equations 1 to 3).

    Attributes:
        sources: who may write the variable: `observer`, `main_execution`, or agents; empty if `source` is not stated.
        valid_for_s: how long evidence is valid; FOREVER_S for `forever`, or if its `valid_for` is not stated.
        states_validity: whether the spec states its `valid_for`.
        history: the number of readings that are kept.
        node: the node of the knowledge graph of which the variable is an attribute (the key `of`).
        terms: words for its values, for fuzzy rules.
        rate: set if loops compute the variable from the history of another variable.
        is_derived: whether another element implies the variable: its value is then a metric, a weight, a course or the
            result of a comparison with poses.
        pose_condition: the comparison with poses, the distance, or the count of paths that is the value of the
            variable; None for any other variable.
        derived: the expression over other variables from which the value follows; None for other variables.
        resolution_m: the step to which the distances in `derived` are rounded; None if it is not stated.
        ros: the topic of ROS 2 from which the values come; None without a topic.
        places: the places of the entries, by key; `name` is the place of the variable's name.
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
    derived: Condition | None = None
    resolution_m: float | None = None
    ros: Topic | None = None
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)

    @property
    def is_computed(self) -> bool:
        """Whether the value follows from the graph or from other variables, so that the variable has no writer."""
        return self.pose_condition is not None or self.derived is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class Hysteresis:
    """`{enter, leave, confirm: k of n}`: between enter and leave the value does not change."""

    enter: Condition
    leave: Condition | None
    confirm: tuple[int, int] | None
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class Members:
    """A mapping from an enum's members to conditions. The first condition that holds determines the value."""

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
    """A scalar key of an element. Generated code passes the value of the key to the runtime unchanged.

    Loading, generation and `codra diff` handle all settings alike. The type of the default determines the kind of
    value: a float is a duration in seconds, an int is a whole number, a `StrEnum` is a choice of words, and any other
    text is a name.

    Attributes:
        field_name: the name of the field, here and in `codra_dsl.runtime.values.model`.
        key: the key in a spec.
        may_be_zero: whether a duration of 0 s is allowed.
    """

    field_name: str
    key: str
    default: Any
    may_be_zero: bool


def _settings_of_type(element_type: type[Any]) -> tuple[Setting, ...]:
    """Return the settings of a type of elements: its fields that state a `key` in their metadata."""
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
        given: the variables whose values the function gets as arguments; all of them must be known.
        host: the program that runs the function; empty for the program of the context manager.
        places: the places of the entries, by key; `name` is the place of the algorithm's name.
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
    host: str = field(default="", metadata={"key": "host"})
    rank: int = 1
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


ALGORITHM_SETTINGS = _settings_of_type(Algorithm)
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
        condition: the expected condition, e.g. `x == true` for `x becomes true`; None for a name alone.
    """

    variable: Reference
    expected: Expected
    condition: Condition | None = None
    within_s: float | None = None
    place: Place

    @property
    def text(self) -> str:
        """The entry as people read it, e.g. `door_open becomes true within 20 s`."""
        name = self.variable.name
        if self.condition is None:
            return name
        value = self.condition.text.removeprefix(name).strip().removeprefix("==").strip()
        within = "" if self.within_s is None else f" within {self.within_s:g} s"
        return f"{name} {self.expected} {value}{within}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Skill:
    """A unit of main execution: the context that it decides on, watches and changes (P1, Figure 1).

    Attributes:
        preview: every variable that the decision needs, named alone or read by a condition, in the order of the spec.
        preview_names: the variables that are named alone. They must be known.
        preview_conditions: the conditions, all of which must hold.
    """

    name: str
    place: Place
    preview: tuple[Reference, ...] = ()
    preview_names: tuple[Reference, ...] = ()
    preview_conditions: tuple[Condition, ...] = ()
    monitor: tuple[Expectation, ...] = ()
    changes: tuple[Reference, ...] = ()
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)

    @property
    def watched_variables(self) -> tuple[str, ...]:
        """The variables that the skill previews, then the variables that it monitors."""
        monitored = (expectation.variable for expectation in self.monitor)
        return tuple(reference.name for reference in (*self.preview, *monitored))


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverSetting:
    """An entry of `observers`: name, period and priority of a tree. Algorithm 2 also creates trees without an entry."""

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
