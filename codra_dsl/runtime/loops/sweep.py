"""Sweeps over the inputs of a loop: metrics, weights, the action, and the rule that causes each switch.

A sweep calls the generated engines, so it shows the behavior of the code that runs on the robot. A sweep ignores
the filter: it shows which action has the highest weight, not when the course switches.
"""

from __future__ import annotations

import itertools
from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from enum import StrEnum

from codra_dsl.logic import Value
from codra_dsl.runtime.errors import unknown_name_error
from codra_dsl.runtime.loops.analysis import Assessment, RuleActivation, assess
from codra_dsl.runtime.loops.courses import hard_rule
from codra_dsl.runtime.loops.declarations import CourseModel, MapeModel
from codra_dsl.runtime.loops.observations import Observation, Scene
from codra_dsl.runtime.values.cell import Cell, Reading
from codra_dsl.runtime.values.derived import ContextAt, DerivedCell
from codra_dsl.runtime.values.model import VariableModel

__all__ = ["Row", "Shift", "Sweep", "Switch", "Trend", "surface", "sweep"]

_BISECTION_STEPS = 40
_TOLERANCE = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True)
class Row:
    """The result for one value of the input.

    Attributes:
        metrics: the value of each metric; None if it is unknown.
        action: the action of a hard rule, else the action with the highest weight, else the course's `otherwise`; empty
            without a course.
        rule: the hard rule that decides, as it is written in the spec; empty if no hard rule holds.
        derived: the values of the derived variables that follow from other inputs; None if a value is unknown.
    """

    value: Value
    metrics: Mapping[str, float | None]
    weights: Mapping[str, float | None]
    action: str
    rule: str
    derived: Mapping[str, Value | None] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Shift:
    """A rule whose strength differs between the two sides of a switch.

    Attributes:
        before: the strength of the rule in the row before the switch; the lower bound if the strength is not certain.
        after: the same for the row after the switch.
    """

    text: str
    place: str
    before: float
    after: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Switch:
    """A change of the action from one value of the input to another.

    Attributes:
        low: `low` and `high` are the two values between which the action changes. If they are numbers, bisection has
            brought them close together; whole numbers differ by 1.
        rules: for each stage, the rule whose strength differs most: among the rules for the two actions, and among the
            rules for the metrics. If a hard rule causes the switch, only the hard rule.
    """

    low: Value
    high: Value
    before: str
    after: str
    rules: tuple[Shift, ...]


class Trend(StrEnum):
    """The trend of a number while an input rises, or passes from one member to the next."""

    CONSTANT = "constant"
    RISES = "rises"
    FALLS = "falls"
    TURNS = "turns"
    """The number rises and falls."""
    UNKNOWN = "unknown"
    """The number is unknown for some value of the input."""

    @property
    def is_monotone(self) -> bool:
        """Return whether the number is always known and never turns."""
        return self in (Trend.CONSTANT, Trend.RISES, Trend.FALLS)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sweep:
    """The results for an input over its range.

    Attributes:
        unit: the unit of the input; empty for none.
        known: the values of all other inputs, except derived variables that follow from inputs; None means unknown.
    """

    variable: str
    unit: str = ""
    known: Mapping[str, Value | None]
    rows: tuple[Row, ...]
    switches: tuple[Switch, ...]

    @property
    def trends(self) -> Mapping[str, Trend]:
        """Return the trend of each metric while the input rises, or passes the members in the order of the rows."""
        rows = sorted(self.rows, key=_sort_key)
        return {name: trend([row.metrics[name] for row in rows]) for name in self.rows[0].metrics}

    def __str__(self) -> str:
        return "\n".join(_lines(self))


def _sort_key(row: Row) -> float:
    return 0.0 if isinstance(row.value, (str, bool)) else row.value


def trend(values: Sequence[float | None]) -> Trend:
    """Return the trend of numbers; differences up to 1e-9 are ignored."""
    known_values = [value for value in values if value is not None]
    if len(known_values) < len(values):
        return Trend.UNKNOWN
    differences = [other - one for one, other in itertools.pairwise(known_values)]
    rises, falls = any(step > _TOLERANCE for step in differences), any(step < -_TOLERANCE for step in differences)
    if rises and falls:
        return Trend.TURNS
    return Trend.RISES if rises else Trend.FALLS if falls else Trend.CONSTANT


