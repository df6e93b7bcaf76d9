"""What a loop makes of an input over its range: metrics, weights, the action, and the rule behind each switch.

The filter is left aside: a sweep asks what would weigh most, not when.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass

from codra_dsl.logic import Value
from codra_dsl.runtime.mape.analysis import Assessment, Fired, assess
from codra_dsl.runtime.mape.courses import hard_rule
from codra_dsl.runtime.mape.declarations import CourseModel, MapeModel
from codra_dsl.runtime.mape.observations import Observation, Scene
from codra_dsl.runtime.names import unknown

_HALVINGS = 40
_SAME = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """What one value of the input comes to.

    Attributes:
        metrics: what counts of each; None if unknown.
        action: the one of a hard rule, else the one that weighs most, else the course's `otherwise`.
        rule: the hard rule that decides, as the spec says it; empty if none does.
    """

    value: Value
    metrics: Mapping[str, float | None]
    weights: Mapping[str, float | None]
    action: str
    rule: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Shift:
    """A rule whose strength differs on both sides of a switch.

    Attributes:
        before: its strength at the row before; the least, if it is not certain.
        after: its strength at the row after.
    """

    text: str
    place: str
    before: float
    after: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Switch:
    """That another action weighs most from a value on.

    Attributes:
        low: with `high` the two values between which it lies: next to each other for numbers.
        rules: of the action that loses or wins, and of the metrics: the one of each stage whose strength differs most;
            or the hard rule alone.
    """

    low: Value
    high: Value
    before: str
    after: str
    rules: tuple[Shift, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """What an input comes to over its range."""

    variable: str
    rows: tuple[Row, ...]
    switches: tuple[Switch, ...]

    def __str__(self) -> str:
        return "\n".join(_lines(self))


def sweep(
    model: MapeModel, course: CourseModel, known: Mapping[str, Value | None], variable: str, values: Sequence[Value]
) -> Sweep:
    """Return what a course makes of an input.

    Args:
        model: of the loops.
        course: whose actions are weighed.
        known: all that the stages and hard rules read, but what stages work out; None is unknown.
        variable: the input that is varied.
        values: that it takes, in order.

    Raises:
        UnknownNameError: if nothing reads the variable.
    """
    if variable not in known:
        raise unknown("input", variable, known)
    scene = {name: Observation(variable=name, value=value, evidence_s=0.0) for name, value in known.items()}
    asked = _Asked(model, course, scene, variable)
    rows = tuple(asked.row(value) for value in values)
    switches = tuple(asked.switch(one, other) for one, other in itertools.pairwise(rows) if one.action != other.action)
    return Sweep(variable=variable, rows=rows, switches=switches)


@dataclass(frozen=True, slots=True)
class _Asked:
    model: MapeModel
    course: CourseModel
    scene: Scene
    variable: str

    def assessed(self, value: Value) -> Assessment:
        seen = Observation(variable=self.variable, value=value, evidence_s=0.0)
        return assess(self.model, {**self.scene, self.variable: seen})

    def row(self, value: Value) -> Row:
        found = self.assessed(value)
        rule = hard_rule(self.course, found, 0.0)
        weights = {action: found.weights()[action] for action in self.course.choose}
        known = {action: weight for action, weight in weights.items() if weight is not None}
        heaviest = max(known, key=known.__getitem__, default=self.course.otherwise)
        return Row(
            value=value,
            metrics={each.name: each.value for each in found.metrics.outputs},
            weights=weights,
            action=heaviest if rule is None else rule.action,
            rule="" if rule is None else rule.text,
        )

    def switch(self, one: Row, other: Row) -> Switch:
        low, high = self._narrowed(one, other)
        return Switch(
            low=low.value,
            high=high.value,
            before=low.action,
            after=high.action,
            rules=tuple(self._shifts(one, other, {low.action, high.action})),
        )

    def _narrowed(self, one: Row, other: Row) -> tuple[Row, Row]:
        """Return two rows on both sides of the switch, as near to each other as halving finds for numbers."""
        for _ in range(_HALVINGS):
            low, high = one.value, other.value
            if isinstance(low, (str, bool)) or isinstance(high, (str, bool)):
                break
            middle = self.row((low + high) / 2.0)
            if middle.action == one.action:
                one = middle
            else:
                other = middle
        return one, other

    def _shifts(self, one: Row, other: Row, actions: set[str]) -> Iterator[Shift]:
        """Yield what differs: a hard rule, or the rule of each stage whose strength differs most."""
        if one.rule != other.rule:
            text, is_after = (other.rule, True) if other.rule else (one.rule, False)
            place = next(rule.place for rule in self.course.always if rule.text == text)
            yield Shift(text=text, place=place, before=float(not is_after), after=float(is_after))
            return
        before, after = self.assessed(one.value), self.assessed(other.value)
        yield from _largest(before.actions.rules, after.actions.rules, actions)
        yield from _largest(before.metrics.rules, after.metrics.rules, {each.name for each in before.metrics.outputs})


def _largest(before: Sequence[Fired], after: Sequence[Fired], about: set[str]) -> Iterator[Shift]:
    shifts = [
        Shift(text=one.text, place=one.place, before=one.low, after=other.low)
        for one, other in zip(before, after, strict=True)
        if about & set(one.concludes)
    ]
    largest = max(shifts, key=_size, default=None)
    if largest is not None and _size(largest) > _SAME:
        yield largest


def _size(shift: Shift) -> float:
    return abs(shift.after - shift.before)


def _lines(found: Sweep) -> Iterator[str]:
    first = found.rows[0]
    names = [found.variable, *first.metrics, *first.weights, "action"]
    widths = [max(10, len(name)) for name in names]
    yield "  ".join(name.rjust(width) for name, width in zip(names, widths, strict=True))
    for row in found.rows:
        cells = [_cell(row.value), *map(_cell, row.metrics.values()), *map(_cell, row.weights.values()), row.action]
        yield "  ".join(cell.rjust(width) for cell, width in zip(cells, widths, strict=True))
    for switch in found.switches:
        between = f"{_cell(switch.low)} and {_cell(switch.high)}"
        yield f"{switch.before} -> {switch.after} between {between}:"
        for rule in switch.rules:
            place = f"  [{rule.place}]" if rule.place else ""
            yield f"  {rule.text}: {rule.before:.3g} -> {rule.after:.3g}{place}"


def _cell(value: Value | None) -> str:
    if value is None:
        return "unknown"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
