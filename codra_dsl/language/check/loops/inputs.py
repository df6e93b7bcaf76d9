"""Checks of loops (phase 3).

Inputs of rules have ranges, rates are computed from numbers, and adaptations set only variables that they may set.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence

from codra_dsl.language.check.index.parsed_rules import defuzzifier_of, output_terms, range_of
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.diagnostics import Diagnostic
from codra_dsl.language.fuzzy.model import Term
from codra_dsl.language.fuzzy.words import KEYWORDS, Hedge, Shape
from codra_dsl.language.load.elements.loops import snake_case
from codra_dsl.language.model import ADAPTER, ANALYST, Course, Kind, Parameter, RateKind, Variable
from codra_dsl.language.units import ONE, UNITS, Unit, convert, parse_unit

_NUMERIC_KINDS = (Kind.INT, Kind.FLOAT)

_RULE_KEYWORDS = KEYWORDS | set(Hedge)


def unfit_inputs(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every number that rules read has a range, only numbers have terms, and no term is a keyword of rules."""
    for variable in spec_index.spec.context:
        if variable.terms and variable.type.kind not in _NUMERIC_KINDS and not variable.is_derived:
            message = f"context-variable '{variable.name}' is not a number, but has terms"
            help = "remove the terms: rules use 'is true', or 'is MEMBER'"
            place = variable.places.get("terms", variable.place)
            yield finding("unfit-input", message, place, path=f"context.{variable.name}.terms", help=help)
    for name in dict.fromkeys(
        name for key in spec_index.parsed_rules.rules for name in spec_index.parsed_rules.input_names(*key)
    ):
        input_variable = spec_index.parsed_rules.variables.get(name)
        is_readable = spec_index.is_readable("context", name, "range") and faults.is_sound("context", name)
        if (
            input_variable is not None
            and is_readable
            and range_of(input_variable) is None
            and input_variable.type.kind in _NUMERIC_KINDS
        ):
            message = f"rules read context-variable '{name}', which has no range"
            help = "add 'range': while the variable is unknown, rules assume the whole range"
            yield finding("unfit-input", message, input_variable.place, path=f"context.{name}", help=help)
        if input_variable is not None and is_readable:
            yield from _reserved_word_findings(input_variable, spec_index.parsed_rules.terms(input_variable))


def _reserved_word_findings(variable: Variable, terms: tuple[Term, ...]) -> Iterator[Diagnostic]:
    """No term or member is a keyword of rules: `is any` would always hold."""
    for term in terms:
        if term.name in _RULE_KEYWORDS:
            key = "values" if variable.type.values else "terms"
            message = f"rules read context-variable '{variable.name}', but '{term.name}' is a keyword of rules"
            place, path = variable.places.get(key, variable.place), f"context.{variable.name}.{key}"
            yield finding("unfit-input", message, place, path=path, help=f"rename '{term.name}'")


