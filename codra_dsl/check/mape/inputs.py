"""Phase 3 for loops: what rules count with are numbers in a range, rates are of numbers, and what is set may be set."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.check.mape.book import defuzzifier_of, output_terms, range_of
from codra_dsl.check.rules import finding
from codra_dsl.check.scope import Faults, Scope
from codra_dsl.diagnostics import Diagnostic
from codra_dsl.fuzzy.model import Term
from codra_dsl.fuzzy.words import KEYWORDS, Hedge, Shape
from codra_dsl.load.mape import snake_case
from codra_dsl.model import ADAPTER, ANALYST, Course, Kind, Parameter, Variable
from codra_dsl.units import ONE, UNITS, Unit, convert, parse_unit

_NUMBERS = (Kind.INT, Kind.FLOAT)

_OF_RULES = KEYWORDS | set(Hedge)


def unfit_inputs(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What a rule names is known to lie within a range; terms are of numbers."""
    for variable in scope.spec.context:
        if variable.terms and variable.type.kind not in _NUMBERS and not variable.is_derived:
            message = f"context-variable '{variable.name}' is no number and has terms"
            way_out = "leave them away: rules say 'is true', or 'is MEMBER'"
            place = variable.places.get("terms", variable.place)
            yield finding("unfit-input", message, place, path=f"context.{variable.name}.terms", way_out=way_out)
    for name in dict.fromkeys(name for key in scope.book.rules for name in scope.book.named(*key)):
        asked = scope.book.variables.get(name)
        whole = scope.readable("context", name, "range") and faults.sound("context", name)
        if asked is not None and whole and range_of(asked) is None and asked.type.kind in _NUMBERS:
            message = f"rules ask for context-variable '{name}', which states no range"
            way_out = "add 'range': while it is unknown, it counts as all of that"
            yield finding("unfit-input", message, asked.place, path=f"context.{name}", way_out=way_out)
        if asked is not None and whole:
            yield from _reserved_words(asked, scope.book.terms(asked))


def _reserved_words(asked: Variable, terms: tuple[Term, ...]) -> Iterator[Diagnostic]:
    """No term or member is called like a word of rules: `is any` would always hold."""
    for term in terms:
        if term.name in _OF_RULES:
            key = "values" if asked.type.values else "terms"
            message = f"rules ask for context-variable '{asked.name}', and '{term.name}' is a word of rules"
            place, path = asked.places.get(key, asked.place), f"context.{asked.name}.{key}"
            yield finding("unfit-input", message, place, path=path, way_out=f"call '{term.name}' something else")


def unfit_outputs(scope: Scope, _: Faults) -> Iterator[Diagnostic]:
    """Terms of an output fit how it becomes a number."""
    for section, output in scope.book.outputs:
        method = defuzzifier_of(output)
        weighted = method.is_weighted
        constant = [term.name for term in output_terms(output) if term.shape is Shape.Constant]
        if constant and not weighted:
            message = (
                f"term '{constant[0]}' of '{output.name}' is a number, and '{snake_case(method.value)}' takes shapes"
            )
            way_out = "write 'inference: takagi_sugeno', or give the term a shape"
        elif weighted and len(constant) < len(output_terms(output)):
            message = f"'{output.name}' adds up numbers, and not all of its terms are such"
            way_out = "write its terms as 'constant 0.5'"
        else:
            continue
        place = output.places.get("terms", output.places.get("defuzzifier", output.place))
        yield finding("unfit-output", message, place, path=f"{section}.{output.name}", way_out=way_out)


