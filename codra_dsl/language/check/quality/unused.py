"""Unused declarations, and names that are easily confused."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import TypeVar

from codra_dsl.language.check.index.mentions import source_mentions
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import MAIN_EXECUTION, OBSERVER, FaultyElements, SpecIndex
from codra_dsl.language.check.quality.reach import unreached_settings
from codra_dsl.language.diagnostics import Diagnostic, Related
from codra_dsl.language.model import Agent, Algorithm, DeclaredParameter, DeclaredTemplate, Resource, Variable

_PARAMETER = re.compile(r"\$\(\w+\)")


def unreached_observers(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every observer is generated, because some skill needs one of its variables."""
    for setting in unreached_settings(spec_index):
        if faults.is_sound("observers", setting.name):
            names_text = " and ".join(f"'{reference.name}'" for reference in setting.identifies)
            yield finding(
                "unreached-observer",
                f"observer '{setting.name}' is not generated: no skill needs {names_text}",
                setting.place,
                path=f"observers.{setting.name}",
                help="add one of its variables to a skill's 'preview' or 'monitor', "
                "or remove the observer and these variables",
            )


def unused_resources(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every resource is used by an algorithm, or may be used by an algorithm of a template."""
    usages = [usage.resource.name for algorithm in spec_index.spec.perception for usage in algorithm.uses]
    if spec_index.has_damage("perception", "uses") or not spec_index.resources.keys() >= set(usages):
        return  # an undeclared name may be a misspelling of any resource
    used_names = _UsedNames(
        spec_index, usages, ((template.name, template.resources) for template in spec_index.spec.templates)
    )
    for resource in _own_elements(spec_index, spec_index.resources.values()):
        if resource.name not in used_names and faults.is_sound("resources", resource.name):
            yield finding(
                "unused-resource",
                f"no algorithm uses resource '{resource.name}'",
                resource.place,
                path=f"resources.{resource.name}",
                help="remove it, or name it under 'uses' of an algorithm",
            )


def unused_agents(spec_index: SpecIndex, faults: FaultyElements) -> Iterator[Diagnostic]:
    """Every agent is the source of something, or takes part in knowledge."""
    sources = [source.name for variable in spec_index.spec.context for source in variable.sources]
    sources += [tree.agent.name for tree in spec_index.spec.trees if tree.agent is not None]
    if spec_index.spec.knows:
        sources += [mention.name for mention in source_mentions(spec_index)]
        sources += [agent.name for agent in spec_index.spec.agents if not agent.conduct.is_bare]
    if spec_index.has_damage("context", "source") or not {OBSERVER, MAIN_EXECUTION, *spec_index.agents} >= set(sources):
        return
    used_names = _UsedNames(
        spec_index, sources, ((template.name, template.sources) for template in spec_index.spec.templates)
    )
    for agent in _own_elements(spec_index, spec_index.agents.values()):
        if agent.name not in used_names and faults.is_sound("agents", agent.name):
            yield finding(
                "unused-agent",
                f"agent '{agent.name}' is not the source of anything",
                agent.place,
                path=f"agents.{agent.name}",
                help="remove the agent, or add it to the 'source' of the elements that it writes",
            )


def unused_templates(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """Every template in the spec's own file is used. Templates of parts may be used by other specs."""
    for template in spec_index.spec.templates:
        if not template.is_used and template.place.span.file == spec_index.spec.file:
            message = f"nothing uses template '{template.name}'"
            path, help = f"templates.{template.name}", "use it, or remove it"
            yield finding("unused-template", message, template.place, path=path, help=help)


def shadowed_names(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """No parameter has the name of an element that the template can refer to as well, as in `$(door)` and `door`."""
    names = {parameter.name for template in spec_index.spec.templates for parameter in template.parameters}
    visible_elements: dict[str, list[tuple[str, _VisibleElement]]] = {}
    for noun, element in _visible_elements(spec_index) if names else ():
        if element.name in names:
            visible_elements.setdefault(element.name, []).append((noun, element))
    templates_by_use = {use.place.span: use.template for use in spec_index.spec.uses}
    for template in spec_index.spec.templates:
        if not template.is_used and template.place.span.file != spec_index.spec.file:
            continue
        for parameter in template.parameters:
            for noun, element in visible_elements.get(parameter.name, ()):
                if element.place.use is None or templates_by_use.get(element.place.use) != template.name:
                    yield _shadowed_name_finding(template, parameter, noun, element)
                    break


def same_labels(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """All labels of variables are different. A variable without a label is shown by its name."""
    first_variable_by_label: dict[str, Variable] = {}
    variables_by_name = {name.casefold(): variable for name, variable in spec_index.variables.items()}
    for variable in spec_index.variables.values():
        if not spec_index.is_readable("context", variable.name, "label"):
            continue
        normalized_label = _normalize_label(variable.label)
        other = first_variable_by_label.setdefault(normalized_label, variable)
        if other is variable:
            other = variables_by_name.get(normalized_label, variable)
        if other is not variable and variable.label != variable.name:
            yield _same_label_finding(variable, other)


UNUSED_CHECKS = (unreached_observers, unused_resources, unused_agents, unused_templates, shadowed_names, same_labels)
"""The checks of this module."""

_VisibleElement = Variable | Resource | Algorithm | Agent
"""An element outside of a template that the template's conditions and keys can refer to."""

_Element = TypeVar("_Element", Resource, Agent)


def _own_elements(spec_index: SpecIndex, elements: Iterable[_Element]) -> Iterator[_Element]:
    """Yield the elements in the spec's own file. Elements of parts are left out, since they may be for another spec."""
    return (element for element in elements if element.place.span.file == spec_index.spec.file)


class _UsedNames:
    """The names that elements use, and the names in templates that the spec does not use.

    In the names of such templates, a parameter can have any text.
    """

    def __init__(
        self, spec_index: SpecIndex, names: Iterable[str], templates: Iterable[tuple[str, tuple[str, ...]]]
    ) -> None:
        used_templates = {use.template for use in spec_index.spec.uses}
        names_in_templates = {
            name for template, template_names in templates if template not in used_templates for name in template_names
        }
        self._names = {*names, *names_in_templates}
        self._patterns = [_pattern(name) for name in sorted(names_in_templates) if _PARAMETER.search(name)]

    def __contains__(self, name: str) -> bool:
        return name in self._names or any(pattern.fullmatch(name) for pattern in self._patterns)


def _pattern(parametrized_name: str) -> re.Pattern[str]:
    """Return the pattern of all names that a name with parameters can become."""
    return re.compile(r"\w*".join(map(re.escape, _PARAMETER.split(parametrized_name))))


def _visible_elements(spec_index: SpecIndex) -> Iterator[tuple[str, _VisibleElement]]:
    yield from (("context-variable", variable) for variable in spec_index.variables.values())
    yield from (("resource", resource) for resource in spec_index.resources.values())
    yield from (("algorithm", algorithm) for algorithm in spec_index.algorithms.values())
    yield from (("agent", agent) for agent in spec_index.agents.values())


def _shadowed_name_finding(
    template: DeclaredTemplate, parameter: DeclaredParameter, noun: str, element: _VisibleElement
) -> Diagnostic:
    name = parameter.name
    return finding(
        "shadowed-name",
        f"parameter '{name}' of template '{template.name}' has the name of {noun} '{name}', "
        f"so that '$({name})' and '{name}' mean different things",
        parameter.place,
        path=f"templates.{template.name}.parameters.{name}",
        help="rename the parameter",
        related=(Related(f"the {noun}", element.place),),
    )


def _same_label_finding(variable: Variable, other: Variable) -> Diagnostic:
    subject = f"the label '{variable.label}' of context-variable '{variable.name}'"
    is_label = other.label != other.name and _normalize_label(other.label) == _normalize_label(variable.label)
    return finding(
        "same-label",
        f"{subject} is the same as the label of '{other.name}'"
        if is_label
        else f"{subject} is the name of another variable",
        variable.places.get("label", variable.place),
        path=f"context.{variable.name}.label",
        help="write different labels",
        related=(Related("the other variable", other.places.get("label", other.place) if is_label else other.place),),
    )


def _normalize_label(label: str) -> str:
    return "".join(label.split()).casefold()
