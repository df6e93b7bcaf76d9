"""The context-variables that loops bring along: one for each metric, each weight and each course.

So whatever asks for context can ask for them too, and their history, journal and `why` are those of all context.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

from codra_dsl.diagnostics import Related
from codra_dsl.expression.tokens import shown
from codra_dsl.load.findings import Findings
from codra_dsl.model import (
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


def with_derived(spec: Spec, findings: Findings) -> Spec:
    """Return a spec with the context-variables and agents that its loops bring along.

    A context-variable of such a name is reported; it stands, and the other is left out.
    """
    if not spec.adapts:
        return spec
    stated = tuple(_with_source(variable) for variable in spec.context)
    taken = {variable.name.casefold(): variable for variable in stated}
    origins = dict(spec.origins)
    derived: list[Variable] = []
    for section, variable in _derived(spec):
        other = taken.setdefault(variable.name.casefold(), variable)
        if other is variable:
            derived.append(variable)
            origins["context", variable.name] = spec.origins[section, _element(section, variable.name)]
        else:
            _report(section, variable, other, findings)
    context = (*stated, *derived)
    named = {source.name for variable in context if variable.is_derived or variable.rate for source in variable.sources}
    sources = {source.name for variable in context for source in variable.sources}
    named |= {ADAPTER} & sources if spec.adaptation or spec.damaged.get("adaptation") else set()
    agents = {agent.name for agent in spec.agents} | spec.damaged.get("agents", frozenset())
    writers = [Agent(name=name, place=spec.place) for name in (ANALYST, ADAPTER) if name in named - agents]
    origins |= {("agents", each.name): next(iter(spec.origins.values())) for each in writers}
    return replace(spec, context=context, agents=(*spec.agents, *writers), origins=origins)


def _with_source(variable: Variable) -> Variable:
    """Return a rate with who works it out as its source, unless it states another."""
    if variable.rate is None or variable.sources:
        return variable
    return replace(variable, sources=(Reference(name=ANALYST, place=variable.rate.of.place),))


def _derived(spec: Spec) -> Iterator[tuple[str, Variable]]:
    yield from (("metrics", _share(each, each.name)) for each in spec.metrics)
    yield from (("actions", _share(each, weight_name(each.name))) for each in spec.actions)
    yield from (("adaptation", _course(each, each.does)) for each in spec.adaptation if isinstance(each.does, Course))


def _share(output: Output, name: str) -> Variable:
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


def _course(adaptation: Adaptation, course: Course) -> Variable:
    members = tuple(dict.fromkeys(reference.name for reference in (*course.choose, course.otherwise) if reference.name))
    return Variable(
        name=adaptation.name,
        type=ValueType(kind=Kind.ENUM, values=members or ("none",)),
        place=adaptation.place,
        label=adaptation.label or adaptation.name,
        sources=(Reference(name=ADAPTER, place=adaptation.place),),
        is_derived=True,
    )


def _element(section: str, variable: str) -> str:
    return variable.removeprefix(weight_name("")) if section == "actions" else variable


def _report(section: str, variable: Variable, other: Variable, findings: Findings) -> None:
    name = _element(section, variable.name)
    noun = {"metrics": "metric", "actions": "action", "adaptation": "adaptation"}[section]
    brings = f"{noun} {shown(name)} brings along a context-variable {shown(variable.name)}, which is there already"
    related = [Related("declared here", other.place)]
    findings.add(
        "duplicate-name", brings, variable.place, help="rename one of them", path=f"{section}.{name}", related=related
    )
