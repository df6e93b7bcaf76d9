"""The arguments of one use of a template: the value of each parameter."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import replace

from codra_dsl.language.diagnostics import Related, replacement_fix, surely_means
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.frozen import dataclass
from codra_dsl.language.load.schema.schema import has_shape
from codra_dsl.language.load.templates.substitution import BoundValue, bind, example_value
from codra_dsl.language.load.templates.templates import EXAMPLES, INSTANCE, Parameter, ParameterKind, Template, fits
from codra_dsl.language.load.yaml.findings import Findings, list_names
from codra_dsl.language.load.yaml.nodes import ScalarNode, YamlNode
from codra_dsl.language.load.yaml.origin import Subject
from codra_dsl.language.load.yaml.reader import entries, is_unread
from codra_dsl.language.units import parse_quantity, parse_unit, units_help

_NUMBER = re.compile(r"-?[0-9]+(?:\.[0-9]+)?")


@dataclass(frozen=True, slots=True)
class Arguments:
    """The value of each parameter. Examples replace wrong or missing values, so that names can still be determined.

    Attributes:
        is_valid: whether no argument is wrong or missing.
    """

    bound_values: Mapping[str, BoundValue]
    is_valid: bool


def read_arguments(subject: Subject, node: YamlNode, template: Template, findings: Findings) -> Arguments:
    """Return the arguments of a use; report arguments that are missing, unknown or of the wrong type."""
    given_entries = {key.text: (key, value) for key, value in entries(node) if key.text != "template"}
    is_valid = has_shape("template_use", node.data)
    corrected_names: set[str] = set()
    required_names = [
        name
        for name, parameter in template.parameters.items()
        if name not in template.unused_names and _is_needed(parameter)
    ]
    missing_names = [name for name in required_names if name not in given_entries]
    unknown_names = [name for name in given_entries if name not in template.parameters or name == INSTANCE]
    for name in unknown_names:
        is_valid = False
        if name in template.undeclared_names:
            continue
        if not template.is_open or name == INSTANCE:
            only_missing_name = missing_names[0] if len(missing_names) == len(unknown_names) == 1 else None
            corrected_names.add(
                _report_unknown(
                    subject, given_entries[name][0], template, given_entries, findings, missing_name=only_missing_name
                )
            )
    bound_values = {INSTANCE: BoundValue(ParameterKind.IDENTIFIER, subject.name, subject.name)}
    for name, parameter in template.parameters.items():
        if name == INSTANCE:
            continue
        if name in given_entries:
            key, value = given_entries[name]
            if isinstance(value, ScalarNode) and _check_argument(subject, key, value, parameter, findings):
                bound_values[name] = bind(parameter, value)
                continue
        elif name in missing_names and name not in corrected_names and not is_unread(node):
            _report_missing(subject, name, parameter, template, findings)
        bound_values[name] = (
            replace(example_value(parameter), is_known=True)
            if name in template.unused_names
            else example_value(parameter)
        )
    return Arguments(bound_values, is_valid and all(argument.is_known for argument in bound_values.values()))


def _is_needed(parameter: Parameter) -> bool:
    """Return whether every use must give a value for a parameter."""
    return parameter.default is None and not parameter.key.reported and parameter.key.text != INSTANCE


def _check_argument(
    subject: Subject, key: ScalarNode, value: ScalarNode, parameter: Parameter, findings: Findings
) -> bool:
    """Report an argument that does not have its parameter's type; return whether it is valid."""
    if value.reported or parameter.key.reported or value.data is None:
        return False
    if fits(parameter.kind, value):
        return True
    message = f"{shown(key.text)} in {subject} must be of type {parameter.kind.value}, not {shown(value.text)}"
    findings.add(
        "ill-typed-argument",
        message,
        subject.origin.of_value(key, value),
        help=_literal_help(parameter, value.text),
        path=subject.part(key.text),
        related=[Related("declared here", parameter.place)],
    )
    return False


def _literal_help(parameter: Parameter, text: str) -> str:
    """Return the help for an argument that is not a literal of its parameter's type.

    A number without a unit is shown with the unit of the default; without a default, with several units.
    """
    number = _NUMBER.match(text) if parameter.kind is ParameterKind.QUANTITY else None
    if number is None:
        return f"write {EXAMPLES[parameter.kind][0]}"
    default = None if parameter.default is None else parse_quantity(parameter.default.text)
    unit = text[number.end() :].strip().replace("%", "percent")
    if unit:
        is_known = parse_unit(unit) is not None
        return f"did you mean '{number[0]} {unit}'?" if is_known else units_help(unit)
    if default is not None:
        return f"write it with its unit: {number[0]} {default.unit}"
    return f"write it with its unit, for example {number[0]} percent, {number[0]} m or {number[0]} s"


def _report_unknown(
    subject: Subject,
    key: ScalarNode,
    template: Template,
    given_entries: Mapping[str, tuple[ScalarNode, YamlNode]],
    findings: Findings,
    *,
    missing_name: str | None,
) -> str:
    """Report an argument for which the template has no parameter; return the parameter that is probably meant.

    `missing_name` is the only missing parameter, if this argument is the only unknown one. An argument that a site
    misspells is probably one that the spec gives.
    """
    declared_names = [name for name in template.parameters if name != INSTANCE]
    place, path = subject.origin.of(key), subject.part(key.text)
    given_names = {
        name
        for name, (given_key, _) in given_entries.items()
        if subject.origin.of(given_key).span.file == place.span.file
    }
    suggestion = findings.nearest(key.text, (name for name in declared_names if name not in given_names))
    if key.text == INSTANCE:
        help_text = "remove it: $(instance) is the name of the use"
    elif suggestion:
        help_text = f"did you mean '{suggestion}'?"
    elif missing_name is not None:
        help_text = f"did you mean '{missing_name}', which is missing?"
    else:
        help_text = (
            f"its parameters are {list_names(declared_names)}" if declared_names else "the template has no parameters"
        )
    message = f"template {shown(template.name)} has no parameter {shown(key.text)}"
    is_safe = (
        suggestion is not None
        and suggestion in template.used_names
        and surely_means(key.text, suggestion, declared_names)
    )
    fix = replacement_fix(place, key.text, suggestion, safe=is_safe) if suggestion else None
    related = [Related("the template", template.origin.of(template.subject.key))]
    findings.add("unknown-argument", message, place, help=help_text, path=path, related=related, fix=fix)
    return suggestion or missing_name or ""


def _report_missing(subject: Subject, name: str, parameter: Parameter, template: Template, findings: Findings) -> None:
    findings.add(
        "missing-argument",
        f"{shown(name)} is missing in {subject}: template {shown(template.name)} needs it",
        subject.origin.of(subject.key),
        help=f"add '{name}: ...' with {EXAMPLES[parameter.kind][0]}",
        path=subject.part(name),
        related=[Related("declared here", parameter.place)],
    )
