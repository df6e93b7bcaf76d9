"""Rules of phase 3: types, units and members in conditions and declarations, and the use of resources."""

from __future__ import annotations

from collections.abc import Iterator

from codra_dsl.language.check.conditions.conditions import Site
from codra_dsl.language.check.conditions.types import Problem
from codra_dsl.language.check.index.fixes import member_fix
from codra_dsl.language.check.index.rules import finding
from codra_dsl.language.check.index.spec_index import FaultyElements, SpecIndex
from codra_dsl.language.check.index.words import USERS
from codra_dsl.language.diagnostics import Diagnostic, Place, Related, suggest
from codra_dsl.language.expression import Text
from codra_dsl.language.model import (
    Access,
    Algorithm,
    Hysteresis,
    Identification,
    Kind,
    Members,
    Usage,
    ValueType,
    Variable,
)


def wrong_conditions(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """Every condition is true or false, or has a value that fits its variable, and compares only comparable values."""
    for judgement in spec_index.judgements.values():
        for problem in judgement.problems:
            yield _condition_finding(spec_index, judgement.site, problem)


def fractional_ranges(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """The ends of the range of an int are whole numbers."""
    for variable in spec_index.spec.context:
        yield from _range_findings(variable.type, variable.place, "context", variable.name, "range")
    for algorithm in spec_index.spec.perception:
        for returned in algorithm.returns:
            key = f"returns.{returned.name}.range"
            yield from _range_findings(returned.type, returned.place, "perception", algorithm.name, key)


def wrong_identification_forms(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """A mapping identifies an enum; `enter` and `leave` identify a bool."""
    for algorithm in spec_index.spec.perception:
        for entry in algorithm.identifies:
            variable = spec_index.variables.get(entry.variable.name)
            if variable is None or spec_index.context_types[variable.name] is None:
                continue
            if isinstance(entry.by, Members):
                yield from _member_findings(spec_index, algorithm, entry, entry.by, variable)
            if isinstance(entry.by, Hysteresis) and variable.type.kind is not Kind.BOOL:
                message = (
                    f"'enter' and 'leave' identify a bool, but '{variable.name}' is {_type_with_article(variable)}"
                )
                help = "write one condition" if variable.type.kind is not Kind.ENUM else "map members to conditions"
                yield _wrong_form_finding(algorithm, entry.by.place, message, help, variable)


def commanded_resources(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """An observer is passive: it reads, and never controls hardware (P1, section 3.2)."""
    for algorithm in spec_index.spec.perception:
        for usage in algorithm.uses:
            if usage.access is Access.COMMAND:
                yield finding(
                    "commanded-resource",
                    f"algorithm '{algorithm.name}' commands '{usage.resource.name}', but observers are passive",
                    usage.place,
                    path=f"perception.{algorithm.name}.uses.{usage.resource.name}",
                    help="write 'read', and control hardware in a skill of the main execution",
                )


def misused_resources(spec_index: SpecIndex, _: FaultyElements) -> Iterator[Diagnostic]:
    """A resource with slots is used with `slot`. A resource without slots has a handle and is used with `read`."""
    for algorithm in spec_index.spec.perception:
        for usage in algorithm.uses:
            resource = spec_index.resources.get(usage.resource.name)
            if resource is None or not spec_index.is_readable("resources", resource.name, "slots"):
                continue
            if usage.access is Access.SLOT and resource.slots is None:
                message = f"algorithm '{algorithm.name}' takes a slot of resource '{resource.name}', which has no slots"
                help = f"write 'read', or declare '{resource.name}: {{slots: 1}}'"
                yield _misuse_finding(algorithm, usage, resource.place, message, help)
            if usage.access is Access.READ and resource.slots is not None:
                message = (
                    f"algorithm '{algorithm.name}' reads resource '{resource.name}', which has slots and no handle"
                )
                yield _misuse_finding(algorithm, usage, resource.place, message, "write 'slot'")


TYPE_CHECKS = (wrong_conditions, fractional_ranges, wrong_identification_forms, commanded_resources, misused_resources)
"""The rules of this phase."""


def _range_findings(value_type: ValueType, place: Place, section: str, name: str, key: str) -> Iterator[Diagnostic]:
    fractional_ends = [end for end in value_type.range or () if not float(end).is_integer()]
    if value_type.kind is Kind.INT and fractional_ends:
        owner = "" if section == "context" else f" of '{key.split('.')[1]}'"
        message = (
            f"the range{owner} in {USERS[section]} '{name}' ends at {fractional_ends[0]:g}, "
            "but an int needs whole numbers"
        )
        range_place = value_type.places.get("range", place)
        yield finding(
            "wrong-range",
            message,
            range_place,
            path=f"{section}.{name}.{key}",
            help="write whole numbers, or 'type: float'",
        )


def _condition_finding(spec_index: SpecIndex, site: Site, problem: Problem) -> Diagnostic:
    section, name = site.owner
    message = f"{problem.message} ('{site.role}' of {USERS[section]} '{name}')"
    place = site.condition.place_of(problem.node)
    fix = None
    if problem.suggestion is not None and isinstance(problem.node, Text):
        text_place = site.condition.place_between(problem.node.start + 1, problem.node.end - 1)
        fix = member_fix(
            problem.node.value, problem.suggestion, problem.candidates, text_place, spec_index.mentioned_words
        )
    return finding(problem.rule, message, place, path=site.path, help=problem.help, fix=fix)


def _member_findings(
    spec_index: SpecIndex, algorithm: Algorithm, entry: Identification, by: Members, variable: Variable
) -> Iterator[Diagnostic]:
    if variable.type.kind is not Kind.ENUM:
        message = f"a mapping identifies an enum, but '{variable.name}' is {_type_with_article(variable)}"
        hysteresis_help = ", or {enter: ..., leave: ...}" if variable.type.kind is Kind.BOOL else ""
        yield _wrong_form_finding(algorithm, by.place, message, f"write one condition{hysteresis_help}", variable)
        return
    for member, _ in by.cases:
        if member.name not in variable.type.values:
            nearest_member = suggest(member.name, variable.type.values)
            values_text = ", ".join(variable.type.values[:10])
            yield finding(
                "unknown-member",
                f"'{member.name}' is not a value of '{variable.name}' (algorithm '{algorithm.name}')",
                member.place,
                path=f"perception.{algorithm.name}.identifies.{entry.variable.name}",
                help=f"did you mean '{nearest_member}'?" if nearest_member else f"values are {values_text}",
                fix=member_fix(
                    member.name, nearest_member, variable.type.values, member.place, spec_index.mentioned_words
                )
                if nearest_member
                else None,
            )


def _wrong_form_finding(algorithm: Algorithm, place: Place, message: str, help: str, variable: Variable) -> Diagnostic:
    path = f"perception.{algorithm.name}.identifies.{variable.name}"
    related = (Related("declared here", variable.places.get("type", variable.place)),)
    return finding("wrong-value-identified", message, place, path=path, help=help, related=related)


def _misuse_finding(
    algorithm: Algorithm, usage: Usage, declaration_place: Place, message: str, help: str
) -> Diagnostic:
    path = f"perception.{algorithm.name}.uses.{usage.resource.name}"
    related = (Related("declared here", declaration_place),)
    return finding("misused-resource", message, usage.place, path=path, help=help, related=related)


def _type_with_article(variable: Variable) -> str:
    return f"an {variable.type.kind}" if variable.type.kind is Kind.INT else f"a {variable.type.kind}"
