"""The context-variables that loops imply: one for each metric, each weight, each filtered weight and each course.

They can be read like any other context-variable, have a history, and appear in the journal and in `why`.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from codra_dsl.language.diagnostics import Related
from codra_dsl.language.expression.tokens import shown
from codra_dsl.language.load.yaml.findings import Findings
from codra_dsl.language.model import (
    ADAPTER,
    ANALYST,
    CONTEXT_NODE,
    Adaptation,
    Agent,
    Course,
    Kind,
    Output,
    Reference,
    Spec,
    ValueType,
    Variable,
    filtered_weight_name,
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
    for implied in _implied_variables(spec):
        section, element, variable = implied
        existing_variable = variables_by_name.setdefault(variable.name.casefold(), variable)
        if existing_variable is variable:
            implied_variables.append(variable)
            origins["context", variable.name] = spec.origins[section, element]
        else:
            _report(spec, implied, existing_variable, findings)
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


def _implied_variables(spec: Spec) -> Iterator[tuple[str, str, Variable]]:
    """Yield the section and the name of the element that implies a variable, and the variable."""
    courses = [(adaptation, adaptation.does) for adaptation in spec.adaptation if isinstance(adaptation.does, Course)]
    filtering_courses = _filtering_courses(spec)
    nodes = {action.name: _node(spec, course) for course in filtering_courses for action in course.choose}
    yield from (("metrics", metric.name, _output_variable(metric, metric.name)) for metric in spec.metrics)
    for action in spec.actions:
        weight = _output_variable(action, weight_name(action.name), "Weight of ")
        yield "actions", action.name, replace(weight, node=nodes.get(action.name, CONTEXT_NODE))
    yield from (
        ("adaptation", adaptation.name, replace(_course_variable(adaptation, course), node=_node(spec, course)))
        for adaptation, course in courses
    )
    actions = {action.name: action for action in spec.actions}
    for course in filtering_courses:
        for name in dict.fromkeys(action.name for action in course.choose if action.name in actions):
            variable = _output_variable(actions[name], filtered_weight_name(name), "Filtered weight of ")
            yield "actions", name, replace(variable, node=_node(spec, course))


def _node(spec: Spec, course: Course) -> str:
    """Return the node of the variables of a course. A node that does not exist is reported at the course alone."""
    names = {*(node.name for node in spec.nodes), *(task.name for task in spec.tasks)}
    return course.node.name if course.node is not None and course.node.name in names else CONTEXT_NODE


def _output_variable(output: Output, name: str, label_prefix: str = "") -> Variable:
    label = f"{label_prefix}{output.label}" if output.label else name
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


def _report(spec: Spec, implied: tuple[str, str, Variable], existing_variable: Variable, findings: Findings) -> None:
    section, name, variable = implied
    noun = {"metrics": "metric", "actions": "action", "adaptation": "adaptation"}[section]
    message = f"{noun} {shown(name)} implies a context-variable {shown(variable.name)}, which already exists"
    related, help = [Related("declared here", existing_variable.place)], "rename one of them"
    if existing_variable.is_derived and existing_variable.place == variable.place:  # two courses choose the action
        courses = (course for course in _filtering_courses(spec) if name in {action.name for action in course.choose})
        related = [Related("a course that chooses it", node.place) for course in courses if (node := course.node)]
        help = "state 'of' in only one of the courses that choose it"
    findings.add("duplicate-name", message, variable.place, help=help, path=f"{section}.{name}", related=related)


def _filtering_courses(spec: Spec) -> Sequence[Course]:
    """Return the courses whose filtered weights are variables."""
    courses = (adaptation.does for adaptation in spec.adaptation if isinstance(adaptation.does, Course))
    return [course for course in courses if course.node is not None]