def unfit_rates(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """A rate is of a number that others write, in its unit per time, of which enough readings are kept."""
    for variable in scope.spec.context:
        if variable.rate is None or not faults.sound("context", variable.name):
            continue
        of = scope.variables.get(variable.rate.of.name)
        keys = ("type", "unit", "rate_of")
        if of is None or not all(scope.readable("context", each.name, *keys) for each in (variable, of)):
            continue
        for message, way_out, key in _about_rate(variable, of):
            place = variable.places.get(key, variable.place)
            yield finding("unfit-rate", message, place, path=f"context.{variable.name}.{key}", way_out=way_out)


def _about_rate(variable: Variable, of: Variable) -> Iterator[tuple[str, str, str]]:
    said = f"context-variable '{variable.name}'"
    if [source.name for source in variable.sources] != [ANALYST]:
        yield f"{said} is a rate, which loops work out", "leave 'source' away", "source"
    if of.type.kind not in _NUMBERS:
        yield f"{said} is the rate of '{of.name}', which is no number", "name a number", "rate_of"
        return
    if of.rate is not None or of.is_derived:
        yield f"{said} is the rate of '{of.name}', which loops work out", "name what agents write", "rate_of"
    if variable.type.kind is not Kind.FLOAT:
        yield f"{said} is a rate and no float", "write 'type: float'", "type"
    elif rate_factor(variable, of) is None:
        unit = f"{of.type.unit or '1'}/s"
        yield f"{said} has not the unit of '{of.name}' per time", f"write 'unit: {unit}', or per min or h", "unit"
    if of.history < _FEWEST:
        yield f"'{of.name}' keeps {of.history} reading, of which no rate follows", "let it keep more", "rate_of"


_FEWEST = 2


def rate_factor(variable: Variable, of: Variable) -> float | None:
    """Return what a change of 1 a second of a variable is in the unit of its rate; None where the units do not fit."""
    base, wanted = _unit(of), _unit(variable)
    if base is None or wanted is None:
        return None
    per_second = base / UNITS["s"]
    if per_second.dimension != wanted.dimension:
        return None
    sign = -1.0 if variable.rate is not None and variable.rate.is_falling else 1.0
    return sign * convert(1.0, per_second, wanted)


def _unit(variable: Variable) -> Unit | None:
    return ONE if variable.type.unit is None else parse_unit(variable.type.unit)


def unfit_parameters(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """What an adaptation sets is a variable whose source it is, and no other adaptation sets it."""
    first: dict[str, str] = {}
    for adaptation in scope.spec.adaptation:
        does = adaptation.does
        if not isinstance(does, Parameter):
            continue
        name, path = does.variable.name, f"adaptation.{adaptation.name}.set"
        variable = scope.variables.get(name)
        other = first.setdefault(name, adaptation.name)
        if other != adaptation.name:
            message = f"adaptation '{other}' sets '{name}', too"
            yield finding("two-adaptations", message, does.variable.place, path=path, way_out="say it in one of them")
        if variable is None or not faults.sound("context", name) or not scope.readable("context", name, "source"):
            continue
        if ADAPTER not in (source.name for source in variable.sources) or variable.is_derived:
            message = f"adaptation '{adaptation.name}' sets '{name}', of which it is no source"
            way_out = f"write 'source: {ADAPTER}' there, or set another variable"
            yield finding("foreign-parameter", message, does.variable.place, path=path, way_out=way_out)


def senseless_times(scope: Scope, faults: Faults) -> Iterator[Diagnostic]:
    """The numbers of an adaptation make sense together."""
    for adaptation in scope.spec.adaptation:
        does = adaptation.does
        for key, message, way_out in _about_times(does, adaptation.dwell_s) if isinstance(does, Course) else ():
            whole = scope.readable("adaptation", adaptation.name, key, "choose")
            if whole and faults.sound("adaptation", adaptation.name):
                place = adaptation.places.get(key, adaptation.place)
                path = f"adaptation.{adaptation.name}.{key}"
                yield finding("senseless-filter", message, place, path=path, way_out=way_out)


def _about_times(course: Course, dwell_s: float) -> Iterator[tuple[str, str, str]]:
    if not 0.0 <= course.lead < 1.0:
        message = f"a lead of {course.lead:g} is never reached: weights go from 0 to 1"
        message = message if course.lead >= 1.0 else f"a lead of {course.lead:g} is negative"
        yield "lead", message, "write a number from 0 up to below 1"
    if course.hold_s > dwell_s > 0.0:
        yield "hold", "what is to be held longer than the dwell makes the dwell useless", "let 'hold' be the shorter"
    chosen = [reference.name for reference in course.choose]
    if course.otherwise.name and course.otherwise.name not in chosen:
        message = f"'{course.otherwise.name}' is not among the actions to choose from"
        yield "otherwise", message, "add it to 'choose', or name one of these"
    for rule in course.always:
        if rule.action.name not in chosen:
            yield "always", f"'{rule.action.name}' is not among the actions to choose from", "add it to 'choose'"


LOOP_TYPES = (unfit_inputs, unfit_outputs, unfit_rates, unfit_parameters, senseless_times)
"""The rules of this subject."""
