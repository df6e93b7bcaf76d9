"""The arguments of one use of a template: what stands for each parameter."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

from codra_dsl.diagnostics import Related
from codra_dsl.expression.tokens import shown
from codra_dsl.load.fill import Bound, bind, example
from codra_dsl.load.findings import Findings, listed
from codra_dsl.load.nodes import ScalarNode, YamlNode
from codra_dsl.load.origin import Subject
from codra_dsl.load.reader import entries
from codra_dsl.load.shape import sound
from codra_dsl.load.templates import EXAMPLES, INSTANCE, Parameter, ParameterKind, Template, fits


@dataclass(frozen=True, slots=True)
class Arguments:
    """What stands for each parameter; where that is not right, examples do, so that names can still be told."""

    bound: Mapping[str, Bound]
    right: bool


def read_arguments(subject: Subject, node: YamlNode, template: Template, findings: Findings) -> Arguments:
    """Return the arguments of a use; findings for what is missing, unknown or of the wrong type."""
    given = {key.text: (key, value) for key, value in entries(node) if key.text != "template"}
    right = sound("template_use", node.data)
    meant: set[str] = set()
    for name, (key, _) in given.items():
        if name not in template.parameters or name == INSTANCE:
            right = False
            meant.add(_report_unknown(subject, key, template, given, findings))
    bound = {INSTANCE: Bound(ParameterKind.IDENTIFIER, subject.name, subject.name)}
    for name, parameter in template.parameters.items():
        if name == INSTANCE:
            continue
        bound[name] = example(parameter)
        if name in given:
            key, value = given[name]
            if isinstance(value, ScalarNode) and _is_right(subject, key, value, parameter, findings):
                bound[name] = bind(parameter, value)
        elif parameter.default is None and name not in meant and not parameter.key.reported:
            _report_missing(subject, name, parameter, template, findings)
    return Arguments(bound, right and all(item.known for item in bound.values()))


def _is_right(subject: Subject, key: ScalarNode, value: ScalarNode, parameter: Parameter, findings: Findings) -> bool:
    """Report an argument that has not its parameter's type."""
    if value.reported or parameter.key.reported or value.data is None:
        return False
    if fits(parameter.kind, value):
        return True
    message = f"{shown(value.text)} is no {parameter.kind.value}, which {shown(key.text)} in {subject} must be"
    findings.add(
        "ill-typed-argument",
        message,
        subject.origin.of_value(key, value),
        help=f"write {EXAMPLES[parameter.kind][0]}",
        path=subject.part(key.text),
        related=[Related("declared here", parameter.place)],
    )
    return False


def _report_unknown(
    subject: Subject, key: ScalarNode, template: Template, given: Mapping[str, object], findings: Findings
) -> str:
    """Report an argument that the template does not know; return the parameter that is probably meant."""
    known = [name for name in template.parameters if name != INSTANCE]
    near = findings.nearest(key.text, (name for name in known if name not in given))
    if key.text == INSTANCE:
        way_out = "remove it: $(instance) is the name of the use"
    elif near:
        way_out = f"did you mean '{near}'?"
    else:
        way_out = f"its parameters are {listed(known)}" if known else "it has none"
    message = f"template {shown(template.name)} has no parameter {shown(key.text)}"
    place, path = subject.origin.of(key), subject.part(key.text)
    findings.add("unknown-argument", message, place, help=way_out, path=path)
    return near or ""


def _report_missing(subject: Subject, name: str, parameter: Parameter, template: Template, findings: Findings) -> None:
    findings.add(
        "missing-argument",
        f"{subject} does not say {shown(name)}, which template {shown(template.name)} needs",
        subject.origin.of(subject.key),
        help=f"add '{name}: ...' with {EXAMPLES[parameter.kind][0]}",
        path=subject.part(name),
        related=[Related("declared here", parameter.place)],
    )
