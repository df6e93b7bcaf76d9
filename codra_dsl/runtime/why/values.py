"""What an explanation says, as values that print as text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime

from codra_dsl.logic import Value
from codra_dsl.runtime.cell import Reading
from codra_dsl.runtime.outline import Place

_INDENT = "  "
_FIRST_DATE_S = 1e9
_LAST_DATE_S = 1e11


@dataclass(frozen=True, slots=True, kw_only=True)
class Missing:
    """Something without which a variable cannot be observed.

    Attributes:
        variable: what would have to be otherwise.
        condition: the condition of the spec that does not hold, or what is to be done.
        value: a value of the variable with which it would hold, given the others that are missing; None where a value
            would not help.
        unit: of the value.
        from_s: when it will hold without anybody doing anything; None if not for that.
        place: of the condition.
    """

    variable: str
    condition: str
    value: Value | None = None
    unit: str = ""
    from_s: float | None = None
    place: Place | None = None

    def __str__(self) -> str:
        if self.value is not None:
            return f"{self.variable} = {shown(self.value)}{_spaced(self.unit)}"
        return self.condition if self.from_s is None else f"{self.condition}, from {instant(self.from_s)} on"


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """A precondition, as it was at an instant.

    Attributes:
        holds: None if that is unknown: then it does not hold.
        because: why the variables that it reads are what they are.
    """

    text: str
    holds: bool | None
    because: tuple[Why, ...]
    place: Place | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """The job that a value comes from.

    Attributes:
        index: its number among the jobs of its algorithm.
        rule: what its result says of the variable.
        values: its result.
        start_s: when its evidence began to be taken.
        stamp_s: when its evidence was taken.
        under: the preconditions, as they were then.
        place: of the rule.
    """

    algorithm: str
    index: int
    rule: str
    values: Mapping[str, Value]
    units: Mapping[str, str]
    start_s: float
    stamp_s: float
    under: tuple[Condition, ...]
    place: Place | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Way:
    """An algorithm by which a variable can be observed, and what keeps it from being so.

    Attributes:
        conditions: its preconditions, at the instant of the question.
        blocked_by: those that do not hold.
        doing: what it does, or what came of its last job, in words; empty if it never had one.
        missing: what would have to be otherwise for it to look.
    """

    algorithm: str
    conditions: tuple[Condition, ...]
    doing: str
    missing: tuple[Missing, ...]
    place: Place | None = None

    @property
    def blocked_by(self) -> tuple[Condition, ...]:
        """Return the preconditions that do not hold."""
        return tuple(condition for condition in self.conditions if condition.holds is not True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Why:
    """Why a variable is what it is at an instant; `str` of it is a text for people.

    Attributes:
        at_s: the instant, on the run's clock.
        reading: what is known of the variable.
        unit: of its value.
        place: of its declaration.
        story: how it came to that, in sentences.
        look: the job that the value comes from, if it was one.
        poses: the edges with poses from which it follows, if it follows from poses.
        ways: the algorithms that identify it, by rank; none, if it is for others to write.
        missing: what keeps it from being observed at that instant, known or not: of the way that lacks least.
        is_told: whether it is told elsewhere in the same explanation; then nothing more is said here.
    """

    at_s: float
    reading: Reading[Value]
    unit: str = ""
    place: Place | None = None
    story: tuple[str, ...] = ()
    look: Look | None = None
    poses: tuple[Why, ...] = ()
    ways: tuple[Way, ...] = ()
    missing: tuple[Missing, ...] = ()
    is_told: bool = False

    @property
    def variable(self) -> str:
        """Return the name of the variable."""
        return self.reading.name

    @property
    def known(self) -> bool:
        """Return whether it has a value."""
        return self.reading.known

    def __str__(self) -> str:
        return "\n".join(_lines_of(self))


def _lines_of(why: Why) -> Iterator[str]:
    reading = why.reading
    unit = f" {why.unit}" if why.unit else ""
    state = f"{shown(reading.content)}{unit}" if reading.known else f"unknown ({reading.reason})"
    told = ", as told above" if why.is_told else ""
    yield f"{why.variable} is {state} at {instant(why.at_s)}{told}{_at(why.place)}"
    for sentence in why.story:
        yield f"{_INDENT}{sentence}"
    if why.look is not None:
        yield from _indented(_lines_of_look(why.look))
    for pose in why.poses:
        yield from _indented(_lines_of(pose))
    for way in why.ways:
        yield from _indented(_lines_of_way(way))
    if why.missing:
        yield f"{_INDENT}missing: {', '.join(map(str, why.missing))}"


def _lines_of_look(look: Look) -> Iterator[str]:
    units = look.units
    values = (f"{key} = {shown(value)}{_spaced(units.get(key))}" for key, value in look.values.items())
    yield f"perception {look.algorithm} saw {', '.join(values) or 'nothing'} (job {look.index})"
    yield f"{_INDENT}which makes it: {look.rule}{_at(look.place)}"
    for condition in look.under:
        yield from _indented(_lines_of_condition(condition))


def _lines_of_way(way: Way) -> Iterator[str]:
    blocked = way.blocked_by
    yield f"perception {way.algorithm} {'cannot look' if blocked else 'can look'}{_at(way.place)}"
    if way.doing:
        yield f"{_INDENT}{way.doing}"
    for condition in blocked:
        yield from _indented(_lines_of_condition(condition))


def _lines_of_condition(condition: Condition) -> Iterator[str]:
    if len(condition.because) == 1 and condition.because[0].variable == condition.text:
        first, *rest = _lines_of(condition.because[0])
        yield first if condition.place is None else f"{first.partition('  [')[0]}{_at(condition.place)}"
        yield from rest
        return
    state = {True: "holds", False: "does not hold", None: "is unknown"}[condition.holds]
    yield f"{condition.text} {state}{_at(condition.place)}"
    for why in condition.because:
        yield from _indented(_lines_of(why))


def _indented(lines: Iterator[str]) -> Iterator[str]:
    return (f"{_INDENT}{line}" for line in lines)


def _at(place: Place | None) -> str:
    return "" if place is None else f"  [{place}]"


def _spaced(unit: str | None) -> str:
    return f" {unit}" if unit else ""


def shown(value: Value | None) -> str:
    """Return a value as text."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else repr(value) if isinstance(value, str) else str(value)


def seconds(duration_s: float) -> str:
    """Return a duration as text, to the millisecond."""
    return f"{duration_s:.3f}".rstrip("0").rstrip(".") + " s"


def instant(instant_s: float) -> str:
    """Return an instant as text, to the millisecond: the time of day where the clock counts from 1970."""
    if not _FIRST_DATE_S <= instant_s < _LAST_DATE_S:
        return seconds(instant_s)
    return datetime.fromtimestamp(instant_s, UTC).isoformat(" ", "milliseconds").replace("+00:00", " UTC")
