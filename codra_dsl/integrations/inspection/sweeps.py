"""Sweeps of a spec's loops: find the inputs, read their values from texts, and return the results as text and JSON."""

from __future__ import annotations

import dataclasses
import importlib
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from codra_dsl.generation.build_plan import BuildPlan
from codra_dsl.generation.build_plan.names import MAPE_MODULE
from codra_dsl.generation.emit import emit
from codra_dsl.integrations.inspection.loading import load_emitted
from codra_dsl.language.check.checked.loops import CheckedMape, CheckedStage
from codra_dsl.language.check.index.parsed_rules import members
from codra_dsl.language.diagnostics import suggest
from codra_dsl.language.model import Kind, Variable
from codra_dsl.language.units import convert, parse_number, parse_quantity, parse_unit
from codra_dsl.runtime.context.package_files import places_in
from codra_dsl.runtime.loops import CourseModel, InputModel, MapeModel
from codra_dsl.runtime.loops.places import with_places
from codra_dsl.runtime.loops.sweep import Sweep
from codra_dsl.runtime.values.conditions import Value
from codra_dsl.runtime.values.derived import DerivedCell, with_inputs
from codra_dsl.runtime.values.model import VariableModel

UNKNOWN = "unknown"

_NAME_AND_VALUE = re.compile(r"((?:[<>=!]=|[^=])*)(=?)(.*)", re.DOTALL)