def sweep(
    model: MapeModel,
    course: CourseModel | None,
    known: Mapping[str, Value | None],
    variable: str,
    values: Sequence[Value],
    *,
    unit: str = "",
    variables: Iterable[VariableModel] = (),
) -> Sweep:
    """Return the metrics, weights and actions for the values of one input.

    Args:
        model: the model of the loops.
        course: the course whose actions are compared; without one, the rows have only metrics.
        known: the values of everything that the stages and hard rules read, except results of stages; None means
            unknown.
        variable: the input that is varied.
        values: the values of this input, in order; at least one. An input whose values are ints has only whole numbers.
        unit: the unit of the input, for the printed text.
        variables: the variables of the spec. If a derived variable among them is unknown in `known` and is not varied,
            its value follows from the other inputs.

    Raises:
        UnknownNameError: if no stage and no hard rule reads the variable.
    """
    if variable not in known:
        raise unknown_name_error("input", variable, known)
    derived = _derived_inputs(known, [variable], variables)
    sweeper = _Sweeper(model, course, known, variable, derived)
    rows = tuple(sweeper.row(value) for value in values)
    switches = tuple(
        sweeper.switch(one, other) for one, other in itertools.pairwise(rows) if one.action != other.action
    )
    other_inputs = {name: value for name, value in known.items() if name != variable and name not in derived}
    return Sweep(variable=variable, unit=unit, known=other_inputs, rows=rows, switches=switches)


def surface(
    model: MapeModel,
    course: CourseModel | None,
    known: Mapping[str, Value | None],
    x_input: tuple[str, Sequence[Value]],
    y_input: tuple[str, Sequence[Value]],
    *,
    variables: Iterable[VariableModel] = (),
) -> tuple[tuple[Row, ...], ...]:
    """Return the metrics, weights and actions for the values of two inputs.

    Args:
        model: the model of the loops.
        course: the same as for `sweep`.
        known: the same as for `sweep`.
        x_input: the input that differs within a row, and its values.
        y_input: the input that differs from row to row, and its values.
        variables: the same as for `sweep`.

    Raises:
        UnknownNameError: if one of the two inputs is read by no stage and no hard rule.
    """
    for name in (x_input[0], y_input[0]):
        if name not in known:
            raise unknown_name_error("input", name, known)
    derived = _derived_inputs(known, [x_input[0], y_input[0]], variables)
    sweepers = (_Sweeper(model, course, {**known, y_input[0]: value}, x_input[0], derived) for value in y_input[1])
    return tuple(tuple(sweeper.row(value) for value in x_input[1]) for sweeper in sweepers)


def _derived_inputs(
    known: Mapping[str, Value | None], varied_names: Sequence[str], variables: Iterable[VariableModel]
) -> Mapping[str, DerivedCell]:
    """Return the derived variables that follow from other inputs."""
    return {
        variable.name: DerivedCell(variable.name, 1, variable.derived, variable.type, {})
        for variable in variables
        if variable.derived is not None and known.get(variable.name) is None and variable.name not in varied_names
    }


def _with_derived_values(
    known: Mapping[str, Value | None], derived: Mapping[str, DerivedCell]
) -> dict[str, Value | None]:
    """Return the values of inputs, with those of the derived variables."""
    cells = {name: _cell(name, content) for name, content in known.items()}
    context = ContextAt({**cells, **derived}, 0.0)
    return {name: context.value(name) for name in known}


def _cell(name: str, content: Value | None) -> Cell:
    cell = Cell(name, 1)
    if content is not None:
        cell.write(Reading(name=name, content=content, evidence_s=0.0))
    return cell


def _scene(known: Mapping[str, Value | None]) -> Scene:
    return {name: Observation(variable=name, value=value, evidence_s=0.0) for name, value in known.items()}


