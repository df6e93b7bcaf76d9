"""The context-variables that loops imply: one for each metric, each weight and each course.

They can be read like any other context-variable, have a history, and appear in the journal and in `why`.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from codra_dsl.language.diagnostics import Related
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.model import (
    ADAPTER,
    ANALYST,
    Adaptation,
    Agent,
    Course,
    Kind,
    Output,
    Reference,
    Spec,
    ValueType,
    Variable,
    weight_name,
)

_SHARE = ValueType(kind=Kind.FLOAT, range=(0.0, 1.0))


def with_loop_variables(spec: Spec, findings: Findings) -> Spec:
    """Return a spec with the context-variables and agents that its loops imply.

    If an implied variable has the same name as a declared variable, or as another implied variable before it, the
    implied variable is reported and left out.
    """
    if not spec.adapts:
        return spec
    declared_variables = tuple(_with_source(variable) for variable in spec.context)
    variables_by_name = {variable.name.casefold(): variable for variable in declared_variables}
    origins = dict(spec.origins)
    implied_variables: list[Variable] = []
    for section, variable in _implied_variables(spec):
        existing_variable = variables_by_name.setdefault(variable.name.casefold(), variable)
        if existing_variable is variable:
            implied_variables.append(variable)
            origins["context", variable.name] = spec.origins[section, _element_name(section, variable.name)]
        else:
            _report(section, variable, existing_variable, findings)
    context = (*declared_variables, *implied_variables)
    needed_agents = {
        source.name for variable in context if variable.is_derived or variable.rate for source in variable.sources
    }
    sources = {source.name for variable in context for source in variable.sources}
    needed_agents |= {ADAPTER} & sources if spec.adaptation or spec.damaged.get("adaptation") else set()
    agent_names = {agent.name for agent in spec.agents} | spec.damaged.get("agents", frozenset())
    writers = [Agent(name=name, place=spec.place) for name in (ANALYST, ADAPTER) if name in needed_agents - agent_names]
    origins |= {("agents", writer.name): next(iter(spec.origins.values())) for writer in writers}
    return replace(spec, context=context, agents=(*spec.agents, *writers), origins=origins)


def _with_source(variable: Variable) -> Variable:
    """Return a variable; a rate that states no source gets the analyst as its source."""
    if variable.rate is None or variable.sources:
        return variable
    return replace(variable, sources=(Reference(name=ANALYST, place=variable.rate.of.place),))


def _implied_variables(spec: Spec) -> Iterator[tuple[str, Variable]]:
    yield from (("metrics", _output_variable(metric, metric.name)) for metric in spec.metrics)
    yield from (("actions", _output_variable(action, weight_name(action.name))) for action in spec.actions)
    yield from (
        ("adaptation", _course_variable(adaptation, adaptation.does))
        for adaptation in spec.adaptation
        if isinstance(adaptation.does, Course)
    )


def _output_variable(output: Output, name: str) -> Variable:
    is_metric = name == output.name
    label = output.label or name if is_metric else f"Weight of {output.label}" if output.label else name
    return Variable(
        name=name,
        type=_SHARE,
        place=output.place,
        label=label,
        description=output.description,
        sources=(Reference(name=ANALYST, place=output.place),),
        terms=output.terms,
        is_derived=True,
    )


def _course_variable(adaptation: Adaptation, course: Course) -> Variable:
    members = tuple(dict.fromkeys(reference.name for reference in (*course.choose, course.otherwise) if reference.name))
    return Variable(
        name=adaptation.name,
        type=ValueType(kind=Kind.ENUM, values=members or ("none",)),
        place=adaptation.place,
        label=adaptation.label or adaptation.name,
        sources=(Reference(name=ADAPTER, place=adaptation.place),),
        is_derived=True,
    )


def _element_name(section: str, variable: str) -> str:
    return variable.removeprefix(weight_name("")) if section == "actions" else variable


def _report(section: str, variable: Variable, existing_variable: Variable, findings: Findings) -> None:
    name = _element_name(section, variable.name)
    noun = {"metrics": "metric", "actions": "action", "adaptation": "adaptation"}[section]
    message = f"{noun} {shown(name)} implies a context-variable {shown(variable.name)}, which already exists"
    related = [Related("declared here", existing_variable.place)]
    findings.add(
        "duplicate-name", message, variable.place, help="rename one of them", path=f"{section}.{name}", related=related
    )
