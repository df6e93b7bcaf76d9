"""The elements of a spec, but for those of knowledge, as frozen values."""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass, field
from enum import StrEnum
from itertools import chain

from codra_dsl.diagnostics import Place
from codra_dsl.expression import Node
from codra_dsl.fuzzy.model import Term

FOREVER_S = math.inf
DEFAULT_PERIOD_S = 1.0
"""Of an observer that `observers` does not set up (P1, section 3.3: "a tick-rate of 1 s")."""

PlaceOf = Callable[[int, int], Place]
"""Gives the place of a range of one file's text, in code points from its beginning."""


class Places(Mapping[str, Place]):
    """The places of an element's keys and values, by key, each made when it is asked for.

    A key leads to its value where that is a scalar or a list on one line, else to the key itself.
    """

    __slots__ = ("_keys", "_offsets", "_place_of")

    def __init__(self, place_of: PlaceOf, ranges: Mapping[str, tuple[int, int]]) -> None:
        """Begin with the ranges that keys lead to, kept as two tuples: a spec has many of these, which are small so."""
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
    """Where each letter of a text stands in its file.

    Attributes:
        runs: (first offset in the text, offset in the file, width in the file of each letter), in growing order. Where
            the width is 1, letters follow one another; else each stands at the same place (a parameter, an escape).
    """

    place_of: PlaceOf = field(repr=False)
    runs: tuple[tuple[int, int, int], ...]

    def place(self, start: int, end: int) -> Place | None:
        """Return the place of a range of the text, or None where no letter of it stands in the file."""
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
    """The kinds of value."""

    BOOL = "bool"
    INT = "int"
    FLOAT = "float"
    STR = "str"
    ENUM = "enum"


class WhenUnobservable(StrEnum):
    """What happens to a value when its precondition fails or a result is rejected."""

    KEEP = "keep"
    FORGET = "forget"


class Refresh(StrEnum):
    """When an observer looks again."""

    PERIODIC = "periodic"
    ON_EVENT = "on_event"


class Access(StrEnum):
    """How an algorithm uses a resource. Observers are passive: `command` is parsed so that it can be refused."""

    READ = "read"
    SLOT = "slot"
    COMMAND = "command"


class Isolation(StrEnum):
    """Where a perception algorithm runs."""

    THREAD = "thread"
    PROCESS = "process"


@dataclass(frozen=True, slots=True, kw_only=True)
class Reference:
    """A name that points to something declared elsewhere."""

    name: str
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class ValueType:
    """A type as written.

    Attributes:
        unit: the unit's text, e.g. `m/s`, or None. Values are in this unit; only `with` literals are turned to SI.
        range: both ends inclusive, in `unit`.
        values: an enum's members, in order.
        places: of what is written, by key (`type`, `unit`, `range`, `values`); `values.NAME` has that of a member.
    """

    kind: Kind
    unit: str | None = None
    range: tuple[float, float] | None = None
    values: tuple[str, ...] = ()
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """A condition as written, after parameters were put in.

    Attributes:
        text: on one line.
        tree: the parsed tree; None when `load` has already reported that it does not parse.
        place: of the whole scalar.
        letters: where the letters of `text` stand in the file, through quotes, folded lines and parameters; None where
            text and file cannot be matched (then `place` serves).
    """

    text: str
    tree: Node | None
    place: Place
    letters: Letters | None = field(default=None, compare=False)

    def place_of(self, node: Node) -> Place:
        """Return the place of a part of this condition, or of the whole where letters cannot be matched."""
        return self.place_between(node.start, node.end)

    def text_of(self, node: Node) -> str:
        """Return a part of this condition as it is written."""
        return self.text[node.start : node.end]

    def place_between(self, start: int, end: int) -> Place:
        """Return the place of a range of `text`, or of the whole condition where letters cannot be matched."""
        part = self.letters.place(start, end) if self.letters is not None else None
        return self.place if part is None else part


@dataclass(frozen=True, slots=True, kw_only=True)
class FuzzyTerm:
    """A word for some values.

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
    """That a variable is how fast another one changes.

    Attributes:
        over_s: the time over which it is taken.
        is_falling: whether a value that shrinks has a positive rate.
    """

    of: Reference
    over_s: float
    is_falling: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Posed:
    """A comparison with poses, such as `distance(a, b) < 0.9 m`.

    Attributes:
        tree: the comparison; each function of two nodes is one name in it.
        said: the condition in which it stands, the first if several do.
        owner: the section and the name of the element that says it, and the key under which it does.
    """

    tree: Node
    said: Condition
    owner: tuple[str, str, str]


@dataclass(frozen=True, slots=True, kw_only=True)
class Variable:
    """A context-variable c = (name, value) of C_M (P1, Equations 1 to 3).

    Attributes:
        sources: who may write: `observer`, `main_execution`, or agents' names; empty where the spec says nothing.
        valid_for_s: how long evidence stands; FOREVER_S where it says so or says nothing.
        states_validity: whether the spec says `valid_for` at all.
        history: how many readings are kept.
        node: the node of the knowledge graph that it is an attribute of (`of`).
        terms: words for its values, for fuzzy rules.
        rate: whose rate of change it is; None if it is none.
        is_derived: whether it follows from another element: it holds a metric, a weight, a course or what `posed` asks.
        posed: what it asks of poses, if it follows from them.
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
    posed: Posed | None = None
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Hysteresis:
    """`{enter, leave, confirm: k of n}`: between enter and leave the value stays as it was."""

    enter: Condition
    leave: Condition | None
    confirm: tuple[int, int] | None
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class Members:
    """A mapping from an enum's members to conditions; the first that holds gives the value."""

    cases: tuple[tuple[Reference, Condition], ...]
    place: Place


@dataclass(frozen=True, slots=True, kw_only=True)
class Identification:
    """How an algorithm's result gives a context-variable its value (P1, Equation 6)."""

    variable: Reference
    by: Condition | Members | Hysteresis


def needed_of(entry: Identification) -> int:
    """Return how many results must agree before an identification gives its variable a value."""
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


@dataclass(frozen=True, slots=True, kw_only=True)
class Algorithm:
    """A perception algorithm pi: how a value is perceived and when that can be trusted (P1, section 3.1).

    Attributes:
        call: `package.module:function`.
        parameters: literals, quantities with a unit as SI floats, in file order; `places` has `with.NAME` for each.
        given: variables whose values it gets as arguments, each of which must be known.
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
    timeout_s: float = 5.0
    min_interval_s: float = 0.0
    isolate: Isolation = Isolation.THREAD
    rank: int = 1
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


class Expected(StrEnum):
    """What a monitored variable is expected to do."""

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
    """A unit of main execution: the context it decides on, watches and changes (P1, Figure 1)."""

    name: str
    place: Place
    preview: tuple[Reference, ...] = ()
    monitor: tuple[Expectation, ...] = ()
    changes: tuple[Reference, ...] = ()
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class ObserverSetting:
    """An entry of `observers`: the name, period and priority of a tree that Algorithm 2 makes anyway."""

    name: str
    place: Place
    identifies: tuple[Reference, ...]
    period_s: float = DEFAULT_PERIOD_S
    priority: int = 0
    places: Mapping[str, Place] = field(default_factory=dict, compare=False, hash=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Resource:
    """Something that algorithms share; with `slots` it is a number of simultaneous jobs and has no handle."""

    name: str
    place: Place
    slots: int | None = None
