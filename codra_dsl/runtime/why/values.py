"""The parts of an explanation, as values that print as text."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from datetime import UTC, datetime

from codra_dsl.logic import Value
from codra_dsl.runtime.journal.spec_summary import Place
from codra_dsl.runtime.values.cell import Reading

_INDENT = "  "
_FIRST_DATE_S = 1e9
_LAST_DATE_S = 1e11


@dataclass(frozen=True, slots=True, kw_only=True)
class MissingChange:
    """A change without which a variable cannot be observed.

    Attributes:
        variable: the variable that would have to change.
        condition: the condition of the spec that does not hold, or the necessary action.
        value: a value of the variable for which the condition would hold, given the other missing changes; None if a
            value would not help.
        unit: the unit of the value.
        from_s: when the condition will hold without any action; None if it will not hold by itself.
        place: the place of the condition in the spec.
    """

    variable: str
    condition: str
    value: Value | None = None
    unit: str = ""
    from_s: float | None = None
    place: Place | None = None

    def __str__(self) -> str:
        if self.value is not None:
            return f"{self.variable} = {value_text(self.value)}{_unit_text(self.unit)}"
        return self.condition if self.from_s is None else f"{self.condition}, from {instant_text(self.from_s)} on"


@dataclass(frozen=True, slots=True, kw_only=True)
class Condition:
    """The state of a precondition at an instant.

    Attributes:
        text: the condition.
        holds: whether the condition holds; None if that is unknown, which counts as not holding.
        because: the explanations of the variables that the condition reads.
        place: the place of the condition in the spec.
    """

    text: str
    holds: bool | None
    because: tuple[Why, ...]
    place: Place | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Look:
    """The job that produced a value.

    Attributes:
        algorithm: the algorithm.
        index: the number of the job among the jobs of its algorithm.
        rule: the rule that computes the variable from the result.
        values: the result.
        units: the units of the result's values.
        start_s: when the acquisition of the job's evidence began.
        stamp_s: when the acquisition of the job's evidence ended.
        under: the preconditions at the time `stamp_s`.
        place: the place of the rule in the spec.
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
    """An algorithm that can observe a variable, and the conditions that now prevent this.

    Attributes:
        algorithm: the algorithm.
        conditions: the preconditions of the algorithm, at the instant of the explanation.
        blocked_by: the preconditions that do not hold.
        obstacle: why the host of the algorithm cannot look; empty if it can, or if the algorithm has no host.
        doing: a sentence about the algorithm's running or last job; empty if it never had a job.
        missing: the changes that the algorithm needs before it can look.
        place: the place of the algorithm in the spec.
    """

    algorithm: str
    conditions: tuple[Condition, ...]
    doing: str
    missing: tuple[MissingChange, ...]
    obstacle: str = ""
    place: Place | None = None

    @property
    def blocked_by(self) -> tuple[Condition, ...]:
        """Return the preconditions that do not hold."""
        return tuple(condition for condition in self.conditions if condition.holds is not True)


@dataclass(frozen=True, slots=True, kw_only=True)
class Derivation:
    """The expression of a derived variable, and its inputs.

    Attributes:
        rule: the expression.
        inputs: the explanations of the inputs; for an unknown variable, of those inputs that are unknown.
        place: the place of the expression in the spec.
    """

    rule: str
    inputs: tuple[Why, ...]
    place: Place | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Why:
    """The explanation of a variable at an instant; `str()` returns it as readable text.

    Attributes:
        at_s: the instant, on the run's clock.
        reading: the reading of the variable.
        unit: the unit of the variable's value.
        place: the place of the variable's declaration in the spec.
        story: the history of the reading, in sentences.
        conditions: for the preview of a skill, the conditions that do not hold, and the variables that are unknown; if
            the preview holds, all its conditions, and the variables that are named alone.
        look: the job that produced the value; None if no job did.
        derivation: the expression and the inputs of a derived variable; None for other variables.
        poses: the explanations of the edges whose poses determine the value; empty if there are none.
        ways: the algorithms that identify the variable, by rank; empty if other sources write it.
        missing: the changes without which the variable cannot be observed at that instant; a known variable can have
            them as well. Of several algorithms, only the changes of the one that needs the fewest are given.
        beneath: for an override, the explanation of the reading that it hides; otherwise None.
        is_repeated: whether this reading is explained elsewhere in the same explanation; the details are then left out.
        is_left_out: whether the details are left out because the chain of causes is too long: ask for this variable.
    """

    at_s: float
    reading: Reading[Value]
    unit: str = ""
    place: Place | None = None
    story: tuple[str, ...] = ()
    conditions: tuple[Condition, ...] = ()
    look: Look | None = None
    derivation: Derivation | None = None
    poses: tuple[Why, ...] = ()
    ways: tuple[Way, ...] = ()
    missing: tuple[MissingChange, ...] = ()
    beneath: Why | None = None
    is_repeated: bool = False
    is_left_out: bool = False

    @property
    def variable(self) -> str:
        """Return the name of the variable."""
        return self.reading.name

    @property
    def known(self) -> bool:
        """Return whether the variable has a value."""
        return self.reading.known

    def __str__(self) -> str:
        return "\n".join(_lines_of(self))


