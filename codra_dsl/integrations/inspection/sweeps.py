"""Sweeps of a spec's loops: what can be varied, what is said of it in words, and what comes of it."""

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
from codra_dsl.runtime.loops.places import placed
from codra_dsl.runtime.loops.sweep import Sweep
from codra_dsl.runtime.values.conditions import Value

UNKNOWN = "unknown"

_NAME_AND_VALUE = re.compile(r"((?:[<>=!]=|[^=])*)(=?)(.*)", re.DOTALL)


class SweepError(ValueError):
    """What was asked for cannot be; the text says what can."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Subject:
    """The loops of a spec, as sweeps ask about them.

    Attributes:
        course: whose actions are weighed; None in a spec that has none.
        inputs: all that the rules and hard rules read, but metrics: what can be varied or held.
    """

    name: str
    model: MapeModel
    course: CourseModel | None
    inputs: Mapping[str, Variable]

    def input(self, name: str) -> Variable:
        """Return an input by its name.

        Raises:
            SweepError: if no rule reads it.
        """
        if name not in self.inputs:
            near = suggest(name, self.inputs)
            help = f"did you mean '{near}'?" if near else f"rules read {', '.join(self.inputs)}"
            raise SweepError(f"no rule of '{self.name}' reads '{name}': {help}")
        return self.inputs[name]

    def terms(self, name: str) -> InputModel | None:
        """Return an input as a stage has it, with the degrees of its terms; None if only a hard rule reads it."""
        stages = [stage for stage in (self.model.metrics, self.model.actions) if stage is not None]
        return next((each for stage in stages for each in stage.inputs if each.variable == name), None)


def subject(plan: BuildPlan, folder: Path, course: str | None = None) -> Subject:
    """Return the loops of a spec, compiled.

    Args:
        plan: of the spec.
        folder: an empty one, which the compiled spec is written to.
        course: the adaptation whose actions are weighed; needed only where there are several.

    Raises:
        SweepError: if the spec has no fuzzy rules, or no such course.
    """
    spec, mape = plan.checked.spec, plan.checked.mape
    if mape is None or not (mape.metrics or mape.actions):
        raise SweepError(f"'{spec.name}' has neither metrics nor actions: there is nothing that follows from an input")
    package = load_emitted(emit(plan), spec.name, folder)
    model: MapeModel = importlib.import_module(f"{package.__name__}.{MAPE_MODULE}").MAPE
    model = placed(model, places_in(folder / spec.name, spec.name))
    chosen = _course(model, course, spec.name)
    names = dict.fromkeys(_read(mape, "" if chosen is None else chosen.name))
    variables = {each.name: each for each in spec.context}
    return Subject(name=spec.name, model=model, course=chosen, inputs={name: variables[name] for name in names})


def _course(model: MapeModel, wanted: str | None, spec: str) -> CourseModel | None:
    courses = {each.name: each for each in model.courses}
    if wanted is not None and wanted not in courses:
        near = suggest(wanted, courses)
        listed = f"there are {', '.join(courses)}" if courses else "the spec chooses none"
        raise SweepError(f"'{spec}' has no course '{wanted}': {f'did you mean {near!r}?' if near else listed}")
    if wanted is None and len(courses) > 1:
        raise SweepError(f"'{spec}' chooses several courses: say which, --course {' or '.join(courses)}")
    return courses[wanted] if wanted is not None else next(iter(courses.values()), None)


def _read(mape: CheckedMape, course: str) -> Iterator[str]:
    """Yield what stages and hard rules read, but metrics."""
    judged = {each.variable for each in mape.metrics.outputs} if mape.metrics is not None else set()
    stages: Sequence[CheckedStage | None] = (mape.metrics, mape.actions)
    for stage in stages:
        yield from (each.variable.name for each in stage.inputs if each.variable.name not in judged) if stage else ()
    for adaptation in mape.adaptation:
        if adaptation.name == course:
            yield from (name for name in adaptation.reads if name not in judged)


def held(subject: Subject, said: Sequence[str]) -> dict[str, Value | None]:
    """Return what all inputs are, of texts such as `battery_level=80`; what nothing is said of is unknown.

    Raises:
        SweepError: if one says nothing, or something that cannot be.
    """
    known: dict[str, Value | None] = dict.fromkeys(subject.inputs)
    for each in said:
        name, equals, text = _parted(each)
        if not equals:
            raise SweepError(f"'{each}' says no value: write {name}=VALUE")
        variable = subject.input(name.strip())
        known[variable.name] = None if text.strip() == UNKNOWN else value_of(variable, text.strip())
    return known


def varied(subject: Subject, said: str, steps: int) -> tuple[Variable, tuple[Value, ...]]:
    """Return an input and the values that it takes.

    Args:
        subject: whose input it is.
        said: `NAME`, `NAME=FROM..TO` or `NAME=VALUE,VALUE,...`; by its name alone it takes its whole range.
        steps: between both ends of a range.

    Raises:
        SweepError: if it says something that cannot be.
    """
    name, equals, text = _parted(said)
    variable = subject.input(name.strip())
    if not equals:
        return variable, _all_values(variable, steps)
    first, dots, last = text.partition("..")
    if dots and variable.type.kind in (Kind.FLOAT, Kind.INT):
        return variable, _between(variable, _number(variable, first), _number(variable, last), steps)
    return variable, tuple(value_of(variable, each.strip()) for each in text.split(","))


def _parted(said: str) -> tuple[str, str, str]:
    """Part `NAME=VALUE`; the name of a comparison with poses holds such a sign itself, as in `<=`."""
    name, equals, text = _NAME_AND_VALUE.fullmatch(said).groups()  # type: ignore[union-attr]  # any text matches
    return name, equals, text


def _all_values(variable: Variable, steps: int) -> tuple[Value, ...]:
    if variable.type.kind in (Kind.BOOL, Kind.ENUM):
        return tuple(value_of(variable, member) for member in members(variable))
    if variable.type.range is None:
        raise SweepError(f"'{variable.name}' has no range: write {variable.name}=FROM..TO")
    return _between(variable, *variable.type.range, steps)


def _between(variable: Variable, first: float, last: float, steps: int) -> tuple[Value, ...]:
    if variable.type.kind is Kind.INT:
        low, high = sorted((math.ceil(first), math.floor(last)))
        return tuple(range(low, high + 1)) if high - low <= steps else tuple(_spread(low, high, steps))
    return tuple(_tidy(first + (last - first) * step / steps) for step in range(steps + 1))


def _spread(low: int, high: int, steps: int) -> Iterator[int]:
    yield from dict.fromkeys(round(low + (high - low) * step / steps) for step in range(steps + 1))


def _tidy(number: float) -> float:
    """Return a number without the last digits, that are of the division: 0.3 and not 0.30000000000000004."""
    return float(f"{number:.12g}")


def value_of(variable: Variable, text: str) -> Value:
    """Return the value that a text says of a variable: a number, with a unit or in the variable's own, or a member.

    Raises:
        SweepError: if it says none that the variable can have.
    """
    if variable.type.kind not in (Kind.BOOL, Kind.ENUM):
        return _number(variable, text)
    known = members(variable)
    if text not in known:
        near = suggest(text, known)
        raise SweepError(
            f"'{variable.name}' is {' or '.join(known)}, not '{text}'{f': did you mean {near!r}?' if near else ''}"
        )
    return text == "true" if variable.type.kind is Kind.BOOL else text


def _number(variable: Variable, text: str) -> float:
    found = _quantity(variable, text.strip())
    if variable.type.kind is Kind.INT and found != int(found):
        raise SweepError(f"'{variable.name}' is a whole number, not {text}")
    if variable.type.range is not None and not variable.type.range[0] <= found <= variable.type.range[1]:
        low, high = variable.type.range
        raise SweepError(f"'{variable.name}' is from {low:g} to {high:g}{_unit(variable)}, not {found:g}")
    return int(found) if variable.type.kind is Kind.INT else found


def _quantity(variable: Variable, text: str) -> float:
    sign = -1 if text.startswith("-") else 1
    try:
        bare = parse_number(text.removeprefix("-"))
    except ValueError:
        bare = None
    if bare is not None:
        return float(sign * bare)
    quantity = parse_quantity(text)
    own = None if variable.type.unit is None else parse_unit(variable.type.unit)
    if quantity is None:
        raise SweepError(f"'{text}' is no number: write {variable.name}=1.5, or FROM..TO to vary it")
    if own is None or quantity.unit.dimension != own.dimension:
        fitting = f"in {variable.type.unit}" if own is not None else "without a unit"
        raise SweepError(f"'{variable.name}' is a number {fitting}, not '{text}'")
    return float(convert(quantity.value, quantity.unit, own))


def _unit(variable: Variable) -> str:
    return f" {variable.type.unit}" if variable.type.unit else ""


def inputs_text(subject: Subject) -> str:
    """Return a table of the inputs: what each can be, and its terms."""
    lines = []
    for variable in subject.inputs.values():
        model = subject.terms(variable.name)
        terms = [] if model is None or model.members else list(model.terms)
        lines.append((variable.name, _can_be(variable), f"terms {', '.join(terms)}" if terms else ""))
    widths = [max(map(len, column)) for column in zip(*lines, strict=True)]
    rows = ("  ".join(cell.ljust(width) for cell, width in zip(line, widths, strict=True)).rstrip() for line in lines)
    return "".join(f"{row}\n" for row in rows)


def inputs_json(subject: Subject) -> str:
    """Return the inputs as JSON in one line."""
    told = []
    for variable in subject.inputs.values():
        model, span = subject.terms(variable.name), variable.type.range
        told.append(
            {
                "variable": variable.name,
                "type": str(variable.type.kind),
                "unit": variable.type.unit,
                "range": None if span is None else list(span),
                "members": list(members(variable)),
                "terms": [] if model is None or model.members else list(model.terms),
            }
        )
    return _json({"spec": subject.name, "inputs": told})


def sweep_json(found: Sweep) -> str:
    """Return a sweep as JSON in one line."""
    told = dataclasses.asdict(found)
    told["trends"] = {name: str(way) for name, way in found.trends.items()}
    return _json(told)


def _json(told: Mapping[str, object]) -> str:
    return json.dumps(told, ensure_ascii=False, allow_nan=False) + "\n"


def _can_be(variable: Variable) -> str:
    if variable.type.kind in (Kind.BOOL, Kind.ENUM):
        return ", ".join(members(variable))
    if variable.type.range is None:
        return f"any number{_unit(variable)}"
    low, high = variable.type.range
    return f"{low:g}..{high:g}{_unit(variable)}"