@dataclass(frozen=True, slots=True)
class _Sweeper:
    model: MapeModel
    course: CourseModel | None
    known: Mapping[str, Value | None]
    variable: str
    derived: Mapping[str, DerivedCell]

    def assess_at(self, value: Value) -> Assessment:
        return assess(self.model, _scene(_with_derived_values({**self.known, self.variable: value}, self.derived)))

    def row(self, value: Value) -> Row:
        assessment = self.assess_at(value)
        metrics = {metric.name: metric.value for metric in assessment.metrics.outputs}
        derived = {name: assessment.scene[name].value for name in self.known if name in self.derived}
        if self.course is None:
            return Row(value=value, metrics=metrics, weights={}, action="", rule="", derived=derived)
        rule = hard_rule(self.course, assessment, 0.0)
        weights = {action: assessment.weights()[action] for action in self.course.choose}
        known_weights = {action: weight for action, weight in weights.items() if weight is not None}
        best_action = max(known_weights, key=known_weights.__getitem__, default=self.course.otherwise)
        return Row(
            value=value,
            metrics=metrics,
            weights=weights,
            action=best_action if rule is None else rule.action,
            rule="" if rule is None else rule.text,
            derived=derived,
        )

    def switch(self, one: Row, other: Row) -> Switch:
        low, high = self._bisect(one, other)
        return Switch(
            low=low.value,
            high=high.value,
            before=low.action,
            after=high.action,
            rules=tuple(
                self._hard_rule_shift(low, high)
                if low.rule != high.rule
                else self._fuzzy_rule_shifts(one, other, low, high)
            ),
        )

    def _bisect(self, one: Row, other: Row) -> tuple[Row, Row]:
        """Return two rows on both sides of the switch, narrowed by bisection for numbers.

        Between two integers that follow each other there is no other value.
        """
        for _ in range(_BISECTION_STEPS):
            low, high = one.value, other.value
            if isinstance(low, (str, bool)) or isinstance(high, (str, bool)):
                break
            is_whole = isinstance(low, int) and isinstance(high, int)
            middle_value = (low + high) // 2 if is_whole else (low + high) / 2.0
            if is_whole and middle_value in (low, high):
                break
            middle = self.row(middle_value)
            if middle.action == one.action:
                one = middle
            else:
                other = middle
        return one, other

    def _hard_rule_shift(self, low: Row, high: Row) -> Iterator[Shift]:
        """Yield the hard rule that holds on only one side of the switch."""
        text, is_after = (high.rule, True) if high.rule else (low.rule, False)
        always = () if self.course is None else self.course.always
        place = next(rule.place for rule in always if rule.text == text)
        yield Shift(text=text, place=place, before=float(not is_after), after=float(is_after))

    def _fuzzy_rule_shifts(self, one: Row, other: Row, low: Row, high: Row) -> Iterator[Shift]:
        """Yield the rule of each stage whose strength differs most.

        If the input is continuous, the strengths are those in the sweep's rows before and after the switch, where the
        difference is clearer than close to the switch.
        """
        rows = (one, other) if isinstance(low.value, float) else (low, high)
        before, after = (self.assess_at(row.value) for row in rows)
        yield from _largest_shift(before.actions.rules, after.actions.rules, {low.action, high.action})
        yield from _largest_shift(
            before.metrics.rules, after.metrics.rules, {metric.name for metric in before.metrics.outputs}
        )


def _largest_shift(
    before: Sequence[RuleActivation], after: Sequence[RuleActivation], outputs: set[str]
) -> Iterator[Shift]:
    shifts = [
        Shift(text=rule_before.text, place=rule_before.place, before=rule_before.low, after=rule_after.low)
        for rule_before, rule_after in zip(before, after, strict=True)
        if outputs & set(rule_before.concludes)
    ]
    largest_shift = max(shifts, key=_strength_change, default=None)
    if largest_shift is not None and _strength_change(largest_shift) > _TOLERANCE:
        yield largest_shift


def _strength_change(shift: Shift) -> float:
    return abs(shift.after - shift.before)


def _lines(sweep_result: Sweep) -> Iterator[str]:
    yield from _other_input_lines(sweep_result.known)
    yield from _table_lines(sweep_result)
    for switch in sweep_result.switches:
        yield f"{switch.before} -> {switch.after} {_position_text(sweep_result, switch)}:"
        for rule in switch.rules:
            place = f"  [{rule.place}]" if rule.place else ""
            yield f"  {rule.text}: {rule.before:.3g} -> {rule.after:.3g}{place}"
    for name, trend_of_metric in sweep_result.trends.items():
        yield f"{name} {_TREND_TEXTS[trend_of_metric]}"


_TREND_TEXTS = {
    Trend.CONSTANT: "is constant",
    Trend.RISES: "is monotone: it never falls",
    Trend.FALLS: "is monotone: it never rises",
    Trend.TURNS: "is not monotone: it rises and falls",
    Trend.UNKNOWN: "is not known everywhere",
}


def _other_input_lines(known: Mapping[str, Value | None]) -> Iterator[str]:
    known_texts = [f"{name} = {_cell_text(value)}" for name, value in known.items() if value is not None]
    unknown_names = [name for name, value in known.items() if value is None]
    yield from [f"with {', '.join(known_texts)}"] if known_texts else []
    yield from [f"unknown: {', '.join(unknown_names)}"] if unknown_names else []


def _table_lines(sweep_result: Sweep) -> Iterator[str]:
    first = sweep_result.rows[0]
    input_title = f"{sweep_result.variable} ({sweep_result.unit})" if sweep_result.unit else sweep_result.variable
    has_course = bool(first.action)
    column_titles = [input_title, *first.derived, *first.metrics, *first.weights, *(["action"] if has_course else [])]
    lines = [column_titles]
    for row in sweep_result.rows:
        values = (row.value, *row.derived.values(), *row.metrics.values(), *row.weights.values())
        lines.append([*map(_cell_text, values), *([row.action] if has_course else [])])
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    for line in lines:
        yield "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True))


def _position_text(sweep_result: Sweep, switch: Switch) -> str:
    low, high = (f"{_cell_text(value)} {sweep_result.unit}".rstrip() for value in (switch.low, switch.high))
    return f"at {low}" if low == high else f"between {low} and {high}"


def _cell_text(value: Value | None) -> str:
    if value is None:
        return "unknown"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f"{value:.4g}" if isinstance(value, float) else str(value)