def _lines_of(why: Why) -> Iterator[str]:
    reading = why.reading
    unit_text = f" {why.unit}" if why.unit else ""
    state_text = f"{value_text(reading.content)}{unit_text}" if reading.known else f"unknown ({reading.reason})"
    repeated_text = ", as explained above" if why.is_repeated else ""
    place_text = _place_text(why.place)
    yield f"{why.variable} is {state_text} at {instant_text(why.at_s)}{repeated_text}{place_text}"
    if why.is_left_out:
        yield f"{_INDENT}its causes are left out, because this chain is long: ask about {why.variable}"
    for sentence in why.story:
        yield f"{_INDENT}{sentence}"
    for condition in why.conditions:
        yield from _indented(_lines_of_condition(condition))
    if why.look is not None:
        yield from _indented(_lines_of_look(why.look))
    if why.derivation is not None:
        yield from _indented(_lines_of_derivation(why.derivation))
    for pose in why.poses:
        yield from _indented(_lines_of(pose))
    for way in why.ways:
        yield from _indented(_lines_of_way(way))
    if why.beneath is not None:
        yield f"{_INDENT}without the override:"
        yield from _indented(_indented(_lines_of(why.beneath)))
    if why.missing:
        yield f"{_INDENT}missing: {', '.join(map(str, why.missing))}"


def _lines_of_look(look: Look) -> Iterator[str]:
    units = look.units
    values = (f"{key} = {value_text(value)}{_unit_text(units.get(key))}" for key, value in look.values.items())
    yield f"perception {look.algorithm} saw {', '.join(values) or 'nothing'} (job {look.index})"
    yield f"{_INDENT}by the rule: {look.rule}{_place_text(look.place)}"
    for condition in look.under:
        yield from _indented(_lines_of_condition(condition))


def _lines_of_derivation(derivation: Derivation) -> Iterator[str]:
    yield f"by the rule: {derivation.rule}{_place_text(derivation.place)}"
    for why in derivation.inputs:
        yield from _indented(_lines_of(why))


def _lines_of_way(way: Way) -> Iterator[str]:
    failing_conditions = way.blocked_by
    is_blocked = bool(failing_conditions or way.obstacle)
    yield f"perception {way.algorithm} {'cannot look' if is_blocked else 'can look'}{_place_text(way.place)}"
    if way.obstacle:
        yield f"{_INDENT}{way.obstacle}"
    if way.doing:
        yield f"{_INDENT}{way.doing}"
    for condition in failing_conditions:
        yield from _indented(_lines_of_condition(condition))


def _lines_of_condition(condition: Condition) -> Iterator[str]:
    if len(condition.because) == 1 and condition.because[0].variable == condition.text:
        first_line, *other_lines = _lines_of(condition.because[0])
        yield (
            first_line if condition.place is None else f"{first_line.partition('  [')[0]}{_place_text(condition.place)}"
        )
        yield from other_lines
        return
    state_text = {True: "holds", False: "does not hold", None: "is unknown"}[condition.holds]
    yield f"{condition.text} {state_text}{_place_text(condition.place)}"
    for why in condition.because:
        yield from _indented(_lines_of(why))


def _indented(lines: Iterator[str]) -> Iterator[str]:
    return (f"{_INDENT}{line}" for line in lines)


def _place_text(place: Place | None) -> str:
    return "" if place is None else f"  [{place}]"


def _unit_text(unit: str | None) -> str:
    return f" {unit}" if unit else ""


def value_text(value: Value | None) -> str:
    """Return a value as text."""
    if isinstance(value, bool):
        return str(value).lower()
    return f"{value:.6g}" if isinstance(value, float) else repr(value) if isinstance(value, str) else str(value)


def duration_text(duration_s: float) -> str:
    """Return a duration as text, to the millisecond."""
    return f"{duration_s:.3f}".rstrip("0").rstrip(".") + " s"


def instant_text(instant_s: float) -> str:
    """Return an instant as text, to the millisecond; if the clock counts from 1970, as date and time in UTC."""
    if not _FIRST_DATE_S <= instant_s < _LAST_DATE_S:
        return duration_text(instant_s)
    return datetime.fromtimestamp(instant_s, UTC).isoformat(" ", "milliseconds").replace("+00:00", " UTC")