def unfit_outputs(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """The terms of an output fit its defuzzification method."""
    for section, output in spec_index.parsed_rules.outputs:
        method = defuzzifier_of(output)
        is_weighted = method.is_weighted
        constant_names = [term.name for term in output_terms(output) if term.shape is Shape.Constant]
        if constant_names and not is_weighted:
            message = (
                f"term '{constant_names[0]}' of '{output.name}' is a number, "
                f"but '{snake_case(method.value)}' needs shapes"
            )
            help = "write 'inference: takagi_sugeno', or give the term a shape"
        elif is_weighted and len(constant_names) < len(output_terms(output)):
            message = f"'{output.name}' adds up numbers, but not all of its terms are numbers"
            help = "write its terms as 'constant 0.5'"
        else:
            continue
        place = output.places.get("terms", output.places.get("defuzzifier", output.place))
        yield finding("unfit-output", message, place, path=f"{section}.{output.name}", help=help)


def unfit_rates(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """A rate is computed from a number that agents write and that keeps enough readings; other kinds from a bool.

    The unit of the rate is the unit of this number per time. A share is a number from 0 to 1.
    """
    for variable in spec_index.spec.context:
        if variable.rate is None or not faults.is_sound("context", variable.name):
            continue
        base_variable = spec_index.variables.get(variable.rate.of.name)
        keys = ("type", "unit", "range", variable.rate.kind.value)
        if base_variable is None or not all(
            spec_index.is_readable("context", declared_variable.name, *keys)
            for declared_variable in (variable, base_variable)
        ):
            continue
        for message, help, key in _PROBLEM_FINDERS[variable.rate.kind](variable, base_variable):
            place = variable.places.get(key, variable.place)
            yield finding("unfit-rate", message, place, path=f"context.{variable.name}.{key}", help=help)


_COMPUTED_TEXT = "which loops compute"
_COMPUTED_HELP = "write the name of a variable that agents write"


def _rate_problems(variable: Variable, base_variable: Variable) -> Iterator[tuple[str, str, str]]:
    subject = f"context-variable '{variable.name}'"
    if [source.name for source in variable.sources] != [ANALYST]:
        yield f"{subject} is a rate, which loops compute", "remove 'source'", "source"
    if base_variable.type.kind not in _NUMERIC_KINDS:
        yield (
            f"{subject} is the rate of '{base_variable.name}', which is not a number",
            "write the name of a number"
            + (f", or 'share_of: {base_variable.name}'" if base_variable.type.kind is Kind.BOOL else ""),
            "rate_of",
        )
        return
    if base_variable.rate is not None or base_variable.is_derived:
        yield f"{subject} is the rate of '{base_variable.name}', {_COMPUTED_TEXT}", _COMPUTED_HELP, "rate_of"
    if variable.type.kind is not Kind.FLOAT:
        yield f"{subject} is a rate, but not a float", "write 'type: float'", "type"
    elif rate_factor(variable, base_variable) is None:
        unit = f"{base_variable.type.unit or '1'}/s"
        yield (
            f"{subject} does not have the unit of '{base_variable.name}' per time",
            f"write 'unit: {unit}', or per min or h",
            "unit",
        )
    if base_variable.history < _MIN_READINGS:
        yield (
            f"'{base_variable.name}' keeps {base_variable.history} reading, but a rate needs more readings",
            f"write a larger 'history' for '{base_variable.name}'",
            "rate_of",
        )


def _share_problems(variable: Variable, base_variable: Variable) -> Iterator[tuple[str, str, str]]:
    subject = f"context-variable '{variable.name}'"
    if [source.name for source in variable.sources] != [ANALYST]:
        yield f"{subject} is a share of time, which loops compute", "remove 'source'", "source"
    if base_variable.type.kind is not Kind.BOOL:
        message = f"{subject} is the share of time of '{base_variable.name}', which is not a bool"
        rate_help = f", or 'rate_of: {base_variable.name}'" if base_variable.type.kind in _NUMERIC_KINDS else ""
        yield message, f"write the name of a bool{rate_help}", "share_of"
        return
    if base_variable.rate is not None:
        yield f"{subject} is the share of time of '{base_variable.name}', {_COMPUTED_TEXT}", _COMPUTED_HELP, "share_of"
    range_ends = variable.type.range
    if variable.type.kind is not Kind.FLOAT:
        yield f"{subject} is a share of time, but not a float", "write 'type: float'", "type"
    elif variable.type.unit is not None:
        yield f"{subject} is a share of time, from 0 to 1, but has a unit", "remove 'unit'", "unit"
    elif range_ends is not None and not (range_ends[0] <= 0.0 and range_ends[1] >= 1.0):
        yield f"{subject} is a share of time, from 0 to 1, but has another range", "write 'range: [0, 1]'", "range"


def _held_problems(variable: Variable, base_variable: Variable) -> Iterator[tuple[str, str, str]]:
    subject = f"context-variable '{variable.name}'"
    if [source.name for source in variable.sources] != [ANALYST]:
        yield f"{subject} states whether a bool was held, which loops compute", "remove 'source'", "source"
    if base_variable.type.kind is not Kind.BOOL:
        message = f"{subject} states for how long '{base_variable.name}' is true, which is not a bool"
        yield message, "write the name of a bool", "held"
    elif base_variable.rate is not None:
        yield f"{subject} states for how long '{base_variable.name}' is true, {_COMPUTED_TEXT}", _COMPUTED_HELP, "held"
    if variable.type.kind is not Kind.BOOL:
        yield f"{subject} states whether a bool was held, but is not a bool", "write 'type: bool'", "type"


_PROBLEM_FINDERS: Mapping[RateKind, Callable[[Variable, Variable], Iterator[tuple[str, str, str]]]] = {
    RateKind.RATE: _rate_problems,
    RateKind.SHARE: _share_problems,
    RateKind.HELD: _held_problems,
}

_MIN_READINGS = 2


def rate_factor(variable: Variable, base_variable: Variable) -> float | None:
    """Return the factor to convert a change of 1 per second to the unit of the rate; None if the units do not fit.

    The factor of a share and of a held bool is 1.
    """
    if variable.rate is not None and variable.rate.kind is not RateKind.RATE:
        return 1.0
    base_unit, rate_unit = _unit(base_variable), _unit(variable)
    if base_unit is None or rate_unit is None:
        return None
    per_second = base_unit / UNITS["s"]
    if per_second.dimension != rate_unit.dimension:
        return None
    sign = -1.0 if variable.rate is not None and variable.rate.is_falling else 1.0
    return sign * convert(1.0, per_second, rate_unit)


def _unit(variable: Variable) -> Unit | None:
    return ONE if variable.type.unit is None else parse_unit(variable.type.unit)


def unfit_parameters(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every variable that an adaptation sets has the source `adaptation`, and no other adaptation sets the variable."""
    first_adaptations: dict[str, str] = {}
    for adaptation in spec_index.spec.adaptation:
        does = adaptation.does
        if not isinstance(does, Parameter):
            continue
        name, path = does.variable.name, f"adaptation.{adaptation.name}.set"
        variable = spec_index.variables.get(name)
        other = first_adaptations.setdefault(name, adaptation.name)
        if other != adaptation.name:
            message = f"adaptation '{other}' also sets '{name}'"
            yield finding(
                "two-adaptations",
                message,
                does.variable.place,
                path=path,
                help="set it in only one of the two adaptations",
            )
        if (
            variable is None
            or variable.derived is not None
            or not faults.is_sound("context", name)
            or not spec_index.is_readable("context", name, "source")
        ):
            continue
        if ADAPTER not in (source.name for source in variable.sources) or variable.is_derived:
            message = f"adaptation '{adaptation.name}' sets '{name}', but is not its source"
            help = f"write 'source: {ADAPTER}' in the variable, or set another variable"
            yield finding("foreign-parameter", message, does.variable.place, path=path, help=help)


def senseless_times(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """The times and the lead of a course are useful, and its rules and `otherwise` name only actions under `choose`."""
    own_holds_s = {action.name: action.hold_s for action in spec_index.spec.actions if action.hold_s is not None}
    for adaptation in spec_index.spec.adaptation:
        does = adaptation.does
        if not isinstance(does, Course):
            continue
        holds_s = [own_holds_s.get(action.name, does.hold_s) for action in does.choose] or [does.hold_s]
        for key, message, help in (*_course_problems(does), *_useless_times(does, adaptation.dwell_s, holds_s)):
            is_readable = spec_index.is_readable("adaptation", adaptation.name, key, "choose")
            if is_readable and faults.is_sound("adaptation", adaptation.name):
                place = adaptation.places.get(key, adaptation.place)
                path = f"adaptation.{adaptation.name}.{key}"
                yield finding("senseless-filter", message, place, path=path, help=help)


def _course_problems(course: Course) -> Iterator[tuple[str, str, str]]:
    if not 0.0 <= course.lead < 1.0:
        message = f"a lead of {course.lead:g} is never reached: weights go from 0 to 1"
        message = message if course.lead >= 1.0 else f"a lead of {course.lead:g} is negative"
        yield "lead", message, "write a number from 0 to below 1"
    action_names = [reference.name for reference in course.choose]
    if course.otherwise.name and course.otherwise.name not in action_names:
        message = f"'{course.otherwise.name}' is not one of the actions under 'choose'"
        yield "otherwise", message, "add it to 'choose', or write one of these actions"
    for rule in course.always:
        if rule.action.name not in action_names:
            yield "always", f"'{rule.action.name}' is not one of the actions under 'choose'", "add it to 'choose'"


def _useless_times(course: Course, dwell_s: float, holds_s: Sequence[float]) -> Iterator[tuple[str, str, str]]:
    """Yield the times of a course that change no choice, because the hold of each action, or the dwell, is longer.

    A lead begins at a switch of the course at the earliest. `holds_s` has the holds of the actions.
    """
    min_hold_s = min(holds_s)
    if min_hold_s > dwell_s > 0.0 and course.hold_s in holds_s:
        yield "hold", "'hold' is longer than 'dwell', which makes 'dwell' useless", "make 'hold' shorter than 'dwell'"
    elif min_hold_s > dwell_s > 0.0:
        message = "the 'hold' of each action is longer than 'dwell', which makes 'dwell' useless"
        yield "dwell", message, "make 'dwell' longer, or remove it"
    if 0.0 < course.cooldown_s <= max(dwell_s, min_hold_s):
        longer_text = "'dwell'" if course.cooldown_s <= dwell_s else "'hold'"
        message = f"'cooldown' is not longer than {longer_text}, which makes 'cooldown' useless"
        yield "cooldown", message, f"make 'cooldown' longer than {longer_text}, or remove it"


LOOP_TYPE_CHECKS = (unfit_inputs, unfit_outputs, unfit_rates, unfit_parameters, senseless_times)
"""The checks of this module."""