class SweepError(ValueError):
    """A sweep is not possible as requested; the message names the possible values."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """The loops of a spec, prepared for sweeps.

    Attributes:
        course: the course whose actions are compared; None if the spec has no course.
        inputs: all variables that rules and hard rules read, except metrics, and all inputs of the derived variables
            among them. Each can be varied or have a fixed value.
        read_names: the inputs that rules and hard rules read.
        variables: the variables of the compiled spec.
    """

    name: str
    model: MapeModel
    course: CourseModel | None
    inputs: Mapping[str, Variable]
    read_names: frozenset[str]
    variables: Sequence[VariableModel]

    def inputs_of(self, name: str) -> frozenset[str]:
        """Return all inputs of a derived variable, also those of derived inputs; none for other variables."""
        cells = {
            variable.name: DerivedCell(variable.name, 1, variable.derived, variable.type, {})
            for variable in self.variables
            if variable.derived is not None
        }
        return with_inputs([name], cells) - {name}

    def input(self, name: str) -> Variable:
        """Return an input by its name.

        Raises:
            SweepError: if no rule reads this input.
        """
        if name not in self.inputs:
            suggestion = suggest(name, self.inputs)
            help_text = f"did you mean '{suggestion}'?" if suggestion else f"rules read {', '.join(self.inputs)}"
            raise SweepError(f"no rule of '{self.name}' reads '{name}': {help_text}")
        return self.inputs[name]

    def terms(self, name: str) -> InputModel | None:
        """Return the model of an input with its terms; None if only a hard rule reads the input."""
        stages = [stage for stage in (self.model.metrics, self.model.actions) if stage is not None]
        return next((model for stage in stages for model in stage.inputs if model.variable == name), None)


def subject(plan: BuildPlan, folder: Path, course: str | None = None) -> Subject:
    """Compile a spec and return its loops.

    Args:
        plan: the build plan of the spec.
        folder: an empty folder, to which the compiled spec is written.
        course: the adaptation whose actions are compared; needed only if there are several courses.

    Raises:
        SweepError: if the spec has no fuzzy rules, or no such course.
    """
    spec, mape = plan.checked.spec, plan.checked.mape
    if mape is None or not (mape.metrics or mape.actions):
        raise SweepError(f"'{spec.name}' has neither metrics nor actions: a sweep has nothing to show")
    package = load_emitted(emit(plan), spec.name, folder)
    model: MapeModel = importlib.import_module(f"{package.__name__}.{MAPE_MODULE}").MAPE
    model = with_places(model, places_in(folder / spec.name, spec.name))
    course_model = _course(model, course, spec.name)
    names = dict.fromkeys(_read_variable_names(mape, "" if course_model is None else course_model.name))
    variables = {variable.name: variable for variable in spec.context}
    read = Subject(
        name=spec.name,
        model=model,
        course=course_model,
        inputs={name: variables[name] for name in names},
        read_names=frozenset(names),
        variables=package.MODEL.variables,
    )
    further_names = frozenset().union(*map(read.inputs_of, names)) - names.keys()
    inputs_of_derived = {name: variable for name, variable in variables.items() if name in further_names}
    return dataclasses.replace(read, inputs={**read.inputs, **inputs_of_derived})


def _course(model: MapeModel, requested_course: str | None, spec: str) -> CourseModel | None:
    courses = {course.name: course for course in model.courses}
    if requested_course is not None and requested_course not in courses:
        suggestion = suggest(requested_course, courses)
        courses_hint = f"there are {', '.join(courses)}" if courses else "the spec has no courses"
        raise SweepError(
            f"'{spec}' has no course '{requested_course}': "
            f"{f'did you mean {suggestion!r}?' if suggestion else courses_hint}"
        )
    if requested_course is None and len(courses) > 1:
        raise SweepError(f"'{spec}' has several courses: choose one with --course {' or '.join(courses)}")
    return courses[requested_course] if requested_course is not None else next(iter(courses.values()), None)


def _read_variable_names(mape: CheckedMape, course: str) -> Iterator[str]:
    """Yield the variables that stages and hard rules read, except metrics."""
    metric_names = {metric.variable for metric in mape.metrics.outputs} if mape.metrics is not None else set()
    stages: Sequence[CheckedStage | None] = (mape.metrics, mape.actions)
    for stage in stages:
        yield from (
            (stage_input.variable.name for stage_input in stage.inputs if stage_input.variable.name not in metric_names)
            if stage
            else ()
        )
    for adaptation in mape.adaptation:
        if adaptation.name == course:
            yield from (name for name in adaptation.reads if name not in metric_names)


def held(subject: Subject, assignments: Sequence[str]) -> dict[str, Value | None]:
    """Return the values of all inputs. Texts such as `battery_level=80` give values; inputs without a text are unknown.

    Raises:
        SweepError: if a text has no value, or an impossible value.
    """
    values: dict[str, Value | None] = dict.fromkeys(subject.inputs)
    for assignment in assignments:
        name, equals_sign, text = _split_assignment(assignment)
        if not equals_sign:
            raise SweepError(f"'{assignment}' has no value: write {name}=VALUE")
        variable = subject.input(name.strip())
        values[variable.name] = None if text.strip() == UNKNOWN else value_of(variable, text.strip())
    return values


def needed(subject: Subject, values: Mapping[str, Value | None], given_names: Sequence[str]) -> dict[str, Value | None]:
    """Return the values without inputs that are read only by derived variables with a given or varied value."""
    derived_names = subject.read_names.difference(given_names)
    names = subject.read_names.union(given_names, *map(subject.inputs_of, derived_names))
    return {name: value for name, value in values.items() if name in names}


def check_given(subject: Subject, given_names: Sequence[str]) -> None:
    """Check that no value is given for a derived variable together with a value of one of its inputs.

    Raises:
        SweepError: if such values are given, because they could contradict each other.
    """
    for name in given_names:
        given_input = next((other for other in given_names if other in subject.inputs_of(name)), None)
        if given_input is not None:
            raise SweepError(f"'{name}' follows from '{given_input}': give a value for only one of them")


def varied(subject: Subject, assignment: str, steps: int) -> tuple[Variable, tuple[Value, ...]]:
    """Return an input and the values over which it is varied.

    Args:
        subject: the loops with the input.
        assignment: `NAME`, `NAME=FROM..TO` or `NAME=VALUE,VALUE,...`; a name without values means the full range.
        steps: the number of steps between both ends of a range.

    Raises:
        SweepError: if the text has an impossible value.
    """
    name, equals_sign, text = _split_assignment(assignment)
    variable = subject.input(name.strip())
    if not equals_sign:
        return variable, _all_values(variable, steps)
    first, range_sign, last = text.partition("..")
    if range_sign and variable.type.kind in (Kind.FLOAT, Kind.INT):
        return variable, _values_between(variable, _number(variable, first), _number(variable, last), steps)
    return variable, tuple(value_of(variable, value_text.strip()) for value_text in text.split(","))


def _split_assignment(assignment: str) -> tuple[str, str, str]:
    """Split `NAME=VALUE` at `=`. The name of a pose condition can itself contain this sign, as in `<=`."""
    name, equals_sign, text = _NAME_AND_VALUE.fullmatch(assignment).groups()  # type: ignore[union-attr]  # any text matches
    return name, equals_sign, text


def _all_values(variable: Variable, steps: int) -> tuple[Value, ...]:
    if variable.type.kind in (Kind.BOOL, Kind.ENUM):
        return tuple(value_of(variable, member) for member in members(variable))
    if variable.type.range is None:
        raise SweepError(f"'{variable.name}' has no range: write {variable.name}=FROM..TO")
    return _values_between(variable, *variable.type.range, steps)


def _values_between(variable: Variable, first: float, last: float, steps: int) -> tuple[Value, ...]:
    if variable.type.kind is Kind.INT:
        low, high = sorted((math.ceil(first), math.floor(last)))
        return tuple(range(low, high + 1)) if high - low <= steps else tuple(_spread_values(low, high, steps))
    return tuple(_without_rounding_error(first + (last - first) * step / steps) for step in range(steps + 1))


def _spread_values(low: int, high: int, steps: int) -> Iterator[int]:
    yield from dict.fromkeys(round(low + (high - low) * step / steps) for step in range(steps + 1))


def _without_rounding_error(number: float) -> float:
    """Return a number without the rounding error of the division: 0.3, not 0.30000000000000004."""
    return float(f"{number:.12g}")


def value_of(variable: Variable, text: str) -> Value:
    """Return the value that a text states for a variable: a number (by default in the variable's unit), or a member.

    Raises:
        SweepError: if the variable cannot have such a value.
    """
    if variable.type.kind not in (Kind.BOOL, Kind.ENUM):
        return _number(variable, text)
    member_names = members(variable)
    if text not in member_names:
        suggestion = suggest(text, member_names)
        raise SweepError(
            f"'{variable.name}' is {' or '.join(member_names)}, not '{text}'"
            f"{f': did you mean {suggestion!r}?' if suggestion else ''}"
        )
    return text == "true" if variable.type.kind is Kind.BOOL else text


def _number(variable: Variable, text: str) -> float:
    number = _quantity(variable, text.strip())
    if variable.type.kind is Kind.INT and number != int(number):
        raise SweepError(f"'{variable.name}' is a whole number, not {text}")
    if variable.type.range is not None and not variable.type.range[0] <= number <= variable.type.range[1]:
        low, high = variable.type.range
        raise SweepError(f"'{variable.name}' is from {low:g} to {high:g}{_unit_text(variable)}, not {number:g}")
    return int(number) if variable.type.kind is Kind.INT else number


def _quantity(variable: Variable, text: str) -> float:
    sign = -1 if text.startswith("-") else 1
    try:
        magnitude = parse_number(text.removeprefix("-"))
    except ValueError:
        magnitude = None
    if magnitude is not None:
        return float(sign * magnitude)
    quantity = parse_quantity(text)
    variable_unit = None if variable.type.unit is None else parse_unit(variable.type.unit)
    if quantity is None:
        raise SweepError(f"'{text}' is not a number: write {variable.name}=1.5, or FROM..TO to vary it")
    if variable_unit is None or quantity.unit.dimension != variable_unit.dimension:
        unit_text = f"in {variable.type.unit}" if variable_unit is not None else "without a unit"
        raise SweepError(f"'{variable.name}' is a number {unit_text}, not '{text}'")
    return float(convert(quantity.value, quantity.unit, variable_unit))


def _unit_text(variable: Variable) -> str:
    return f" {variable.type.unit}" if variable.type.unit else ""


def inputs_text(subject: Subject) -> str:
    """Return a table of the inputs with their possible values and terms."""
    lines = []
    for variable in subject.inputs.values():
        model = subject.terms(variable.name)
        terms = [] if model is None or model.members else list(model.terms)
        inputs = [name for name in subject.inputs if name in subject.inputs_of(variable.name)]
        notes = [
            *([f"terms {', '.join(terms)}"] if terms else []),
            *([f"follows from {', '.join(inputs)}"] if inputs else []),
        ]
        lines.append((variable.name, _possible_values(variable), "; ".join(notes)))
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    rows = ("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines)
    return "".join(f"{row}\n" for row in rows)


def inputs_json(subject: Subject) -> str:
    """Return the inputs as JSON in one line."""
    inputs = []
    for variable in subject.inputs.values():
        model, value_range = subject.terms(variable.name), variable.type.range
        inputs.append(
            {
                "variable": variable.name,
                "type": str(variable.type.kind),
                "unit": variable.type.unit,
                "range": None if value_range is None else list(value_range),
                "members": list(members(variable)),
                "terms": [] if model is None or model.members else list(model.terms),
                "follows_from": [name for name in subject.inputs if name in subject.inputs_of(variable.name)],
            }
        )
    return _json({"spec": subject.name, "inputs": inputs})


def sweep_json(sweep_result: Sweep) -> str:
    """Return a sweep as JSON in one line."""
    fields = dataclasses.asdict(sweep_result)
    fields["trends"] = {name: str(trend) for name, trend in sweep_result.trends.items()}
    return _json(fields)


def _json(fields: Mapping[str, object]) -> str:
    return json.dumps(fields, ensure_ascii=False, allow_nan=False) + "\n"


def _possible_values(variable: Variable) -> str:
    if variable.type.kind in (Kind.BOOL, Kind.ENUM):
        return ", ".join(members(variable))
    if variable.type.range is None:
        return f"any number{_unit_text(variable)}"
    low, high = variable.type.range
    return f"{low:g}..{high:g}{_unit_text(variable)}"
